//! Weighted sums of the boxes of corresponding clusters, at the speed of memory.
//!
//! Sums run over a few clusters of all paints at a time, so that they stay in the nearest cache: each corner is read once
//! and written once. A box that extrapolation turned inside out gets its corners ordered again, and corners are held to
//! [`MAX_LAB`]; both are looked for as the corners pass, and only a block that has one is gone through number by number.
//! Boxes are not clamped to `L >= 0`, because the light they stand for is clamped once, when it is evaluated.

use std::ops::{AddAssign, Mul};

use super::Boxes;
use super::clamp::Ledger;
use crate::paint::MAX_LAB;

/// Numbers of a run that the compiler turns into vectors: a whole number of corners and of vector registers.
const RUN: usize = 12;
/// Numbers of a block: four of them, sums and corners, fit the nearest cache.
const BLOCK: usize = RUN * 64;
/// Largest weight up to which sums of 32-bit products are exact enough: with Σ|w| below 20 and corners of a few hundred
/// Lab they are off by 20 · 300 · 2^-24 = 4e-4 Lab at most. Beyond it cancellation would bite, and sums take 64 bits.
const MODERATE: f64 = 4.0;

/// Boxes of a realisation and what became of them.
pub(super) struct Mixed {
    pub lower: Vec<[f32; 3]>,
    pub upper: Vec<[f32; 3]>,
    pub account: Account,
}

/// How many corners had to be mended, and the worst of them.
#[derive(Debug, Default)]
pub(super) struct Account {
    inverted: usize,
    narrowest: f64,
    beyond: usize,
    furthest: f64,
}

impl Account {
    /// Tells the ledger, of so many numbers.
    pub fn close(self, of: usize, ledger: &mut Ledger) {
        let order = "inverted corners put in order";
        ledger.record("flakes.boxes", order, self.inverted, of, -self.narrowest);
        let held = "Lab held to -2000..2000";
        ledger.record("flakes.boxes", held, self.beyond, of, self.furthest);
    }

    /// Orders a pair of numbers and holds them.
    #[allow(clippy::cast_possible_truncation)] // boxes are kept at texel precision
    fn mend(&mut self, low: &mut f32, high: &mut f32, exact: [f64; 2]) {
        let [l, h] = exact;
        self.inverted += usize::from(h < l);
        self.narrowest = self.narrowest.min(h - l);
        let (l, h) = (l.min(h), l.max(h));
        let reach = h.max(-l) - MAX_LAB;
        self.beyond += usize::from(reach > 0.0);
        self.furthest = self.furthest.max(reach);
        *low = l.clamp(-MAX_LAB, MAX_LAB) as f32;
        *high = h.clamp(-MAX_LAB, MAX_LAB) as f32;
    }
}

/// `Σ_m w_m g_m` for both corners of every cluster; `weights` are per paint, for L, a and b.
pub(super) fn mix_boxes(paints: &[Boxes], weights: &[[f64; 3]]) -> Mixed {
    if weights.iter().flatten().all(|w| w.abs() <= MODERATE) {
        #[allow(clippy::cast_possible_truncation)] // moderate weights of texels
        sums(paints, weights, |w| w as f32, f64::from, |v| v)
    } else {
        #[allow(clippy::cast_possible_truncation)] // held before it is used
        sums(paints, weights, |w| w, |v| v, |v| v as f32)
    }
}

fn sums<T>(
    paints: &[Boxes],
    weights: &[[f64; 3]],
    weight: fn(f64) -> T,
    exact: fn(T) -> f64,
    texel: fn(T) -> f32,
) -> Mixed
where
    T: Copy + Default + From<f32> + Mul<Output = T> + AddAssign,
{
    let patterns: Vec<[T; RUN]> = weights
        .iter()
        .map(|axes| std::array::from_fn(|k| weight(axes[k % 3])))
        .collect();
    let clusters = paints.first().map_or(0, |p| p.lower.len());
    let (mut lower, mut upper) = (Vec::with_capacity(clusters), Vec::with_capacity(clusters));
    let mut account = Account::default();
    let (mut low, mut high) = ([T::default(); BLOCK], [T::default(); BLOCK]);
    let (mut to_low, mut to_high) = ([0.0_f32; BLOCK], [0.0_f32; BLOCK]);
    for first in (0..3 * clusters).step_by(BLOCK) {
        let here = first..(first + BLOCK).min(3 * clusters);
        let count = here.len();
        let (low, high) = (&mut low[..count], &mut high[..count]);
        let (to_low, to_high) = (&mut to_low[..count], &mut to_high[..count]);
        low.fill(T::default());
        high.fill(T::default());
        for (own, pattern) in paints.iter().zip(&patterns) {
            add(low, &own.lower.as_flattened()[here.clone()], pattern);
            add(high, &own.upper.as_flattened()[here.clone()], pattern);
        }
        let mut odd = 0;
        for k in 0..count {
            (to_low[k], to_high[k]) = (texel(low[k]), texel(high[k]));
            odd |= is_odd(to_low[k], to_high[k]);
        }
        if odd != 0 {
            for k in 0..count {
                let exact = [exact(low[k]), exact(high[k])];
                account.mend(&mut to_low[k], &mut to_high[k], exact);
            }
        }
        lower.extend_from_slice(to_low.as_chunks().0);
        upper.extend_from_slice(to_high.as_chunks().0);
    }
    Mixed {
        lower,
        upper,
        account,
    }
}

