//! Weighted sums of the boxes of corresponding clusters, at the speed of memory.
//!
//! ```text
//! l = Σ_m w_m g_m,   l' = Σ_m w_m g'_m      (g, g' the corners of a cluster's box in paint m)
//! ```
//!
//! One pass reads every corner once and writes both corners of the sum; the number of paints is known to the compiler,
//! so that the loop is as plain as `a·X + b·Y`. Only where a weight is negative can a box turn inside out: there its
//! corners are put in order on the way. Whether a sum can leave ±[`MAX_LAB`] at all follows from the weights and the
//! farthest corner, before anything is summed; if it can, a block that left is gone through again, number by number. Where
//! a weight is large, every number is summed in 64 bits.
//! Boxes are not clamped to `L >= 0`, because the light they stand for is clamped once, when it is evaluated.

use super::clamp::Ledger;
use super::{BlendedFlakes, Boxes};
use crate::paint::{MAX_LAB, largest_magnitude};

/// Numbers of a block, a whole number of corners: the blocks of two paints and their weights stay in the nearest cache.
const BLOCK: usize = 768;
/// Largest weight up to which sums of 32-bit products are exact enough: with Σ|w| below 20 and corners of a few hundred
/// Lab they are off by 20 · 300 · 2^-24 = 4e-4 Lab at most. Beyond it cancellation would bite, and sums take 64 bits.
const MODERATE: f64 = 4.0;
/// What rounding may add to a 32-bit sum of five products: relative, 2^-24 for every product, sum and weight.
const ROUNDING: f64 = 1.0 + 11.0 * 6e-8;

/// Bits of a number without its sign, and those of the bound.
const MAGNITUDE: u32 = 0x7fff_ffff;
#[allow(clippy::cast_possible_truncation)] // exact
const BOUND: u32 = (MAX_LAB as f32).to_bits();

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
    fn turned(&mut self, seen: &Seen) {
        self.inverted += seen.inverted as usize;
        let widest = f32::from_bits(seen.widest.cast_unsigned());
        self.narrowest = self.narrowest.min(-f64::from(widest));
    }
}

/// Magnitude that no number of any corner exceeds, infinite where a corner is no number.
pub(super) fn reach(paints: &[Boxes]) -> f32 {
    let lists = paints.iter().flat_map(|own| [&own.lower, &own.upper]);
    lists
        .map(|list| largest_magnitude(list.as_flattened()))
        .map(|own| if own.is_nan() { f32::INFINITY } else { own })
        .fold(0.0, f32::max)
}

/// `Σ_m w_m g_m` for both corners of every cluster into `out`; `weights` are per paint, for L, a and b.
pub(super) fn mix_boxes(flakes: &BlendedFlakes, weights: &[[f64; 3]], out: &mut Boxes) -> Account {
    let largest = |axis: usize| weights.iter().map(|w| w[axis].abs()).sum::<f64>();
    let size = largest(0).max(largest(1)).max(largest(2));
    let farthest = size * f64::from(flakes.reach) * ROUNDING;
    if farthest.is_infinite() || weights.iter().flatten().any(|w| w.abs() > MODERATE) {
        return wide(&flakes.boxes, weights, out);
    }
    let leaves = farthest > MAX_LAB;
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
    let weights: [[f32; 3]; PAINTS] = std::array::from_fn(|m| weights[m].map(|w| w as f32));
    // Weights that are not negative keep corners in order, for rounding does.
    let turns = weights.as_flattened().iter().any(|w| *w < 0.0);
    if weights.iter().all(|w| *w == [w[0]; 3]) {
        let weights = weights.map(|w| w[0]);
        if turns {
            make_room(out, paints[0].lower.len());
        }
        return blocks(paints, &weights, [leaves, turns], out);
    }
    let patterns: [[f32; BLOCK]; PAINTS] = weights.map(|axes| std::array::from_fn(|k| axes[k % 3]));
    make_room(out, paints[0].lower.len());
    blocks(paints, &patterns, [leaves, turns], out)
}

