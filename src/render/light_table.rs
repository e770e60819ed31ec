//! Where the light comes from: directions drawn in proportion to the radiance of an environment.
//!
//! A latitude-longitude grid holds mean luminance. A surface that faces one of 26 ways (the faces, edges and corners of
//! a cube) draws from a density in proportion to luminance times its cosine there, so that hardly a direction is wasted
//! behind it. A fixed set of low-discrepancy directions is drawn for each facing once per scene, and pixels pick from
//! it; as a whole a set carries exactly the light of the grid. A small uniform share keeps the density above zero, so
//! no direction outshines the rest by much.

use std::f32::consts::{PI, TAU};

use rayon::prelude::*;

use super::environment::{Environment, Map, Source, luminance};
use super::vector::{Vec3, dot, scale, unit};

/// One drawn direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightSample {
    pub(super) direction: Vec3,
    /// Density in 1/sr.
    pub(super) density: f32,
    /// Radiance over density.
    pub(super) light: Vec3,
}

/// An environment prepared for sampling.
#[derive(Clone, Debug)]
pub(super) struct LightTable {
    grid: Grid,
    facings: Vec<Facing>,
}

/// Mean luminance by direction.
#[derive(Clone, Debug)]
struct Grid {
    width: usize,
    height: usize,
    /// With the floor.
    luminance: Vec<f32>,
    floor: f32,
}

/// Lights as a surface sees them.
#[derive(Clone, Debug)]
struct Facing {
    normal: Vec3,
    /// Density over (luminance + floor) times weight.
    scale: f32,
    samples: Vec<LightSample>,
}

/// Drawn directions a side: 64 x 64 strata, as many as stay in a core's cache.
const STRATA: u16 = 64;

/// Share of the mean luminance added everywhere.
const FLOOR: f32 = 0.03;

/// Cells across, at most; twice as many as cells down.
const WIDEST: usize = 1024;

/// Cosine of a facing, widened to what surfaces that are a little turned see.
fn weight(cosine: f32) -> f32 {
    if cosine > -0.5 { cosine.max(0.0) + 0.1 } else { 0.0 }
}

/// Number of the facing nearest a normal, and all facings in that order.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0, 1 or 2
fn facing_of(normal: Vec3) -> usize {
    // Directions nearer a cube's face than its edge have their smaller components below 0.414 of the largest.
    let largest = normal.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    let digit = |v: f32| usize::from(v > -0.414 * largest) + usize::from(v > 0.414 * largest);
    digit(normal[0]) * 9 + digit(normal[1]) * 3 + digit(normal[2])
}

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
impl LightTable {
    /// Prepares an environment; `None` for one without light.
    pub(super) fn new(environment: &Environment) -> Option<Self> {
        let mut grid = Grid::new(environment);
        let mean: f64 = (0..grid.luminance.len()).map(|k| f64::from(grid.luminance[k]) * grid.share(k)).sum();
        if mean <= 0.0 {
            return None;
        }
        grid.floor = FLOOR * mean as f32;
        for cell in &mut grid.luminance {
            *cell += grid.floor;
        }
        let directions: Vec<Vec3> = (0..grid.luminance.len()).map(|k| grid.center(k)).collect();
        let normal = |k: usize| [k / 9, k / 3 % 3, k % 3].map(|digit| digit as f32 - 1.0);
        let facings = (0..27_usize).into_par_iter().map(|k| Facing::new(unit(normal(k)), &grid, &directions, environment));
        Some(Self { facings: facings.collect(), grid })
    }

    /// The directions for surfaces with this normal.
    pub(super) fn facing(&self, normal: Vec3) -> usize {
        facing_of(normal)
    }

    /// The drawn direction of a sample point.
    pub(super) fn sample(&self, facing: usize, [u, v]: [f32; 2]) -> &LightSample {
        let stratum = |x: f32| ((x * f32::from(STRATA)) as usize).min(usize::from(STRATA) - 1);
        &self.facings[facing].samples[stratum(v) * usize::from(STRATA) + stratum(u)]
    }

