//! What a glossmeter reads of a paint at 20°, 60° and 85°.
//!
//! ```text
//! G = 100 Φ / Φ_glass,  Φ = mean over the source's aperture of ∫ over the receptor's of f cos θo dω
//! ```
//!
//! with the apertures of ASTM D523 and a black glass of index 1.567, which is a mirror. The coat's mirror image, which
//! `f` leaves out, falls into the receptor as a whole. Model description, section 6.
//!
//! The mean over the source is taken of the angles between the mirrored source and the receptor: the light stands still,
//! and each view counts by the share of the source whose mirror image is so far from the receptor's points. Angles are
//! small, so that this is the mean but for what `f` changes over the source's 0.75°.

use serde::Serialize;

use crate::color::luminance;
use crate::paint::{CarPaint, Chi, Reflectance, fresnel};

/// Index of the black glass that reads 100.
const GLASS: f64 = 1.567;

/// Half angles of the source's aperture, degrees: in the plane of incidence, across it.
const SOURCE_DEG: [f64; 2] = [0.375, 1.25];

/// Points along each half axis of the receptor.
const POINTS: u32 = 64;

/// How much denser points stand at the middle: lobes narrower than the receptor by three magnitudes are seen.
const DENSER: f64 = 7.0;

/// Gloss units of a paint; black glass has 100 of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gloss {
    /// Light at 20°, for paints that gloss much.
    #[serde(rename = "20")]
    pub at_20: f64,
    /// Light at 60°.
    #[serde(rename = "60")]
    pub at_60: f64,
    /// Light at 85°, for matt paints.
    #[serde(rename = "85")]
    pub at_85: f64,
}

/// Reads the gloss of a paint.
#[must_use]
pub fn gloss(paint: &CarPaint) -> Gloss {
    let reflectance = Reflectance::new(paint);
    Gloss {
        at_20: reading(&reflectance, 20.0, [0.9, 1.8]),
        at_60: reading(&reflectance, 60.0, [2.2, 5.85]),
        at_85: reading(&reflectance, 85.0, [2.0, 3.0]),
    }
}

/// Gloss units at an angle of light, for a receptor of these half angles, degrees.
fn reading(reflectance: &Reflectance<'_>, light_deg: f64, receptor_deg: [f64; 2]) -> f64 {
    let light = light_deg.to_radians();
    let wi = [-light.sin(), 0.0, light.cos()];
    let [along, across] = [0, 1].map(|axis| axis_of(receptor_deg[axis], SOURCE_DEG[axis]));
    let mut flux = reflectance.mirror([light.sin(), 0.0, light.cos()]);
    for &(v, weight_v) in &across {
        for &(u, weight_u) in &along {
            for u in [u, -u] {
                let view = light + u;
                let wo = [view.sin() * v.cos(), v.sin(), view.cos() * v.cos()];
                let f = luminance(reflectance.evaluate(wi, wo, Chi::Table));
                // Twice, for the other side of the plane of incidence.
                flux += 2.0 * weight_u * weight_v * f * wo[2] * v.cos();
            }
        }
    }
    100.0 * flux / fresnel(light.cos(), GLASS)
}

/// Angles from the mirror direction along half an axis of the receptor, radians, with their weights: the width that each
/// stands for, times the share of the source that it holds for.
fn axis_of(receptor_deg: f64, source_deg: f64) -> Vec<(f64, f64)> {
    let reach = receptor_deg + source_deg;
    let step = 1.0 / f64::from(POINTS);
    (0..POINTS)
        .map(|k| {
            let t = (f64::from(k) + 0.5) * step;
            let angle = reach * (DENSER * t).sinh() / DENSER.sinh();
            let width = reach * DENSER * (DENSER * t).cosh() / DENSER.sinh() * step;
            let share = ((reach - angle) / (2.0 * source_deg)).clamp(0.0, 1.0);
            (angle.to_radians(), width.to_radians() * share)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{Coat, ColorTable};

    fn paint(diffuse: f64, coat: Option<Coat>) -> CarPaint {
        CarPaint {
            coat,
            diffuse: [diffuse; 3],
            lobes: Vec::new(),
            color_table: ColorTable::white(),
            flakes: None,
        }
    }

    fn rough(ior: f64, roughness: f64) -> CarPaint {
        let coat = Coat {
            roughness,
            ..Coat::smooth(ior)
        };
        paint(0.0, Some(coat))
    }

    #[test]
    fn a_smooth_coat_reads_what_its_index_reflects() {
        for (ior, want) in [(1.5, 89.1), (1.53, 94.1), (1.567, 100.0), (1.6, 105.2)] {
            let read = gloss(&paint(0.0, Some(Coat::smooth(ior)))).at_60;
            assert!((read - want).abs() < 0.05, "{ior}: {read}");
        }
    }

    /// The roughness of a coat of index 1.5 by its gloss: the table of the model description.
    #[test]
    fn a_rough_coat_reads_the_known_gloss() {
        for (roughness, want) in [
            (0.0134, 85.0),
            (0.0218, 70.0),
            (0.0350, 50.0),
            (0.0610, 30.0),
            (0.1362, 10.0),
        ] {
            let read = gloss(&rough(1.5, roughness)).at_60;
            assert!((read - want).abs() < 0.15, "{roughness}: {read}");
        }
    }

    #[test]
    fn a_matt_base_adds_its_share() {
        let bare = gloss(&paint(1.0, None)).at_60;
        assert!((bare - 2.49).abs() < 0.01, "{bare}");
        let coated = gloss(&paint(0.5, Some(Coat::smooth(1.5)))).at_60;
        assert!((coated - 89.1 - 0.5 * 2.06).abs() < 0.06, "{coated}");
    }

    #[test]
    fn gloss_falls_with_roughness_and_does_not_jump_where_a_mirror_ends() {
        let at = |roughness| gloss(&rough(1.5, roughness));
        let (mirror, narrow) = (at(0.0009), at(0.0011));
        for (a, b) in [
            (mirror.at_20, narrow.at_20),
            (mirror.at_60, narrow.at_60),
            (mirror.at_85, narrow.at_85),
        ] {
            assert!((a - b).abs() < 0.5, "{mirror:?} {narrow:?}");
        }
        let falling = [0.002, 0.02, 0.1, 0.5].map(|roughness| at(roughness).at_20);
        assert!(falling.is_sorted_by(|a, b| a > b), "{falling:?}");
    }
}
