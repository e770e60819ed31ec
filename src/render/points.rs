//! Sample points: Sobol' pairs, scrambled per dimension.
//!
//! The first two dimensions of Sobol's sequence are a (0,2)-sequence: every elementary interval of every power of two
//! gets its share. Owen scrambling by hashing (S. Laine and T. Karras 2011; B. Burley, "Practical Hash-based Owen
//! Scrambling", JCGT 2020) keeps that. Pixels take their runs of one sequence along a Z-order curve (A. Ahmed and
//! P. Wonka, "Screen-space blue-noise diffusion of Monte Carlo sampling error", 2020): neighbours complete each other,
//! so what error remains is fine-grained and vanishes to the eye. Further dimensions are padded with the same pairs,
//! their index order scrambled too.
//!
//! A pixel's points depend on its position, the seed and the index, never on threads or time.

use crate::paint::pcg;

/// The points of one pixel: a run of one sequence over the whole picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    first: u32,
    seed: u32,
}

impl Points {
    /// The `count` points of a pixel; `index` below stays below it.
    pub(super) fn of_pixel(x: u32, y: u32, count: u32, seed: u32) -> Self {
        let run = count.next_power_of_two();
        Self {
            first: (spread(x) | (spread(y) << 1)).wrapping_mul(run),
            seed: pcg(seed),
        }
    }

    /// Point `index` of the pair of dimensions `pair`, in `0..1` each.
    pub(super) fn pair(self, index: u32, pair: u32) -> [f32; 2] {
        self.one_of(0, 1, index, pair)
    }

    /// Draw `draw` of `draws` for point `index`; all draws of all points together are evenly spread.
    pub(super) fn one_of(self, draw: u32, draws: u32, index: u32, pair: u32) -> [f32; 2] {
        let seed = pcg(self.seed ^ pair.wrapping_mul(0x9e37_79b9));
        let index = self
            .first
            .wrapping_add(index)
            .wrapping_mul(draws)
            .wrapping_add(draw);
        let shuffled = scramble(index, seed);
        let x = shuffled.reverse_bits();
        let y = second_dimension(shuffled);
        [
            to_unit(scramble(x, seed ^ 0x5bd1_e995)),
            to_unit(scramble(y, seed ^ 0xb529_7a4d)),
        ]
    }
}

/// Puts a zero between the bits of a 16-bit number.
fn spread(x: u32) -> u32 {
    let mut x = x & 0xffff;
    x = (x | (x << 8)) & 0x00ff_00ff;
    x = (x | (x << 4)) & 0x0f0f_0f0f;
    x = (x | (x << 2)) & 0x3333_3333;
    (x | (x << 1)) & 0x5555_5555
}

/// Second Sobol' dimension: Pascal's triangle modulo 2 as generator matrix, a sum over supersets of the bits.
fn second_dimension(index: u32) -> u32 {
    let mut x = index;
    x ^= (x >> 1) & 0x5555_5555;
    x ^= (x >> 2) & 0x3333_3333;
    x ^= (x >> 4) & 0x0f0f_0f0f;
    x ^= (x >> 8) & 0x00ff_00ff;
    x ^= (x >> 16) & 0x0000_ffff;
    x.reverse_bits()
}

/// Owen scrambling: flips each bit by a hash of the bits above it.
fn scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

#[allow(clippy::cast_precision_loss)] // 24 bits are exact in an f32
fn to_unit(x: u32) -> f32 {
    (x >> 8) as f32 / 16_777_216.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss
    )]
    fn evenly_spread(points: &[[f32; 2]]) -> bool {
        let n = points.len();
        (0..=n.ilog2()).all(|k| {
            let (columns, rows) = (1 << k, n >> k);
            let mut count = vec![0; n];
            for [x, y] in points {
                count[(x * columns as f32) as usize * rows + (y * rows as f32) as usize] += 1;
            }
            count.iter().all(|&c| c == 1)
        })
    }

    #[test]
    fn every_elementary_interval_gets_one_point() {
        for x in 0..20 {
            let points: Vec<_> = (0..64)
                .map(|k| Points::of_pixel(x, 7, 64, 1).pair(k, 3))
                .collect();
            assert!(evenly_spread(&points), "pixel {x}");
        }
    }

    #[test]
    fn neighbouring_pixels_complete_each_other() {
        let block = (0..16).map(|k| (8 + k % 4, 4 + k / 4));
        let points: Vec<_> = block
            .flat_map(|(x, y)| (0..16).map(move |k| Points::of_pixel(x, y, 16, 9).pair(k, 1)))
            .collect();
        assert!(evenly_spread(&points));
    }

    #[test]
    fn pixels_and_dimensions_differ() {
        let here = Points::of_pixel(3, 4, 16, 0);
        assert_ne!(here.pair(5, 0), Points::of_pixel(4, 3, 16, 0).pair(5, 0));
        assert_ne!(here.pair(5, 0), here.pair(5, 1));
        assert_eq!(here.pair(5, 0), Points::of_pixel(3, 4, 16, 0).pair(5, 0));
    }
}