    /// Density of drawing a unit direction, 1/sr.
    pub(super) fn density(&self, facing: usize, d: Vec3) -> f32 {
        let u = (d[0].atan2(-d[2]) / TAU).rem_euclid(1.0);
        let v = d[1].clamp(-1.0, 1.0).acos() / PI;
        let column = ((u * self.grid.width as f32) as usize).min(self.grid.width - 1);
        let row = ((v * self.grid.height as f32) as usize).min(self.grid.height - 1);
        let k = row * self.grid.width + column;
        let facing = &self.facings[facing];
        self.grid.luminance[k] * weight(dot(self.grid.center(k), facing.normal)) * facing.scale
    }
}

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
impl Facing {
    fn new(normal: Vec3, grid: &Grid, directions: &[Vec3], environment: &Environment) -> Self {
        let power: Vec<f64> = directions
            .iter()
            .enumerate()
            .map(|(k, d)| f64::from(grid.luminance[k] * weight(dot(*d, normal))) * grid.share(k))
            .collect();
        let columns: Vec<Search> = power.chunks(grid.width).map(Search::new).collect();
        let rows = Search::new(&columns.iter().map(Search::total).collect::<Vec<_>>());
        let sphere = 4.0 * std::f64::consts::PI;
        let scale_of = (1.0 / (rows.total() * sphere)) as f32;
        let side = f64::from(STRATA);
        let mut samples = Vec::with_capacity(usize::from(STRATA) * usize::from(STRATA));
        let mut drawn = 0.0;
        for j in 0..STRATA {
            for i in 0..STRATA {
                // A rank-1 lattice inside the strata: rows do not line up.
                let k = f64::from(j) * side + f64::from(i);
                let v = (f64::from(j) + (k * 0.754_877_666_246_693).fract()) / side;
                let u = (f64::from(i) + (k * 0.569_840_290_998_053).fract()) / side;
                let (row, down) = rows.find(v);
                let (column, across) = columns[row].find(u);
                let cell = row * grid.width + column;
                let direction = grid.place(row, column, across, down);
                let radiance = environment.radiance(direction);
                let seen = weight(dot(directions[cell], normal));
                let density = grid.luminance[cell] * seen * scale_of;
                drawn += f64::from(luminance(radiance) * seen / density);
                samples.push(LightSample { direction, density, light: scale(radiance, 1.0 / density) });
            }
        }
        // The set as a whole carries the light of the grid: what few directions miss between them is shared out.
        let floor: f64 = directions
            .iter()
            .enumerate()
            .map(|(k, d)| f64::from(grid.floor * weight(dot(*d, normal))) * grid.share(k))
            .sum();
        let light = (rows.total() - floor) * sphere;
        let correction = (light * samples.len() as f64 / drawn) as f32;
        for sample in samples.iter_mut().filter(|_| correction.is_finite()) {
            sample.light = scale(sample.light, correction);
        }
        Self { normal, scale: scale_of, samples }
    }
}

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
impl Grid {
    fn new(environment: &Environment) -> Self {
        let (width, height, luminance) = match environment.source() {
            Source::Uniform(radiance) => (64, 32, vec![luminance(*radiance); 64 * 32]),
            Source::Map(map) => map_cells(map),
            Source::Studio(studio) => {
                let (width, height, fine) = (256, 128, 3);
                let mut mean = vec![0.0; width * height];
                for (k, cell) in mean.iter_mut().enumerate() {
                    for s in 0..fine * fine {
                        let x = (k % width) as f32 + ((s % fine) as f32 + 0.5) / fine as f32;
                        let y = (k / width) as f32 + ((s / fine) as f32 + 0.5) / fine as f32;
                        let direction = Map::direction(x / width as f32, y / height as f32);
                        *cell += luminance(studio.radiance(direction)) / (fine * fine) as f32;
                    }
                }
                (width, height, mean)
            }
        };
        Self { width, height, luminance, floor: 0.0 }
    }

    /// Height on the unit sphere of the upper edge of a row.
    fn edge(&self, row: usize) -> f64 {
        (std::f64::consts::PI * row as f64 / self.height as f64).cos()
    }

    /// Share of the sphere that a cell covers.
    fn share(&self, cell: usize) -> f64 {
        let row = cell / self.width;
        (self.edge(row) - self.edge(row + 1)) / 2.0 / self.width as f64
    }

    fn center(&self, cell: usize) -> Vec3 {
        Map::direction(
            ((cell % self.width) as f32 + 0.5) / self.width as f32,
            ((cell / self.width) as f32 + 0.5) / self.height as f32,
        )
    }

    /// Direction at a place in a cell, even in solid angle.
    fn place(&self, row: usize, column: usize, across: f64, down: f64) -> Vec3 {
        let y = self.edge(row) + (self.edge(row + 1) - self.edge(row)) * down;
        let turn = (column as f64 + across) / self.width as f64 * std::f64::consts::TAU;
        let r = (1.0 - y * y).max(0.0).sqrt();
        [(r * turn.sin()) as f32, y as f32, (-r * turn.cos()) as f32]
    }
}

/// Cells of whole pixels; each pixel's light is spread as bilinear reading spreads it.
#[allow(clippy::cast_precision_loss)]
fn map_cells(map: &Map) -> (usize, usize, Vec<f32>) {
    let (across, down) = (map.width.div_ceil(WIDEST), map.height.div_ceil(WIDEST / 2));
    let (width, height) = (map.width.div_ceil(across), map.height.div_ceil(down));
    let light: Vec<f32> = map.pixels.iter().map(|p| luminance(*p)).collect();
    let at = |x: usize, y: usize| light[y * map.width + x];
    let mut mean = vec![0.0; width * height];
    let mut count = vec![0.0_f32; width * height];
    for y in 0..map.height {
        let rows = [(y.saturating_sub(1), 1.0), (y, 6.0), ((y + 1).min(map.height - 1), 1.0)];
        for x in 0..map.width {
            let columns = [((x + map.width - 1) % map.width, 1.0), (x, 6.0), ((x + 1) % map.width, 1.0)];
            let sum: f32 = rows.iter().flat_map(|&(r, a)| columns.map(|(c, b)| a * b * at(c, r))).sum();
            let cell = y * height / map.height * width + x * width / map.width;
            mean[cell] += sum / 64.0;
            count[cell] += 1.0;
        }
    }
    for (m, c) in mean.iter_mut().zip(count) {
        *m /= c.max(1.0);
    }
    (width, height, mean)
}

/// Cumulative weights to search.
struct Search {
    sums: Vec<f64>,
}

impl Search {
    fn new(weights: &[f64]) -> Self {
        let mut sum = 0.0;
        let mut step = |w: &f64| {
            sum += w;
            sum
        };
        Self { sums: weights.iter().map(&mut step).collect() }
    }

    fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Bin of a share of the total, and the place inside it.
    fn find(&self, share: f64) -> (usize, f64) {
        let last = self.sums.len() - 1;
        let target = share * self.sums[last];
        let bin = self.sums.partition_point(|&s| s <= target).min(last);
        let below = if bin == 0 { 0.0 } else { self.sums[bin - 1] };
        let width = self.sums[bin] - below;
        (bin, if width > 0.0 { ((target - below) / width).clamp(0.0, 1.0) } else { 0.5 })
    }
}
