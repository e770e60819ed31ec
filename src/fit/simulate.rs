//! Simulated flakes for paints that were measured without pictures of them.
//!
//! Günther et al. (VMV 2005) give a fitted car paint its sparkle back by random flake normals seen through the paint's
//! own reflection. Here a patch is scattered with flakes: discs of varied size lying over one another in random order,
//! the upper ones hiding the lower, each with a normal of its own, a tint of its own and a brightness that stands for its
//! depth. Every flake reflects like a small rough mirror,
//!
//! ```text
//! f = g tint D_w(angle(m, h)) / (4 cosθi cosθo),   D_w = exp(−tan²δ/w²) / (π w² cos⁴δ)
//! ```
//!
//! with light and view on either side of the half vector across its plane of tilt, so that both cosines are
//! `cosθh cosθd`; a metal's reflectance hardly depends on θd within the grid. The gain g is set once, so that the patch's mean luminance at θh = θd = 0 is a given share of the base's
//! there, lobes narrower than any flake's spread (a lacquer's highlight) not counted. The pictures then go the way of
//! measured ones, [`fit_flakes`]. A plausible paint, not a measured one: mark it as simulated.

use std::f64::consts::PI;

use super::clusters::ClusterSettings;
use super::flakes::{FittedFlakes, FlakeFitError, Progress, fit_flakes};
use crate::color::{LinearRgb, luminance};
use crate::measurement::{FlakePictures, PackageError, SliceRoom};
use crate::paint::{AngleGrid, CarPaint, half_angles};

/// What the flakes of a paint are like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeRecipe {
    /// Flakes per square millimetre, 0 to 100000.
    pub per_mm2: f64,
    /// Median radius, micrometres, 0.1 to 1000.
    pub radius_um: f64,
    /// Beckmann roughness α of the flakes' normals, 0.001 to 2; a metallic's widest lobe but one has it.
    pub tilt: f64,
    /// Width w of one flake's reflection as an angle, degrees, 0.5 to 45: how smooth the flakes are.
    pub half_width_deg: f64,
    /// Color of the metal, 0 to 2: of luminance 1 where it only tints what brightness and depth decide.
    pub tint: LinearRgb,
    /// Standard deviation of the logarithm of a flake's own tint, per channel.
    pub tint_spread: f64,
    /// Standard deviation of the logarithm of a flake's brightness: the spread of depths.
    pub depth_spread: f64,
    /// Mean luminance of the flakes at the mirror direction, as a share of the base's.
    pub share: f64,
    /// Side of a texel, micrometres.
    pub texel_um: f64,
    /// Texels along a side of the patch, 1 to 4096.
    pub texels: u32,
    /// Angles of θh and θd, 1 to 181.
    pub angles: u32,
    /// Largest angle, degrees, to 85.
    pub largest_deg: f64,
    /// Another seed is another patch of the same paint.
    pub seed: u64,
}

impl Default for FlakeRecipe {
    fn default() -> Self {
        Self {
            per_mm2: 1500.0,
            radius_um: 12.0,
            tilt: 0.17,
            half_width_deg: 3.0,
            tint: [1.0; 3],
            tint_spread: 0.04,
            depth_spread: 0.4,
            share: 0.15,
            texel_um: 20.0,
            texels: 64,
            angles: 24,
            largest_deg: 66.0,
            seed: 1,
        }
    }
}

/// Roughness below which a lobe is a lacquer's and not the flakes'.
const LACQUER_ALPHA: f64 = 0.05;
/// Places per texel and axis at which it is asked which flake is on top.
const PLACES: usize = 4;

/// Simulates the flakes of a paint and fits them.
///
/// # Errors
///
/// [`FlakeFitError::Recipe`] for a recipe out of range, and what [`fit_flakes`] refuses.
pub fn simulate_flakes(
    base: &CarPaint,
    recipe: &FlakeRecipe,
    settings: &ClusterSettings,
    progress: Progress,
) -> Result<FittedFlakes, FlakeFitError> {
    fit_flakes(&SimulatedPatch::new(base, recipe)?, settings, progress)
}

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

impl FlakeRecipe {
    fn check(&self) -> Result<(), FlakeFitError> {
        let fields = [
            ("per_mm2", self.per_mm2, 0.0, 1e5),
            ("radius_um", self.radius_um, 0.1, 1000.0),
            ("tilt", self.tilt, 1e-3, 2.0),
            ("half_width_deg", self.half_width_deg, 0.5, 45.0),
            ("tint_spread", self.tint_spread, 0.0, 2.0),
            ("depth_spread", self.depth_spread, 0.0, 2.0),
            ("share", self.share, 0.0, 10.0),
            ("texel_um", self.texel_um, 0.1, 1000.0),
            ("texels", f64::from(self.texels), 1.0, 4096.0),
            ("angles", f64::from(self.angles), 1.0, 181.0),
            ("largest_deg", self.largest_deg, 0.0, 85.0),
            ("tint red", self.tint[0], 0.0, 2.0),
            ("tint green", self.tint[1], 0.0, 2.0),
            ("tint blue", self.tint[2], 0.0, 2.0),
        ];
        for (field, value, low, high) in fields {
            if !(low..=high).contains(&value) {
                return Err(FlakeFitError::Recipe {
                    field,
                    value,
                    low,
                    high,
                });
            }
        }
        Ok(())
    }

    fn grid(&self) -> AngleGrid {
        let steps = (self.angles - 1).max(1);
        let angles = if self.largest_deg > 0.0 {
            self.angles
        } else {
            1
        };
        let degrees = (0..angles)
            .map(|k| self.largest_deg * f64::from(k) / f64::from(steps))
            .collect();
        // Multiples of a positive step up to at most 85°.
        AngleGrid::new(degrees).unwrap_or_else(|_| AngleGrid::single())
    }
}

