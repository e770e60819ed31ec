//! The sums of a block: the loops that run at the speed of memory.
//!
//! A register of corners is summed, held against the bound and put in order before the next one: what stands in registers
//! costs memory nothing. The steps are the same for every width of registers, and so are the bits.

use pulp::Simd;

use super::Account;
use crate::paint::MAX_LAB;

/// Numbers of a pattern of weights, a whole number of corners and of registers: the patterns of all paints stay in the
/// nearest cache.
pub(super) const PATTERN: usize = 768;

/// Whether a magnitude is beyond ±[`MAX_LAB`].
fn is_beyond(farthest: f32) -> bool {
    f64::from(farthest) > MAX_LAB
}

/// Boxes that were inside out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Turned {
    pub count: usize,
    /// The largest of all differences of a lower and an upper corner, 0 if there is none above.
    pub widest: f32,
}

/// What was seen of the corners that went by, lane by lane.
struct Seen<S: Simd> {
    simd: S,
    farthest: S::f32s,
    /// Whole numbers, of which a block has too few for rounding.
    turned: S::f32s,
    widest: S::f32s,
}

impl<S: Simd> Seen<S> {
    #[inline(always)]
    fn nothing(simd: S) -> Self {
        let none = simd.splat_f32s(0.0);
        Self {
            simd,
            farthest: none,
            turned: none,
            widest: none,
        }
    }

    /// Looks at lower and upper corners, and puts them in order.
    #[inline(always)]
    fn watch(&mut self, [low, high]: [S::f32s; 2]) -> [S::f32s; 2] {
        let simd = self.simd;
        let farthest = simd.max_f32s(simd.abs_f32s(low), simd.abs_f32s(high));
        self.farthest = simd.max_f32s(self.farthest, farthest);
        let turned = simd.less_than_f32s(high, low);
        let none = simd.splat_f32s(0.0);
        let count = simd.select_f32s(turned, simd.splat_f32s(1.0), none);
        self.turned = simd.add_f32s(self.turned, count);
        let difference = simd.select_f32s(turned, simd.sub_f32s(low, high), none);
        self.widest = simd.max_f32s(self.widest, difference);
        [
            simd.select_f32s(turned, high, low),
            simd.select_f32s(turned, low, high),
        ]
    }

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a block
    fn close(self) -> (f32, Turned) {
        let simd = self.simd;
        let turned = Turned {
            count: simd.reduce_sum_f32s(self.turned) as usize,
            widest: simd.reduce_max_f32s(self.widest),
        };
        (simd.reduce_max_f32s(self.farthest), turned)
    }
}

/// One weight for all three axes, or weights that repeat along a block.
pub(super) trait Weight {
    /// Numbers that are summed in one go, a whole number of corners and of registers.
    const BLOCK: usize;

    /// The weight of number `k` of a block.
    fn at(&self, k: usize) -> f32;

    /// The weights of register `k` of a block.
    fn register<S: Simd>(&self, simd: S, k: usize) -> S::f32s;
}

impl Weight for f32 {
    /// So many that a block's own cost is nothing, and so few that they are still at hand when they are gone through again.
    const BLOCK: usize = 8 * PATTERN;

    #[inline(always)]
    fn at(&self, _: usize) -> f32 {
        *self
    }

    #[inline(always)]
    fn register<S: Simd>(&self, simd: S, _: usize) -> S::f32s {
        simd.splat_f32s(*self)
    }
}

impl Weight for [f32; PATTERN] {
    const BLOCK: usize = PATTERN;

    #[inline(always)]
    fn at(&self, k: usize) -> f32 {
        self[k]
    }

    #[inline(always)]
    fn register<S: Simd>(&self, _: S, k: usize) -> S::f32s {
        S::as_simd_f32s(self).0[k]
    }
}

