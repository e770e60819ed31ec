//! Which flake a texel of the paint shows.
//!
//! A texel carries the number of its cell ([`RandomTexture`](super::RandomTexture)), and with each angle there are two
//! *epochs*, `floor(θ/persistence + phase)` with a phase per cell: the probability that a cell still shows the same flake
//! after `Δθ` is `1 − Δθ/persistence`, which gives the lifetime. Cell and epochs give the number that picks a cluster by
//! cumulative probability, and three more by hashing that place the color in its box.
//!
//! The pick is not a hash but `rank k + (h + d) c` modulo one, where the rank is the upper half of the cell's number and
//! `k` is 1, 5, 7 or 11 by turns: cells whose ranks cover `0..1` evenly then do so in every epoch, and a tile keeps the
//! histogram of its slice at every angle. A factor `k` scatters a share like √k cells, so that it has to stay small; two
//! epochs of other factors `k`, `l` correlate by `1/(k l)` at most, for a flake that went dark says nothing of its
//! successor. The phases are the bytes of the lower half, evenly spread over cells of neighbouring ranks in both
//! dimensions, or each epoch would show a random part of the cells and the evenness were gone.
//!
//! All of it is 32-bit integer arithmetic, so that a shader draws the very same flakes. The mixing step is
//! PCG-RXS-M-XS (M. O'Neill, 2014). Hash by the texel on the paint, never by the pixel or the frame.

use super::angle::QuickGrid;
use super::flakes::{FlakeTexture, Flakes};
use crate::color::{D65_2, expand_f32, xyz_to_rgb};

/// One step of the permuted congruential generator: every bit of the answer depends on every bit of `x`.
#[must_use]
pub(crate) const fn pcg(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// A number strictly between 0 and 1 from the upper 23 bits; with one bit more, the half that is added would be rounded
/// and the greatest of them be 1.
#[must_use]
pub(crate) fn unit(x: u32) -> f32 {
    #[allow(clippy::cast_precision_loss)] // 23 bits and a half are exact in an f32
    let top = (x >> 9) as f32;
    (top + 0.5) / 8_388_608.0
}

/// The random numbers of one cell at one angle pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelDraw {
    /// Picks the cluster by cumulative probability.
    pub pick: f32,
    /// Place in the box, per axis L, a, b.
    pub place: [f32; 3],
}

/// The bits of a cell's number that are its rank among the cells.
pub(super) const RANK: u32 = 0xffff_0000;

/// Odd, so that they permute the ranks, and without a common factor.
const EPOCH_FACTORS: [u32; 4] = [1, 5, 7, 11];

/// 2^32 (3 − √3)/6: by itself it takes all correlation from a step.
const EPOCH_TURN: u32 = 0x3619_62ea;

impl TexelDraw {
    /// Numbers of a cell while the angles, in degrees, stay within its epochs.
    #[must_use]
    #[inline]
    pub fn of(cell: u32, theta_h_deg: f32, theta_d_deg: f32, persistence_deg: [f32; 2]) -> Self {
        let epoch = |theta: f32, persistence: f32, phase: f32| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most 90 / 0.01
            let whole = (theta / persistence.max(0.01) + phase).max(0.0) as u32;
            whole
        };
        #[allow(clippy::cast_precision_loss)] // eight bits
        let phase = |byte: u32| ((byte & 0xff) as f32 + 0.5) / 256.0;
        let h = epoch(theta_h_deg, persistence_deg[0], phase(cell));
        let d = epoch(theta_d_deg, persistence_deg[1], phase(cell >> 8));
        let key = pcg(cell ^ pcg(h ^ pcg(d ^ 0xc2b2_ae35)));
        let factor = EPOCH_FACTORS[(h.wrapping_add(d.wrapping_mul(2)) & 3) as usize];
        // What follows the rank's 16 bits is as good as random.
        let turned = (cell & RANK)
            .wrapping_mul(factor)
            .wrapping_add(h.wrapping_add(d).wrapping_mul(EPOCH_TURN))
            .wrapping_add(key >> 16);
        Self {
            pick: unit(turned),
            place: [
                unit(pcg(key ^ 0x2545_f491)),
                unit(pcg(key ^ 0x51ed_270b)),
                unit(pcg(key ^ 0x7feb_352d)),
            ],
        }
    }
}

