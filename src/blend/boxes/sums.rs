//! The sums of a block: the loops that run at the speed of memory.

use super::Account;
use crate::paint::MAX_LAB;

/// Numbers of a block, a whole number of corners: the blocks of two paints and their weights stay in the nearest cache.
pub(super) const BLOCK: usize = 768;
/// Bits of a number without its sign, and those of the bound.
const MAGNITUDE: u32 = 0x7fff_ffff;
#[allow(clippy::cast_possible_truncation)] // exact
const BOUND: u32 = (MAX_LAB as f32).to_bits();

/// What [`sums`] does, at the end of two lists. Two paints are summed on their way, each further one on top of them.
#[inline(never)]
pub(super) fn append_sums<const PAINTS: usize, const WATCH: bool>(
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
pub(super) struct Seen {
    beyond: u32,
    pub(super) inverted: u32,
    pub(super) widest: i32,
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

/// Both corners of a block of at most [`BLOCK`] numbers, and what [`Seen::is_beyond`] says of them.
///
/// A function of its own: its two outputs are known to be apart from everything else, so that the loop becomes vectors.
#[inline(never)]
pub(super) fn sums<const PAINTS: usize, const WATCH: bool, const TURN: bool>(
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
