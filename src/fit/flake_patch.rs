//! A patch of simulated flakes: discs lying over one another, each a small mirror, and the pictures taken of them.

use std::f64::consts::PI;

use super::flakes::FlakeFitError;
use super::simulate::FlakeRecipe;
use super::stream::Stream;
use crate::color::{LinearRgb, luminance};
use crate::measurement::{FlakePictures, PackageError, SliceRoom};
use crate::paint::{AngleGrid, CarPaint, half_angles};

/// Roughness below which a lobe is a lacquer's and not the flakes'.
const LACQUER_ALPHA: f64 = 0.05;
/// Places per texel and axis at which it is asked which flake is on top.
const PLACES: usize = 4;

/// One flake: its normal, and its color with gain.
#[derive(Clone, Copy, Debug)]
struct Flake {
    normal: [f64; 3],
    color: LinearRgb,
}

/// A patch of paint with every flake in its place, and the pictures of it.
#[derive(Debug)]
pub struct SimulatedPatch {
    theta_h: AngleGrid,
    theta_d: AngleGrid,
    texel_um: f64,
    texels: u32,
    width: f64,
    flakes: Vec<Flake>,
    /// Flake on top and share of the texel, texel by texel.
    shows: Vec<(u32, f32)>,
    /// First of `shows` of each texel, and one past the last.
    starts: Vec<u32>,
}

impl SimulatedPatch {
    /// Scatters flakes over a patch of this paint.
    ///
    /// # Errors
    ///
    /// [`FlakeFitError::Recipe`] for a recipe out of range.
    pub fn new(base: &CarPaint, recipe: &FlakeRecipe) -> Result<Self, FlakeFitError> {
        recipe.check()?;
        let mut random = Stream::new(recipe.seed ^ 0x5bd1_e995_9d1b_54a5);
        let side = f64::from(recipe.texels);
        let side_mm = side * recipe.texel_um / 1000.0;
        let count = (recipe.per_mm2 * side_mm * side_mm).round() as usize;
        let mut flakes = Vec::with_capacity(count);
        let mut discs = Vec::with_capacity(count);
        for _ in 0..count {
            let radius = recipe.radius_um * (0.3 * random.normal()).exp() / recipe.texel_um;
            discs.push((random.open() * side, random.open() * side, radius));
            let (slope, turn) = (
                recipe.tilt * (-random.open().ln()).sqrt(),
                2.0 * PI * random.open(),
            );
            let length = 1.0_f64.hypot(slope);
            let normal = [
                slope * turn.cos() / length,
                slope * turn.sin() / length,
                1.0 / length,
            ];
            let depth = (recipe.depth_spread * random.normal()).exp();
            let color = recipe
                .tint
                .map(|t| t * depth * (recipe.tint_spread * random.normal()).exp());
            flakes.push(Flake { normal, color });
        }
        let (shows, starts) = topmost(&discs, recipe.texels as usize);
        let (theta_h, theta_d) = (recipe.grid(), recipe.grid());
        let width = recipe.half_width_deg.to_radians().tan();
        let (texel_um, texels) = (recipe.texel_um, recipe.texels);
        let mut patch = Self {
            theta_h,
            theta_d,
            texel_um,
            texels,
            width,
            flakes,
            shows,
            starts,
        };
        let mean = patch.mean_luminance();
        if mean > 0.0 {
            let gain = recipe.share * base_luminance(base) / mean;
            patch
                .flakes
                .iter_mut()
                .for_each(|flake| flake.color = flake.color.map(|c| c * gain));
        }
        Ok(patch)
    }

    /// What each flake reflects at an angle pair in degrees, 1/sr.
    fn reflections(&self, theta_h_deg: f64, theta_d_deg: f64) -> Vec<LinearRgb> {
        let (sin_h, cos_h) = theta_h_deg.to_radians().sin_cos();
        let cos_d = theta_d_deg.to_radians().cos();
        let w2 = self.width * self.width;
        let reflect = |flake: &Flake| {
            let cosine = (flake.normal[0] * sin_h + flake.normal[2] * cos_h).clamp(1e-3, 1.0);
            let tan2 = 1.0 / (cosine * cosine) - 1.0;
            let spread = (-tan2 / w2).exp() / (PI * w2 * cosine.powi(4));
            let scale = spread / (4.0 * (cos_h * cos_d).powi(2));
            flake.color.map(|c| scale * c)
        };
        self.flakes.iter().map(reflect).collect()
    }

