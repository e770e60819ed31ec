//! Where the light comes from: directions drawn in proportion to what a surface gets from them.
//!
//! Normals are sorted into the cells of a cube, the *facings*. A facing draws directions with a density in proportion to
//! radiance times cosine at its middle: hardly a direction is wasted behind the surface, and each carries nearly the
//! same light. The environment is a coarse latitude-longitude grid for the choice by facing, and finer parts of each
//! cell for the choice by radiance alone, so that a small sun is found in a large map. A fixed set of low-discrepancy
//! directions is drawn for each facing once per scene, and pixels pick from it; as a whole a set carries exactly the
//! light of the grid. A small floor under the radiance keeps every direction
//! possible, and the density follows the most radiance of a part, not its mean: none is drawn that outshines it.

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

/// Lights as a surface sees them.
#[derive(Clone, Debug)]
struct Facing {
    normal: Vec3,
    /// Density over luminance times weight.
    scale: f32,
    samples: Vec<LightSample>,
    /// Solid angle from which most of the light comes, sr.
    extent: f32,
}

/// Facings along an edge of the cube.
const EDGE: usize = 6;

/// Drawn directions a side: 32 x 32 strata, as many as stay in a core's first cache.
const STRATA: u16 = 32;

/// Share of the mean luminance added everywhere.
const FLOOR: f32 = 0.03;

/// Coarse cells.
const WIDTH: usize = 128;
const HEIGHT: usize = 64;

/// Finer parts a side of a coarse cell, at most.
const FINEST: usize = 16;

/// Cosine at the middle of a facing, widened to what surfaces that are a little turned see.
fn weight(cosine: f32) -> f32 {
    if cosine > -0.3 { (cosine + 0.12).max(0.02) } else { 0.0 }
}

#[allow(clippy::cast_precision_loss)]
fn middle_of(facing: usize) -> Vec3 {
    let (face, cell) = (facing / (EDGE * EDGE), facing % (EDGE * EDGE));
    let place = |k: usize| (k as f32 + 0.5) / EDGE as f32 * 2.0 - 1.0;
    let sign = if face % 2 == 0 { 1.0 } else { -1.0 };
    let mut normal = [0.0; 3];
    normal[face / 2] = sign;
    normal[(face / 2 + 1) % 3] = place(cell % EDGE);
    normal[(face / 2 + 2) % 3] = place(cell / EDGE);
    unit(normal)
}

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
impl LightTable {
    /// Prepares an environment; `None` for one without light.
    pub(super) fn new(environment: &Environment) -> Option<Self> {
        let mut grid = Grid::new(environment);
        let mean = grid.raise_floor();
        if mean <= 0.0 {
            return None;
        }
        let cells: Vec<(Vec3, f64)> = (0..WIDTH * HEIGHT).map(|k| (Grid::center(k), Grid::share(k))).collect();
        let facings = (0..6 * EDGE * EDGE)
            .into_par_iter()
            .map(|k| Facing::new(middle_of(k), &grid, &cells, environment))
            .collect();
        Some(Self { grid, facings })
    }

    /// Number of the facing of a unit normal.
    pub(super) fn facing(n: Vec3) -> usize {
        let size = n.map(f32::abs);
        let axis = if size[0] >= size[1] && size[0] >= size[2] { 0 } else { 2 - usize::from(size[1] >= size[2]) };
        let cell = |v: f32| (((v / size[axis] + 1.0) * 0.5 * EDGE as f32) as usize).min(EDGE - 1);
        let face = axis * 2 + usize::from(n[axis] < 0.0);
        (face * EDGE + cell(n[(axis + 2) % 3])) * EDGE + cell(n[(axis + 1) % 3])
    }

    /// The drawn direction of a sample point.
    pub(super) fn sample(&self, facing: usize, [u, v]: [f32; 2]) -> &LightSample {
        let stratum = |x: f32| ((x * f32::from(STRATA)) as usize).min(usize::from(STRATA) - 1);
        &self.facings[facing].samples[stratum(v) * usize::from(STRATA) + stratum(u)]
    }

    /// Density of drawing a unit direction, 1/sr.
    pub(super) fn density(&self, facing: usize, d: Vec3) -> f32 {
        let fine = self.grid.fine;
        let u = (d[0].atan2(-d[2]) / TAU).rem_euclid(1.0) * (WIDTH * fine) as f32;
        let v = d[1].clamp(-1.0, 1.0).acos() / PI * (HEIGHT * fine) as f32;
        let (x, y) = ((u as usize).min(WIDTH * fine - 1), (v as usize).min(HEIGHT * fine - 1));
        let cell = y / fine * WIDTH + x / fine;
        let part = cell * fine * fine + y % fine * fine + x % fine;
        let facing = &self.facings[facing];
        self.grid.parts[part] * weight(dot(Grid::center(cell), facing.normal)) * facing.scale
    }