impl SimulatedPatch {
    /// Scatters flakes over a patch of this paint.
    ///
    /// # Errors
    ///
    /// [`FlakeFitError::Recipe`] for a recipe out of range.
    pub fn new(base: &CarPaint, recipe: &FlakeRecipe) -> Result<Self, FlakeFitError> {
        recipe.check()?;
        let mut random = Random(recipe.seed ^ 0x5bd1_e995_9d1b_54a5);
        let side = f64::from(recipe.texels);
        let side_mm = side * recipe.texel_um / 1000.0;
        let count = (recipe.per_mm2 * side_mm * side_mm).round() as usize;
        let mut flakes = Vec::with_capacity(count);
        let mut discs = Vec::with_capacity(count);
        for _ in 0..count {
            let radius = recipe.radius_um * (0.3 * random.normal()).exp() / recipe.texel_um;
            discs.push((random.uniform() * side, random.uniform() * side, radius));
            let (slope, turn) = (
                recipe.tilt * (-random.uniform().ln()).sqrt(),
                2.0 * PI * random.uniform(),
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

/// `SplitMix64` (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Between 0 and 1, neither of them.
    fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// Standard normal (Box and Muller 1958).
    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (2.0 * PI * self.uniform()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{ColorTable, Lobe};
    use std::ops::ControlFlow;

    fn silver() -> CarPaint {
        let lobe = |s: f64, alpha: f64, f0: f64| Lobe {
            weight: [s; 3],
            alpha,
            f0,
        };
        let lobes = vec![
            lobe(0.08, 0.38, 1.0),
            lobe(0.11, 0.17, 0.92),
            lobe(0.013, 0.013, 0.9),
        ];
        CarPaint {
            coat: None,
            diffuse: [0.06; 3],
            lobes,
            color_table: ColorTable::white(),
            flakes: None,
        }
    }

    fn simulated(recipe: &FlakeRecipe) -> FittedFlakes {
        simulate_flakes(&silver(), recipe, &ClusterSettings::default(), &|_, _| {
            ControlFlow::Continue(())
        })
        .expect("in range")
    }

    const SMALL: FlakeRecipe = FlakeRecipe {
        per_mm2: 2000.0,
        radius_um: 11.0,
        tilt: 0.17,
        half_width_deg: 3.0,
        tint: [0.9; 3],
        tint_spread: 0.04,
        depth_spread: 0.4,
        share: 0.15,
        texel_um: 20.0,
        texels: 48,
        angles: 12,
        largest_deg: 66.0,
        seed: 3,
    };

    #[test]
    fn flakes_carry_their_share_at_the_mirror_and_less_elsewhere() {
        let flakes = simulated(&SMALL).flakes;
        let mean = |h: usize, d: usize| luminance(flakes.slice(h, d).mean());
        let wanted = 0.15 * base_luminance(&silver());
        assert!(
            (mean(0, 0) / wanted - 1.0).abs() < 1e-5,
            "{} instead of {wanted}",
            mean(0, 0)
        );
        assert!(mean(2, 0) < mean(0, 0) && mean(6, 0) < 0.02 * mean(0, 0));
    }

    #[test]
    fn few_texels_shine_many_times_brighter_than_the_mean() {
        let patch = SimulatedPatch::new(&silver(), &SMALL).expect("in range");
        let reflections = patch.reflections(12.0, 10.0);
        let mut light: Vec<f64> = (0..patch.starts.len() - 1)
            .map(|t| luminance(patch.texel(t, &reflections)))
            .collect();
        light.sort_by(f64::total_cmp);
        let mean = light.iter().sum::<f64>() / light.len() as f64;
        assert!(
            light[light.len() * 99 / 100] > 8.0 * mean,
            "99th percentile over mean"
        );
        assert!(light[light.len() / 2] < 0.5 * mean, "median over mean");
    }

    #[test]
    fn coarser_flakes_have_a_larger_grain() {
        let grain = |radius_um: f64| {
            simulated(&FlakeRecipe {
                radius_um,
                angles: 4,
                ..SMALL
            })
            .flakes
            .texture
            .grain_um
        };
        let (fine, coarse) = (grain(8.0), grain(40.0));
        assert!(coarse > 1.5 * fine, "{fine} {coarse}");
    }

    #[test]
    fn the_same_seed_is_the_same_patch_and_another_is_not() {
        let small = FlakeRecipe {
            angles: 3,
            texels: 24,
            ..SMALL
        };
        let one = simulated(&small);
        assert_eq!(one, simulated(&small));
        assert_ne!(
            one.flakes,
            simulated(&FlakeRecipe { seed: 4, ..small }).flakes
        );
    }

    #[test]
    fn a_recipe_out_of_range_is_refused_by_field() {
        let recipe = FlakeRecipe {
            tilt: f64::NAN,
            ..SMALL
        };
        let error = simulate_flakes(&silver(), &recipe, &ClusterSettings::default(), &|_, _| {
            ControlFlow::Continue(())
        });
        assert!(error.expect_err("refused").to_string().contains("tilt"));
    }

    #[test]
    fn no_flakes_at_all_are_black_slices() {
        let flakes = simulated(&FlakeRecipe {
            per_mm2: 0.0,
            angles: 2,
            ..SMALL
        })
        .flakes;
        assert_eq!(flakes.clusters(), 4);
        assert_eq!(flakes.slice(0, 0).mean(), [0.0; 3]);
    }
}