    fn texel(&self, texel: usize, reflections: &[LinearRgb]) -> LinearRgb {
        let mut sum = [0.0; 3];
        for (flake, share) in
            &self.shows[self.starts[texel] as usize..self.starts[texel + 1] as usize]
        {
            let color = reflections[*flake as usize];
            (0..3).for_each(|k| sum[k] += f64::from(*share) * color[k]);
        }
        sum
    }

    fn mean_luminance(&self) -> f64 {
        let reflections = self.reflections(0.0, 0.0);
        let texels = self.starts.len() - 1;
        (0..texels)
            .map(|t| luminance(self.texel(t, &reflections)))
            .sum::<f64>()
            / texels as f64
    }
}

/// Luminance of the base in the mirror direction of the normal, without a lacquer's lobes.
fn base_luminance(base: &CarPaint) -> f64 {
    let up = [0.0, 0.0, 1.0];
    let h = half_angles(up, up);
    let chi = base.color_table.nodes()[0].to_rgb();
    let mut sum = base.diffuse.map(|d| d / PI);
    for lobe in base.lobes.iter().filter(|lobe| lobe.alpha >= LACQUER_ALPHA) {
        let shape = lobe.shape(&h, 1.0, 1.0);
        (0..3).for_each(|k| sum[k] += lobe.weight[k] * shape);
    }
    luminance([0, 1, 2].map(|k| sum[k] * chi[k]))
}

/// Which disc is on top at the places of each texel; the first of the list lies uppermost. The patch repeats.
fn topmost(discs: &[(f64, f64, f64)], side: usize) -> (Vec<(u32, f32)>, Vec<u32>) {
    const NONE: u32 = u32::MAX;
    let fine = side * PLACES;
    let mut top = vec![NONE; fine * fine];
    for (number, &(x, y, radius)) in (0_u32..).zip(discs) {
        let (x, y, radius) = (
            x * PLACES as f64,
            y * PLACES as f64,
            (radius * PLACES as f64).min(fine as f64 / 2.0),
        );
        let range = |c: f64| (c - radius).floor() as i64..=(c + radius).ceil() as i64;
        for v in range(y) {
            for u in range(x) {
                let inside = (u as f64 + 0.5 - x).hypot(v as f64 + 0.5 - y) <= radius;
                let place = &mut top[v.rem_euclid(fine as i64) as usize * fine
                    + u.rem_euclid(fine as i64) as usize];
                if inside && *place == NONE {
                    *place = number;
                }
            }
        }
    }
    let (mut shows, mut starts) = (Vec::new(), vec![0]);
    for texel in 0..side * side {
        let (x, y) = (texel % side * PLACES, texel / side * PLACES);
        let mut seen: [u32; PLACES * PLACES] =
            std::array::from_fn(|k| top[(y + k / PLACES) * fine + x + k % PLACES]);
        seen.sort_unstable();
        for run in seen.chunk_by(|a, b| a == b).filter(|run| run[0] != NONE) {
            shows.push((run[0], run.len() as f32 / seen.len() as f32));
        }
        starts.push(shows.len() as u32);
    }
    (shows, starts)
}

impl FlakePictures for SimulatedPatch {
    fn theta_h(&self) -> &AngleGrid {
        &self.theta_h
    }

    fn theta_d(&self) -> &AngleGrid {
        &self.theta_d
    }

    fn texel_um(&self) -> f64 {
        self.texel_um
    }

    fn size(&self) -> [u32; 2] {
        [self.texels; 2]
    }

    fn name(&self, slice: usize) -> String {
        let (h, d) = (slice / self.theta_d.len(), slice % self.theta_d.len());
        format!("simulated slice {h}, {d}")
    }

    fn read(&self, slice: usize, room: &mut SliceRoom) -> Result<(), PackageError> {
        let (h, d) = (slice / self.theta_d.len(), slice % self.theta_d.len());
        let reflections = self.reflections(self.theta_h.degrees()[h], self.theta_d.degrees()[d]);
        let picture = &mut room.picture;
        (picture.width, picture.height) = (self.texels as usize, self.texels as usize);
        picture.planes.iter_mut().for_each(Vec::clear);
        for texel in 0..self.starts.len() - 1 {
            let color = self.texel(texel, &reflections);
            picture
                .planes
                .iter_mut()
                .zip(color)
                .for_each(|(plane, c)| plane.push(c as f32));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
