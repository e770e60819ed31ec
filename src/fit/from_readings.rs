//! A base from the readings of a portable multi-angle instrument alone.
//!
//! Half a dozen readings say how bright and of which color a paint is at half a dozen angles. The lobes carry the shape
//! that they have in luminance ([`fit_curve`]), the color table what is left of it, per channel, so that the paint
//! reads at these angles what was read ([`fit_colors`]). In between and outside, the shape is the model's.
//!
//! ```text
//! read(γ) / T(i) T(o) − Ξ̄(θh,θd)  =  chi(θh,θd) (a/π + Σ f_k(ī,ō))
//! ```
//!
//! The coat is not fitted: an instrument leaves its mirror image out, so readings do not show it. Flakes that were
//! photographed are part of what was read, so their mean is taken off first; where they alone outshine a reading, the
//! base there is black, and a warning says by how much. Left to others: how far the paint is from its readings
//! ([`super::against_readings`]).

mod colors;
mod curve;
mod doubts;

use std::f64::consts::PI;

use self::colors::{MOST_OF_CURVE, fit_colors};
use self::curve::fit_curve;
use self::doubts::{degrees, doubts};
use crate::color::{Lab, LinearRgb, luminance};
use crate::measurement::{MultiAngle, ReadColors, ReadColorsError};
use crate::paint::{
    CarPaint, Chi, Coat, ColorTable, Direction, Flakes, HalfAngles, MAX_WEIGHT, Reflectance,
};

/// Fewest half angles from which a lobe can be told: its weight, its roughness and the diffuse part.
const LEAST_ANGLES_OF_A_LOBE: usize = 3;
/// Share of a reading by which flakes may outshine it before that is told: what instruments of one kind differ by.
const OUTSHONE: f64 = 0.01;
/// Angle from the normal beyond which a reading is not believed, of light or viewer: there a coat lets nothing in or out,
/// and what little was read would make anything of the base.
const GRAZING_DEG: f64 = 85.0;
/// Luminance that counts as black, 1/sr: L = 0.3.
const BLACK: f64 = 1e-4;

/// A paint that reads what was read, and what a reader of it should know.
#[derive(Clone, Debug, PartialEq)]
pub struct PaintFromReadings {
    /// Coat and flakes as they were given, the base fitted.
    pub paint: CarPaint,
    /// What a reader of the paint should know.
    pub warnings: Vec<String>,
}

/// Why readings make no paint.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadingsFitError {
    /// Readings without colors.
    #[error("{0}")]
    Colors(#[from] ReadColorsError),
    /// Light or every viewer too near to the horizon, or below.
    #[error(
        "with light at {illumination_deg}° none of {rows} readings can be fitted, accepted are light and viewer up to \
         {GRAZING_DEG}° from the normal: aspecular angles up to {GRAZING_DEG}° from that of the light"
    )]
    NoViewer {
        /// Angle of the light, degrees.
        illumination_deg: f64,
        /// How many readings there are.
        rows: usize,
    },
    /// Nothing above black.
    #[error("no reading reflects any light, accepted is at least one with L above 0")]
    Dark,
    /// No color table.
    #[error("no color table reproduces the readings, accepted are readings that differ by less")]
    NoColors,
    /// Values that no reflectance takes.
    #[error(
        "{field} would be {value:e}, accepted is up to 1000: the readings are no reflectance factors"
    )]
    NotAReflectance {
        /// Parameter of the fit.
        field: &'static str,
        /// Its value.
        value: f64,
    },
}

/// What was read at one pair of directions, inside the coat and without the flakes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Read {
    aspecular_deg: f64,
    half: HalfAngles,
    /// Cosines of light and view inside the coat.
    cosines: (f64, f64),
    /// BRDF of the base, 1/sr.
    base: LinearRgb,
    /// Luminance that was read, 1/sr.
    whole: f64,
    /// What of the base's luminance was below 0, over the luminance that was read.
    below_zero: f64,
}

