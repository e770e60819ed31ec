//! The paint at eight samples, in single precision: what [`crate::paint::Reflectance`] says, with the flakes of a texel
//! in place of their mean.
//!
//! Formulas and sources stand in `paint`; a test holds this to `Reflectance::terms`. Kernels are specialised by
//! constant arguments for what the paint has: a solid color has no flake code, an uncoated paint no coat code.
//!
//! Besides the value, an evaluation gives the density with which [`Kernel::sample`] would have drawn the light
//! direction: a mixture of the coat's highlight, the lobes (inside the coat) and a cosine, all normalised.

#![allow(clippy::inline_always)] // one kernel per kind of paint, without calls inside

use std::f32::consts::{PI, TAU};

use super::lanes::{Lanes, Lanes3, WIDTH, get, set};
use super::optics::{CoatKernel, Half, LEAST_COSINE, beckmann_half, mirrored};
use super::vector::{Vec3, along, mix, scale};
use crate::paint::{CarPaint, FlakeSampler, MIN_ALPHA, QuickBracket, QuickGrid, Reflectance};

/// Lobes that look narrower than this are also drawn by their own shape; wider ones are served by drawing lights alone.
const NARROW: f32 = 0.05;

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
    /// Cosine of the view up to which a lobe looks narrow: towards grazing its image shrinks with the cosine.
    narrow_below: f32,
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

/// The view side of an evaluation, common to all lights.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) outer: Lanes3,
    inner: Lanes3,
    transmission: Lanes,
    /// Whether drawing directions by the paint's own shape pays.
    pub(super) draws: bool,
}

