//! The box of a cluster in CIELAB, from its members.

use serde::{Deserialize, Serialize};

use super::texels::{Texel, linear};
use crate::color::LinearRgb;
use crate::paint::{MAX_LAB, center_of_mean};

/// How a cluster's box follows from its members.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BoxRule {
    /// The bounding box.
    Tight,
    /// Mean and variance, and the exact mean in linear light.
    #[default]
    Moments,
}

impl BoxRule {
    /// Name as it stands in files and profiles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tight => "tight",
            Self::Moments => "moments",
        }
    }
}

/// Corners of smallest and of largest L, a, b.
pub(super) type Corners = ([f32; 3], [f32; 3]);

/// The bounding box of the members.
pub(super) fn tight(members: &[Texel]) -> Corners {
    let (mut lower, mut upper) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for texel in members {
        for k in 0..3 {
            (lower[k], upper[k]) = (lower[k].min(texel[k]), upper[k].max(texel[k]));
        }
    }
    (lower, upper)
}

/// The box of the members' mean and variance, and of their mean in linear light plus `more`.
pub(super) fn moments(members: &[Texel], light: &[[f32; 4]], more: LinearRgb) -> Corners {
    let origin = members[0].map(f64::from);
    let (mut first, mut second, mut sum) = ([0.0_f64; 3], [0.0_f64; 3], [0.0_f64; 3]);
    for texel in members {
        let rgb = linear(texel, light);
        for k in 0..3 {
            let d = f64::from(texel[k]) - origin[k];
            first[k] += d;
            second[k] += d * d;
            sum[k] += rgb[k];
        }
    }
    let count = members.len() as f64;
    let mean: [f64; 3] = std::array::from_fn(|k| origin[k] + first[k] / count);
    let variance =
        std::array::from_fn(|k| (second[k] / count - (first[k] / count).powi(2)).max(0.0));
    let light = std::array::from_fn(|k| sum[k] / count + more[k]);
    of_moments(mean, variance, light)
}

/// The box of this mean and variance in Lab whose middle is moved until its mean in linear light is `light`.
pub(super) fn of_moments(mean: [f64; 3], variance: [f64; 3], light: LinearRgb) -> Corners {
    // A box must not reach beyond the bounds, wherever its mean moves it.
    let half = std::array::from_fn(|k| {
        (3.0 * variance[k])
            .sqrt()
            .min((MAX_LAB - mean[k].abs()).max(0.0))
    });
    let center = center_of_mean(half, light, mean);
    let bound = MAX_LAB as f32;
    let corner = |sign: f64| {
        std::array::from_fn(|k| ((center[k] + sign * half[k]) as f32).clamp(-bound, bound))
    };
    (corner(-1.0), corner(1.0))
}

/// Root of the mean squared distance between members and independent colors of their box, Lab units.
pub(super) fn reach(members: &[Texel], lower: [f32; 3], upper: [f32; 3]) -> f64 {
    let mut squared = 0.0_f64;
    for k in 0..3 {
        let (center, half) = (
            f32::midpoint(lower[k], upper[k]),
            f64::from(upper[k] - lower[k]) / 2.0,
        );
        let sum: f32 = members
            .iter()
            .map(|texel| (texel[k] - center) * (texel[k] - center))
            .sum();
        squared += f64::from(sum) / members.len() as f64 + half * half / 3.0;
    }
    squared.sqrt()
}
