//! A Cook-Torrance lobe as car-paint fits write it.
//!
//! ```text
//! f_k = s D F G / (π i_z o_z)
//! D = exp(−tan²θh/α²) / (α² cos⁴θh),  F = F0 + (1−F0)(1 − h·o)⁵,  G = min(1, 2 h_z o_z/(h·o), 2 h_z i_z/(h·o))
//! ```
//!
//! D has no 1/π, so a lobe is `4s` times a normalised Beckmann Cook-Torrance lobe: that is the model, and measured
//! parameters rely on it. Source: Golla and Klein 2018, eq. 2-5; evaluated in a form without 0/0.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::direction::{HalfAngles, masking};
use super::validate::MIN_ALPHA;
use crate::color::LinearRgb;

/// One lobe of the base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lobe {
    /// Weight `s` per channel, `>= 0`.
    pub weight: LinearRgb,
    /// Beckmann roughness `α`, `> 0`.
    pub alpha: f64,
    /// Schlick reflectance at normal incidence, `0..=1`.
    pub f0: f64,
}

impl Lobe {
    /// The lobe in 1/sr without its weight, for directions of cosine `i_z`, `o_z` above the horizon.
    #[must_use]
    pub fn shape(&self, h: &HalfAngles, i_z: f64, o_z: f64) -> f64 {
        let alpha = self.alpha.max(MIN_ALPHA);
        let log_d = -h.tan2_h / (alpha * alpha) - 2.0 * alpha.ln() - 4.0 * h.h_z.ln();
        let schlick = self.f0 + (1.0 - self.f0) * (1.0 - h.h_o).powi(5);
        log_d.exp() * schlick / PI * masking(h, i_z, o_z)
    }

    /// Whether the lobe adds nothing.
    #[must_use]
    pub fn is_absent(&self) -> bool {
        self.weight == [0.0; 3]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::direction::half_angles;

    /// Mirror direction at 30°, worked by hand: D = 1/α², G = 1 (2·0.866/0.866 = 2 > 1).
    #[test]
    fn the_mirror_direction_matches_hand_arithmetic() {
        let lobe = Lobe {
            weight: [1.0; 3],
            alpha: 0.5,
            f0: 0.04,
        };
        let (s, c) = 30.0_f64.to_radians().sin_cos();
        let h = half_angles([-s, 0.0, c], [s, 0.0, c]);
        let schlick = 0.04 + 0.96 * (1.0 - c).powi(5);
        let want = 4.0 * schlick / (PI * c * c);
        assert!((lobe.shape(&h, c, c) - want).abs() < 1e-12 * want);
    }

    #[test]
    fn a_lobe_is_finite_at_grazing_and_for_any_roughness() {
        for alpha in [0.0, 1e-12, 1e-8, 1.0, 10.0] {
            for z in [1e-300, 1e-8, 0.5] {
                let x = (1.0_f64 - z * z).sqrt();
                for wo in [[x, 0.0, z], [-x, 0.0, z], [0.0, x, z], [0.0, 0.0, 1.0]] {
                    let h = half_angles([x, 0.0, z], wo);
                    let f = Lobe {
                        weight: [1.0; 3],
                        alpha,
                        f0: 1.0,
                    }
                    .shape(&h, z, wo[2]);
                    assert!(
                        f.is_finite() && f >= 0.0,
                        "alpha {alpha}, z {z}, wo {wo:?}: {f}"
                    );
                }
            }
        }
    }
}
