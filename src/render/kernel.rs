//! The paint at eight samples, in single precision: what [`crate::paint::Reflectance`] says, with the flakes of a texel
//! in place of their mean.
//!
//! Formulas and sources stand in `paint`; a test holds this to `Reflectance::terms`. Kernels are specialised by
//! constant arguments for what the paint has: a solid color has no flake code, an uncoated paint no coat code.
//!
//! Besides the value, an evaluation gives the density with which [`Kernel::sample`] would have drawn the light
//! direction: a mixture of the coat's highlight, the lobes (inside the coat) and a cosine, all normalised.

use std::f32::consts::{PI, TAU};

use super::lanes::{Lanes, Lanes3, WIDTH, add, dot, sub, times};
use super::vector::{self, Vec3, along, scale};
use crate::paint::{CarPaint, Coat, FlakeSampler, MIN_ALPHA, QuickBracket, QuickGrid, Reflectance};

/// Cosines are not taken below this; at grazing a pixel must stay finite.
const LEAST_COSINE: f32 = 1e-4;

/// Lobes narrower than this are also drawn by their own shape; wider ones are served by drawing lights alone.
const NARROW: f64 = 0.06;

/// A paint prepared for shading.
#[derive(Debug)]
pub(super) struct Kernel<'a> {
    diffuse: Vec3,
    lobes: Vec<LobeKernel>,
    chi: Vec<Vec3>,
    chi_h: QuickGrid,
    chi_d: QuickGrid,
    coat: CoatKernel,
    flakes: Option<FlakeSampler<'a>>,
    cosine_share: f32,
    /// Whether drawing directions by the paint's own shape pays.
    pub(super) draws: bool,
}

#[derive(Clone, Copy, Debug)]
struct LobeKernel {
    /// `s/π`.
    weight: Vec3,
    inverse_alpha2: f32,
    alpha2: f32,
    f0: f32,
    /// Share of the drawn directions.
    share: f32,
}

#[derive(Clone, Copy, Debug)]
struct CoatKernel {
    ior: f32,
    inverse_ior: f32,
    alpha2: f32,
    /// Share of the drawn directions; 0 for a mirror.
    share: f32,
    mirror: bool,
}

/// The view side of an evaluation, common to all lights.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) outer: Lanes3,
    inner: Lanes3,
    transmission: Lanes,
}

/// Paint towards one light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    /// BRDF, 1/sr.
    pub(super) f: Lanes3,
    /// Density of [`Kernel::sample`], 1/sr.
    pub(super) density: Lanes,
}

/// Numbers of the texels under the samples.
pub(super) type Cells = [u32; WIDTH];

impl<'a> Kernel<'a> {
    #[allow(clippy::cast_possible_truncation)] // pixels are f32
    pub(super) fn new(paint: &'a CarPaint) -> Self {
        let reflectance = Reflectance::new(paint);
        let coat = paint.coat.map_or(CoatKernel::ABSENT, |coat| CoatKernel::new(&coat));
        let present = || paint.lobes.iter().filter(|lobe| !lobe.is_absent());
        let mut lobes: Vec<LobeKernel> = present()
            .map(|lobe| {
                let alpha = lobe.alpha.max(MIN_ALPHA) as f32;
                let weight = lobe.weight.map(|s| s as f32 / PI);
                let bright = weight.iter().fold(0.0_f32, |m, &w| m.max(w)) * (lobe.f0 as f32 + 0.04);
                let alpha2 = alpha * alpha;
                LobeKernel { weight, alpha2, inverse_alpha2: 1.0 / alpha2, f0: lobe.f0 as f32, share: bright }
            })
            .collect();
        let total: f32 = lobes.iter().map(|lobe| lobe.share).sum();
        let rest = 1.0 - coat.share;
        let cosine_share = if total > 0.0 { 0.3 * rest } else { rest };
        for lobe in &mut lobes {
            lobe.share *= (rest - cosine_share) / total.max(f32::MIN_POSITIVE);
        }
        Self {
            diffuse: paint.diffuse.map(|a| a as f32 / PI),
            lobes,
            chi: reflectance.chi_nodes().iter().map(|rgb| rgb.map(|v| v as f32)).collect(),
            chi_h: QuickGrid::new(paint.color_table.theta_h()),
            chi_d: QuickGrid::new(paint.color_table.theta_d()),
            coat,
            flakes: paint.flakes.as_ref().map(FlakeSampler::new),
            cosine_share,
            draws: !coat.mirror || present().any(|lobe| lobe.alpha < NARROW),
        }
    }

    pub(super) fn view<const COATED: bool>(&self, outer: Lanes3) -> View {
        let outer = [outer[0], outer[1], outer[2].at_least(LEAST_COSINE)];
        if !COATED {
            return View { outer, inner: outer, transmission: Lanes::splat(1.0) };
        }
        View { outer, inner: self.coat.refract(outer), transmission: -self.coat.fresnel(outer[2]) + 1.0 }
    }

