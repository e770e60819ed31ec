//! The floor under the object: how much of its sky the object hides.
//!
//! Occlusion is the cosine-weighted share of the hemisphere over a floor point that the object covers. A ball on the
//! floor has the closed form `r² h / d³`; other shapes are sampled once on a grid, the same directions at every node,
//! and read bilinearly. What is narrower than the grid, as the foot of a panel, must not become a row of blots: every
//! direction starts from another point about its node, with the weight that bilinear reading gives it.

use rayon::prelude::*;

use super::points::Points;
use super::surface::Surface;
use super::vector::Vec3;

/// Height of the floor.
pub(super) const FLOOR_Y: f32 = -1.0;

/// Occlusion of the floor.
#[derive(Clone, Debug)]
pub(super) enum Ground {
    Ball,
    Grid(Vec<f32>),
}

const NODES: u16 = 72;
const REACH: f32 = 3.2;
const RAYS: u32 = 256;

impl Ground {
    pub(super) fn new(surface: &Surface) -> Self {
        if matches!(surface, Surface::Sphere) {
            return Self::Ball;
        }
        let spacing = 2.0 * REACH / f32::from(NODES - 1);
        // The triangle of two nodes' reach, by its inverse distribution.
        let about = |u: f32| {
            let off = if u < 0.5 {
                (2.0 * u).sqrt() - 1.0
            } else {
                1.0 - (2.0 - 2.0 * u).sqrt()
            };
            off * spacing
        };
        let rays: Vec<([f32; 2], Vec3)> = (0..RAYS)
            .map(|k| {
                let points = Points::of_pixel(0, 0, RAYS, 0x6d);
                let ([u, v], start) = (points.pair(k, 0), points.pair(k, 1));
                let (r, turn) = (u.sqrt(), v * std::f32::consts::TAU);
                let direction = [r * turn.cos(), (1.0 - u).sqrt(), r * turn.sin()];
                (start.map(about), direction)
            })
            .collect();
        let place = |k: u16| (f32::from(k) / f32::from(NODES - 1) * 2.0 - 1.0) * REACH;
        let hidden = |z: u16, x: u16| {
            let (x, z) = (place(x), place(z));
            let met = rays
                .iter()
                .filter(|([right, near], towards)| {
                    let from = [x + right, FLOOR_Y, z + near];
                    surface.meet(from, *towards).is_some()
                })
                .count();
            #[allow(clippy::cast_precision_loss)]
            let share = met as f32 / rays.len() as f32;
            share
        };
        let rows = (0..NODES)
            .into_par_iter()
            .map(|z| (0..NODES).map(|x| hidden(z, x)).collect());
        Self::Grid(rows.collect::<Vec<Vec<f32>>>().concat())
    }

    /// Share of the sky hidden from a point of the floor.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to the grid
    pub(super) fn occlusion(&self, x: f32, z: f32) -> f32 {
        match self {
            Self::Ball => {
                let d2 = 1.0 + x * x + z * z;
                1.0 / (d2 * d2.sqrt())
            }
            Self::Grid(nodes) => {
                let last = f32::from(NODES - 1);
                let place = |v: f32| ((v / REACH + 1.0) * 0.5 * last).clamp(0.0, last - 1e-3);
                let (u, v) = (place(x), place(z));
                let (column, row) = (u as usize, v as usize);
                let at = |r: usize, c: usize| nodes[r * usize::from(NODES) + c];
                let (s, t) = (u.fract(), v.fract());
                (at(row, column) * (1.0 - s) + at(row, column + 1) * s) * (1.0 - t)
                    + (at(row + 1, column) * (1.0 - s) + at(row + 1, column + 1) * s) * t
            }
        }
    }

    /// Where a ray meets the floor, if it does.
    pub(super) fn meet(origin: Vec3, direction: Vec3) -> Option<[f32; 2]> {
        let distance = (FLOOR_Y - origin[1]) / direction[1];
        (direction[1] < -1e-5 && distance > 0.0).then(|| {
            [
                origin[0] + direction[0] * distance,
                origin[2] + direction[2] * distance,
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Shape;

    #[test]
    fn under_a_panel_it_is_darker_than_far_away() {
        for shape in [Shape::Capsule, Shape::Panel] {
            let ground = Ground::new(&Surface::new(shape));
            assert!(
                ground.occlusion(0.0, 0.0) > 0.4,
                "{shape:?} {}",
                ground.occlusion(0.0, 0.0)
            );
            assert!(ground.occlusion(3.0, 3.0) < 0.02);
        }
    }

    #[test]
    fn a_ball_hides_everything_where_it_stands() {
        assert!((Ground::Ball.occlusion(0.0, 0.0) - 1.0).abs() < 1e-6);
    }
}
