//! The random texture: which texels of the paint belong to the same flake.
//!
//! Points are scattered over a tile as flakes are, four at random places in each bucket of a grid, and a texel carries
//! the 32-bit number of the point nearest to it: a Voronoi cell about a flake wide. Two texels show the same flake with
//! the probability that they share a cell, whatever the histogram, so the texels' autocorrelation is the paint's grain
//! ([`cell_spacing`]). Within a bucket the places are free, or the buckets' grid would beat with the texels'.
//!
//! Numbers are dealt so that a tile keeps the histogram it draws: in random order every cell is given the middle of a
//! piece of `0..2^32` as long as its area. The cells whose numbers lie in an interval then cover that share of the tile,
//! not a share that scatters like a dice count, and a tile's mean and sparkle are the slice's as nearly as its cells
//! can make them. That is the upper half of a number, its rank. The two bytes of the lower half say when the cell's flake
//! changes as the paint turns about either angle, spread evenly over the pairs of bytes by cells that follow one another.
//!
//! Places and order come from 32-bit integer hashing and the tile has no seam; a shader reads it from a texture.

use std::sync::OnceLock;

use super::flakes::FlakeTexture;
use super::sparkle::{RANK, pcg, unit};

/// A tile of cell numbers that repeats over the paint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RandomTexture {
    width: u32,
    height: u32,
    cells: Vec<u32>,
}

impl RandomTexture {
    /// Texels along a side of the tile that pictures and bundles share.
    pub const TILE: u32 = 256;

    /// How many tiles [`RandomTexture::of`] chooses from.
    pub const KINDS: usize = KINDS;

    /// The tile of these flakes: the one that pictures draw and bundles carry.
    ///
    /// A tile holds a whole number of buckets, so that paints of similar grain share one: each of the
    /// [`RandomTexture::KINDS`] is made when it is first asked for and kept, 256 KiB apiece.
    #[must_use]
    pub fn of(texture: &FlakeTexture) -> &'static Self {
        static TILES: [OnceLock<RandomTexture>; KINDS] = [const { OnceLock::new() }; KINDS];
        let kind = Self::kind(texture);
        TILES[kind].get_or_init(|| {
            let spacing = if kind == 0 {
                0.0
            } else {
                f64::from(Self::TILE) / (2.0 * kind as f64)
            };
            Self::new(Self::TILE, Self::TILE, spacing, 1)
        })
    }

    /// Which of the tiles these flakes get, below [`RandomTexture::KINDS`]: 0 for texels that are cells of their own,
    /// else the buckets along a side.
    #[must_use]
    pub fn kind(texture: &FlakeTexture) -> usize {
        let spacing = cell_spacing(texture.grain_um / texture.texel_um);
        if spacing.is_nan() || spacing < LEAST_SPACING {
            return 0;
        }
        (buckets_along(Self::TILE, spacing) as usize).min(KINDS - 1)
    }

    /// A tile of `width x height` texels whose cells are `spacing` texels apart (see [`cell_spacing`]).
    ///
    /// Sizes are at least 1; the same arguments give the same tile on every machine.
    #[must_use]
    pub fn new(width: u32, height: u32, spacing: f64, seed: u32) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        // Not a number is no spacing either.
        let mut cells = if spacing.is_nan() || spacing < LEAST_SPACING {
            (0..width.wrapping_mul(height)).collect()
        } else {
            nearest_points(width, height, spacing, seed)
        };
        deal_numbers(&mut cells, seed);
        Self {
            width,
            height,
            cells,
        }
    }

    /// Texels across.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Texels down.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// The numbers, row by row.
    #[must_use]
    pub fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// Number of a texel anywhere on the paint. Every repetition of the tile deals its ranks and phases from another
    /// beginning, so that each is as even as the tile and none looks like it.
    #[must_use]
    pub fn at(&self, x: i32, y: i32) -> u32 {
        let (w, h) = (self.width.cast_signed(), self.height.cast_signed());
        let (tile_x, tile_y) = (x.div_euclid(w), y.div_euclid(h));
        let inside = y.rem_euclid(h) * w + x.rem_euclid(w);
        let cell = self.cells[inside.cast_unsigned() as usize];
        if (tile_x, tile_y) == (0, 0) {
            return cell;
        }
        let turn = pcg(tile_x
            .cast_unsigned()
            .wrapping_add(pcg(tile_y.cast_unsigned())));
        // Each part goes round by itself.
        let part = |bits: u32| (cell & bits).wrapping_add(turn & bits) & bits;
        part(RANK) | part(0xff00) | part(0x00ff)
    }
}

