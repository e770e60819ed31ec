//! The paint at one sample, in single precision: what [`crate::paint::Reflectance`] says, with the flakes of a texel
//! in place of their mean.
//!
//! Formulas and sources stand in `paint`; a test holds this to `Reflectance::terms`. Kernels are specialised by
//! constant arguments for what the paint has: a solid color has no flake code, an uncoated paint no coat code.
//!
//! Besides the value, an evaluation gives the density with which [`Kernel::sample`] would have drawn the light
//! direction: a mixture of the coat's highlight, the lobes (inside the coat) and a cosine, all normalised.

use std::f32::consts::PI;

use super::vector::{Vec3, along, dot, scale};
use crate::paint::{CarPaint, Coat, FlakeSampler, MIN_ALPHA, QuickBracket, QuickGrid, Reflectance};

/// Cosines are not taken below this; at grazing a pixel must stay finite.
const LEAST_COSINE: f32 = 1e-4;

/// A paint prepared for shading.
#[derive(Debug)]
pub(super) struct Kernel<'a> {
    diffuse: Vec3,
    lobes: Vec<LobeKernel>,
    chi: Vec<Vec3>,
    chi_h: QuickGrid,
    chi_d: QuickGrid,
    coat: CoatKernel,
    pub(super) flakes: Option<FlakeSampler<'a>>,
    cosine_share: f32,
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
    pub(super) outer: Vec3,
    inner: Vec3,
    transmission: f32,
}

/// Which texel is looked at.
pub(super) type Cell = u32;

impl<'a> Kernel<'a> {
    #[allow(clippy::cast_possible_truncation)] // pixels are f32
    pub(super) fn new(paint: &'a CarPaint, flakes: bool) -> Self {
        let reflectance = Reflectance::new(paint);
        let coat = paint.coat.map_or(CoatKernel::ABSENT, |coat| CoatKernel::new(&coat));
        let present = paint.lobes.iter().filter(|lobe| !lobe.is_absent());
        let mut lobes: Vec<LobeKernel> = present
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
            flakes: paint.flakes.as_ref().filter(|_| flakes).map(FlakeSampler::new),
            cosine_share,
        }
    }

    pub(super) fn view<const COATED: bool>(&self, outer: Vec3) -> View {
        let outer = [outer[0], outer[1], outer[2].max(LEAST_COSINE)];
        if !COATED {
            return View { outer, inner: outer, transmission: 1.0 };
        }
        View { outer, inner: self.coat.refract(outer), transmission: 1.0 - self.coat.fresnel(outer[2]) }
    }

    /// Weight of the coat's mirror image.
    pub(super) fn mirror(&self, view: &View) -> f32 {
        if self.coat.mirror { 1.0 - view.transmission } else { 0.0 }
    }

    /// BRDF in 1/sr and the density of [`Kernel::sample`] for a light direction above the horizon.
    pub(super) fn evaluate<const COATED: bool, const FLAKES: bool>(
        &self,
        view: &View,
        light: Vec3,
        cell: Cell,
    ) -> (Vec3, f32) {
        let outer = [light[0], light[1], light[2].max(LEAST_COSINE)];
        let (mut inner, mut transmission) = (outer, 1.0);
        let (mut highlight, mut density) = (0.0, self.cosine_share * outer[2] / PI);
        let mut compression = 1.0;
        if COATED {
            inner = self.coat.refract(outer);
            transmission = view.transmission * (1.0 - self.coat.fresnel(outer[2]));
            compression = self.coat.inverse_ior * self.coat.inverse_ior * outer[2] / inner[2];
            if !self.coat.mirror {
                let half = Half::of(outer, view.outer);
                let d = half.beckmann(1.0 / self.coat.alpha2) / PI;
                highlight = d * self.coat.fresnel(half.h_o) / 4.0 * half.masking(outer[2], view.outer[2]);
                density += self.coat.share * d * half.h_z / (4.0 * half.h_o);
            }
        }
        let half = Half::of(inner, view.inner);
        let masking = half.masking(inner[2], view.inner[2]);
        let away = 1.0 - half.h_o;
        let schlick = away * away * away * away * away;
        let mut sum = self.diffuse;
        let mut drawn = 0.0;
        for lobe in &self.lobes {
            let d = half.beckmann(lobe.inverse_alpha2);
            drawn += lobe.share * d;
            sum = along(sum, lobe.weight, d * masking * (lobe.f0 + (1.0 - lobe.f0) * schlick));
        }
        density += drawn / PI * half.h_z / (4.0 * half.h_o) * compression;

        let (theta_h, theta_d) = half.angles_deg();
        let chi = bilinear(&self.chi, self.chi_d_len(), self.chi_h.bracket(theta_h), self.chi_d.bracket(theta_d));
        let mut base: Vec3 = std::array::from_fn(|k| chi[k] * sum[k]);
        if FLAKES && let Some(flakes) = &self.flakes {
            let flake = flakes.color(cell, theta_h, theta_d);
            base = [base[0] + flake[0], base[1] + flake[1], base[2] + flake[2]];
        }
        (base.map(|v| (transmission * v + highlight).max(0.0)), density)
    }

    fn chi_d_len(&self) -> usize {
        self.chi_d.len()
    }

    /// Draws a light direction by the shape of highlight and lobes; `None` where it would come from below or inside.
    pub(super) fn sample<const COATED: bool>(&self, view: &View, pick: f32, [u, v]: [f32; 2]) -> Option<Vec3> {
        let mut rest = pick - self.cosine_share;
        if rest < 0.0 {
            let (r, turn) = (u.sqrt(), v * std::f32::consts::TAU);
            return Some([r * turn.cos(), r * turn.sin(), (1.0 - u).max(0.0).sqrt()]);
        }
        if COATED && !self.coat.mirror {
            rest -= self.coat.share;
            if rest < 0.0 {
                return mirrored(view.outer, beckmann_half(self.coat.alpha2, u, v));
            }
        }
        let last = self.lobes.len().checked_sub(1)?;
        for (k, lobe) in self.lobes.iter().enumerate() {
            rest -= lobe.share;
            if rest < 0.0 || k == last {
                let inner = mirrored(view.inner, beckmann_half(lobe.alpha2, u, v))?;
                return if COATED { self.coat.leave(inner) } else { Some(inner) };
            }
        }
        None
    }
}

