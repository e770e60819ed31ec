//! Numbers on their way into a texture: finite, within the range of the texture's type, and what was bent is told.
//!
//! Halves below 2^-14 are subnormal, and readers differ in whether they are numbers or nothing. None is written: such a
//! number becomes 0 or 2^-14, whichever is nearer, which moves it by 3e-5 at most, a tenth of a step of a half next to 1.

use half::f16;
use half::slice::HalfFloatSliceExt;
use serde::Serialize;

use super::ExportError;
use crate::paint::largest_magnitude;

/// Largest magnitude that a half holds.
const HALF_MAX: f32 = 65504.0;

/// A clamp that bit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Clamped {
    /// The texture.
    pub what: &'static str,
    /// How many numbers were outside the range.
    pub count: usize,
    /// The farthest of them.
    pub farthest: f64,
    /// The magnitude they were held to.
    pub limit: f64,
}

/// Smallest magnitude, other than 0, that every reader of halves reads alike.
const HALF_MIN: f32 = 6.103_515_6e-5;

/// The largest magnitude of finite numbers; refuses others.
pub(super) fn finite(what: &'static str, values: &[f32]) -> Result<f32, ExportError> {
    let largest = largest_magnitude(values);
    if largest.is_finite() {
        return Ok(largest);
    }
    let index = values.iter().position(|v| !v.is_finite()).unwrap_or(0);
    Err(ExportError::NotFinite { what, index })
}

/// The nearer of 0 and [`HALF_MIN`] for a number between them.
fn without_subnormals(value: f32) -> f32 {
    if value.abs() > HALF_MIN / 2.0 {
        HALF_MIN.copysign(value)
    } else {
        0.0
    }
}

/// Numbers as halves, and the largest difference that makes to one of them.
#[derive(Debug)]
pub(super) struct Halves {
    pub list: Vec<f16>,
    pub rounding: f32,
}

impl Halves {
    /// No number.
    pub const fn none() -> Self {
        Self {
            list: Vec::new(),
            rounding: 0.0,
        }
    }
}

/// Numbers that are converted at a time: they and their halves stay in the nearest cache.
const BLOCK: usize = 1024;

/// Halves of finite numbers, clamped to ±65504, none subnormal. Adds to `clamped` when the clamp bit.
pub(super) fn halves(
    what: &'static str,
    values: &mut [f32],
    clamped: &mut Vec<Clamped>,
) -> Result<Halves, ExportError> {
    if finite(what, values)? > HALF_MAX {
        hold(what, values, clamped);
    }
    Ok(pulp::Arch::new().dispatch(Conversion { values }))
}

/// The conversion of numbers within the range, compiled for wide registers too.
struct Conversion<'a> {
    values: &'a [f32],
}

impl pulp::NullaryFnOnce for Conversion<'_> {
    type Output = Halves;

    #[inline(always)]
    fn call(self) -> Halves {
        let mut list = Vec::with_capacity(self.values.len());
        let (mut rounding, mut halves, mut back) = (0.0_f32, [f16::ZERO; BLOCK], [0.0; BLOCK]);
        for values in self.values.chunks(BLOCK) {
            let halves = &mut halves[..values.len()];
            halves.convert_from_f32_slice(values);
            // Counted, not searched for: a search that may stop would go number by number.
            let mut small = 0_u32;
            for value in values {
                small += u32::from(value.abs() < HALF_MIN) - u32::from(*value == 0.0);
            }
            if small > 0 {
                for (half, value) in halves.iter_mut().zip(values) {
                    if value.abs() < HALF_MIN {
                        *half = f16::from_f32(without_subnormals(*value));
                    }
                }
            }
            list.extend_from_slice(halves);
            let back = &mut back[..values.len()];
            halves.convert_to_f32_slice(back);
            for (back, value) in back.iter_mut().zip(values) {
                *back -= value;
            }
            rounding = rounding.max(largest_magnitude(back));
        }
        Halves { list, rounding }
    }
}

/// Holds numbers to ±65504 and keeps the account.
fn hold(what: &'static str, values: &mut [f32], clamped: &mut Vec<Clamped>) {
    let (mut count, mut farthest) = (0, 0.0_f32);
    for value in values.iter_mut().filter(|v| v.abs() > HALF_MAX) {
        count += 1;
        if value.abs() > farthest.abs() {
            farthest = *value;
        }
        *value = value.clamp(-HALF_MAX, HALF_MAX);
    }
    if let Some(known) = clamped.iter_mut().find(|c| c.what == what) {
        known.count += count;
        if f64::from(farthest.abs()) > known.farthest.abs() {
            known.farthest = f64::from(farthest);
        }
    } else {
        let (farthest, limit) = (f64::from(farthest), f64::from(HALF_MAX));
        clamped.push(Clamped {
            what,
            count,
            farthest,
            limit,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_too_large_for_a_half_is_held_and_told() {
        let mut clamped = Vec::new();
        let mut values = [1.0, 70000.0, -1e9, 65504.0];
        let out = halves("means", &mut values, &mut clamped).expect("finite");
        assert_eq!(
            out.list.iter().map(|h| h.to_f32()).collect::<Vec<_>>(),
            [1.0, 65504.0, -65504.0, 65504.0]
        );
        assert_eq!(out.rounding, 0.0);
        assert_eq!(
            clamped,
            [Clamped {
                what: "means",
                count: 2,
                farthest: -1e9,
                limit: 65504.0
            }]
        );
    }

    #[test]
    fn what_is_not_finite_is_refused_by_place() {
        let error = halves("means", &mut [0.0, f32::NAN], &mut Vec::new()).expect_err("refused");
        assert!(matches!(
            error,
            ExportError::NotFinite {
                what: "means",
                index: 1
            }
        ));
    }

    #[test]
    fn a_number_too_small_for_a_normal_half_becomes_the_nearer_of_nothing_and_the_smallest() {
        let smallest = f16::MIN_POSITIVE.to_f32();
        assert_eq!(smallest, HALF_MIN);
        let mut values = [1e-45, 3.05e-5, -3.06e-5, 6.1e-5, smallest, -1e-30, 7e-5];
        let out = halves("means", &mut values, &mut Vec::new()).expect("finite");
        let want = [0.0, 0.0, -smallest, smallest, smallest, 0.0, 7e-5];
        for (half, want) in out.list.iter().zip(want) {
            assert_eq!(*half, f16::from_f32(want));
        }
    }

    #[test]
    fn the_rounding_is_that_of_the_worst_number() {
        // Halves next to 1000 are half a unit apart, over many blocks.
        let mut values: Vec<f32> = (0..5000_u16).map(|k| f32::from(k) / 5.0).collect();
        let written = halves("x", &mut values, &mut Vec::new()).expect("finite");
        let worst = values
            .iter()
            .zip(&written.list)
            .map(|(v, h)| (v - h.to_f32()).abs());
        assert_eq!(written.rounding, worst.fold(0.0, f32::max));
        assert!((0.19..=0.25).contains(&written.rounding));
    }

    #[test]
    fn no_finite_number_becomes_an_infinite_half() {
        // Between 65504 and 65520 a half rounds down, above it would be infinite.
        let mut clamped = Vec::new();
        for value in [65504.1_f32, 65519.9, 65520.0, f32::MAX] {
            assert_eq!(
                halves("x", &mut [value], &mut clamped)
                    .expect("finite")
                    .list,
                [f16::MAX]
            );
        }
        assert_eq!(clamped[0].count, 4);
    }
}
