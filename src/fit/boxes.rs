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

/// What a box needs to know of a cluster's members.
#[derive(Clone, Copy, Debug)]
pub(super) struct Members {
    pub count: f64,
    /// Mean in Lab.
    pub mean: [f64; 3],
    /// Variance in Lab, per axis.
    pub variance: [f64; 3],
    /// Mean in linear light, of π f.
    pub light: LinearRgb,
    /// The bounding box in Lab.
    pub hull: Corners,
}

impl Members {
    /// Of these texels, at least one.
    pub(super) fn of(texels: &[Texel], light: &[[f32; 4]]) -> Self {
        let origin = texels[0].map(f64::from);
        let (mut first, mut second, mut sum) = ([0.0_f64; 3], [0.0_f64; 3], [0.0_f64; 3]);
        let (mut lower, mut upper) = (texels[0], texels[0]);
        for texel in texels {
            let rgb = linear(texel, light);
            for k in 0..3 {
                let d = f64::from(texel[k]) - origin[k];
                first[k] += d;
                second[k] += d * d;
                sum[k] += rgb[k];
            }
            for k in 0..4 {
                lower[k] = if texel[k] < lower[k] {
                    texel[k]
                } else {
                    lower[k]
                };
                upper[k] = if texel[k] > upper[k] {
                    texel[k]
                } else {
                    upper[k]
                };
            }
        }
        let count = texels.len() as f64;
        let corner = |corner: Texel| [corner[0], corner[1], corner[2]];
        Self {
            count,
            mean: std::array::from_fn(|k| origin[k] + first[k] / count),
            variance: std::array::from_fn(|k| {
                (second[k] / count - (first[k] / count).powi(2)).max(0.0)
            }),
            light: sum.map(|s| s / count),
            hull: (corner(lower), corner(upper)),
        }
    }

    /// The box of the members' mean and variance, and of their mean in linear light plus `more`.
    pub(super) fn moments(&self, more: LinearRgb) -> Corners {
        let light = std::array::from_fn(|k| self.light[k] + more[k]);
        of_moments(self.mean, self.variance, light)
    }

    /// Root of the mean squared distance between members and independent colors of a box, Lab units.
    pub(super) fn reach(&self, (lower, upper): Corners) -> f64 {
        let axis = |k: usize| {
            let (low, high) = (f64::from(lower[k]), f64::from(upper[k]));
            let off = self.mean[k] - f64::midpoint(low, high);
            self.variance[k] + off * off + (high - low) * (high - low) / 12.0
        };
        (0..3).map(axis).sum::<f64>().sqrt()
    }
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