fn beckmann_half(alpha2: f32, u: f32, v: f32) -> Vec3 {
    let tan2 = -alpha2 * (1.0 - u).ln();
    let cos = 1.0 / (1.0 + tan2).sqrt();
    let (sin, turn) = ((1.0 - cos * cos).max(0.0).sqrt(), v * std::f32::consts::TAU);
    [sin * turn.cos(), sin * turn.sin(), cos]
}

fn mirrored(o: Vec3, h: Vec3) -> Option<Vec3> {
    let h_o = dot(h, o);
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

    fn refract(&self, w: Vec3) -> Vec3 {
        let (x, y) = (w[0] * self.inverse_ior, w[1] * self.inverse_ior);
        [x, y, (1.0 - x * x - y * y).max(LEAST_COSINE * LEAST_COSINE).sqrt()]
    }

    fn leave(&self, w: Vec3) -> Option<Vec3> {
        let (x, y) = (w[0] * self.ior, w[1] * self.ior);
        let z2 = 1.0 - x * x - y * y;
        (z2 > 0.0).then(|| [x, y, z2.sqrt()])
    }

    fn fresnel(&self, cos: f32) -> f32 {
        let cos = cos.clamp(0.0, 1.0);
        let inner = (1.0 - (1.0 - cos * cos) * self.inverse_ior * self.inverse_ior).max(0.0).sqrt();
        let s = (cos - self.ior * inner) / (cos + self.ior * inner);
        let p = (self.ior * cos - inner) / (self.ior * cos + inner);
        0.5 * (s * s + p * p)
    }
}

/// Half vector of two directions above the horizon.
#[derive(Clone, Copy, Debug)]
struct Half {
    across: f32,
    h_z: f32,
    h_o: f32,
    sine2: f32,
    cosine2: f32,
}

impl Half {
    fn of(i: Vec3, o: Vec3) -> Self {
        let (sum, difference) = ([i[0] + o[0], i[1] + o[1], i[2] + o[2]], [i[0] - o[0], i[1] - o[1], i[2] - o[2]]);
        let cosine2 = dot(sum, sum).sqrt();
        let sine2 = dot(difference, difference).sqrt();
        let inverse = 1.0 / cosine2;
        let across = (sum[0] * sum[0] + sum[1] * sum[1]).sqrt() * inverse;
        let norm = 1.0 / (sine2 * sine2 + cosine2 * cosine2).sqrt();
        Self { across, h_z: sum[2] * inverse, h_o: cosine2 * norm, sine2, cosine2 }
    }

    /// D without 1/π.
    fn beckmann(&self, inverse_alpha2: f32) -> f32 {
        let z2 = self.h_z * self.h_z;
        (-self.across * self.across / z2 * inverse_alpha2).exp() * inverse_alpha2 / (z2 * z2)
    }

    fn masking(&self, i_z: f32, o_z: f32) -> f32 {
        (1.0 / (i_z * o_z)).min(2.0 * self.h_z / (self.h_o * i_z.max(o_z)))
    }

    fn angles_deg(&self) -> (f32, f32) {
        (quadrant_deg(self.across, self.h_z), quadrant_deg(self.sine2, self.cosine2))
    }
}

/// Angle of a point of the first quadrant, degrees, to 3e-5°.
///
/// `atan` on 0..1 by an odd polynomial of degree 13, fitted here for the least maximal error (2.5e-7 rad).
fn quadrant_deg(y: f32, x: f32) -> f32 {
    let (small, large) = if y < x { (y, x) } else { (x, y) };
    let t = if large > 0.0 { small / large } else { 0.0 };
    let t2 = t * t;
    let p = ATAN.iter().rev().fold(0.0, |p, c| p * t2 + c);
    let angle = t * p * (180.0 / PI);
    if y < x { angle } else { 90.0 - angle }
}

const ATAN: [f32; 7] =
    [0.999_996_1, -0.333_173_7, 0.198_078_15, -0.132_333_4, 0.079_623_62, -0.033_604_17, 0.006_811_78];

fn bilinear(table: &[Vec3], columns: usize, row: QuickBracket, column: QuickBracket) -> Vec3 {
    let at = |r: usize, c: usize| table[r * columns + c];
    let across = |r: usize| {
        let (low, high) = (at(r, column.low), at(r, column.high));
        along(scale(low, 1.0 - column.fraction), high, column.fraction)
    };
    along(scale(across(row.low), 1.0 - row.fraction), across(row.high), row.fraction)
}
