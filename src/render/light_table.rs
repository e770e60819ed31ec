//! Where the light comes from: directions drawn in proportion to what a surface gets from them.
//!
//! Normals are sorted into the cells of a cube, the *facings*. A facing draws directions with a density in proportion to
//! radiance times cosine at its middle: hardly a direction is wasted behind the surface, and each carries nearly the
//! same light. The environment is a coarse latitude-longitude grid for the choice by facing, and finer parts of each
//! cell for the choice by radiance alone, so that a small sun is found in a large map. A fixed set of low-discrepancy
//! directions is drawn for each facing once per scene, and pixels pick from it; as a whole a set carries exactly the
//! light of the grid. A small floor under the radiance keeps every direction
//! possible, and the density follows the most radiance of a part, not its mean: none is drawn that outshines it.

use std::sync::OnceLock;

use super::environment::Environment;
use super::environment_map::luminance;
use super::light_grid::{Grid, HEIGHT, WIDTH};
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
#[derive(Debug)]
pub(super) struct LightTable<'a> {
    environment: &'a Environment,
    grid: Grid,
    /// Middle of each cell and its share of the sphere.
    cells: Vec<(Vec3, f64)>,
    /// Made when a surface first faces that way: small pictures and flat shapes need few.
    facings: Vec<OnceLock<Facing>>,
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

/// Cosine at the middle of a facing, widened to what surfaces that are a little turned see.
fn weight(cosine: f32) -> f32 {
    if cosine > -0.3 {
        (cosine + 0.12).max(0.02)
    } else {
        0.0
    }
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

#[allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss
)]
impl<'a> LightTable<'a> {
    /// Prepares an environment; `None` for one without light.
    pub(super) fn new(environment: &'a Environment) -> Option<Self> {
        let mut grid = Grid::new(environment);
        let mean = grid.raise_floor();
        if mean <= 0.0 {
            return None;
        }
        let cells: Vec<(Vec3, f64)> = (0..WIDTH * HEIGHT)
            .map(|k| (Grid::center(k), Grid::share(k)))
            .collect();
        let facings = (0..6 * EDGE * EDGE).map(|_| OnceLock::new()).collect();
        Some(Self {
            environment,
            grid,
            cells,
            facings,
        })
    }

    fn seen_from(&self, facing: usize) -> &Facing {
        let make = || Facing::new(middle_of(facing), &self.grid, &self.cells, self.environment);
        self.facings[facing].get_or_init(make)
    }

    /// Number of the facing of a unit normal.
    pub(super) fn facing(n: Vec3) -> usize {
        let size = n.map(f32::abs);
        let axis = if size[0] >= size[1] && size[0] >= size[2] {
            0
        } else {
            2 - usize::from(size[1] >= size[2])
        };
        let cell = |v: f32| (((v / size[axis] + 1.0) * 0.5 * EDGE as f32) as usize).min(EDGE - 1);
        let face = axis * 2 + usize::from(n[axis] < 0.0);
        (face * EDGE + cell(n[(axis + 2) % 3])) * EDGE + cell(n[(axis + 1) % 3])
    }

    /// The drawn direction of a sample point.
    pub(super) fn sample(&self, facing: usize, [u, v]: [f32; 2]) -> &LightSample {
        let stratum = |x: f32| ((x * f32::from(STRATA)) as usize).min(usize::from(STRATA) - 1);
        &self.seen_from(facing).samples[stratum(v) * usize::from(STRATA) + stratum(u)]
    }

    /// Density of drawing a unit direction, 1/sr.
    pub(super) fn density(&self, facing: usize, d: Vec3) -> f32 {
        let (cell, part) = self.grid.find(d);
        let facing = self.seen_from(facing);
        self.grid.parts[part] * weight(dot(Grid::center(cell), facing.normal)) * facing.scale
    }

