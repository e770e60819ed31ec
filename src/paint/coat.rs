//! The clear coat: refraction, exact Fresnel reflectance, and the coat's own highlight.
//!
//! ```text
//! f_coat = D_c G R(h·i; ior) / (4 i_z o_z),   D_c = exp(−tan²θh/α²) / (π α² cos⁴θh)
//! ```
//!
//! `D_c` carries its 1/π (unlike the base lobes), R is the exact unpolarised Fresnel reflectance, `h` is taken outside
//! the coat. T = 1 − R at the outer cosine, without the 1/ior² of a radiance, as fits of such paints have it.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::direction::{Direction, half_angles, masking};

/// A dielectric layer over the base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coat {
    /// Index of refraction, `1..=4`; 1 is optically no coat.
    pub ior: f64,
    /// Beckmann roughness `α_c`, `>= 0`; below [`Coat::MIRROR_ROUGHNESS`] the coat is a mirror.
    pub roughness: f64,
    /// Thickness in micrometres, where the lab stated it. Kept, not used: refraction does not shift the texel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness_um: Option<f64>,
}

impl Coat {
    /// Roughness below which the highlight is a perfect mirror image, left out of finite evaluations.
    pub const MIRROR_ROUGHNESS: f64 = 1e-3;

    /// A smooth coat.
    #[must_use]
    pub const fn smooth(ior: f64) -> Self {
        Self {
            ior,
            roughness: 0.0,
            thickness_um: None,
        }
    }

    /// Whether the highlight is a mirror image.
    #[must_use]
    pub fn is_mirror(&self) -> bool {
        self.roughness < Self::MIRROR_ROUGHNESS
    }

    /// Highlight of a coat of finite width in 1/sr, 0 for a mirror. Directions outside the coat, above the horizon.
    #[must_use]
    pub fn highlight(&self, wi: Direction, wo: Direction) -> f64 {
        if self.is_mirror() {
            return 0.0;
        }
        let h = half_angles(wi, wo);
        let alpha2 = self.roughness * self.roughness;
        let log_d = -h.tan2_h / alpha2 - (PI * alpha2).ln() - 4.0 * h.h_z.ln();
        log_d.exp() * fresnel(h.h_o, self.ior) / 4.0 * masking(&h, wi[2], wo[2])
    }

    /// Weight of the mirror image seen at outer cosine `cos`, 0 where the highlight has finite width.
    #[must_use]
    pub fn mirror(&self, cos: f64) -> f64 {
        if self.is_mirror() {
            fresnel(cos, self.ior)
        } else {
            0.0
        }
    }
}

/// Exact unpolarised Fresnel reflectance from air into a medium of index `ior >= 1`, at the outer cosine.
///
/// Written without the differences that cancel near `ior = 1`, where the textbook form divides 0 by 0: an index of 1
/// reflects nothing at any angle, and the reflectance grows from there without a step.
///
/// ```text
/// q = sqrt(c² + n² − 1),  r_s = (n² − 1) / (c + q)²,  r_p = (n² − 1)((n² + 1) c² − 1) / (n² c + q)²
/// ```
#[must_use]
pub fn fresnel(cos: f64, ior: f64) -> f64 {
    let excess = (ior - 1.0) * (ior + 1.0);
    if excess <= 0.0 {
        return 0.0;
    }
    let c = cos.clamp(0.0, 1.0);
    let n2 = ior * ior;
    let q = c.hypot(excess.sqrt());
    let s = excess / (c + q).powi(2);
    let p = excess * ((n2 + 1.0) * c * c - 1.0) / (n2 * c + q).powi(2);
    f64::midpoint(s * s, p * p)
}

/// Share of light that passes a coat of index `ior` on its way in from `wi` and out towards `wo`, both outside.
#[must_use]
pub fn transmission(wi: Direction, wo: Direction, ior: f64) -> f64 {
    passed(wi[2], ior) * passed(wo[2], ior)
}

/// `1 − R` of [`fresnel`] without the difference, which cancels where nearly all is reflected.
///
/// ```text
/// T = (t_s + t_p) / 2,  t_s = 4 c q / (c + q)²,  t_p = 4 n² c q / (n² c + q)²
/// ```
fn passed(cos: f64, ior: f64) -> f64 {
    let excess = (ior - 1.0) * (ior + 1.0);
    if excess <= 0.0 {
        return 1.0;
    }
    let c = cos.clamp(0.0, 1.0);
    let n2 = ior * ior;
    let q = c.hypot(excess.sqrt());
    let s = 4.0 * c * q / (c + q).powi(2);
    let p = 4.0 * n2 * c * q / (n2 * c + q).powi(2);
    f64::midpoint(s, p)
}

/// Direction inside the coat of a direction outside it; exact for an index of 1.
#[must_use]
pub fn refract(w: Direction, ior: f64) -> Direction {
    let excess = ((ior - 1.0) * (ior + 1.0)).max(0.0);
    [w[0] / ior, w[1] / ior, w[2].hypot(excess.sqrt()) / ior]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn glass_reflects_four_percent_at_normal_and_all_at_grazing() {
        assert!((fresnel(1.0, 1.5) - 0.04).abs() < 1e-15);
        assert!((fresnel(0.0, 1.5) - 1.0).abs() < 1e-15);
        // ASTM D523's black glass at 60°, to its published digits.
        assert!((fresnel(0.5, 1.567) - 0.100_06).abs() < 5e-6);
    }

    #[test]
    fn no_coat_bends_and_reflects_nothing() {
        assert_eq!(refract([0.6, 0.0, 0.8], 1.0), [0.6, 0.0, 0.8]);
        assert_eq!(fresnel(0.3, 1.0), 0.0);
    }

    #[test]
    fn a_narrow_highlight_reflects_what_fresnel_says() {
        let coat = Coat {
            ior: 1.5,
            roughness: 0.02,
            thickness_um: None,
        };
        let theta = 30.0_f64.to_radians();
        let wi = [-theta.sin(), 0.0, theta.cos()];
        let (n, reach) = (800_u32, 0.2);
        let mut albedo = 0.0;
        for a in 0..n {
            for b in 0..n {
                let x = theta.sin() + reach * (2.0 * (f64::from(a) + 0.5) / f64::from(n) - 1.0);
                let y = reach * (2.0 * (f64::from(b) + 0.5) / f64::from(n) - 1.0);
                let wo = [x, y, (1.0 - x * x - y * y).sqrt()];
                // dω cosθ = dx dy on the projected disc.
                albedo += coat.highlight(wi, wo) * (2.0 * reach / f64::from(n)).powi(2);
            }
        }
        let smooth = fresnel(theta.cos(), 1.5);
        assert!(
            (albedo / smooth - 1.0).abs() < 5e-3,
            "{albedo} instead of {smooth}"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn it_equals_the_textbook_form_where_that_does_not_cancel(cos in 0.01..=1.0_f64, ior in 1.2..=4.0_f64) {
            let inner = (1.0 - (1.0 - cos * cos) / (ior * ior)).sqrt();
            let s = (cos - ior * inner) / (cos + ior * inner);
            let p = (ior * cos - inner) / (ior * cos + inner);
            prop_assert!((fresnel(cos, ior) - f64::midpoint(s * s, p * p)).abs() < 1e-14);
        }

        #[test]
        fn reflectance_stays_between_nothing_and_all(cos in 0.0..=1.0_f64, ior in 1.0..=4.0_f64) {
            prop_assert!((0.0..=1.0 + 4.0 * f64::EPSILON).contains(&fresnel(cos, ior)));
        }
    }
}
