//! Where a measurement is asked: pairs of directions that cover what a viewer sees, and the near-mirror ones densely.
//!
//! Goniometers are not to be trusted beyond some 75° from the normal: the cosine that they divide by vanishes there.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::stream::Stream;
use crate::color::{LinearRgb, luminance};
use crate::measurement::MeasuredBrdf;
use crate::paint::{Direction, HalfAngles, half_angles};

/// Largest angle from the normal that residuals are judged at.
pub(super) const TRUSTED_DEG: f64 = 70.0;

/// θh below which a sample counts as next to the mirror direction.
pub(super) const NEAR_MIRROR_DEG: f64 = 5.0;

/// What was measured between two directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub wi: Direction,
    pub wo: Direction,
    pub rgb: LinearRgb,
    pub luminance: f64,
}

impl Sample {
    /// Half-vector angles of the directions as given.
    pub fn half(&self) -> HalfAngles {
        half_angles(self.wi, self.wo)
    }

    /// Measures at these directions; `None` where nothing was measured or the value is not finite.
    pub fn take(measured: &dyn MeasuredBrdf, wi: Direction, wo: Direction) -> Option<Self> {
        let rgb = measured
            .reflectance(wi, wo)
            .filter(|rgb| rgb.iter().all(|v| v.is_finite()))?;
        Some(Self {
            wi,
            wo,
            rgb,
            luminance: luminance(rgb),
        })
    }
}

/// Uniform direction in a cone around the normal.
fn in_cone(stream: &mut Stream, degrees: f64) -> Direction {
    let z = 1.0 - stream.unit() * (1.0 - degrees.to_radians().cos());
    let (s, c) = (TAU * stream.unit()).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    [r * c, r * s, z]
}

/// Direction pairs, both within a cone: three quarters independent of each other, one quarter with the half vector
/// within 5° of the normal. In random order.
fn pairs(count: usize, degrees: f64, seed: u64) -> Vec<(Direction, Direction)> {
    let mut stream = Stream::new(seed);
    let least = degrees.to_radians().cos();
    let mut out = Vec::with_capacity(count);
    // A near-mirror pair may leave the cone and is drawn again: a quarter more draws than needed always suffice.
    for _ in 0..4 * count {
        if out.len() == count {
            break;
        }
        let wi = in_cone(&mut stream, degrees);
        let wo = if stream.unit() < 0.25 {
            let h = in_cone(&mut stream, NEAR_MIRROR_DEG);
            let along = 2.0 * (wi[0] * h[0] + wi[1] * h[1] + wi[2] * h[2]);
            std::array::from_fn(|k| along * h[k] - wi[k])
        } else {
            in_cone(&mut stream, degrees)
        };
        if wo[2] > least {
            out.push((wi, wo));
        }
    }
    out
}

/// Measures at `count` pairs of directions within `degrees` of the normal; fewer where nothing was measured.
pub(super) fn measure(
    measured: &dyn MeasuredBrdf,
    count: usize,
    degrees: f64,
    seed: u64,
) -> Vec<Sample> {
    pairs(count, degrees, seed)
        .into_par_iter()
        .map(|(wi, wo)| Sample::take(measured, wi, wo))
        .collect::<Vec<_>>()
        .into_iter()
        .flatten()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_stay_in_their_cone_and_a_quarter_lies_near_the_mirror() {
        let pairs = pairs(4000, 70.0, 1);
        assert_eq!(pairs.len(), 4000);
        let cone = 70.0_f64.to_radians().cos() - 1e-12;
        assert!(pairs.iter().all(|(wi, wo)| wi[2] >= cone && wo[2] >= cone));
        assert!(
            pairs
                .iter()
                .all(|(_, wo)| (wo[0].hypot(wo[1]).hypot(wo[2]) - 1.0).abs() < 1e-12)
        );
        let near = pairs
            .iter()
            .filter(|(wi, wo)| half_angles(*wi, *wo).theta_h < 5.0_f64.to_radians())
            .count();
        assert!((900..1300).contains(&near), "{near}");
    }
}
