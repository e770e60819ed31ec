//! What readings look like whose numbers mean something else: said, not corrected.

use super::Read;
use crate::color::Lab;
use crate::measurement::ReadColors;

/// L that the brightest reading of any paint has, the blackest one's within 25° of the mirror direction too.
const DARKEST_FACE: f64 = 2.0;
/// Aspecular angles up to which a paint shows its face, and from which on its flop, degrees.
const FACE_DEG: f64 = 30.0;
const FLOP_DEG: f64 = 70.0;
/// By how much a flop may outshine its face before the angles are doubted.
const BRIGHTER_FLOP: f64 = 1.2;
/// Luminances of one angle that differ by more are not of one place of one paint.
const ONE_ANGLE: f64 = 1.25;

/// What is doubtful of the readings as they came, those that were left out included.
pub(super) fn doubts(colors: &ReadColors, reads: &[Read]) -> Vec<String> {
    let mut doubts = Vec::new();
    let brightest = colors.rows.iter().map(|(_, lab)| lab.l);
    let brightest = brightest.fold(f64::NEG_INFINITY, f64::max);
    if brightest < DARKEST_FACE {
        doubts.push(format!(
            "the brightest reading has an L of {brightest:.2}: L goes up to 100 for white, and a reflectance factor to 1"
        ));
    }
    let below = |lab: &Lab| lab.l < 0.0;
    let negative: Vec<f64> = (colors.rows.iter())
        .filter(|(_, lab)| below(lab))
        .map(|(angle, _)| *angle)
        .collect();
    if !negative.is_empty() {
        doubts.push(format!(
            "at {} L is negative: less light than none was fitted as black",
            degrees(&negative)
        ));
    }
    let among = |seen: &dyn Fn(f64) -> bool| {
        let seen = reads.iter().filter(|read| seen(read.aspecular_deg.abs()));
        seen.map(|read| read.whole).fold(0.0, f64::max)
    };
    let (face, flop) = (
        among(&|angle| angle <= FACE_DEG),
        among(&|angle| angle >= FLOP_DEG),
    );
    if face > 0.0 && flop > BRIGHTER_FLOP * face {
        doubts.push(format!(
            "the paint is {:.1} times as bright {FLOP_DEG}° and farther from the mirror direction as within {FACE_DEG}°: \
             paints darken towards large aspecular angles; are the angles reversed, or angles of the viewer?",
            flop / face
        ));
    }
    let mut sorted: Vec<&Read> = reads.iter().collect();
    sorted.sort_by(|a, b| a.aspecular_deg.total_cmp(&b.aspecular_deg));
    for of_angle in sorted.chunk_by(|a, b| a.aspecular_deg == b.aspecular_deg) {
        let light = of_angle.iter().map(|read| read.whole);
        let most = light.clone().fold(f64::NEG_INFINITY, f64::max);
        let least = light.fold(f64::INFINITY, f64::min);
        if of_angle.len() > 1 && most > ONE_ANGLE * least.max(0.0) {
            doubts.push(format!(
                "the {} readings at {}° contradict each other: the brightest has {:.1} times the light of the darkest",
                of_angle.len(),
                of_angle[0].aspecular_deg,
                most / least.max(1e-6)
            ));
        }
    }
    doubts
}

/// Angles in a list.
pub(super) fn degrees(angles: &[f64]) -> String {
    let texts: Vec<String> = angles.iter().map(|angle| format!("{angle}°")).collect();
    texts.join(", ")
}