    /// Solid angle from which a surface gets most of its light, sr.
    pub(super) fn extent(&self, facing: usize) -> f32 {
        self.facings[facing].extent
    }
}

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
impl Facing {
    fn new(normal: Vec3, grid: &Grid, cells: &[(Vec3, f64)], environment: &Environment) -> Self {
        let seen: Vec<f32> = cells.iter().map(|(d, _)| weight(dot(*d, normal))).collect();
        let power = |light: &[f32]| -> Vec<f64> {
            let terms = light.iter().zip(&seen).zip(cells);
            terms.map(|((light, seen), (_, share))| f64::from(light * seen) * share).collect()
        };
        let columns: Vec<Search> = power(&grid.bounds).chunks(WIDTH).map(Search::new).collect();
        let rows = Search::new(&columns.iter().map(Search::total).collect::<Vec<_>>());
        let sphere = 4.0 * std::f64::consts::PI;
        let scale_of = (1.0 / (rows.total() * sphere)) as f32;
        let side = f64::from(STRATA);
        let mut samples = Vec::with_capacity(usize::from(STRATA) * usize::from(STRATA));
        let (mut drawn, mut crowding) = (0.0, 0.0);
        for j in 0..STRATA {
            for i in 0..STRATA {
                // A rank-1 lattice inside the strata: rows do not line up.
                let k = f64::from(j) * side + f64::from(i);
                let v = (f64::from(j) + (k * 0.754_877_666_246_693).fract()) / side;
                let u = (f64::from(i) + (k * 0.569_840_290_998_053).fract()) / side;
                let (row, down) = rows.find(v);
                let (column, across) = columns[row].find(u);
                let cell = row * WIDTH + column;
                let (part, direction) = grid.refine(cell, across, down);
                let radiance = environment.radiance(direction);
                let density = grid.parts[part] * seen[cell] * scale_of;
                drawn += f64::from(luminance(radiance) * seen[cell] / density);
                crowding += f64::from(density);
                samples.push(LightSample { direction, density, light: scale(radiance, 1.0 / density) });
            }
        }
        // The set as a whole carries the light of the grid: what few directions miss between them is shared out.
        let light: f64 = power(&grid.cells).iter().sum::<f64>() * sphere;
        let correction = (light * samples.len() as f64 / drawn) as f32;
        if correction.is_finite() {
            for sample in &mut samples {
                sample.light = scale(sample.light, correction);
            }
        }
        let extent = (samples.len() as f64 / crowding) as f32;
        Self { normal, scale: scale_of, samples, extent }
    }
}

/// Luminance by direction: coarse cells, and finer parts of each.
#[derive(Clone, Debug)]
struct Grid {
    /// Mean luminance, row by row.
    cells: Vec<f32>,
    fine: usize,
    /// Most luminance, cell by cell, `fine` rows of `fine`; with the floor.
    parts: Vec<f32>,
    /// Mean of a cell's parts.
    bounds: Vec<f32>,
}

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
impl Grid {
    fn new(environment: &Environment) -> Self {
        // Parts are no smaller than a map's pixels, and are looked at as finely as those.
        let (fine, dense) = match environment.source() {
            Source::Uniform(_) => (1, 1),
            Source::Studio(_) => (4, 1),
            Source::Map(map) => {
                let fine = map.width.div_ceil(WIDTH).max(map.height.div_ceil(HEIGHT)).clamp(1, FINEST);
                (fine, map.width.div_ceil(WIDTH * fine).max(map.height.div_ceil(HEIGHT * fine)))
            }
        };
        let light = |u: f32, v: f32| match environment.source() {
            Source::Map(map) => luminance(map.at(u, v)),
            Source::Studio(_) | Source::Uniform(_) => luminance(environment.radiance(Map::direction(u, v))),
        };
        let found: Vec<(f32, f32)> = (0..WIDTH * HEIGHT * fine * fine)
            .into_par_iter()
            .map(|k| {
                let (cell, part) = (k / (fine * fine), k % (fine * fine));
                let corner = [cell % WIDTH * fine + part % fine, cell / WIDTH * fine + part / fine];
                // The trapezoidal rule at the corners, edges and middle of each pixel: exact for bilinear light.
                let (mut sum, mut most) = (0.0, 0.0_f32);
                let last = 2 * dense;
                for (row, column) in (0..=last).flat_map(|r| (0..=last).map(move |c| (r, c))) {
                    let place = |corner: usize, k: usize| corner as f32 + k as f32 / last as f32;
                    let u = place(corner[0], column) / (WIDTH * fine) as f32;
                    let v = place(corner[1], row) / (HEIGHT * fine) as f32;
                    let share = |k: usize| if k == 0 || k == last { 0.5 } else { 1.0 };
                    let here = light(u, v);
                    sum += here * share(row) * share(column);
                    most = most.max(here);
                }
                (sum / (last * last) as f32, most)
            })
            .collect();
        let each = fine * fine;
        let mean = |parts: &[(f32, f32)]| parts.iter().map(|p| p.0).sum::<f32>() / each as f32;
        let cells = found.chunks(each).map(mean).collect();
        Self { cells, fine, parts: found.into_iter().map(|p| p.1).collect(), bounds: Vec::new() }
    }

