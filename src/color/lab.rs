//! CIELAB with the linear branch extended to negative light.
//!
//! ```text
//! f(t) = t^(1/3)               for t > (6/29)^3
//!      = t / (3 (6/29)^2) + 4/29    otherwise, below zero too
//! L = 116 f(Y/Yn) − 16,  a = 500 (f(X/Xn) − f(Y/Yn)),  b = 200 (f(Y/Yn) − f(Z/Zn))
//! ```
//!
//! Source: CIE 15:2018, 8.2.1. `L` may exceed 100 (sparkle, face readings of silvers) and may be negative (sensor
//! noise); nothing is clamped. Do not average Lab to get a mean color: light adds in linear RGB.

use serde::{Deserialize, Serialize};

use super::rgb::{LinearRgb, rgb_to_xyz, xyz_to_rgb};
use super::white::{D65_2, WhitePoint};

/// CIELAB relative to the perfect diffuser, D65 and 2° observer unless it comes with another white point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lab {
    /// Lightness, 0 black, 100 the perfect diffuser.
    pub l: f64,
    /// Green (−) to red (+).
    pub a: f64,
    /// Blue (−) to yellow (+).
    pub b: f64,
}

/// Knee of the cube root, on the `f` axis.
pub(crate) const KNEE: f64 = 6.0 / 29.0;

/// Largest light whose root is found by steps that do not overflow.
const BRIGHTEST: f64 = 1e300;

/// Cube root of light above the knee, within a unit in the last place of the standard library's, in a third of its time.
///
/// The inverse root needs no division: four thirds of the exponent's bias less a third of the bits, less a little that makes
/// the worst guess least, is one within 4 %, and each step of Householder's
/// third order takes its relative error to about the fourth power (A. S. Householder, "The Numerical Treatment of a
/// Single Nonlinear Equation", 1970, 4.4). A Newton step on the root takes away what roundings leave.
fn cube_root(t: f64) -> f64 {
    if t > BRIGHTEST {
        return t.cbrt();
    }
    let mut inverse = f64::from_bits(0x553e_f0ff_289d_d796 - t.to_bits() / 3);
    for _ in 0..2 {
        let miss = 1.0 - t * inverse * inverse * inverse;
        inverse += inverse * miss * (1.0 / 3.0 + miss * (2.0 / 9.0 + miss * (14.0 / 81.0)));
    }
    let root = t * inverse * inverse;
    root + (t - root * root * root) * (inverse * inverse) * (1.0 / 3.0)
}

/// The CIELAB compression of one channel's relative light.
pub(crate) fn compress(t: f64) -> f64 {
    if t > KNEE * KNEE * KNEE {
        cube_root(t)
    } else {
        t / (3.0 * KNEE * KNEE) + 4.0 / 29.0
    }
}

/// Inverse of the CIELAB compression: relative light of one channel from its `f` value.
pub(crate) fn expand(f: f64) -> f64 {
    if f > KNEE { f * f * f } else { expand_dark(f) }
}

/// [`expand`] up to the knee.
#[inline]
pub(crate) fn expand_dark(f: f64) -> f64 {
    3.0 * KNEE * KNEE * (f - 4.0 / 29.0)
}

/// [`expand`] at texel precision.
pub(crate) fn expand_f32(f: f32) -> f32 {
    const KNEE: f32 = 6.0 / 29.0;
    if f > KNEE {
        f * f * f
    } else {
        3.0 * KNEE * KNEE * (f - 4.0 / 29.0)
    }
}

impl Lab {
    /// Lab of an XYZ color under a white point.
    #[must_use]
    pub fn from_xyz(xyz: [f64; 3], white: WhitePoint) -> Self {
        let [x, y, z] = [
            compress(xyz[0] / white.x),
            compress(xyz[1] / white.y),
            compress(xyz[2] / white.z),
        ];
        Self {
            l: 116.0 * y - 16.0,
            a: 500.0 * (x - y),
            b: 200.0 * (y - z),
        }
    }

    /// XYZ of a Lab color under a white point.
    #[must_use]
    pub fn to_xyz(self, white: WhitePoint) -> [f64; 3] {
        let y = (self.l + 16.0) / 116.0;
        let (x, z) = (y + self.a / 500.0, y - self.b / 200.0);
        [
            white.x * expand(x),
            white.y * expand(y),
            white.z * expand(z),
        ]
    }

    /// Lab of a linear sRGB reflectance factor (`π f` of a BRDF value `f`).
    #[must_use]
    pub fn from_rgb(rgb: LinearRgb) -> Self {
        Self::from_xyz(rgb_to_xyz(rgb), D65_2)
    }

    /// Linear sRGB reflectance factor of a Lab color.
    #[must_use]
    pub fn to_rgb(self) -> LinearRgb {
        xyz_to_rgb(self.to_xyz(D65_2))
    }

    /// The three numbers in order.
    #[must_use]
    pub const fn to_array(self) -> [f64; 3] {
        [self.l, self.a, self.b]
    }
}

impl From<[f64; 3]> for Lab {
    fn from([l, a, b]: [f64; 3]) -> Self {
        Self { l, a, b }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn roots_are_within_a_unit_in_the_last_place() {
        let knee = KNEE.powi(3);
        let mut light = knee;
        while light < 1e306 {
            let (own, known) = (cube_root(light), light.cbrt());
            let apart = own.to_bits().abs_diff(known.to_bits());
            assert!(apart <= 1, "{light}: {own} {known}");
            light *= if light < 10.0 { 1.000_123 } else { 1.07 };
        }
        assert_eq!(cube_root(f64::INFINITY), f64::INFINITY);
        assert!(compress(f64::NAN).is_nan());
    }

    #[test]
    fn white_is_one_hundred() {
        let white = Lab::from_xyz([D65_2.x, 1.0, D65_2.z], D65_2);
        assert_eq!(
            white,
            Lab {
                l: 100.0,
                a: 0.0,
                b: 0.0
            }
        );
    }

    /// sRGB red, worked from the published formulas with 30 digits.
    #[test]
    fn red_has_its_published_lab() {
        let red = Lab::from_rgb([1.0, 0.0, 0.0]);
        for (x, y) in red
            .to_array()
            .into_iter()
            .zip([53.240_79, 80.092_46, 67.203_2])
        {
            assert!((x - y).abs() < 5e-3, "{red:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn lab_and_back_keeps_twelve_digits(l in -50.0..1000.0_f64, a in -300.0..300.0_f64, b in -300.0..300.0_f64) {
            let xyz = Lab { l, a, b }.to_xyz(D65_2);
            let back = Lab::from_xyz(xyz, D65_2);
            // f is of order 10 here and a, b multiply its error by 500 and 200.
            prop_assert!((back.l - l).abs() <= 1e-12 * l.abs().max(100.0));
            prop_assert!((back.a - a).abs() <= 1e-12 * 500.0 * 10.0);
            prop_assert!((back.b - b).abs() <= 1e-12 * 200.0 * 10.0);
        }

        #[test]
        fn more_light_is_lighter(y in -1.0..100.0_f64) {
            prop_assert!(compress(y + 1e-6) > compress(y));
        }
    }
}
