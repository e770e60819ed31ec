//! Weighted sums of the boxes of corresponding clusters, at the speed of memory.
//!
//! ```text
//! l = Σ_m w_m g_m,   l' = Σ_m w_m g'_m      (g, g' the corners of a cluster's box in paint m)
//! ```
//!
//! One pass reads every corner once and writes both corners of the sum; the number of paints is known to the compiler,
//! so that the loop is as plain as `a·X + b·Y`. Only where a weight is negative can a box turn inside out: there its
//! corners are put in order on the way. Whether a sum can leave ±[`MAX_LAB`] at all follows from the weights and the
//! farthest corner of each paint, before anything is summed; if it can, a block that left is gone through again, number by
//! number. Where a weight is large, every number is summed in 64 bits.
//! Boxes are not clamped to `L >= 0`, because the light they stand for is clamped once, when it is evaluated.

mod sums;
#[cfg(test)]
mod tests;

use self::sums::{BLOCK, Turned, Weights, append_sums, sums};
use super::clamp::Ledger;
use super::{BlendedFlakes, Boxes};
use crate::paint::{MAX_LAB, largest_magnitude};

/// Largest weight up to which sums of 32-bit products are exact enough: with Σ|w| below 20 and corners of a few hundred
/// Lab they are off by 20 · 300 · 2^-24 = 4e-4 Lab at most. Beyond it cancellation would bite, and sums take 64 bits.
const MODERATE: f64 = 4.0;
/// What rounding may add to a 32-bit sum of five products: relative, 2^-24 for every product, sum and weight.
const ROUNDING: f64 = 1.0 + 11.0 * 6e-8;

/// How many corners had to be mended, and the worst of them.
#[derive(Debug, Default, PartialEq)]
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
    fn mended(&mut self, [low, high]: [f64; 2]) -> [f32; 2] {
        self.inverted += usize::from(high < low);
        self.narrowest = self.narrowest.min(high - low);
        let (low, high) = (low.min(high), low.max(high));
        let reach = high.max(-low) - MAX_LAB;
        self.beyond += usize::from(reach > 0.0);
        self.furthest = self.furthest.max(reach);
        [low, high].map(|v| v.clamp(-MAX_LAB, MAX_LAB) as f32)
    }

    /// Counts what was put in order on its way.
    fn turned(&mut self, turned: Turned) {
        self.inverted += turned.count;
        self.narrowest = self.narrowest.min(-f64::from(turned.widest));
    }
}

/// Magnitude that no number of a paint's corners exceeds, infinite where one is no number.
pub(super) fn reach(own: &Boxes) -> f32 {
    [&own.lower, &own.upper]
        .map(|list| largest_magnitude(list.as_flattened()))
        .map(|far| if far.is_nan() { f32::INFINITY } else { far })
        .into_iter()
        .fold(0.0, f32::max)
}

/// Magnitudes that no sum exceeds, on each axis; no number where a corner is none.
fn farthest(reaches: &[f32], weights: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let paints = reaches.iter().zip(weights);
        let sum: f64 = paints.map(|(far, w)| w[axis].abs() * f64::from(*far)).sum();
        sum * ROUNDING
    })
}

/// `Σ_m w_m g_m` for both corners of every cluster into `out`; `weights` are per paint, for L, a and b.
pub(super) fn mix_boxes(flakes: &BlendedFlakes, weights: &[[f64; 3]], out: &mut Boxes) -> Account {
    let farthest = farthest(&flakes.reaches, weights);
    // Neither an overflow nor a weight of 0 for what is no number is for 32 bits.
    let overflows = farthest
        .iter()
        .any(|far| far.is_nan() || *far > f64::from(f32::MAX));
    if overflows || weights.iter().flatten().any(|w| w.abs() > MODERATE) {
        return wide(&flakes.boxes, weights, out);
    }
    let leaves = farthest.iter().any(|far| *far > MAX_LAB);
    match flakes.boxes.as_slice() {
        [a, b] => narrow([a, b], weights, leaves, out),
        [a, b, c] => narrow([a, b, c], weights, leaves, out),
        [a, b, c, d] => narrow([a, b, c, d], weights, leaves, out),
        [a, b, c, d, e] => narrow([a, b, c, d, e], weights, leaves, out),
        _ => wide(&flakes.boxes, weights, out),
    }
}