/// What [`sums`] does unwatched, at the end of two lists: new memory need not be cleared for it.
#[inline(never)]
pub(super) fn append_sums<const PAINTS: usize>(
    weights: &[impl Weight; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    lists: &mut [Vec<f32>; 2],
) {
    for (list, corners) in lists.iter_mut().zip([lower, upper]) {
        let first = list.len();
        let pairs = corners[0].iter().zip(corners[1]).enumerate();
        let sums = pairs.map(|(k, (own, other))| weights[0].at(k) * own + weights[1].at(k) * other);
        list.extend(sums);
        for (weight, corners) in weights.iter().zip(corners).skip(2) {
            for (k, (sum, own)) in list[first..].iter_mut().zip(corners).enumerate() {
                *sum += weight.at(k) * own;
            }
        }
    }
}

/// Both corners of a block of at most [`Weight::BLOCK`] numbers. If they may leave the range or turn inside out, they are to be
/// `WATCH`ed: then they are put in order and counted, and the answer is whether one is beyond ±[`MAX_LAB`].
pub(super) fn sums<const PAINTS: usize, const WATCH: bool>(
    weights: &[impl Weight; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    out: [&mut [f32]; 2],
    account: &mut Account,
) -> bool {
    let (farthest, turned) = pulp::Arch::new().dispatch(Sums::<_, PAINTS, WATCH> {
        weights,
        lower,
        upper,
        out,
    });
    account.turned(turned);
    is_beyond(farthest)
}

/// A block with all it needs, compiled once for every processor and once for those with wide registers.
struct Sums<'a, W, const PAINTS: usize, const WATCH: bool> {
    weights: &'a [W; PAINTS],
    lower: [&'a [f32]; PAINTS],
    upper: [&'a [f32]; PAINTS],
    out: [&'a mut [f32]; 2],
}

impl<'a, W: Weight, const PAINTS: usize, const WATCH: bool> pulp::WithSimd
    for Sums<'a, W, PAINTS, WATCH>
{
    type Output = (f32, Turned);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let [low, high] = self.out;
        let mut seen = Seen::nothing(simd);
        let (lows, low_rest) = S::as_mut_simd_f32s(low);
        let (highs, high_rest) = S::as_mut_simd_f32s(high);
        let count = lows.len().min(highs.len());
        let registers = |own: &'a [f32]| &S::as_simd_f32s(own).0[..count];
        let (lower, upper) = (self.lower.map(registers), self.upper.map(registers));
        for k in 0..count {
            let mut sums = [simd.splat_f32s(0.0); 2];
            for m in 0..PAINTS {
                let weight = self.weights[m].register(simd, k);
                sums = add(simd, m, sums, weight, [lower[m][k], upper[m][k]]);
            }
            if WATCH {
                sums = seen.watch(sums);
            }
            [lows[k], highs[k]] = sums;
        }
        if !low_rest.is_empty() {
            let mut sums = [simd.splat_f32s(0.0); 2];
            for m in 0..PAINTS {
                let weight = self.weights[m].register(simd, count);
                let low = simd.partial_load_f32s(S::as_simd_f32s(self.lower[m]).1);
                let high = simd.partial_load_f32s(S::as_simd_f32s(self.upper[m]).1);
                sums = add(simd, m, sums, weight, [low, high]);
            }
            if WATCH {
                sums = seen.watch(sums);
            }
            simd.partial_store_f32s(low_rest, sums[0]);
            simd.partial_store_f32s(high_rest, sums[1]);
        }
        seen.close()
    }
}

/// The sums with another paint's corners; the first paint's stand alone.
#[inline(always)]
fn add<S: Simd>(
    simd: S,
    paint: usize,
    [low, high]: [S::f32s; 2],
    weight: S::f32s,
    corners: [S::f32s; 2],
) -> [S::f32s; 2] {
    let own_low = simd.mul_f32s(weight, corners[0]);
    let own_high = simd.mul_f32s(weight, corners[1]);
    if paint == 0 {
        return [own_low, own_high];
    }
    [simd.add_f32s(low, own_low), simd.add_f32s(high, own_high)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_width_of_registers_gives_the_same_bits() {
        let corners = |seed: u32| -> Vec<f32> {
            let mut state = seed;
            let mut next = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f32::from_bits(0x3f80_0000 | state >> 9) * 300.0 - 450.0
            };
            (0..PATTERN).map(|_| next()).collect()
        };
        let paints: [Vec<f32>; 6] = std::array::from_fn(|k| corners(k as u32 + 1));
        let one = [1.3_f32, -0.7, 0.4];
        let pattern =
            one.map(|w| std::array::from_fn::<f32, PATTERN, _>(|k| w / (1 + k % 3) as f32));
        for count in [0, 3, 6, 9, 21, 765, PATTERN] {
            let at = |k: usize| &paints[k][..count];
            let (lower, upper) = ([at(0), at(1), at(2)], [at(3), at(4), at(5)]);
            same_on_both(&one, lower, upper);
            same_on_both(&pattern, lower, upper);
        }
    }

    fn same_on_both(weights: &[impl Weight; 3], lower: [&[f32]; 3], upper: [&[f32]; 3]) {
        let sized = || vec![0.0_f32; lower[0].len()];
        let (mut low, mut high, mut narrow_low, mut narrow_high) =
            (sized(), sized(), sized(), sized());
        let (farthest, turned) = pulp::Arch::new().dispatch(Sums::<_, 3, true> {
            weights,
            lower,
            upper,
            out: [&mut low, &mut high],
        });
        let narrow = pulp::Scalar::new().vectorize(Sums::<_, 3, true> {
            weights,
            lower,
            upper,
            out: [&mut narrow_low, &mut narrow_high],
        });
        assert_eq!(narrow, (farthest, turned));
        let bits = |list: &[f32]| list.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&low), bits(&narrow_low));
        assert_eq!(bits(&high), bits(&narrow_high));
        assert!(low.iter().zip(&high).all(|(low, high)| low <= high));
        let halves = low.len() / 4;
        assert!(
            turned.count >= halves && turned.count <= 3 * halves.max(3),
            "{turned:?}"
        );
    }
}
