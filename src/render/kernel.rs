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
            draws: !coat.mirror || present().any(|lobe| lobe.alpha < NARROW),
        }
    }

    pub(super) fn view<const COATED: bool>(&self, outer: Lanes3) -> View {
        let outer = [outer[0], outer[1], outer[2].at_least(LEAST_COSINE)];
        if !COATED {
            return View {
                outer,
                inner: outer,
                transmission: Lanes::splat(1.0),
            };
        }
        View {
            outer,
            inner: self.coat.refract(outer),
            transmission: -self.coat.fresnel(outer[2]) + 1.0,
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
        if self.draws {
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
mod tests {
    use super::*;
    use crate::color::Lab;
    use crate::paint::{AngleGrid, Chi, Coat, ColorTable, Direction, Lobe};
    use crate::render::lanes::splat3;
    use proptest::prelude::*;

    fn paint(coat: Option<Coat>) -> CarPaint {
        let grid = |d: &[f64]| AngleGrid::new(d.to_vec()).expect("ascending");
        let nodes = (0..12).map(|k| Lab {
            l: 95.0 - 6.0 * f64::from(k),
            a: 20.0 - f64::from(k),
            b: 4.0 * f64::from(k),
        });
        let (rows, columns) = (grid(&[0.0, 7.0, 25.0, 60.0]), grid(&[0.0, 20.0, 66.0]));
        let overall = Lab {
            l: 70.0,
            a: 0.0,
            b: 0.0,
        };
        CarPaint {
            coat,
            diffuse: [0.3, 0.2, 0.1],
            lobes: vec![
                Lobe {
                    weight: [0.05, 0.06, 0.07],
                    alpha: 0.4,
                    f0: 0.3,
                },
                Lobe {
                    weight: [0.01; 3],
                    alpha: 0.09,
                    f0: 0.6,
                },
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
        kernel.evaluate::<COATED, false>(&view, single(wi), &[0; WIDTH], None)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn the_kernel_says_what_the_reflectance_says(
            iz in 0.02..1.0_f64, oz in 0.02..1.0_f64, turn in 0.0..std::f64::consts::TAU, ior in 1.0..2.5_f64, rough in 0.0..0.3_f64,
        ) {
            let (wi, wo) = (direction(iz, turn), direction(oz, 0.0));
            for coat in [None, Some(Coat { ior, roughness: rough, thickness_um: None })] {
                let paint = paint(coat);
                let want = Reflectance::new(&paint).evaluate(wi, wo, Chi::Table);
                let got = if coat.is_some() { answer::<true>(&paint, wi, wo) } else { answer::<false>(&paint, wi, wo) };
                // At a cosine of 0.02 the half vector of f32 directions is off by 2.5e-6; out to four widths that turns
                // a lobe by up to 2e-5 over its width, doubled for the coat's own rounding.
                let narrowest = if coat.is_some() && rough >= Coat::MIRROR_ROUGHNESS { rough.min(0.09) } else { 0.09 };
                let accepted = 2e-3 + 5e-5 / narrowest;
                for (x, y) in get(&got.f, 2).iter().zip(want) {
                    // The kernel leaves the clamp at 0 to the pixel.
                    let x = f64::from(x.max(0.0));
                    prop_assert!((x - y).abs() <= accepted * y + 1e-5, "{x} instead of {y}");
                }
            }
        }

        #[test]
        fn nothing_is_infinite_at_grazing(
            iz in 0.0..1e-3_f64, oz in 0.0..1e-3_f64, turn in 0.0..std::f64::consts::TAU, rough in 0.0..0.3_f64,
        ) {
            let paint = paint(Some(Coat { ior: 1.5, roughness: rough, thickness_um: None }));
            let got = answer::<true>(&paint, direction(iz, turn), direction(oz, 0.0));
            prop_assert!(get(&got.f, 0).iter().all(|v| v.is_finite()));
            prop_assert!(got.density.0[0].is_finite());
        }
    }

    /// χ² over 8 bands of height and 8 of azimuth: how often directions are drawn against the integral of the density.
    #[test]
    fn drawn_directions_fall_where_their_density_says() {
        for (coat, roughness) in [(true, 0.0), (true, 0.08), (false, 0.0)] {
            let coat = coat.then_some(Coat {
                ior: 1.5,
                roughness,
                thickness_um: None,
            });
            if coat.is_some() {
                assert_drawn_by_density::<true>(&paint(coat));
            } else {
                assert_drawn_by_density::<false>(&paint(coat));
            }
        }
    }

    fn assert_drawn_by_density<const COATED: bool>(paint: &CarPaint) {
        const DRAWS: u32 = 1 << 16;
        let mut kernel = Kernel::new(paint);
        kernel.draws = true;
        let view = kernel.view::<COATED>(single(direction(0.7, 0.0)));
        let points = super::super::points::Points::of_pixel(0, 0, DRAWS, 5);
        let mut counts = [0.0_f64; 64];
        for k in 0..DRAWS {
            let (pick, pair) = (points.pair(k, 1)[0], points.pair(k, 0));
            let Some(light) = kernel.sample::<COATED>(&view, 0, pick, pair) else {
                continue;
            };
            let turn = light[1].atan2(light[0]) / TAU;
            let band = ((light[2] * 8.0) as usize).min(7);
            counts[8 * band + ((turn - turn.floor()) * 8.0).min(7.0) as usize] += 1.0;
        }
        let (mut statistic, mut cells) = (0.0, 0.0);
        for (cell, count) in counts.iter().enumerate() {
            let mut density = 0.0;
            let steps = 60_u32;
            for k in 0..steps * steps {
                let part = |k: u32| (f64::from(k) + 0.5) / f64::from(steps);
                let z = ((cell / 8) as f64 + part(k / steps)) / 8.0;
                let turn = ((cell % 8) as f64 + part(k % steps)) / 8.0 * std::f64::consts::TAU;
                let light = single(direction(z, turn));
                let answer = kernel.evaluate::<COATED, false>(&view, light, &[0; WIDTH], None);
                density += f64::from(answer.density.0[0]);
            }
            let solid = std::f64::consts::TAU / 64.0 / f64::from(steps * steps);
            let expected = density * solid * f64::from(DRAWS);
            if expected >= 5.0 {
                statistic += (count - expected).powi(2) / expected;
                cells += 1.0;
            } else {
                assert!(
                    *count < 30.0,
                    "{count} draws where {expected} were expected"
                );
            }
        }
        // k + 6 √(2k); the midpoint rule on lobes of a few of its steps adds no more than that again.
        let limit: f64 = 2.0 * (cells + 6.0 * f64::sqrt(2.0 * cells));
        assert!(
            cells > 20.0 && statistic < limit,
            "χ² {statistic} of {cells} cells"
        );
    }

    /// Directions drawn by the kernel, weighted by one over their stated density, must cover the hemisphere.
    #[test]
    fn drawn_directions_have_their_stated_density() {
        for roughness in [0.0, 0.08] {
            let paint = paint(Some(Coat {
                ior: 1.5,
                roughness,
                thickness_um: None,
            }));
            let mut kernel = Kernel::new(&paint);
            kernel.draws = true;
            let wo = direction(0.7, 0.0);
            let view = kernel.view::<true>(single(wo));
            let points = super::super::points::Points::of_pixel(0, 0, 1 << 16, 5);
            let mut sum = 0.0_f64;
            for k in 0..1 << 16 {
                let Some(light) =
                    kernel.sample::<true>(&view, 0, points.pair(k, 1)[0], points.pair(k, 0))
                else {
                    continue;
                };
                let light = splat3(light);
                let answer = kernel.evaluate::<true, false>(&view, light, &[0; WIDTH], None);
                sum += f64::from(light[2].0[0] / answer.density.0[0]);
            }
            let projected = sum / f64::from(1 << 16);
            assert!(
                (projected / std::f64::consts::PI - 1.0).abs() < 0.01,
                "{roughness}: {projected}"
            );
        }
    }
}
