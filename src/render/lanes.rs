//! Eight single-precision numbers that go through the same arithmetic, in a form compilers turn into vector code.
#![allow(clippy::inline_always)] // a call would cost more than what it does

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

use super::vector::Vec3;

/// How many samples are shaded together.
pub(super) const WIDTH: usize = 8;

/// One number per sample.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub(super) struct Lanes(pub(super) [f32; WIDTH]);

/// A vector or color per sample.
pub(super) type Lanes3 = [Lanes; 3];

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(from_fn(|k| self.0[k] $op other.0[k]))
            }
        }
        impl $trait<f32> for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                Self(from_fn(|k| self.0[k] $op other))
            }
        }
    };
}

lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|v| -v))
    }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

impl Lanes {
    #[inline(always)]
    pub(super) const fn splat(v: f32) -> Self {
        Self([v; WIDTH])
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self(from_fn(|k| self.0[k].sqrt()))
    }

    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self(from_fn(|k| larger(self.0[k], other.0[k])))
    }

    #[inline(always)]
    pub(super) fn at_least(self, least: f32) -> Self {
        Self(from_fn(|k| larger(self.0[k], least)))
    }

    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self(from_fn(|k| {
            if self.0[k] < other.0[k] {
                self.0[k]
            } else {
                other.0[k]
            }
        }))
    }

    /// `self` where `a < b`, `other` elsewhere.
    #[inline(always)]
    pub(super) fn where_less(self, a: Self, b: Self, other: Self) -> Self {
        Self(from_fn(|k| {
            if a.0[k] < b.0[k] {
                self.0[k]
            } else {
                other.0[k]
            }
        }))
    }

    /// `exp(−x)` for `x ≥ 0` to 4e-7 + 1e-7 x relative (the rounding of x itself), in arithmetic that every machine does alike; 0 beyond 87.
    ///
    /// `2^n 2^f` with `f` in ±0.5, a Taylor polynomial of degree 6 in `f ln 2`.
    #[inline(always)]
    pub(super) fn exp_of_negative(self) -> Self {
        // Adding and taking away 1.5·2²³ rounds to the nearest whole number, whose bits stand at the end meanwhile.
        const ROUND: f32 = 12_582_912.0;
        let y = self.min(Self::splat(87.3)) * -std::f32::consts::LOG2_E;
        let rounded = y + ROUND;
        let t = (y - (rounded - ROUND)) * std::f32::consts::LN_2;
        let p = ((((t * (1.0 / 720.0) + 1.0 / 120.0) * t + 1.0 / 24.0) * t + 1.0 / 6.0) * t + 0.5)
            * t
            * t
            + t
            + 1.0;
        let power = Self(from_fn(|k| {
            let n = rounded.0[k]
                .to_bits()
                .wrapping_sub(ROUND.to_bits())
                .wrapping_add(127);
            f32::from_bits(n << 23)
        }));
        (p * power).where_less(self, Self::splat(87.3), Self::splat(0.0))
    }

    /// Angle of the point `(x, y)` of the first quadrant, degrees, to 3e-5°.
    ///
    /// `atan` on 0..1 by an odd polynomial of degree 13, fitted here for the least maximal error (2.5e-7 rad).
    #[inline(always)]
    pub(super) fn quadrant_deg(y: Self, x: Self) -> Self {
        const C: [f32; 7] = [
            0.999_996_1,
            -0.333_173_7,
            0.198_078_15,
            -0.132_333_4,
            0.079_623_62,
            -0.033_604_17,
            0.006_811_78,
        ];
        let t = y.min(x) / y.max(x).at_least(f32::MIN_POSITIVE);
        let s = t * t;
        let p = (((((s * C[6] + C[5]) * s + C[4]) * s + C[3]) * s + C[2]) * s + C[1]) * s + C[0];
        let angle = t * p * (180.0 / std::f32::consts::PI);
        angle.where_less(y, x, Self::splat(90.0) - angle)
    }
}

#[inline(always)]
pub(super) fn dot(a: Lanes3, b: Lanes3) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn add(a: Lanes3, b: Lanes3) -> Lanes3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn sub(a: Lanes3, b: Lanes3) -> Lanes3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn times(a: Lanes3, s: Lanes) -> Lanes3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(super) fn splat3(v: Vec3) -> Lanes3 {
    v.map(Lanes::splat)
}

/// One vector of many.
#[inline(always)]
pub(super) fn get(v: &Lanes3, k: usize) -> Vec3 {
    [v[0].0[k], v[1].0[k], v[2].0[k]]
}

#[inline(always)]
pub(super) fn set(v: &mut Lanes3, k: usize, to: Vec3) {
    for (lanes, value) in v.iter_mut().zip(to) {
        lanes.0[k] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_keep_their_digits() {
        for k in 0..8800_u16 {
            let x = f32::from(k) * 0.01;
            let got = f64::from(Lanes::splat(x).exp_of_negative().0[3]);
            let want = (-f64::from(x)).exp();
            let accepted = (4e-7 + 1e-7 * f64::from(x)) * want;
            assert!(
                (got - want).abs() <= accepted || x > 87.2,
                "{x}: {got} {want}"
            );
        }
        assert_eq!(Lanes::splat(1e30).exp_of_negative().0[0], 0.0);
    }

    #[test]
    fn angles_of_the_first_quadrant_are_right_everywhere() {
        for k in 0..=9000_u16 {
            let want = f64::from(k) * 0.01;
            #[allow(clippy::cast_possible_truncation)]
            let (y, x) = (
                want.to_radians().sin() as f32,
                want.to_radians().cos() as f32,
            );
            let got = Lanes::quadrant_deg(Lanes::splat(y), Lanes::splat(x)).0[0];
            assert!((f64::from(got) - want).abs() < 5e-5, "{want}: {got}");
        }
        assert_eq!(
            Lanes::quadrant_deg(Lanes::splat(0.0), Lanes::splat(0.0)).0[0],
            90.0
        );
    }
}