    /// Weight of the coat's mirror image.
    pub(super) fn mirror(&self, view: &View) -> Lanes {
        if self.coat.mirror { -view.transmission + 1.0 } else { Lanes::splat(0.0) }
    }

    /// BRDF and density for light directions above the horizon; below it the answer means nothing, but is finite.
    #[inline(always)]
    pub(super) fn evaluate<const COATED: bool, const FLAKES: bool>(
        &self,
        view: &View,
        light: Lanes3,
        cells: &Cells,
        contrast: Lanes,
    ) -> Answer {
        let outer = [light[0], light[1], light[2].at_least(LEAST_COSINE)];
        let (mut inner, mut transmission) = (outer, Lanes::splat(1.0));
        let (mut highlight, mut density) = (Lanes::splat(0.0), outer[2] * (self.cosine_share / PI));
        let mut compression = Lanes::splat(1.0);
        if COATED {
            inner = self.coat.refract(outer);
            transmission = view.transmission * (-self.coat.fresnel(outer[2]) + 1.0);
            compression = outer[2] * (self.coat.inverse_ior * self.coat.inverse_ior) / inner[2];
            if !self.coat.mirror {
                let half = Half::of(outer, view.outer);
                let d = half.beckmann(1.0 / self.coat.alpha2) * (1.0 / PI);
                highlight = d * self.coat.fresnel(half.h_o) * 0.25 * half.masking(outer[2], view.outer[2]);
                density = density + d * half.h_z * (self.coat.share * 0.25) / half.h_o;
            }
        }
        let half = Half::of(inner, view.inner);
        let masking = half.masking(inner[2], view.inner[2]);
        let away = -half.h_o + 1.0;
        let schlick = away * away * away * away * away;
        let mut sum = self.diffuse.map(Lanes::splat);
        let mut drawn = Lanes::splat(0.0);
        for lobe in &self.lobes {
            let d = half.beckmann(lobe.inverse_alpha2);
            drawn = drawn + d * lobe.share;
            let shape = d * masking * (schlick * (1.0 - lobe.f0) + lobe.f0);
            sum = std::array::from_fn(|k| sum[k] + shape * lobe.weight[k]);
        }
        if self.draws {
            density = density + drawn * half.h_z * compression / half.h_o * (0.25 / PI);
        }
        let theta_h = Lanes::quadrant_deg(half.across, half.h_z);
        let theta_d = Lanes::quadrant_deg(half.sine2, half.cosine2);
        let mut color = self.chi(theta_h, theta_d);
        color = std::array::from_fn(|k| color[k] * sum[k]);
        if FLAKES && let Some(flakes) = &self.flakes {
            for (k, cell) in cells.iter().enumerate() {
                let (flake, mean) = flakes.color_and_mean(*cell, theta_h.0[k], theta_d.0[k]);
                for c in 0..3 {
                    color[c].0[k] += mean[c] + (flake[c] - mean[c]) * contrast.0[k];
                }
            }
        }
        Answer { f: color.map(|v| (v * transmission + highlight).at_least(0.0)), density }
    }

    #[inline(always)]
    fn chi(&self, theta_h: Lanes, theta_d: Lanes) -> Lanes3 {
        if let [single] = self.chi.as_slice() {
            return single.map(Lanes::splat);
        }
        let mut color = [Lanes::splat(0.0); 3];
        for k in 0..WIDTH {
            let (row, column) = (self.chi_h.bracket(theta_h.0[k]), self.chi_d.bracket(theta_d.0[k]));
            let node = bilinear(&self.chi, self.chi_d.len(), row, column);
            super::lanes::set(&mut color, k, node);
        }
        color
    }

    /// Draws a light direction for one sample by the shape of highlight and lobes; `None` where it would come from
    /// below or be caught inside.
    pub(super) fn sample<const COATED: bool>(
        &self,
        view: &View,
        k: usize,
        pick: f32,
        [u, v]: [f32; 2],
    ) -> Option<Vec3> {
        let mut rest = pick - self.cosine_share;
        if rest < 0.0 {
            let (r, turn) = (u.sqrt(), v * TAU);
            return Some([r * turn.cos(), r * turn.sin(), (1.0 - u).max(0.0).sqrt()]);
        }
        if COATED && !self.coat.mirror {
            rest -= self.coat.share;
            if rest < 0.0 {
                return mirrored(super::lanes::get(&view.outer, k), beckmann_half(self.coat.alpha2, u, v));
            }
        }
        let last = self.lobes.len().checked_sub(1)?;
        for (index, lobe) in self.lobes.iter().enumerate() {
            rest -= lobe.share;
            if rest < 0.0 || index == last {
                let inner = mirrored(super::lanes::get(&view.inner, k), beckmann_half(lobe.alpha2, u, v))?;
                return if COATED { self.coat.leave(inner) } else { Some(inner) };
            }
        }
        None
    }
}