/// Fits the base of a paint to readings; coat and flakes are what is known of the paint already.
///
/// # Errors
///
/// [`ReadingsFitError`] for readings without colors, without light, or of no angle above the paint.
pub fn paint_from_readings(
    readings: &MultiAngle,
    coat: Option<Coat>,
    flakes: Option<Flakes>,
) -> Result<PaintFromReadings, ReadingsFitError> {
    let colors = readings.colors()?;
    let without_base = CarPaint {
        coat,
        diffuse: [0.0; 3],
        lobes: Vec::new(),
        color_table: ColorTable::white(),
        flakes,
    };
    let mut warnings = Vec::new();
    let reads = reads(readings.illumination_deg, &colors, &without_base);
    let left_out = colors.rows.len() - reads.len();
    if reads.is_empty() {
        return Err(ReadingsFitError::NoViewer {
            illumination_deg: readings.illumination_deg,
            rows: colors.rows.len(),
        });
    }
    if !reads.iter().any(|read| read.whole > 0.0) {
        return Err(ReadingsFitError::Dark);
    }
    if left_out > 0 {
        warnings.push(format!(
            "{left_out} of {} readings were left out: their light or their viewer is more than {GRAZING_DEG}° from the normal",
            colors.rows.len()
        ));
    }
    let mut angles: Vec<f64> = reads.iter().map(|read| read.aspecular_deg).collect();
    angles.sort_by(f64::total_cmp);
    angles.dedup();
    if angles.len() < reads.len() {
        warnings.push(format!(
            "{} readings are of {} angles: where there are several of one, their mean was fitted",
            reads.len(),
            angles.len()
        ));
    }
    warnings.extend(doubts(&colors, &reads));
    if let Some(most) = reads
        .iter()
        .max_by(|a, b| a.below_zero.total_cmp(&b.below_zero))
        && most.below_zero > OUTSHONE
    {
        warnings.push(format!(
            "at {}° the pictures of the flakes reflect {:.0} % more than was read: the base is black there",
            most.aspecular_deg,
            100.0 * most.below_zero
        ));
    }
    let curve = fit_curve(&reads);
    let curve_fields = [("diffuse", curve.diffuse)].into_iter();
    for (field, value) in
        curve_fields.chain(curve.lobes.iter().map(|l| ("a lobe's weight", l.weight[0])))
    {
        if !(0.0..=MAX_WEIGHT).contains(&value) {
            return Err(ReadingsFitError::NotAReflectance { field, value });
        }
    }
    let fitted = fit_colors(&reads, &curve).ok_or(ReadingsFitError::NoColors)?;
    if !fitted.mapped.is_empty() {
        warnings.push(format!(
            "what was read at {} lies outside sRGB, or is less than no light, and became the nearest color inside",
            degrees(&fitted.mapped)
        ));
    }
    if !fitted.held.is_empty() {
        warnings.push(format!(
            "the reading at {} is more than {MOST_OF_CURVE} times what lobes explain of it, which is as much as was kept",
            degrees(&fitted.held)
        ));
    }
    warnings.push(if curve.angles < LEAST_ANGLES_OF_A_LOBE {
        let so_few = if curve.angles == 1 {
            "one half angle says"
        } else {
            "two half angles say"
        };
        format!(
            "{so_few} nothing of how the paint darkens between them: the base is diffuse, its color by angle is the \
             readings'; 3 readings or more on one side of the mirror direction make lobes"
        )
    } else {
        format!(
            "{} readings were fitted: between their angles, nearer to the mirror direction and out of the plane of \
             incidence the shape is the model's",
            reads.len()
        )
    });
    let paint = CarPaint {
        diffuse: [curve.diffuse; 3],
        lobes: curve.lobes,
        color_table: fitted.table,
        ..without_base
    };
    Ok(PaintFromReadings { paint, warnings })
}

/// Readings as BRDF inside the coat, without flakes; those that are believed.
fn reads(illumination_deg: f64, colors: &ReadColors, without_base: &CarPaint) -> Vec<Read> {
    let reflectance = Reflectance::new(without_base);
    let read = |&(aspecular_deg, lab): &(f64, Lab)| {
        if !is_believed(illumination_deg, aspecular_deg) {
            return None;
        }
        let (wi, wo) = directions(illumination_deg, aspecular_deg);
        let terms = reflectance.terms(wi, wo, Chi::Overall)?;
        let factor = colors.rgb(lab);
        let whole = factor.map(|v| v / PI);
        let inside = |k: usize| (whole[k] - terms.highlight) / terms.transmission - terms.flakes[k];
        let base: LinearRgb = std::array::from_fn(inside);
        let lost = if without_base.flakes.is_some() {
            -luminance(base) * terms.transmission / luminance(whole).max(BLACK)
        } else {
            0.0
        };
        let ior = without_base.coat.map_or(1.0, |coat| coat.ior);
        let inner = |w: Direction| crate::paint::refract(w, ior)[2];
        Some(Read {
            aspecular_deg,
            half: terms.half,
            cosines: (inner(wi), inner(wo)),
            base,
            whole: luminance(whole),
            below_zero: lost.max(0.0),
        })
    };
    colors.rows.iter().filter_map(read).collect()
}

/// Whether light and viewer are far enough above the paint for a reading to say something of it.
pub(super) fn is_believed(illumination_deg: f64, aspecular_deg: f64) -> bool {
    [illumination_deg, illumination_deg - aspecular_deg]
        .iter()
        .all(|angle| angle.abs() <= GRAZING_DEG)
}

/// Directions of light and viewer in air, both in the plane of incidence.
pub(super) fn directions(illumination_deg: f64, aspecular_deg: f64) -> (Direction, Direction) {
    let light = illumination_deg.to_radians();
    let view = (illumination_deg - aspecular_deg).to_radians();
    (
        [-light.sin(), 0.0, light.cos()],
        [view.sin(), 0.0, view.cos()],
    )
}

#[cfg(test)]
mod tests;
