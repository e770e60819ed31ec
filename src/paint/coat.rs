//! The clear coat: refraction, exact Fresnel reflectance, and the coat's own highlight.
//!
//! ```text
//! f_coat = D_c G R(h·i; ior) / (4 i_z o_z),   D_c = exp(−tan²θh/α²) / (π α² cos⁴θh)
//! ```
//!
//! D_c carries its 1/π (unlike the base lobes), R is the exact unpolarised Fresnel reflectance, `h` is taken outside
//! the coat. T = 1 − R at the outer cosine, without the 1/ior² of a radiance, as fits of such paints have it.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::direction::{Direction, half_angles, masking};

/// A dielectric layer over the base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coat {
    /// Index of refraction, `1..=4`. Below 1.0001 the coat optically is not there.
    pub ior: f64,
    /// Beckmann roughness α_c, `>= 0`; below [`Coat::MIRROR_ROUGHNESS`] the coat is a mirror.
    pub roughness: f64,
    /// Thickness in micrometres, where the lab stated it. Kept, not used: refraction does not shift the texel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness_um: Option<f64>,
}

impl Coat {
    /// Roughness below which the highlight is a perfect mirror image, left out of finite evaluations.
    pub const MIRROR_ROUGHNESS: f64 = 1e-3;

    /// Least index of a coat that bends light.
    pub const MIN_IOR: f64 = 1.0 + 1e-4;

    /// A smooth coat.
    #[must_use]
    pub const fn smooth(ior: f64) -> Self {
        Self { ior, roughness: 0.0, thickness_um: None }
    }

    /// Whether the highlight is a mirror image.
    #[must_use]
    pub fn is_mirror(&self) -> bool {
        self.roughness < Self::MIRROR_ROUGHNESS
    }

    /// Highlight of a coat of finite width in 1/sr, 0 for a mirror. Directions outside the coat, above the horizon.
    #[must_use]
    pub fn highlight(&self, wi: Direction, wo: Direction) -> f64 {
        if self.is_mirror() || self.ior < Self::MIN_IOR {
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
        if self.is_mirror() { fresnel(cos, self.ior) } else { 0.0 }
    }
}

/// Exact unpolarised Fresnel reflectance from air into a medium, at the outer cosine.
///
/// An index below [`Coat::MIN_IOR`] reflects nothing. At the horizon everything is reflected.
#[must_use]
pub fn fresnel(cos: f64, ior: f64) -> f64 {
    if ior < Coat::MIN_IOR {
        return 0.0;
    }
    let cos = cos.clamp(0.0, 1.0);
    let inner = (1.0 - (1.0 - cos * cos) / (ior * ior)).max(0.0).sqrt();
    let s = (cos - ior * inner) / (cos + ior * inner);
    let p = (ior * cos - inner) / (ior * cos + inner);
    f64::midpoint(s * s, p * p)
}

/// Direction inside the coat of a direction outside it.
#[must_use]
pub fn refract(w: Direction, ior: f64) -> Direction {
    if ior < Coat::MIN_IOR {
        return w;
    }
    let (x, y) = (w[0] / ior, w[1] / ior);
    [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn glass_reflects_four_percent_at_normal_and_all_at_grazing() {
        assert!((fresnel(1.0, 1.5) - 0.04).abs() < 1e-15);
        assert!((fresnel(0.0, 1.5) - 1.0).abs() < 1e-15);
        // ASTM D523's black glass at 60°, worked with 30 digits.
        assert!((fresnel(0.5, 1.567) - 0.100_060).abs() < 2e-6);
    }

    #[test]
    fn no_coat_bends_and_reflects_nothing() {
        assert_eq!(refract([0.6, 0.0, 0.8], 1.0), [0.6, 0.0, 0.8]);
        assert_eq!(fresnel(0.3, 1.0), 0.0);
    }

    #[test]
    fn a_narrow_highlight_reflects_what_fresnel_says() {
        let coat = Coat { ior: 1.5, roughness: 0.02, thickness_um: None };
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
        assert!((albedo / smooth - 1.0).abs() < 5e-3, "{albedo} instead of {smooth}");
    }

    proptest! {
        #[test]
        fn reflectance_stays_between_nothing_and_all(cos in 0.0..=1.0_f64, ior in 1.0..=4.0_f64) {
            prop_assert!((0.0..=1.0).contains(&fresnel(cos, ior)));
        }
    }
}
