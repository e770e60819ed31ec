//! The sums of a block: the loops that run at the speed of memory.
//!
//! A block stays in the nearest cache while it is summed, held against the bound and put in order, each by a loop of its
//! own: short loops become vectors, one that did all of it would not.

use super::Account;
use crate::paint::MAX_LAB;

/// Numbers of a block, a whole number of corners: the blocks of two paints and their weights stay in the nearest cache.
pub(super) const BLOCK: usize = 768;
/// Bits of a number without its sign.
const MAGNITUDE: u32 = 0x7fff_ffff;

/// Largest magnitude of some numbers, as its bits: they compare like magnitudes, those of NaN above all.
#[derive(Clone, Copy, Debug, Default)]
struct Farthest(i32);

impl Farthest {
    #[inline(always)]
    fn of(numbers: &[f32]) -> Self {
        let magnitudes = numbers.iter().map(|x| x.to_bits() & MAGNITUDE);
        Self(magnitudes.fold(0, |most, own| most.max(own.cast_signed())))
    }

    fn or(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }

    /// Whether a number is beyond ±[`MAX_LAB`].
    #[allow(clippy::cast_possible_truncation)] // exact
    fn is_beyond(self) -> bool {
        self.0 > (MAX_LAB as f32).to_bits().cast_signed()
    }
}

/// Boxes that were inside out.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Turned {
    pub count: u32,
    /// The largest of all differences of a lower and an upper corner that are above 0, as its bits.
    pub widest: i32,
}

impl Turned {
    /// Of these corners, which are in order afterwards.
    #[inline(always)]
    fn put_back(low: &mut [f32], high: &mut [f32]) -> Self {
        let mut turned = Self::default();
        for (l, h) in low.iter().zip(&*high) {
            turned.count += u32::from(h < l);
            // Positive differences compare like their bits, and above all others.
            turned.widest = turned.widest.max((l - h).to_bits().cast_signed());
        }
        if turned.count > 0 {
            order(low, high);
        }
        turned
    }
}

/// Puts corners in order without a branch: a store that hangs on a comparison is slower.
#[inline(always)]
fn order(low: &mut [f32], high: &mut [f32]) {
    for (low, high) in low.iter_mut().zip(high) {
        let exchanged = 0_u32.wrapping_sub(u32::from(*high < *low));
        let change = (low.to_bits() ^ high.to_bits()) & exchanged;
        *low = f32::from_bits(low.to_bits() ^ change);
        *high = f32::from_bits(high.to_bits() ^ change);
    }
}

/// One weight for all three axes, or weights that repeat along a block.
pub(super) trait Weight {
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

/// What [`sums`] does, at the end of two lists. Two paints are summed on their way, each further one on top of them.
#[inline(never)]
pub(super) fn append_sums<const PAINTS: usize, const WATCH: bool>(
    weights: [f32; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    lists: &mut [Vec<f32>; 2],
) -> bool {
    let mut farthest = Farthest::default();
    for (list, corners) in lists.iter_mut().zip([lower, upper]) {
        let first = list.len();
        let pairs = corners[0].iter().zip(corners[1]);
        list.extend(pairs.map(|(own, other)| weights[0] * own + weights[1] * other));
        let list = &mut list[first..];
        for (weight, corners) in weights.iter().zip(corners).skip(2) {
            for (sum, own) in list.iter_mut().zip(corners) {
                *sum += weight * own;
            }
        }
        if WATCH {
            farthest = farthest.or(Farthest::of(list));
        }
    }
    farthest.is_beyond()
}

/// Both corners of a block of at most [`BLOCK`] numbers, put in order where they may `TURN`; whether one is beyond
/// ±[`MAX_LAB`], if that is `WATCH`ed.
pub(super) fn sums<const PAINTS: usize, const WATCH: bool, const TURN: bool>(
    weights: &[impl Weight; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    out: [&mut [f32]; 2],
    account: &mut Account,
) -> bool {
    let (farthest, turned) = pulp::Arch::new().dispatch(Sums::<_, PAINTS, WATCH, TURN> {
        weights,
        lower,
        upper,
        out,
    });
    if TURN {
        account.turned(turned);
    }
    farthest.is_beyond()
}

/// A block with all it needs, compiled once for every processor and once for those with wide registers. Both do the same
/// operations in the same order, so that the bits are the same.
struct Sums<'a, W, const PAINTS: usize, const WATCH: bool, const TURN: bool> {
    weights: &'a [W; PAINTS],
    lower: [&'a [f32]; PAINTS],
    upper: [&'a [f32]; PAINTS],
    out: [&'a mut [f32]; 2],
}

impl<W: Weight, const PAINTS: usize, const WATCH: bool, const TURN: bool> pulp::NullaryFnOnce
    for Sums<'_, W, PAINTS, WATCH, TURN>
{
    type Output = (Farthest, Turned);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let [low, high] = self.out;
        debug_assert!(low.len() <= BLOCK && low.len() == high.len(), "a block");
        sum_block(self.weights, self.lower, self.upper, low, high);
        let farthest = if WATCH {
            Farthest::of(low).or(Farthest::of(high))
        } else {
            Farthest::default()
        };
        let turned = if TURN {
            Turned::put_back(low, high)
        } else {
            Turned::default()
        };
        (farthest, turned)
    }
}

/// Its two outputs are arguments, so that they are known to be apart from everything else and the loop becomes vectors.
#[inline(always)]
fn sum_block<const PAINTS: usize>(
    weights: &[impl Weight; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    low: &mut [f32],
    high: &mut [f32],
) {
    let count = low.len().min(BLOCK);
    let (low, high) = (&mut low[..count], &mut high[..count]);
    let (lower, upper) = (lower.map(|l| &l[..count]), upper.map(|u| &u[..count]));
    for k in 0..count {
        let mut l = weights[0].at(k) * lower[0][k];
        let mut h = weights[0].at(k) * upper[0][k];
        for m in 1..PAINTS {
            l += weights[m].at(k) * lower[m][k];
            h += weights[m].at(k) * upper[m][k];
        }
        (low[k], high[k]) = (l, h);
    }
}