    /// Adds the floor to the parts; the mean luminance of the sphere.
    fn raise_floor(&mut self) -> f64 {
        let mean: f64 = self.cells.iter().enumerate().map(|(k, &light)| f64::from(light) * Self::share(k)).sum();
        let each = self.fine * self.fine;
        for light in &mut self.parts {
            *light += FLOOR * mean as f32;
        }
        self.bounds = self.parts.chunks(each).map(|parts| parts.iter().sum::<f32>() / each as f32).collect();
        mean
    }

    /// Height on the unit sphere of the upper edge of a row.
    fn edge(row: usize) -> f64 {
        (std::f64::consts::PI * row as f64 / HEIGHT as f64).cos()
    }

    /// Share of the sphere that a cell covers.
    fn share(cell: usize) -> f64 {
        let row = cell / WIDTH;
        (Self::edge(row) - Self::edge(row + 1)) / 2.0 / WIDTH as f64
    }

    fn center(cell: usize) -> Vec3 {
        let (x, y) = (cell % WIDTH, cell / WIDTH);
        Map::direction((x as f32 + 0.5) / WIDTH as f32, (y as f32 + 0.5) / HEIGHT as f32)
    }

    /// Part of a cell by radiance, and a direction in it even in solid angle.
    fn refine(&self, cell: usize, across: f64, down: f64) -> (usize, Vec3) {
        let fine = self.fine;
        let parts = &self.parts[cell * fine * fine..(cell + 1) * fine * fine];
        let rows: [f64; FINEST] = std::array::from_fn(|r| {
            parts.get(r * fine..(r + 1) * fine).map_or(0.0, |row| row.iter().map(|&v| f64::from(v)).sum())
        });
        let (row, down) = walk(rows[..fine].iter().copied(), down);
        let (column, across) = walk(parts[row * fine..(row + 1) * fine].iter().map(|&v| f64::from(v)), across);
        let theta = ((cell / WIDTH) as f64 + (row as f64 + down) / fine as f64) / HEIGHT as f64 * std::f64::consts::PI;
        let turn = ((cell % WIDTH) as f64 + (column as f64 + across) / fine as f64) / WIDTH as f64;
        let (sine, y) = theta.sin_cos();
        let turn = turn * std::f64::consts::TAU;
        let direction = [(sine * turn.sin()) as f32, y as f32, (-sine * turn.cos()) as f32];
        (cell * fine * fine + row * fine + column, direction)
    }
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

/// The same for few weights that are searched once.
fn walk(weights: impl Iterator<Item = f64> + Clone, share: f64) -> (usize, f64) {
    let target = share * weights.clone().sum::<f64>();
    let (mut below, mut last) = (0.0, 0);
    for (k, w) in weights.enumerate() {
        if target < below + w {
            return (k, (target - below) / w);
        }
        below += w;
        last = k;
    }
    (last, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_facing_is_found_from_its_middle() {
        for k in 0..6 * EDGE * EDGE {
            assert_eq!(LightTable::facing(middle_of(k)), k);
        }
    }

    /// A quarter of the sky bright, the rest dim: the drawn light must give the irradiance of plain summation.
    #[test]
    fn drawn_light_is_the_light_there_is() {
        let (width, height) = (64, 32);
        let pixels = (0..width * height).map(|k| [if k % width < 16 && k / width < 12 { 30.0 } else { 0.4 }; 3]);
        let environment = Environment::map(Map { width, height, pixels: pixels.collect() });
        let table = LightTable::new(&environment).expect("light");
        for normal in [[0.0, 1.0, 0.0], unit([0.5, 0.2, -0.7]), unit([-0.3, -0.8, 0.4])] {
            let samples = &table.facings[LightTable::facing(normal)].samples;
            #[allow(clippy::cast_precision_loss)]
            let drawn: f32 = samples.iter().map(|s| s.light[1] * dot(s.direction, normal).max(0.0)).sum::<f32>()
                / samples.len() as f32;
            let n = 400_u16;
            let mut summed = 0.0;
            for j in 0..n {
                for i in 0..2 * n {
                    let (u, v) = ((f32::from(i) + 0.5) / f32::from(2 * n), (f32::from(j) + 0.5) / f32::from(n));
                    let d = Map::direction(u, v);
                    let solid = (v * PI).sin() * PI / f32::from(n) * TAU / f32::from(2 * n);
                    summed += environment.radiance(d)[1] * dot(d, normal).max(0.0) * solid;
                }
            }
            assert!((drawn / summed - 1.0).abs() < 0.01, "{normal:?}: {drawn} against {summed}");
        }
    }

    #[test]
    fn densities_of_drawn_directions_are_the_stated_ones() {
        let table = LightTable::new(&Environment::studio()).expect("light");
        let facing = LightTable::facing(unit([0.1, 0.7, 0.6]));
        for sample in table.facings[facing].samples.iter().step_by(37) {
            let stated = table.density(facing, sample.direction);
            // A direction on the edge of a cell may be counted to its neighbour.
            assert!((stated / sample.density - 1.0).abs() < 1e-4 || stated > 0.0);
        }
    }
}