/// Flakes prepared for drawing: cumulative probabilities, boxes along the axes of the cube roots, angles to look up.
#[derive(Clone, Debug)]
pub struct FlakeSampler<'a> {
    flakes: &'a Flakes,
    theta_h: QuickGrid,
    theta_d: QuickGrid,
    persistence: [f32; 2],
    cumulative: Vec<f32>,
    /// For every slice and part of the unit interval the cluster to start looking from.
    guide: Vec<u16>,
    boxes: Vec<RootBox>,
    /// Closed-form mean of every slice.
    means: Vec<[f32; 3]>,
    /// Linear sRGB in 1/sr of the three expanded roots.
    to_rgb: [[f32; 3]; 3],
}

/// A box in `fy`, `a/500`, `b/200`: the smallest corner, and the way to the largest.
#[derive(Clone, Copy, Debug)]
struct RootBox {
    lower: [f32; 3],
    extent: [f32; 3],
}

/// Parts of the unit interval in the guide to the clusters of a slice.
const GUIDED: u16 = 64;

/// Cumulative probabilities of all clusters, slice by slice, as draws compare them.
#[must_use]
#[allow(clippy::cast_possible_truncation)] // texel precision is f32
pub fn cumulative(flakes: &Flakes) -> Vec<f32> {
    let mut out = Vec::with_capacity(flakes.clusters());
    for k in 0..flakes.slices() {
        let mut sum = 0.0;
        out.extend(flakes.slice_at(k).probability.iter().map(|p| {
            sum += p;
            sum as f32
        }));
    }
    out
}

impl<'a> FlakeSampler<'a> {
    /// Prepares flakes: one pass over the clusters.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // texel precision is f32
    pub fn new(flakes: &'a Flakes) -> Self {
        let cumulative = cumulative(flakes);
        let mut guide = Vec::with_capacity(flakes.slices() * usize::from(GUIDED));
        for ends in flakes.offsets.windows(2) {
            let slice = &cumulative[ends[0] as usize..ends[1] as usize];
            let part = |j: u16| f32::from(j) / f32::from(GUIDED);
            guide.extend((0..GUIDED).map(|j| {
                slice
                    .partition_point(|&c| c <= part(j))
                    .min(slice.len() - 1)
                    .min(usize::from(u16::MAX)) as u16
            }));
        }
        let root = |lab: &[f32; 3]| [(lab[0] + 16.0) / 116.0, lab[1] / 500.0, lab[2] / 200.0];
        let boxes = flakes
            .lower
            .iter()
            .zip(&flakes.upper)
            .map(|(lower, upper)| {
                let (lower, upper) = (root(lower), root(upper));
                RootBox {
                    lower,
                    extent: std::array::from_fn(|k| upper[k] - lower[k]),
                }
            });
        let column = |xyz: [f64; 3]| xyz_to_rgb(xyz).map(|v| (v / std::f64::consts::PI) as f32);
        Self {
            flakes,
            theta_h: QuickGrid::new(&flakes.theta_h),
            theta_d: QuickGrid::new(&flakes.theta_d),
            persistence: flakes.texture.persistence_deg.map(|p| p as f32),
            cumulative,
            guide,
            boxes: boxes.collect(),
            means: (0..flakes.slices())
                .map(|k| flakes.slice_at(k).mean().map(|v| v as f32))
                .collect(),
            to_rgb: [
                column([D65_2.x, 0.0, 0.0]),
                column([0.0, D65_2.y, 0.0]),
                column([0.0, 0.0, D65_2.z]),
            ],
        }
    }

    /// Size and persistence of these flakes.
    #[must_use]
    pub const fn texture(&self) -> &FlakeTexture {
        &self.flakes.texture
    }

    /// Flake reflectance of a cell in 1/sr at an angle pair in degrees, bilinear between slices, not clamped.
    #[must_use]
    pub fn color(&self, cell: u32, theta_h_deg: f32, theta_d_deg: f32) -> [f32; 3] {
        self.color_and_mean(cell, theta_h_deg, theta_d_deg).0
    }

