//! Sample points: Sobol' pairs, scrambled per pixel and per dimension.
//!
//! The first two dimensions of Sobol's sequence are a (0,2)-sequence: every elementary interval of every power of two
//! gets its share. Owen scrambling by hashing (S. Laine and T. Karras 2011; B. Burley, "Practical Hash-based Owen
//! Scrambling", JCGT 2020) keeps that and makes pixels independent of each other. Further dimensions are padded with
//! the same pairs, their index order scrambled too.
//!
//! A pixel's points depend on its position, the seed and the index, never on threads or time.

/// The points of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    seed: u32,
}

impl Points {
    pub(super) fn of_pixel(x: u32, y: u32, seed: u32) -> Self {
        Self { seed: hash(x ^ hash(y ^ hash(seed))) }
    }

    /// Point `index` of the pair of dimensions `pair`, in `0..1` each.
    pub(super) fn pair(self, index: u32, pair: u32) -> [f32; 2] {
        let seed = hash(self.seed ^ pair.wrapping_mul(0x9e37_79b9));
        let shuffled = scramble(index, seed);
        let x = shuffled.reverse_bits();
        let y = second_dimension(shuffled);
        [to_unit(scramble(x, seed ^ 0x5bd1_e995)), to_unit(scramble(y, seed ^ 0xb529_7a4d))]
    }
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

/// A finaliser of M. O'Neill's PCG family.
pub(super) const fn hash(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

#[allow(clippy::cast_precision_loss)] // 24 bits are exact in an f32
fn to_unit(x: u32) -> f32 {
    (x >> 8) as f32 / 16_777_216.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    fn every_elementary_interval_gets_one_point() {
        for pixel in 0..20 {
            let points = Points::of_pixel(pixel, 7, 1);
            for (columns, rows) in [(1, 64), (2, 32), (4, 16), (8, 8), (16, 4), (64, 1)] {
                let mut count = vec![0; 64];
                for index in 0..64 {
                    let [x, y] = points.pair(index, 3);
                    let cell = (x * columns as f32) as usize * rows + (y * rows as f32) as usize;
                    count[cell] += 1;
                }
                assert!(count.iter().all(|&c| c == 1), "{columns} x {rows}: {count:?}");
            }
        }
    }

    #[test]
    fn pixels_and_dimensions_differ() {
        let here = Points::of_pixel(3, 4, 0);
        assert_ne!(here.pair(5, 0), Points::of_pixel(4, 3, 0).pair(5, 0));
        assert_ne!(here.pair(5, 0), here.pair(5, 1));
        assert_eq!(here.pair(5, 0), Points::of_pixel(3, 4, 0).pair(5, 0));
    }
}