/// Buckets along a side: one holds four cells, so it is two spacings wide.
fn buckets_along(size: u32, spacing: f64) -> u32 {
    (f64::from(size) / (2.0 * spacing))
        .round()
        .clamp(1.0, 4.0 * f64::from(size)) as u32
}

/// Buckets along a shared tile's side at [`LEAST_SPACING`], and the tile without buckets.
const KINDS: usize = 234;

/// Points in each bucket.
const PER_BUCKET: u32 = 4;

/// A scattered point: its place in texels and its index.
type Point = (f64, f64, u32);

/// The buckets of a tile, a whole number of them across and down.
struct Buckets {
    columns: u32,
    rows: u32,
    step: [f64; 2],
    seed: u32,
}

impl Buckets {
    fn new(width: u32, height: u32, spacing: f64, seed: u32) -> Self {
        let (columns, rows) = (
            buckets_along(width, spacing),
            buckets_along(height, spacing),
        );
        Self {
            columns,
            rows,
            step: [
                f64::from(width) / f64::from(columns),
                f64::from(height) / f64::from(rows),
            ],
            seed,
        }
    }

    /// Points of a row of buckets and of one bucket more at either end, in order of columns from -1.
    fn row(&self, row: i64) -> Vec<Point> {
        let columns = i64::from(self.columns);
        let mut points = Vec::with_capacity((self.columns as usize + 2) * PER_BUCKET as usize);
        for column in -1..=columns {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // below 2^30: at most 16 per texel
            let bucket = (row.rem_euclid(i64::from(self.rows)) * columns
                + column.rem_euclid(columns)) as u32;
            for k in 0..PER_BUCKET {
                let index = bucket.wrapping_mul(PER_BUCKET).wrapping_add(k);
                let hash = pcg(index ^ pcg(self.seed));
                #[allow(clippy::cast_precision_loss)] // small integers
                let place = |at: i64, salt: u32| at as f64 + f64::from(unit(pcg(hash ^ salt)));
                let (x, y) = (place(column, 0x68bc_21eb), place(row, 0x02e5_be93));
                points.push((x * self.step[0], y * self.step[1], index));
            }
        }
        points
    }
}

/// The index of the nearest point for every texel of a tile.
fn nearest_points(width: u32, height: u32, spacing: f64, seed: u32) -> Vec<u32> {
    let buckets = Buckets::new(width, height, spacing, seed);
    let mut rows: [(i64, Vec<Point>); 3] = std::array::from_fn(|_| (i64::MIN, Vec::new()));
    let mut indices = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height {
        let py = f64::from(y) + 0.5;
        #[allow(clippy::cast_possible_truncation)] // a bucket's index
        let row = (py / buckets.step[1]).floor() as i64;
        for near in row - 1..=row + 1 {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0, 1 or 2
            let slot = &mut rows[near.rem_euclid(3) as usize];
            if slot.0 != near {
                *slot = (near, buckets.row(near));
            }
        }
        for x in 0..width {
            let px = f64::from(x) + 0.5;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // a bucket's index, not negative
            let first = (px / buckets.step[0])
                .floor()
                .min(f64::from(buckets.columns - 1)) as usize
                * PER_BUCKET as usize;
            let (mut distance, mut index) = (f64::INFINITY, 0);
            for (_, points) in &rows {
                for &(qx, qy, candidate) in &points[first..first + 3 * PER_BUCKET as usize] {
                    let d = (qx - px) * (qx - px) + (qy - py) * (qy - py);
                    if d < distance {
                        (distance, index) = (d, candidate);
                    }
                }
            }
            indices.push(index);
        }
    }
    indices
}