fn blocks<const PAINTS: usize>(
    paints: [&Boxes; PAINTS],
    weights: &[impl Weight; PAINTS],
    [leaves, turns]: [bool; 2],
    out: &mut Boxes,
) -> Account {
    let mut account = Account::default();
    let numbers = paints[0].lower.as_flattened().len();
    let mut lists =
        [&mut out.lower, &mut out.upper].map(|list| std::mem::take(list).into_flattened());
    // Used memory is written over. New memory would have to be cleared first: it is appended to, where one weight is for
    // all axes and none is negative.
    let over = lists.iter().all(|list| list.len() == numbers);
    if !over {
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
        let beyond = if over {
            let out = lists.each_mut().map(|list| &mut list[here.clone()]);
            match (leaves, turns) {
                (true, true) => {
                    sums::<PAINTS, true, true>(weights, lower, upper, out, &mut account)
                }
                (true, false) => {
                    sums::<PAINTS, true, false>(weights, lower, upper, out, &mut account)
                }
                (false, true) => {
                    sums::<PAINTS, false, true>(weights, lower, upper, out, &mut account)
                }
                (false, false) => {
                    sums::<PAINTS, false, false>(weights, lower, upper, out, &mut account)
                }
            }
        } else {
            let weights = weights.each_ref().map(|weight| weight.at(0));
            if leaves {
                append_sums::<PAINTS, true>(weights, lower, upper, &mut lists)
            } else {
                append_sums::<PAINTS, false>(weights, lower, upper, &mut lists)
            }
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

/// What [`sums`] does, at the end of two lists. Two paints are summed on their way, each further one on top of them.
#[inline(never)]
fn append_sums<const PAINTS: usize, const WATCH: bool>(
    weights: [f32; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    [low, high]: &mut [Vec<f32>; 2],
) -> bool {
    let first = low.len();
    let (x, y) = (weights[0], weights[1]);
    let sum = |(own, other): (&f32, &f32)| x * own + y * other;
    low.extend(lower[0].iter().zip(lower[1]).map(sum));
    let mut seen = Seen::default();
    if PAINTS == 2 {
        let pairs = upper[0].iter().zip(upper[1]).zip(&low[first..]);
        high.extend(pairs.map(|(pair, &l)| {
            let h = sum(pair);
            seen.look::<WATCH, false>(l, h).1
        }));
        return seen.is_beyond();
    }
    high.extend(upper[0].iter().zip(upper[1]).map(sum));
    let (low, high) = (&mut low[first..], &mut high[first..]);
    for m in 2..PAINTS {
        for (list, corners) in [(&mut *low, lower[m]), (&mut *high, upper[m])] {
            for (sum, own) in list.iter_mut().zip(corners) {
                *sum += weights[m] * own;
            }
        }
    }
    if WATCH {
        for (&l, &h) in low.iter().zip(&*high) {
            seen.look::<WATCH, false>(l, h);
        }
    }
    seen.is_beyond()
}

/// What is gathered of sums on their way.
#[derive(Default)]
struct Seen {
    beyond: u32,
    inverted: u32,
    widest: i32,
}

impl Seen {
    /// Looks at the corners of a box; gives them back, if it may `TURN` inside out, in order.
    #[inline(always)]
    fn look<const WATCH: bool, const TURN: bool>(&mut self, l: f32, h: f32) -> (f32, f32) {
        if WATCH {
            // Magnitudes compare like their bits: the sign says whether one is beyond the bound.
            self.beyond |= BOUND.wrapping_sub(l.to_bits() & MAGNITUDE);
            self.beyond |= BOUND.wrapping_sub(h.to_bits() & MAGNITUDE);
        }
        if !TURN {
            return (l, h);
        }
        let turned = h < l;
        self.inverted += u32::from(turned);
        // Positive differences compare like their bits, and above all others.
        self.widest = self.widest.max((l - h).to_bits().cast_signed());
        if turned { (h, l) } else { (l, h) }
    }

    /// Whether a number is beyond ±[`MAX_LAB`], if that was watched.
    const fn is_beyond(&self) -> bool {
        self.beyond >> 31 == 1
    }
}

/// One weight for all three axes, or weights that repeat along a block.
trait Weight {
    fn at(&self, k: usize) -> f32;
}

impl Weight for f32 {
    #[inline(always)]
    fn at(&self, _: usize) -> f32 {
        *self
    }
}

impl Weight for [f32; BLOCK] {
    #[inline(always)]
    fn at(&self, k: usize) -> f32 {
        self[k]
    }
}

/// Both corners of a block of at most [`BLOCK`] numbers, and what [`Seen::is_beyond`] says of them.
///
/// A function of its own: its two outputs are known to be apart from everything else, so that the loop becomes vectors.
#[inline(never)]
fn sums<const PAINTS: usize, const WATCH: bool, const TURN: bool>(
    weights: &[impl Weight; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    [low, high]: [&mut [f32]; 2],
    account: &mut Account,
) -> bool {
    let count = low.len().min(BLOCK);
    let (low, high) = (&mut low[..count], &mut high[..count]);
    let (lower, upper) = (lower.map(|l| &l[..count]), upper.map(|u| &u[..count]));
    let mut seen = Seen::default();
    for k in 0..count {
        let mut l = weights[0].at(k) * lower[0][k];
        let mut h = weights[0].at(k) * upper[0][k];
        for m in 1..PAINTS {
            l += weights[m].at(k) * lower[m][k];
            h += weights[m].at(k) * upper[m][k];
        }
        (low[k], high[k]) = seen.look::<WATCH, TURN>(l, h);
    }
    if TURN {
        account.turned(&seen);
    }
    seen.is_beyond()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::AngleGrid;
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

    fn flakes(boxes: Vec<Boxes>) -> BlendedFlakes {
        let clusters = boxes[0].lower.len();
        BlendedFlakes::new(
            [AngleGrid::single(), AngleGrid::single()],
            vec![0, u32::try_from(clusters).expect("few")].into(),
            vec![1.0 / clusters as f64; clusters].into(),
            boxes,
            vec![],
        )
    }

    fn mixed(boxes: Vec<Boxes>, weights: &[[f64; 3]]) -> (Boxes, Account) {
        let mut out = Boxes::default();
        let account = mix_boxes(&flakes(boxes), weights, &mut out);
        (out, account)
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
            small in prop::bool::ANY, alike in prop::bool::ANY,
        ) {
            let weights: Vec<[f64; 3]> = weights.iter()
                .map(|w| if alike { [w[0]; 3] } else { *w })
                .map(|w| w.map(|w| if small { w / 10.0 } else { w }))
                .collect();
            let paints: Vec<Boxes> = (0..weights.len()).map(|m| boxes(count, m as f32)).collect();
            let (mixed, account) = mixed(paints.clone(), &weights);
            // Products and sums of numbers below 70: 2 M roundings of 2^-24 each in 32 bits, one in 64.
            let size: f64 = weights.iter().flatten().fold(1.0, |m: f64, w| m.max(w.abs())) * 70.0;
            let tolerance = 2.0 * weights.len() as f64 * size * f64::from(f32::EPSILON);
            let mut inverted = 0;
            for k in 0..count {
                for axis in 0..3 {
                    let [low, high] = plainly(&paints, &weights, k, axis);
                    prop_assert!((f64::from(mixed.lower[k][axis]) - low).abs() <= tolerance);
                    prop_assert!((f64::from(mixed.upper[k][axis]) - high).abs() <= tolerance);
                    let width = |w: &[f64; 3], own: &Boxes| w[axis] * f64::from(own.upper[k][axis] - own.lower[k][axis]);
                    let width: f64 = weights.iter().zip(&paints).map(|(w, own)| width(w, own)).sum();
                    inverted += usize::from(width < -tolerance);
                }
            }
            prop_assert!(account.inverted >= inverted, "{} of at least {inverted}", account.inverted);
            prop_assert!(inverted == 0 || account.narrowest < 0.0);
        }
    }

    #[test]
    fn a_weight_of_one_gives_the_very_boxes() {
        let paints = vec![boxes(1000, 0.0), boxes(1000, 1.0)];
        let (mixed, account) = mixed(paints.clone(), &[[1.0; 3], [0.0; 3]]);
        assert_eq!(mixed, paints[0]);
        assert_eq!(account, Account::default());
    }

    /// Two to five paints; weights that may turn boxes and such that may not; sums that leave the range and that do not.
    #[test]
    fn lists_that_were_used_before_give_the_same() {
        for (count, paints) in [(500, 2), (999, 3), (256, 4), (1000, 5)] {
            for (share, first) in [(0.3, 0.4), (-0.4, 1.9), (1.2, 0.9)] {
                for far in [0.0_f32, 980.0] {
                    let all = || -> Vec<Boxes> {
                        let moved = |m: usize| {
                            let mut own = boxes(count, m as f32);
                            for corner in own.lower.iter_mut().chain(&mut own.upper) {
                                *corner = corner.map(|v| v + far);
                            }
                            own
                        };
                        (0..paints).map(moved).collect()
                    };
                    let mut weights = vec![[share; 3]; paints];
                    weights[0] = [first; 3];
                    let fresh = mixed(all(), &weights);
                    let leaves = fresh.1.beyond > 0;
                    let sum = first + share * (paints - 1) as f64;
                    assert_eq!(leaves, sum * f64::from(far) > 2000.0, "{sum} {far}");
                    for used in [3, count, 2000] {
                        let mut out = boxes(used, 7.0);
                        let account = mix_boxes(&flakes(all()), &weights, &mut out);
                        assert_eq!((&out, &account), (&fresh.0, &fresh.1));
                    }
                    for k in 0..count {
                        for axis in 0..3 {
                            let plain = plainly(&all(), &weights, k, axis);
                            let own = [fresh.0.lower[k][axis], fresh.0.upper[k][axis]];
                            // Five products and sums of at most 1.9 · 1000.
                            let close = |(x, y): (f32, f64)| (f64::from(x) - y).abs() < 5e-3;
                            assert!(own.into_iter().zip(plain).all(close), "{own:?} {plain:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn moderate_and_large_weights_meet_where_they_part() {
        let at = |w: f64| {
            let paints = vec![boxes(999, 0.0), boxes(999, 1.0)];
            mixed(paints, &[[w; 3], [1.0 - w; 3]]).0
        };
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
        let pair = vec![one(10.0, 12.0), one(10.0, 20.0)];
        let (out, account) = mixed(pair, &[[2.0; 3], [-1.0; 3]]);
        assert_eq!((out.lower[0], out.upper[0]), ([4.0; 3], [10.0; 3]));
        assert_eq!((account.inverted, account.narrowest), (3, -6.0));
        let far = vec![one(10.0, 12.0), one(1.0, 1.0)];
        let (out, account) = mixed(far, &[[1e9; 3], [0.0; 3]]);
        assert_eq!((out.lower[0], out.upper[0]), ([2000.0; 3], [2000.0; 3]));
        assert_eq!((account.beyond, account.furthest), (3, 12e9 - 2000.0));
        let near = vec![one(900.0, 1000.0), one(-10.0, 1.0)];
        let (out, account) = mixed(near, &[[3.0; 3], [-2.0; 3]]);
        assert_eq!((out.lower[0], out.upper[0]), ([2000.0; 3], [2000.0; 3]));
        assert_eq!((account.beyond, account.furthest), (3, 998.0));
    }

    #[test]
    fn corners_that_are_no_numbers_are_never_summed_quickly() {
        let mut paints = vec![boxes(20, 0.0), boxes(20, 1.0)];
        for worst in [f32::NAN, f32::NEG_INFINITY] {
            paints[1].upper[19][2] = worst;
            assert_eq!(reach(&paints), f32::INFINITY);
        }
    }
}