fn beckmann_half(alpha2: f32, u: f32, v: f32) -> Vec3 {
    let tan2 = -alpha2 * (1.0 - u).ln();
    let cos = 1.0 / (1.0 + tan2).sqrt();
    let (sin, turn) = ((1.0 - cos * cos).max(0.0).sqrt(), v * TAU);
    [sin * turn.cos(), sin * turn.sin(), cos]
}

fn mirrored(o: Vec3, h: Vec3) -> Option<Vec3> {
    let h_o = vector::dot(h, o);
    let i = along(scale(h, 2.0 * h_o), o, -1.0);
    (h_o > 0.0 && i[2] > 0.0).then_some(i)
}

impl CoatKernel {
    const ABSENT: Self = Self { ior: 1.0, inverse_ior: 1.0, alpha2: 0.0, share: 0.0, mirror: true };

    #[allow(clippy::cast_possible_truncation)]
    fn new(coat: &Coat) -> Self {
        if coat.ior <= 1.0 {
            return Self::ABSENT;
        }
        let (ior, roughness, mirror) = (coat.ior as f32, coat.roughness as f32, coat.is_mirror());
        let share = if mirror { 0.0 } else { 0.5 };
        Self { ior, inverse_ior: 1.0 / ior, alpha2: roughness * roughness, share, mirror }
    }

    #[inline(always)]
    fn refract(&self, w: Lanes3) -> Lanes3 {
        let (x, y) = (w[0] * self.inverse_ior, w[1] * self.inverse_ior);
        [x, y, (-(x * x + y * y) + 1.0).at_least(LEAST_COSINE * LEAST_COSINE).sqrt()]
    }

    fn leave(&self, w: Vec3) -> Option<Vec3> {
        let (x, y) = (w[0] * self.ior, w[1] * self.ior);
        let z2 = 1.0 - x * x - y * y;
        (z2 > 0.0).then(|| [x, y, z2.sqrt()])
    }

    #[inline(always)]
    fn fresnel(&self, cos: Lanes) -> Lanes {
        let inner = ((cos * cos - 1.0) * (self.inverse_ior * self.inverse_ior) + 1.0).at_least(0.0).sqrt();
        let s = (cos - inner * self.ior) / (cos + inner * self.ior);
        let p = (cos * self.ior - inner) / (cos * self.ior + inner);
        (s * s + p * p) * 0.5
    }
}

/// Half vectors of directions above the horizon.
#[derive(Clone, Copy, Debug)]
struct Half {
    across: Lanes,
    tan2: Lanes,
    inverse_z4: Lanes,
    h_z: Lanes,
    h_o: Lanes,
    /// Twice sine and cosine of θd.
    sine2: Lanes,
    cosine2: Lanes,
}

impl Half {
    #[inline(always)]
    fn of(i: Lanes3, o: Lanes3) -> Self {
        let (sum, difference) = (add(i, o), sub(i, o));
        let cosine2 = dot(sum, sum).at_least(1e-12).sqrt();
        let sine2 = dot(difference, difference).sqrt();
        let h = times(sum, Lanes::splat(1.0) / cosine2);
        let across2 = h[0] * h[0] + h[1] * h[1];
        let inverse_z2 = Lanes::splat(1.0) / (h[2] * h[2]);
        Self {
            across: across2.sqrt(),
            tan2: across2 * inverse_z2,
            inverse_z4: inverse_z2 * inverse_z2,
            h_z: h[2],
            h_o: cosine2 / (sine2 * sine2 + cosine2 * cosine2).sqrt(),
            sine2,
            cosine2,
        }
    }

    /// D without 1/π.
    #[inline(always)]
    fn beckmann(&self, inverse_alpha2: f32) -> Lanes {
        (self.tan2 * inverse_alpha2).exp_of_negative() * inverse_alpha2 * self.inverse_z4
    }

    #[inline(always)]
    fn masking(&self, i_z: Lanes, o_z: Lanes) -> Lanes {
        (Lanes::splat(1.0) / (i_z * o_z)).min(self.h_z * 2.0 / (self.h_o * i_z.max(o_z)))
    }
}