fn add<T>(sum: &mut [T], own: &[f32], pattern: &[T; RUN])
where
    T: Copy + From<f32> + Mul<Output = T> + AddAssign,
{
    let (sums, tail) = sum.as_chunks_mut::<RUN>();
    let (runs, rest) = own.as_chunks::<RUN>();
    for (sum, run) in sums.iter_mut().zip(runs) {
        for k in 0..RUN {
            sum[k] += pattern[k] * T::from(run[k]);
        }
    }
    for ((sum, &own), &weight) in tail.iter_mut().zip(rest).zip(pattern) {
        *sum += weight * T::from(own);
    }
}

/// Not 0 where a side is inside out or beyond the bound.
#[allow(clippy::cast_possible_truncation)] // 2000 is exact
fn is_odd(low: f32, high: f32) -> u32 {
    const MOST: f32 = MAX_LAB as f32;
    u32::from(high < low) | u32::from(high > MOST) | u32::from(low < -MOST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn boxes(count: usize, seed: f32) -> Boxes {
        let corner = |k: usize, up: f32| {
            let at = (k as f32 * 0.37 + seed).sin() * 60.0;
            [at + up, at * 0.3 + up * 0.5, up - at]
        };
        Boxes {
            lower: (0..count).map(|k| corner(k, 0.0)).collect(),
            upper: (0..count).map(|k| corner(k, 3.0 + seed)).collect(),
        }
    }

    /// Corner by corner, in 64 bits.
    fn plainly(paints: &[Boxes], weights: &[[f64; 3]], k: usize, axis: usize) -> [f64; 2] {
        let mut pair = [0.0, 0.0];
        for (paint, w) in paints.iter().zip(weights) {
            pair[0] += w[axis] * f64::from(paint.lower[k][axis]);
            pair[1] += w[axis] * f64::from(paint.upper[k][axis]);
        }
        [pair[0].min(pair[1]), pair[0].max(pair[1])].map(|v| v.clamp(-MAX_LAB, MAX_LAB))
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn every_corner_is_its_weighted_sum(
            count in 1..700_usize, weights in prop::collection::vec(prop::array::uniform3(-40.0..40.0_f64), 2..=5),
            small in prop::bool::ANY,
        ) {
            let weights: Vec<[f64; 3]> = weights.iter().map(|w| w.map(|w| if small { w / 10.0 } else { w })).collect();
            let paints: Vec<Boxes> = (0..weights.len()).map(|m| boxes(count, m as f32)).collect();
            let mixed = mix_boxes(&paints, &weights);
            // Products and sums of numbers below 70: 2 M roundings of 2^-24 each in 32 bits, one in 64.
            let size: f64 = weights.iter().flatten().fold(1.0, |m: f64, w| m.max(w.abs())) * 70.0;
            let tolerance = 2.0 * weights.len() as f64 * size * f64::from(f32::EPSILON);
            for k in 0..count {
                for axis in 0..3 {
                    let [low, high] = plainly(&paints, &weights, k, axis);
                    prop_assert!((f64::from(mixed.lower[k][axis]) - low).abs() <= tolerance);
                    prop_assert!((f64::from(mixed.upper[k][axis]) - high).abs() <= tolerance);
                }
            }
        }
    }

    #[test]
    fn a_weight_of_one_gives_the_very_boxes() {
        let paints = [boxes(1000, 0.0), boxes(1000, 1.0)];
        let mixed = mix_boxes(&paints, &[[1.0; 3], [0.0; 3]]);
        assert_eq!(mixed.lower, paints[0].lower);
        assert_eq!(mixed.upper, paints[0].upper);
    }

    #[test]
    fn moderate_and_large_weights_meet_where_they_part() {
        let paints = [boxes(999, 0.0), boxes(999, 1.0)];
        let at = |w: f64| mix_boxes(&paints, &[[w; 3], [1.0 - w; 3]]);
        let (narrow, wide) = (at(MODERATE), at(MODERATE + 1e-12));
        let corners = narrow.lower.iter().chain(&narrow.upper).flatten();
        for (a, b) in corners.zip(wide.lower.iter().chain(&wide.upper).flatten()) {
            // Four products and sums of at most 4 · 70.
            assert!((a - b).abs() <= 4.0 * 280.0 * f32::EPSILON, "{a} {b}");
        }
    }

    #[test]
    fn inverted_and_distant_corners_are_counted() {
        let one = |low: f32, high: f32| Boxes {
            lower: vec![[low; 3]],
            upper: vec![[high; 3]],
        };
        let mixed = mix_boxes(&[one(10.0, 12.0), one(10.0, 20.0)], &[[2.0; 3], [-1.0; 3]]);
        assert_eq!((mixed.lower[0], mixed.upper[0]), ([4.0; 3], [10.0; 3]));
        assert_eq!((mixed.account.inverted, mixed.account.narrowest), (3, -6.0));
        let mixed = mix_boxes(&[one(10.0, 12.0), one(1.0, 1.0)], &[[1e9; 3], [0.0; 3]]);
        assert_eq!((mixed.lower[0], mixed.upper[0]), ([2000.0; 3], [2000.0; 3]));
        assert_eq!(
            (mixed.account.beyond, mixed.account.furthest),
            (3, 12e9 - 2000.0)
        );
    }
}
