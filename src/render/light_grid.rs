//! An environment as a grid to draw directions from: coarse latitude-longitude cells, and finer parts of each.
//!
//! Cells hold mean luminance, which says how much light there is; parts hold the most luminance found in them, which
//! bounds what a drawn direction can carry. Parts are no smaller than a map's pixels and looked at as finely as those.

use std::f32::consts::{PI, TAU};

use rayon::prelude::*;

use super::environment::{Environment, Source};
use super::environment_map::{Map, luminance};
use super::vector::Vec3;

/// Coarse cells across.
pub(super) const WIDTH: usize = 128;
/// Coarse cells down.
pub(super) const HEIGHT: usize = 64;

/// Finer parts a side of a coarse cell, at most.
const FINEST: usize = 16;

/// Share of the mean luminance added everywhere.
const FLOOR: f32 = 0.03;

/// Luminance by direction: coarse cells, and finer parts of each.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Mean luminance, row by row.
    pub(super) cells: Vec<f32>,
    fine: usize,
    /// Most luminance, cell by cell, `fine` rows of `fine`; with the floor.
    pub(super) parts: Vec<f32>,
    /// Mean of a cell's parts.
    pub(super) bounds: Vec<f32>,
}

#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)]
impl Grid {
    pub(super) fn new(environment: &Environment) -> Self {
        let (fine, dense) = match environment.source() {
            Source::Uniform(_) => (1, 1),
            Source::Studio(_) => (3, 1),
            Source::Map(map) => {
                let fine = map
                    .width
                    .div_ceil(WIDTH)
                    .max(map.height.div_ceil(HEIGHT))
                    .clamp(1, FINEST);
                (
                    fine,
                    map.width
                        .div_ceil(WIDTH * fine)
                        .max(map.height.div_ceil(HEIGHT * fine)),
                )
            }
        };
        let light = |u: f32, v: f32| match environment.source() {
            Source::Map(map) => luminance(map.at(u, v)),
            Source::Studio(_) | Source::Uniform(_) => {
                luminance(environment.radiance(Map::direction(u, v)))
            }
        };
        let found: Vec<(f32, f32)> = (0..WIDTH * HEIGHT * fine * fine)
            .into_par_iter()
            .map(|k| {
                let (cell, part) = (k / (fine * fine), k % (fine * fine));
                let corner = [
                    cell % WIDTH * fine + part % fine,
                    cell / WIDTH * fine + part / fine,
                ];
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
        Self {
            cells,
            fine,
            parts: found.into_iter().map(|p| p.1).collect(),
            bounds: Vec::new(),
        }
    }

    /// Adds the floor to the parts; the mean luminance of the sphere.
    pub(super) fn raise_floor(&mut self) -> f64 {
        let mean: f64 = self
            .cells
            .iter()
            .enumerate()
            .map(|(k, &light)| f64::from(light) * Self::share(k))
            .sum();
        let each = self.fine * self.fine;
        for light in &mut self.parts {
            *light += FLOOR * mean as f32;
        }
        self.bounds = self
            .parts
            .chunks(each)
            .map(|parts| parts.iter().sum::<f32>() / each as f32)
            .collect();
        mean
    }

    /// Height on the unit sphere of the upper edge of a row.
    fn edge(row: usize) -> f64 {
        (std::f64::consts::PI * row as f64 / HEIGHT as f64).cos()
    }

    /// Share of the sphere that a cell covers.
    pub(super) fn share(cell: usize) -> f64 {
        let row = cell / WIDTH;
        (Self::edge(row) - Self::edge(row + 1)) / 2.0 / WIDTH as f64
    }

    pub(super) fn center(cell: usize) -> Vec3 {
        let (x, y) = (cell % WIDTH, cell / WIDTH);
        Map::direction(
            (x as f32 + 0.5) / WIDTH as f32,
            (y as f32 + 0.5) / HEIGHT as f32,
        )
    }

    /// Cell and part of a unit direction.
    #[allow(clippy::cast_sign_loss)]
    pub(super) fn find(&self, d: Vec3) -> (usize, usize) {
        let fine = self.fine;
        let u = (d[0].atan2(-d[2]) / TAU).rem_euclid(1.0) * (WIDTH * fine) as f32;
        let v = d[1].clamp(-1.0, 1.0).acos() / PI * (HEIGHT * fine) as f32;
        let (x, y) = (
            (u as usize).min(WIDTH * fine - 1),
            (v as usize).min(HEIGHT * fine - 1),
        );
        let cell = y / fine * WIDTH + x / fine;
        (cell, cell * fine * fine + y % fine * fine + x % fine)
    }

    /// Part of a cell by radiance, and a direction in it even in solid angle.
    pub(super) fn refine(&self, cell: usize, across: f64, down: f64) -> (usize, Vec3) {
        let fine = self.fine;
        let parts = &self.parts[cell * fine * fine..(cell + 1) * fine * fine];
        let rows: [f64; FINEST] = std::array::from_fn(|r| {
            parts
                .get(r * fine..(r + 1) * fine)
                .map_or(0.0, |row| row.iter().map(|&v| f64::from(v)).sum())
        });
        let (row, down) = walk(rows[..fine].iter().copied(), down);
        let (column, across) = walk(
            parts[row * fine..(row + 1) * fine]
                .iter()
                .map(|&v| f64::from(v)),
            across,
        );
        let theta = ((cell / WIDTH) as f64 + (row as f64 + down) / fine as f64) / HEIGHT as f64
            * std::f64::consts::PI;
        let turn = ((cell % WIDTH) as f64 + (column as f64 + across) / fine as f64) / WIDTH as f64;
        let (sine, y) = theta.sin_cos();
        let turn = turn * std::f64::consts::TAU;
        let direction = [
            (sine * turn.sin()) as f32,
            y as f32,
            (-sine * turn.cos()) as f32,
        ];
        (cell * fine * fine + row * fine + column, direction)
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