/// Lists of so many corners, whatever they are.
fn make_room(out: &mut Boxes, clusters: usize) {
    for list in [&mut out.lower, &mut out.upper] {
        list.resize(clusters, [0.0; 3]);
    }
}

/// Sums in 64 bits, every number ordered and held.
fn wide(paints: &[Boxes], weights: &[[f64; 3]], out: &mut Boxes) -> Account {
    let mut account = Account::default();
    make_room(out, paints.first().map_or(0, |own| own.lower.len()));
    for (k, (low, high)) in out.lower.iter_mut().zip(&mut out.upper).enumerate() {
        for axis in 0..3 {
            let mut pair = [0.0; 2];
            for (own, w) in paints.iter().zip(weights) {
                pair[0] += w[axis] * f64::from(own.lower[k][axis]);
                pair[1] += w[axis] * f64::from(own.upper[k][axis]);
            }
            [low[axis], high[axis]] = account.mended(pair);
        }
    }
    account
}

/// Sums in 32 bits; `leaves` says whether one of them may leave the range.
fn narrow<const PAINTS: usize>(
    paints: [&Boxes; PAINTS],
    weights: &[[f64; 3]],
    leaves: bool,
    out: &mut Boxes,
) -> Account {
    #[allow(clippy::cast_possible_truncation)] // moderate weights of texels
    let weights: [Weights; PAINTS] = std::array::from_fn(|m| weights[m].map(|w| w as f32));
    // Weights that are not negative keep corners in order, for rounding does.
    let turns = weights.as_flattened().iter().any(|w| *w < 0.0);
    let watch = leaves || turns;
    let is_plain = !watch && weights.iter().all(|w| *w == [w[0]; 3]);
    let mut account = Account::default();
    let numbers = paints[0].lower.as_flattened().len();
    let mut lists =
        [&mut out.lower, &mut out.upper].map(|list| std::mem::take(list).into_flattened());
    // Used memory is written over where both lists are as long as the sums.
    if lists.iter().any(|list| list.len() != numbers) {
        for list in &mut lists {
            list.clear();
            list.reserve_exact(numbers);
        }
    }
    for first in (0..numbers).step_by(BLOCK) {
        let here = first..(first + BLOCK).min(numbers);
        let [lower, upper] = [
            paints.map(|own| &own.lower.as_flattened()[here.clone()]),
            paints.map(|own| &own.upper.as_flattened()[here.clone()]),
        ];
        if lists[0].len() < here.end {
            if is_plain {
                append_sums(&weights.map(|w| w[0]), lower, upper, &mut lists);
                continue;
            }
            // New memory is cleared block by block: a cache holds a block until its sums are there.
            for list in &mut lists {
                list.resize(here.end, 0.0);
            }
        }
        let out = lists.each_mut().map(|list| &mut list[here.clone()]);
        let beyond = if watch {
            sums::<PAINTS, true>(&weights, lower, upper, out, &mut account)
        } else {
            sums::<PAINTS, false>(&weights, lower, upper, out, &mut account)
        };
        let [low, high] = lists.each_mut().map(|list| &mut list[here.clone()]);
        if beyond {
            for (low, high) in low.iter_mut().zip(high) {
                [*low, *high] = account.mended([*low, *high].map(f64::from));
            }
        }
    }
    [out.lower, out.upper] = lists.map(corner_by_corner);
    account
}

/// The same list in the same memory, as long as that holds whole corners.
fn corner_by_corner(numbers: Vec<f32>) -> Vec<[f32; 3]> {
    let cast = bytemuck::allocation::try_cast_vec(numbers);
    cast.unwrap_or_else(|(_, numbers)| numbers.as_chunks().0.to_vec())
}