    /// Solid angle from which a surface gets most of its light, sr.
    pub(super) fn extent(&self, facing: usize) -> f32 {
        self.seen_from(facing).extent
    }
}

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
impl Facing {
    fn new(normal: Vec3, grid: &Grid, cells: &[(Vec3, f64)], environment: &Environment) -> Self {
        let seen: Vec<f32> = cells.iter().map(|(d, _)| weight(dot(*d, normal))).collect();
        let power = |light: &[f32]| -> Vec<f64> {
            let terms = light.iter().zip(&seen).zip(cells);
            terms
                .map(|((light, seen), (_, share))| f64::from(light * seen) * share)
                .collect()
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
                samples.push(LightSample {
                    direction,
                    density,
                    light: scale(radiance, 1.0 / density),
                });
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
        Self {
            normal,
            scale: scale_of,
            samples,
            extent,
        }
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
        Self {
            sums: weights.iter().map(&mut step).collect(),
        }
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
        (
            bin,
            if width > 0.0 {
                ((target - below) / width).clamp(0.0, 1.0)
            } else {
                0.5
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::environment::Held;
    use crate::render::environment_map::Map;
    use std::f32::consts::{PI, TAU};

    #[test]
    fn a_facing_is_found_from_its_middle() {
        for k in 0..6 * EDGE * EDGE {
            assert_eq!(LightTable::facing(middle_of(k)), k);
        }
    }

    /// A quarter of the sky bright, the rest dim.
    fn quarter() -> Environment {
        let (width, height) = (64, 32);
        let pixels = (0..width * height).map(|k| {
            [if k % width < 16 && k / width < 12 {
                30.0
            } else {
                0.4
            }; 3]
        });
        let map = Map::new(width, height, pixels.collect());
        Environment::map(map, Held::NONE)
    }

    /// The drawn light must give the irradiance of plain summation.
    #[test]
    fn drawn_light_is_the_light_there_is() {
        let environment = quarter();
        let table = LightTable::new(&environment).expect("light");
        for normal in [
            [0.0, 1.0, 0.0],
            unit([0.5, 0.2, -0.7]),
            unit([-0.3, -0.8, 0.4]),
        ] {
            let samples = &table.seen_from(LightTable::facing(normal)).samples;
            #[allow(clippy::cast_precision_loss)]
            let drawn: f32 = samples
                .iter()
                .map(|s| s.light[1] * dot(s.direction, normal).max(0.0))
                .sum::<f32>()
                / samples.len() as f32;
            let n = 400_u16;
            let mut summed = 0.0;
            for j in 0..n {
                for i in 0..2 * n {
                    let (u, v) = (
                        (f32::from(i) + 0.5) / f32::from(2 * n),
                        (f32::from(j) + 0.5) / f32::from(n),
                    );
                    let d = Map::direction(u, v);
                    let solid = (v * PI).sin() * PI / f32::from(n) * TAU / f32::from(2 * n);
                    summed += environment.radiance(d)[1] * dot(d, normal).max(0.0) * solid;
                }
            }
            assert!(
                (drawn / summed - 1.0).abs() < 0.01,
                "{normal:?}: {drawn} against {summed}"
            );
        }
    }

    #[test]
    fn densities_of_drawn_directions_are_the_stated_ones() {
        for environment in [Environment::studio(), quarter()] {
            let table = LightTable::new(&environment).expect("light");
            for facing in [0, 40, LightTable::facing(unit([0.1, 0.7, 0.6])), 215] {
                let samples = &table.seen_from(facing).samples;
                let stated = samples.iter().filter(|sample| {
                    let stated = table.density(facing, sample.direction);
                    (stated / sample.density - 1.0).abs() < 1e-6
                });
                // A direction in single precision on the edge of a part may be counted to its neighbour.
                let share = stated.count() as f64 / samples.len() as f64;
                assert!(share >= 0.95, "facing {facing}: {share}");
            }
        }
    }

    /// Blocks of the sphere that draws are counted in, across and down.
    const BLOCKS: [usize; 2] = [16, 16];

    fn block(d: Vec3) -> usize {
        let u = (f64::from(d[0]).atan2(-f64::from(d[2])) / std::f64::consts::TAU).rem_euclid(1.0);
        let v = f64::from(d[1]).clamp(-1.0, 1.0).acos() / std::f64::consts::PI;
        let place = |share: f64, of: usize| ((share * of as f64) as usize).min(of - 1);
        place(v, BLOCKS[1]) * BLOCKS[0] + place(u, BLOCKS[0])
    }

    /// Integral of the stated density over each block: the middle of every part by the solid angle of its part.
    fn expected(table: &LightTable<'_>, facing: usize) -> Vec<f64> {
        let (across, down) = (WIDTH * 3, HEIGHT * 3);
        let mut sums = vec![0.0; BLOCKS[0] * BLOCKS[1]];
        let edge = |row: usize| (std::f64::consts::PI * row as f64 / down as f64).cos();
        for row in 0..down {
            let solid = (edge(row) - edge(row + 1)) * std::f64::consts::TAU / across as f64;
            for column in 0..across {
                let (u, v) = (
                    (column as f32 + 0.5) / across as f32,
                    (row as f32 + 0.5) / down as f32,
                );
                let d = Map::direction(u, v);
                sums[block(d)] += f64::from(table.density(facing, d)) * solid;
            }
        }
        sums
    }

    /// χ² of how often directions are drawn in each block against the integral of the density, over many facings.
    #[test]
    fn directions_are_drawn_as_often_as_their_density_says() {
        for (what, environment) in [("studio", Environment::studio()), ("quarter", quarter())] {
            let table = LightTable::new(&environment).expect("light");
            let mut counts = vec![0.0_f64; BLOCKS[0] * BLOCKS[1]];
            let mut wanted = vec![0.0_f64; BLOCKS[0] * BLOCKS[1]];
            let (mut most, mut facings) = (0.0_f64, 0.0_f64);
            for facing in (0..6 * EDGE * EDGE).step_by(7) {
                facings += 1.0;
                let own = expected(&table, facing);
                most = most.max((own.iter().sum::<f64>() - 1.0).abs());
                let draws = f32::from(STRATA) * f32::from(STRATA);
                for (sum, own) in wanted.iter_mut().zip(own) {
                    *sum += own * f64::from(draws);
                }
                for k in 0..STRATA * STRATA {
                    let place = |k: u16| (f32::from(k) + 0.5) / f32::from(STRATA);
                    let drawn = table.sample(facing, [place(k % STRATA), place(k / STRATA)]);
                    counts[block(drawn.direction)] += 1.0;
                }
            }
            let (mut statistic, mut freedom) = (0.0_f64, 0.0_f64);
            let (mut rare, mut rarely) = (0.0_f64, 0.0_f64);
            for (count, wanted) in counts.iter().zip(wanted) {
                if wanted >= 5.0 {
                    statistic += (count - wanted).powi(2) / wanted;
                    freedom += 1.0;
                } else {
                    rare += wanted;
                    rarely += count;
                }
            }
            // Parts of a cell count as of one size, which at the poles they are not.
            assert!(most < 1e-3, "{what}: a density sums to 1 but for {most:e}");
            // Draws are stratified, which scatters less than chance. Six standard deviations of chance.
            assert!(
                freedom > 60.0 && statistic <= freedom + 6.0 * (2.0 * freedom).sqrt(),
                "{what}: χ² {statistic} of {freedom}"
            );
            // All facings draw with the same points of the unit square, and the one in its corner lies at the end of every
            // distribution, where hardly anything is expected.
            let accepted = 6.0 * rare.sqrt().max(1.0) + facings;
            assert!(
                (rarely - rare).abs() <= accepted,
                "{what}: {rarely} of {rare}"
            );
        }
    }
}