/// Replaces the index of every texel's cell by the cell's number.
fn deal_numbers(cells: &mut [u32], seed: u32) {
    let points = cells.iter().max().map_or(0, |last| *last as usize + 1);
    let mut area = vec![0_u32; points];
    for &index in &*cells {
        area[index as usize] += 1;
    }
    let order = pcg(seed ^ 0xa511_e9b3);
    #[allow(clippy::cast_possible_truncation)] // indices are 32 bit
    let mut dealt: Vec<(u32, u32)> = (0..points as u32)
        .filter(|k| area[*k as usize] > 0)
        .map(|k| (pcg(k ^ order), k))
        .collect();
    dealt.sort_unstable();
    let (whole, mut before) = (cells.len() as u64, 0_u64);
    for (place, (_, index)) in (0_u32..).zip(dealt) {
        let own = u64::from(area[index as usize]);
        // The middle of before..before + own, of whole; an area of one texel is at least 2^32 / 2^26 long.
        #[allow(clippy::cast_possible_truncation)] // below 2^32, since the middle is below whole
        let number = (((2 * before + own) << 31) / whole) as u32;
        let phase = |step: u32| place.wrapping_mul(step) >> 24;
        area[index as usize] = number & RANK | phase(PLASTIC[1]) << 8 | phase(PLASTIC[0]);
        before += own;
    }
    for cell in cells {
        *cell = area[*cell as usize];
    }
}

/// 2^32 by the plastic number and by its square: their multiples spread any run of places evenly over the unit square
/// (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
const PLASTIC: [u32; 2] = [0xc13f_a9a9, 0x91e1_0da6];

/// Spacing of cells, in texels, whose autocorrelation falls to one half at `grain` texels.
///
/// Independent texels fall to one half at 0.5 texels (linear between lags 0 and 1); a grain below that is what
/// independent texels give. Found by measuring tiles of many spacings; a test measures them again.
#[must_use]
pub fn cell_spacing(grain: f64) -> f64 {
    let last = SPACING_OF_GRAIN.len() - 1;
    if grain >= SPACING_OF_GRAIN[last].0 {
        return grain * SPACING_OF_GRAIN[last].1 / SPACING_OF_GRAIN[last].0;
    }
    let above = SPACING_OF_GRAIN.partition_point(|&(g, _)| g <= grain);
    if above == 0 {
        return SPACING_OF_GRAIN[0].1;
    }
    let ((g0, s0), (g1, s1)) = (SPACING_OF_GRAIN[above - 1], SPACING_OF_GRAIN[above]);
    s0 + (s1 - s0) * (grain - g0) / (g1 - g0)
}

/// Spacing below which every texel is a cell of its own.
const LEAST_SPACING: f64 = 0.55;

/// (distance of half autocorrelation, spacing), both in texels: means of 12 tiles of 504 x 504, good to 0.001.
const SPACING_OF_GRAIN: [(f64, f64); 17] = [
    (0.5, 0.5),
    (0.5056, 0.7),
    (0.5159, 0.8),
    (0.5323, 0.9),
    (0.5516, 1.0),
    (0.5934, 1.15),
    (0.6384, 1.3),
    (0.7042, 1.5),
    (0.7922, 1.75),
    (0.8828, 2.0),
    (1.0942, 2.5),
    (1.3290, 3.0),
    (1.7469, 4.0),
    (2.6091, 6.0),
    (3.4147, 8.0),
    (5.1919, 12.0),
    (6.8104, 16.0),
];

#[cfg(test)]
mod tests;