/// Paint towards one light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    /// BRDF, 1/sr. A texel's sensor noise may make it negative; a pixel is clamped, so that its mean stays right.
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
        let coat = paint
            .coat
            .map_or(CoatKernel::ABSENT, |coat| CoatKernel::new(&coat));
        let present = || paint.lobes.iter().filter(|lobe| !lobe.is_absent());
        let mut lobes: Vec<LobeKernel> = present()
            .map(|lobe| {
                let alpha = lobe.alpha.max(MIN_ALPHA) as f32;
                let weight = lobe.weight.map(|s| s as f32 / PI);
                let bright =
                    weight.iter().fold(0.0_f32, |m, &w| m.max(w)) * (lobe.f0 as f32 + 0.04);
                let alpha2 = alpha * alpha;
                LobeKernel {
                    weight,
                    alpha2,
                    inverse_alpha2: 1.0 / alpha2,
                    f0: lobe.f0 as f32,
                    share: bright,
                }
            })
            .collect();
        let total: f32 = lobes.iter().map(|lobe| lobe.share).sum();
        let rest = 1.0 - coat.share;
        let cosine_share = if total > 0.0 { 0.3 * rest } else { rest };
        for lobe in &mut lobes {
            lobe.share *= (rest - cosine_share) / total.max(f32::MIN_POSITIVE);
        }
        let narrow_below = if coat.mirror {
            let narrowest = lobes.iter().map(|lobe| lobe.alpha2.sqrt());
            NARROW / narrowest.fold(f32::INFINITY, f32::min)
        } else {
            f32::INFINITY
        };
        Self {
            diffuse: paint.diffuse.map(|a| a as f32 / PI),
            lobes,
            chi: reflectance
                .chi_nodes()
                .iter()
                .map(|rgb| rgb.map(|v| v as f32))
                .collect(),
            chi_h: QuickGrid::new(paint.color_table.theta_h()),
            chi_d: QuickGrid::new(paint.color_table.theta_d()),
            coat,
            flakes: paint.flakes.as_ref().map(FlakeSampler::new),
            cosine_share,
            narrow_below,
        }
    }

    pub(super) fn view<const COATED: bool>(&self, outer: Lanes3) -> View {
        let outer = [outer[0], outer[1], outer[2].at_least(LEAST_COSINE)];
        let inner = if COATED {
            self.coat.refract(outer)
        } else {
            outer
        };
        View {
            outer,
            inner,
            transmission: if COATED {
                -self.coat.fresnel(outer[2]) + 1.0
            } else {
                Lanes::splat(1.0)
            },
            draws: inner[2].0.iter().any(|&z| z < self.narrow_below),
        }
    }

    /// Weight of the coat's mirror image.
    pub(super) fn mirror(&self, view: &View) -> Lanes {
        if self.coat.mirror {
            -view.transmission + 1.0
        } else {
            Lanes::splat(0.0)
        }
    }

    /// BRDF and density for light directions above the horizon; below it the answer means nothing, but is finite.
    ///
    /// Flakes show their mean and `contrast` times their deviation from it; without a contrast the mean alone.
    #[inline(always)]
    pub(super) fn evaluate<const COATED: bool, const FLAKES: bool>(
        &self,
        view: &View,
        light: Lanes3,
        cells: &Cells,
        contrast: Option<Lanes>,
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
                highlight =
                    d * self.coat.fresnel(half.h_o) * 0.25 * half.masking(outer[2], view.outer[2]);
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
        if view.draws {
            density = density + drawn * half.h_z * compression / half.h_o * (0.25 / PI);
        }
        let theta_h = Lanes::quadrant_deg(half.across, half.h_z);
        let theta_d = Lanes::quadrant_deg(half.sine2, half.cosine2);
        let mut color = self.chi(theta_h, theta_d);
        color = std::array::from_fn(|k| color[k] * sum[k]);
        if FLAKES && let Some(flakes) = &self.flakes {
            for (k, cell) in cells.iter().enumerate() {
                let flake = match contrast {
                    Some(contrast) => {
                        let (flake, mean) =
                            flakes.color_and_mean(*cell, theta_h.0[k], theta_d.0[k]);
                        mix(mean, flake, contrast.0[k])
                    }
                    None => flakes.mean(theta_h.0[k], theta_d.0[k]),
                };
                for (lanes, value) in color.iter_mut().zip(flake) {
                    lanes.0[k] += value;
                }
            }
        }
        Answer {
            f: color.map(|v| v * transmission + highlight),
            density,
        }
    }

    #[inline(always)]
    fn chi(&self, theta_h: Lanes, theta_d: Lanes) -> Lanes3 {
        if let [single] = self.chi.as_slice() {
            return single.map(Lanes::splat);
        }
        let mut color = [Lanes::splat(0.0); 3];
        for k in 0..WIDTH {
            let (row, column) = (
                self.chi_h.bracket(theta_h.0[k]),
                self.chi_d.bracket(theta_d.0[k]),
            );
            let node = bilinear(&self.chi, self.chi_d.len(), row, column);
            set(&mut color, k, node);
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
                return mirrored(get(&view.outer, k), beckmann_half(self.coat.alpha2, u, v));
            }
        }
        let last = self.lobes.len().checked_sub(1)?;
        for (index, lobe) in self.lobes.iter().enumerate() {
            rest -= lobe.share;
            if rest < 0.0 || index == last {
                let inner = mirrored(get(&view.inner, k), beckmann_half(lobe.alpha2, u, v))?;
                return if COATED {
                    self.coat.leave(inner)
                } else {
                    Some(inner)
                };
            }
        }
        None
    }
}

fn bilinear(table: &[Vec3], columns: usize, row: QuickBracket, column: QuickBracket) -> Vec3 {
    let at = |r: usize, c: usize| table[r * columns + c];
    let across = |r: usize| {
        let (low, high) = (at(r, column.low), at(r, column.high));
        along(scale(low, 1.0 - column.fraction), high, column.fraction)
    };
    along(
        scale(across(row.low), 1.0 - row.fraction),
        across(row.high),
        row.fraction,
    )
}

#[cfg(test)]
mod tests;
