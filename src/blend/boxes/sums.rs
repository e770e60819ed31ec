//! The sums of a block: the loops that run at the speed of memory.
//!
//! A register of corners is summed, held against the bound and put in order before the next one: what stands in registers
//! costs memory nothing. The steps are the same for every width of registers, and so are the bits.

use pulp::Simd;

use super::Account;
use crate::paint::MAX_LAB;

/// Numbers that are summed in one go, a whole number of corners and of registers: so many that a block's own cost is
/// nothing, and so few that they are still at hand when they are gone through again.
pub(super) const BLOCK: usize = 6144;

/// Weights of a paint for L, a and b.
pub(super) type Weights = [f32; 3];

/// Most lanes of a register.
const MOST_LANES: usize = 16;

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

/// What [`sums`] does unwatched where a paint's weights are one for all axes, at the end of two lists: new memory need not
/// be cleared for it.
#[inline(never)]
pub(super) fn append_sums<const PAINTS: usize>(
    weights: &[f32; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    lists: &mut [Vec<f32>; 2],
) {
    for (list, corners) in lists.iter_mut().zip([lower, upper]) {
        let first = list.len();
        let pairs = corners[0].iter().zip(corners[1]);
        list.extend(pairs.map(|(own, other)| weights[0] * own + weights[1] * other));
        for (weight, corners) in weights.iter().zip(corners).skip(2) {
            for (sum, own) in list[first..].iter_mut().zip(corners) {
                *sum += weight * own;
            }
        }
    }
}

/// Both corners of a block of at most [`BLOCK`] numbers. If they may leave the range or turn inside out, they are to be
/// `WATCH`ed: then they are put in order and counted, and the answer is whether one is beyond ±[`MAX_LAB`].
pub(super) fn sums<const PAINTS: usize, const WATCH: bool>(
    weights: &[Weights; PAINTS],
    lower: [&[f32]; PAINTS],
    upper: [&[f32]; PAINTS],
    out: [&mut [f32]; 2],
    account: &mut Account,
) -> bool {
    let (farthest, turned) = pulp::Arch::new().dispatch(Sums::<PAINTS, WATCH> {
        weights,
        lower,
        upper,
        out,
    });
    account.turned(turned);
    is_beyond(farthest)
}

/// A block with all it needs, compiled once for every processor and once for those with wide registers.
struct Sums<'a, const PAINTS: usize, const WATCH: bool> {
    weights: &'a [Weights; PAINTS],
    lower: [&'a [f32]; PAINTS],
    upper: [&'a [f32]; PAINTS],
    out: [&'a mut [f32]; 2],
}

/// The weights of the registers of a block: whatever their width, they repeat after three.
#[inline(always)]
fn registers<S: Simd>(weights: Weights) -> [S::f32s; 3] {
    let lanes: [f32; 3 * MOST_LANES] = std::array::from_fn(|k| weights[k % 3]);
    let registers = S::as_simd_f32s(&lanes).0;
    [registers[0], registers[1], registers[2]]
}

impl<'a, const PAINTS: usize, const WATCH: bool> pulp::WithSimd for Sums<'a, PAINTS, WATCH> {
    type Output = (f32, Turned);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let [low, high] = self.out;
        let mut seen = Seen::nothing(simd);
        let (lows, low_rest) = S::as_mut_simd_f32s(low);
        let (highs, high_rest) = S::as_mut_simd_f32s(high);
        let count = lows.len().min(highs.len());
        let wholes = |own: &'a [f32]| &S::as_simd_f32s(own).0[..count];
        let (lower, upper) = (self.lower.map(wholes), self.upper.map(wholes));
        let weights = self.weights.map(registers::<S>);
        let whole = count / 3 * 3;
        for first in (0..whole).step_by(3) {
            for turn in 0..3 {
                let k = first + turn;
                let own = Corners { lower, upper, k };
                [lows[k], highs[k]] = own.sums::<S, WATCH>(simd, &weights, turn, &mut seen);
            }
        }
        for turn in 0..count - whole {
            let k = whole + turn;
            let own = Corners { lower, upper, k };
            [lows[k], highs[k]] = own.sums::<S, WATCH>(simd, &weights, turn, &mut seen);
        }
        if !low_rest.is_empty() {
            let rest = |own: &'a [f32]| simd.partial_load_f32s(S::as_simd_f32s(own).1);
            let (lower, upper) = (self.lower.map(rest), self.upper.map(rest));
            let own = Corners {
                lower: lower.each_ref().map(std::slice::from_ref),
                upper: upper.each_ref().map(std::slice::from_ref),
                k: 0,
            };
            let [low, high] = own.sums::<S, WATCH>(simd, &weights, count - whole, &mut seen);
            simd.partial_store_f32s(low_rest, low);
            simd.partial_store_f32s(high_rest, high);
        }
        seen.close()
    }
}

/// Register `k` of both corners of every paint.
struct Corners<'a, T, const PAINTS: usize> {
    lower: [&'a [T]; PAINTS],
    upper: [&'a [T]; PAINTS],
    k: usize,
}

impl<T: Copy, const PAINTS: usize> Corners<'_, T, PAINTS> {
    #[inline(always)]
    fn sums<S: Simd<f32s = T>, const WATCH: bool>(
        &self,
        simd: S,
        weights: &[[T; 3]; PAINTS],
        turn: usize,
        seen: &mut Seen<S>,
    ) -> [T; 2] {
        let mut sums = [simd.splat_f32s(0.0); 2];
        for m in 0..PAINTS {
            let own = [self.lower[m][self.k], self.upper[m][self.k]];
            for (sum, own) in sums.iter_mut().zip(own) {
                let own = simd.mul_f32s(weights[m][turn], own);
                // The first paint's stand alone: nothing and -0 would be 0.
                *sum = if m == 0 {
                    own
                } else {
                    simd.add_f32s(*sum, own)
                };
            }
        }
        if WATCH {
            sums = seen.watch(sums);
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTH: usize = 768;

    #[test]
    fn every_width_of_registers_gives_the_same_bits() {
        let corners = |seed: u32| -> Vec<f32> {
            let mut state = seed;
            let mut next = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f32::from_bits(0x3f80_0000 | state >> 9) * 300.0 - 450.0
            };
            (0..LENGTH).map(|_| next()).collect()
        };
        let paints: [Vec<f32>; 6] = std::array::from_fn(|k| corners(k as u32 + 1));
        let one = [1.3_f32, -0.7, 0.4].map(|w| [w; 3]);
        let three = [1.3_f32, -0.7, 0.4].map(|w| [w, w / 2.0, w / 3.0]);
        for count in [0, 3, 6, 9, 21, 765, LENGTH] {
            let at = |k: usize| &paints[k][..count];
            let (lower, upper) = ([at(0), at(1), at(2)], [at(3), at(4), at(5)]);
            same_on_both(&one, lower, upper);
            same_on_both(&three, lower, upper);
        }
    }

    fn bits(list: &[f32]) -> Vec<u32> {
        list.iter().map(|x| x.to_bits()).collect()
    }

    fn same_on_both(weights: &[Weights; 3], lower: [&[f32]; 3], upper: [&[f32]; 3]) {
        let sized = || vec![0.0_f32; lower[0].len()];
        let (mut low, mut high, mut narrow_low, mut narrow_high) =
            (sized(), sized(), sized(), sized());
        let (farthest, turned) = pulp::Arch::new().dispatch(Sums::<3, true> {
            weights,
            lower,
            upper,
            out: [&mut low, &mut high],
        });
        let (mut plain, mut other) = ([sized(), sized()], [sized(), sized()]);
        let unwatched = pulp::Arch::new().dispatch(Sums::<3, false> {
            weights,
            lower,
            upper,
            out: plain.each_mut().map(Vec::as_mut_slice),
        });
        let narrow = pulp::Scalar::new().vectorize(Sums::<3, false> {
            weights,
            lower,
            upper,
            out: other.each_mut().map(Vec::as_mut_slice),
        });
        assert_eq!((unwatched, unwatched.0), (narrow, 0.0));
        assert_eq!(plain.map(|list| bits(&list)), other.map(|list| bits(&list)));
        let narrow = pulp::Scalar::new().vectorize(Sums::<3, true> {
            weights,
            lower,
            upper,
            out: [&mut narrow_low, &mut narrow_high],
        });
        assert_eq!(narrow, (farthest, turned));
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
