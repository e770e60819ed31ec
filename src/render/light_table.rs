//! Where the light comes from: directions drawn in proportion to the radiance of an environment.
//!
//! A latitude-longitude grid of mean luminance times solid angle gives the density; a fixed set of low-discrepancy
//! directions is drawn from it once per scene, and pixels pick from the set. Each drawn direction carries radiance over
//! density, which is nearly constant: no direction can outshine the rest. A small uniform share keeps the density above
//! zero everywhere.

use std::f32::consts::{PI, TAU};

use super::environment::{Environment, Map, Source, luminance};
use super::vector::Vec3;

/// One drawn direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightSample {
    pub(super) direction: Vec3,
    /// Density in 1/sr.
    pub(super) density: f32,
    pub(super) radiance: Vec3,
}

/// An environment prepared for sampling.
#[derive(Clone, Debug)]
pub(super) struct LightTable {
    width: usize,
    height: usize,
    /// Density in 1/sr of each cell.
    density: Vec<f32>,
    samples: Vec<LightSample>,
}

/// Drawn directions a side: 128 x 128 strata.
const STRATA: u16 = 128;

/// Share of the samples that ignores the radiance.
const UNIFORM_SHARE: f64 = 0.03;

/// Cells across, at most; twice as many as cells down.
const WIDEST: usize = 1024;

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
impl LightTable {
    /// Prepares an environment; `None` for one without light.
    pub(super) fn new(environment: &Environment) -> Option<Self> {
        let (width, height, mean) = cells(environment);
        let share = |row: usize| {
            let edge = |r: usize| (std::f64::consts::PI * r as f64 / height as f64).cos();
            (edge(row) - edge(row + 1)) / 2.0 / width as f64
        };
        let power: Vec<f64> = mean.iter().enumerate().map(|(k, &m)| f64::from(m) * share(k / width)).collect();
        let total: f64 = power.iter().sum();
        if total <= 0.0 {
            return None;
        }
        let probability: Vec<f64> = power
            .iter()
            .enumerate()
            .map(|(k, p)| (1.0 - UNIFORM_SHARE) * p / total + UNIFORM_SHARE * share(k / width))
            .collect();
        let sphere = 4.0 * std::f64::consts::PI;
        let density =
            probability.iter().enumerate().map(|(k, p)| (p / (share(k / width) * sphere)) as f32).collect();
        let mut table = Self { width, height, density, samples: Vec::new() };
        table.draw(environment, &probability);
        Some(table)
    }

    fn draw(&mut self, environment: &Environment, probability: &[f64]) {
        let rows: Vec<f64> = probability.chunks(self.width).map(|row| row.iter().sum()).collect();
        let mut samples = Vec::with_capacity(usize::from(STRATA) * usize::from(STRATA));
        let side = f64::from(STRATA);
        let mut row_search = Search::new(&rows);
        for j in 0..STRATA {
            for i in 0..STRATA {
                // A rank-1 lattice inside the strata: rows do not line up.
                let k = f64::from(j) * side + f64::from(i);
                let v = (f64::from(j) + (k * 0.754_877_666_246_693).fract()) / side;
                let u = (f64::from(i) + (k * 0.569_840_290_998_053).fract()) / side;
                let (row, down) = row_search.find(v);
                let columns = &probability[row * self.width..(row + 1) * self.width];
                let (column, across) = search(columns, rows[row] * u);
                let edge = |r: usize| (std::f64::consts::PI * r as f64 / self.height as f64).cos();
                let y = edge(row) + (edge(row + 1) - edge(row)) * down;
                let turn = (column as f64 + across) / self.width as f64 * std::f64::consts::TAU;
                let r = (1.0 - y * y).max(0.0).sqrt();
                let direction = [(r * turn.sin()) as f32, y as f32, (-r * turn.cos()) as f32];
                let density = self.density[row * self.width + column];
                samples.push(LightSample { direction, density, radiance: environment.radiance(direction) });
            }
        }
        self.samples = samples;
    }

    /// The drawn direction of a sample point.
    pub(super) fn sample(&self, [u, v]: [f32; 2]) -> &LightSample {
        let stratum = |x: f32| ((x * f32::from(STRATA)) as usize).min(usize::from(STRATA) - 1);
        &self.samples[stratum(v) * usize::from(STRATA) + stratum(u)]
    }

    /// Density of drawing a unit direction, 1/sr.
    pub(super) fn density(&self, d: Vec3) -> f32 {
        let u = (d[0].atan2(-d[2]) / TAU).rem_euclid(1.0);
        let v = d[1].clamp(-1.0, 1.0).acos() / PI;
        let column = ((u * self.width as f32) as usize).min(self.width - 1);
        let row = ((v * self.height as f32) as usize).min(self.height - 1);
        self.density[row * self.width + column]
    }
}

/// Mean luminance of the cells of a latitude-longitude grid.
#[allow(clippy::cast_precision_loss)]
fn cells(environment: &Environment) -> (usize, usize, Vec<f32>) {
    match environment.source() {
        Source::Uniform(radiance) => (2, 1, vec![luminance(*radiance); 2]),
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
            // A ragged last cell is stretched over its pixels: cells and pixels need not divide.
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

/// Cumulative search over few, fixed weights.
struct Search {
    sums: Vec<f64>,
}

impl Search {
    fn new(weights: &[f64]) -> Self {
        let mut sum = 0.0;
        Self {
            sums: weights
                .iter()
                .map(|w| {
                    sum += w;
                    sum
                })
                .collect(),
        }
    }

    /// Bin of a share of the total, and the place inside it.
    fn find(&mut self, share: f64) -> (usize, f64) {
        let last = self.sums.len() - 1;
        let target = share * self.sums[last];
        let bin = self.sums.partition_point(|&s| s <= target).min(last);
        let below = if bin == 0 { 0.0 } else { self.sums[bin - 1] };
        let width = self.sums[bin] - below;
        (bin, if width > 0.0 { ((target - below) / width).clamp(0.0, 1.0) } else { 0.5 })
    }
}

/// The same by walking, for weights that are asked for once.
fn search(weights: &[f64], target: f64) -> (usize, f64) {
    let mut below = 0.0;
    for (k, &w) in weights.iter().enumerate() {
        if target < below + w {
            return (k, (target - below) / w);
        }
        below += w;
    }
    (weights.len() - 1, 0.5)
}

/// Light a mean radiance would give: used by tests and estimates.
#[cfg(test)]
fn mean_radiance(table: &LightTable) -> Vec3 {
    let mut sum = [0.0; 3];
    for s in &table.samples {
        sum = super::vector::add(sum, scale(s.radiance, 1.0 / s.density));
    }
    #[allow(clippy::cast_precision_loss)]
    scale(sum, 1.0 / table.samples.len() as f32 / (4.0 * PI))
}