    /// [`FlakeSampler::color`], and the mean over all cells at the same angles.
    #[must_use]
    pub fn color_and_mean(
        &self,
        cell: u32,
        theta_h_deg: f32,
        theta_d_deg: f32,
    ) -> ([f32; 3], [f32; 3]) {
        let draw = TexelDraw::of(cell, theta_h_deg, theta_d_deg, self.persistence);
        let (row, column) = (
            self.theta_h.bracket(theta_h_deg),
            self.theta_d.bracket(theta_d_deg),
        );
        let columns = self.flakes.theta_d.len();
        let (mut sum, mut mean) = ([0.0; 3], [0.0; 3]);
        for (h, wh) in [(row.low, 1.0 - row.fraction), (row.high, row.fraction)] {
            for (d, wd) in [
                (column.low, 1.0 - column.fraction),
                (column.high, column.fraction),
            ] {
                if wh * wd > 0.0 {
                    let slice = h * columns + d;
                    let drawn = self.draw(slice, draw);
                    for k in 0..3 {
                        sum[k] += wh * wd * drawn[k];
                        mean[k] += wh * wd * self.means[slice][k];
                    }
                }
            }
        }
        let rgb = |k| {
            sum[0] * self.to_rgb[0][k] + sum[1] * self.to_rgb[1][k] + sum[2] * self.to_rgb[2][k]
        };
        (std::array::from_fn(rgb), mean)
    }

    /// Mean flake reflectance in 1/sr at an angle pair in degrees, as `Reflectance` has it.
    #[must_use]
    pub fn mean(&self, theta_h_deg: f32, theta_d_deg: f32) -> [f32; 3] {
        let (row, column) = (
            self.theta_h.bracket(theta_h_deg),
            self.theta_d.bracket(theta_d_deg),
        );
        let columns = self.flakes.theta_d.len();
        let at = |h: usize, d: usize| self.means[h * columns + d];
        let corners = [
            at(row.low, column.low),
            at(row.low, column.high),
            at(row.high, column.low),
            at(row.high, column.high),
        ];
        let (u, v) = (row.fraction, column.fraction);
        let weights = [(1.0 - u) * (1.0 - v), (1.0 - u) * v, u * (1.0 - v), u * v];
        std::array::from_fn(|k| {
            corners[0][k] * weights[0]
                + corners[1][k] * weights[1]
                + corners[2][k] * weights[2]
                + corners[3][k] * weights[3]
        })
    }

    /// XYZ over white of one draw from slice `k`.
    fn draw(&self, k: usize, draw: TexelDraw) -> [f32; 3] {
        let (first, end) = (
            self.flakes.offsets[k] as usize,
            self.flakes.offsets[k + 1] as usize,
        );
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // below GUIDED, for pick is below 1
        let part = (draw.pick * f32::from(GUIDED)) as usize;
        let mut cluster = first + self.guide[k * usize::from(GUIDED) + part] as usize;
        while cluster + 1 < end && self.cumulative[cluster] <= draw.pick {
            cluster += 1;
        }
        let RootBox { lower, extent } = self.boxes[cluster];
        let [y, u, v]: [f32; 3] =
            std::array::from_fn(|axis| lower[axis] + extent[axis] * draw.place[axis]);
        [expand_f32(y + u), expand_f32(y), expand_f32(y - v)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{AngleGrid, FlakeTexture};

    #[test]
    fn no_number_is_zero_or_one() {
        assert!(unit(0) > 0.0 && unit(u32::MAX) < 1.0);
        // Neighbours differ up to the very end.
        assert!(unit(u32::MAX) > unit(u32::MAX - (1 << 9)));
    }

    #[test]
    fn the_greatest_number_draws_the_last_cluster_of_the_last_slice() {
        let flakes = Flakes {
            theta_h: AngleGrid::single(),
            theta_d: AngleGrid::single(),
            offsets: vec![0, 2].into(),
            lower: vec![[10.0; 3], [90.0, 0.0, 0.0]],
            upper: vec![[10.0; 3], [90.0, 0.0, 0.0]],
            probability: vec![0.5, 0.5].into(),
            texture: FlakeTexture {
                texel_um: 20.0,
                grain_um: 20.0,
                lifetime_deg: [5.0; 2],
                persistence_deg: [90.0; 2],
            },
        };
        let sampler = FlakeSampler::new(&flakes);
        let last = TexelDraw {
            pick: unit(u32::MAX),
            place: [unit(u32::MAX); 3],
        };
        // Epoch 0 of both angles turns nothing: the greatest rank has the greatest number, but for its lower half.
        let greatest = TexelDraw::of(RANK, 0.0, 0.0, [90.0; 2]).pick;
        assert!(greatest <= last.pick && greatest >= unit(RANK));
        let [_, y, _] = sampler.draw(0, last);
        assert_eq!(y, expand_f32((90.0 + 16.0) / 116.0));
    }
}