fn bilinear(table: &[Vec3], columns: usize, row: QuickBracket, column: QuickBracket) -> Vec3 {
    let at = |r: usize, c: usize| table[r * columns + c];
    let across = |r: usize| {
        let (low, high) = (at(r, column.low), at(r, column.high));
        along(scale(low, 1.0 - column.fraction), high, column.fraction)
    };
    along(scale(across(row.low), 1.0 - row.fraction), across(row.high), row.fraction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::Lab;
    use crate::paint::{AngleGrid, Chi, ColorTable, Direction, Lobe};
    use crate::render::lanes::{get, splat3};
    use proptest::prelude::*;

    fn paint(coat: Option<Coat>) -> CarPaint {
        let grid = |d: &[f64]| AngleGrid::new(d.to_vec()).expect("ascending");
        let nodes =
            (0..12).map(|k| Lab { l: 95.0 - 6.0 * f64::from(k), a: 20.0 - f64::from(k), b: 4.0 * f64::from(k) });
        let (rows, columns) = (grid(&[0.0, 7.0, 25.0, 60.0]), grid(&[0.0, 20.0, 66.0]));
        let overall = Lab { l: 70.0, a: 0.0, b: 0.0 };
        CarPaint {
            coat,
            diffuse: [0.3, 0.2, 0.1],
            lobes: vec![
                Lobe { weight: [0.05, 0.06, 0.07], alpha: 0.4, f0: 0.3 },
                Lobe { weight: [0.01; 3], alpha: 0.09, f0: 0.6 },
            ],
            color_table: ColorTable::new(rows, columns, nodes.collect(), overall).expect("fits"),
            flakes: None,
        }
    }

    fn direction(z: f64, turn: f64) -> Direction {
        let r = (1.0 - z * z).sqrt();
        [r * turn.cos(), r * turn.sin(), z]
    }

    #[allow(clippy::cast_possible_truncation)]
    fn single(w: Direction) -> Lanes3 {
        splat3(w.map(|v| v as f32))
    }

    fn answer<const COATED: bool>(paint: &CarPaint, wi: Direction, wo: Direction) -> Answer {
        let kernel = Kernel::new(paint);
        let view = kernel.view::<COATED>(single(wo));
        kernel.evaluate::<COATED, false>(&view, single(wi), &[0; WIDTH], Lanes::splat(1.0))
    }

    proptest! {
        #[test]
        fn the_kernel_says_what_the_reflectance_says(
            iz in 0.02..1.0_f64, oz in 0.02..1.0_f64, turn in 0.0..std::f64::consts::TAU, ior in 1.05..2.5_f64, rough in 0.0..0.3_f64,
        ) {
            let (wi, wo) = (direction(iz, turn), direction(oz, 0.0));
            for coat in [None, Some(Coat { ior, roughness: rough, thickness_um: None })] {
                let paint = paint(coat);
                let want = Reflectance::new(&paint).evaluate(wi, wo, Chi::Table);
                let got = if coat.is_some() { answer::<true>(&paint, wi, wo) } else { answer::<false>(&paint, wi, wo) };
                for (x, y) in get(&got.f, 2).iter().zip(want) {
                    // An f32 unit vector is off by 6e-8; a lobe of width 0.02 turns that into 1e-5 of its value per
                    // width, times the distance from the peak.
                    prop_assert!((f64::from(*x) - y).abs() <= 2e-3 * y + 1e-5, "{x} instead of {y}");
                }
            }
        }

        #[test]
        fn nothing_is_infinite_at_grazing(
            iz in 0.0..1e-3_f64, oz in 0.0..1e-3_f64, turn in 0.0..std::f64::consts::TAU, rough in 0.0..0.3_f64,
        ) {
            let paint = paint(Some(Coat { ior: 1.5, roughness: rough, thickness_um: None }));
            let got = answer::<true>(&paint, direction(iz, turn), direction(oz, 0.0));
            prop_assert!(get(&got.f, 0).iter().all(|v| v.is_finite() && *v >= 0.0));
            prop_assert!(got.density.0[0].is_finite());
        }
    }

    /// Directions drawn by the kernel, weighted by one over their stated density, must cover the hemisphere.
    #[test]
    fn drawn_directions_have_their_stated_density() {
        for roughness in [0.0, 0.08] {
            let paint = paint(Some(Coat { ior: 1.5, roughness, thickness_um: None }));
            let mut kernel = Kernel::new(&paint);
            kernel.draws = true;
            let wo = direction(0.7, 0.0);
            let view = kernel.view::<true>(single(wo));
            let points = super::super::points::Points::of_pixel(0, 0, 1 << 16, 5);
            let mut sum = 0.0_f64;
            for k in 0..1 << 16 {
                let Some(light) = kernel.sample::<true>(&view, 0, points.pair(k, 1)[0], points.pair(k, 0)) else {
                    continue;
                };
                let light = splat3(light);
                let answer = kernel.evaluate::<true, false>(&view, light, &[0; WIDTH], Lanes::splat(1.0));
                sum += f64::from(light[2].0[0] / answer.density.0[0]);
            }
            let projected = sum / f64::from(1 << 16);
            assert!((projected / std::f64::consts::PI - 1.0).abs() < 0.01, "{roughness}: {projected}");
        }
    }
}
