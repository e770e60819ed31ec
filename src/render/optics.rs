//! Half vectors, the lobes' common factors and the clear coat, for eight samples in single precision.
//!
//! Formulas as in `paint` (`direction`, `lobe`, `coat`), without branches, finite for every direction whose cosine is at
//! least [`LEAST_COSINE`].
#![allow(clippy::inline_always)] // calls between these few operations would cost more than they do

use std::f32::consts::TAU;

use super::lanes::{Lanes, Lanes3, add, dot, sub, times};
use super::vector::{self, Vec3, along, scale};
use crate::paint::Coat;

/// Cosines are not taken below this; at grazing a pixel must stay finite.
pub(super) const LEAST_COSINE: f32 = 1e-4;

/// A coat prepared for shading.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoatKernel {
    pub(super) ior: f32,
    pub(super) inverse_ior: f32,
    /// `ior² − 1`, without cancellation.
    excess: f32,
    pub(super) alpha2: f32,
    /// Share of the drawn directions; 0 for a mirror.
    pub(super) share: f32,
    pub(super) mirror: bool,
}

impl CoatKernel {
    pub(super) const ABSENT: Self = Self {
        ior: 1.0,
        inverse_ior: 1.0,
        excess: 0.0,
        alpha2: 0.0,
        share: 0.0,
        mirror: true,
    };

    #[allow(clippy::cast_possible_truncation)]
    pub(super) fn new(coat: &Coat) -> Self {
        if coat.ior <= 1.0 {
            return Self::ABSENT;
        }
        let (ior, roughness, mirror) = (coat.ior as f32, coat.roughness as f32, coat.is_mirror());
        let share = if mirror { 0.0 } else { 0.7 };
        let excess = ((coat.ior - 1.0) * (coat.ior + 1.0)) as f32;
        Self {
            ior,
            inverse_ior: 1.0 / ior,
            excess,
            alpha2: roughness * roughness,
            share,
            mirror,
        }
    }

    #[inline(always)]
    pub(super) fn refract(&self, w: Lanes3) -> Lanes3 {
        let z = (w[2] * w[2] + self.excess).sqrt() * self.inverse_ior;
        [w[0] * self.inverse_ior, w[1] * self.inverse_ior, z]
    }

    /// Direction outside of one inside; none where it is caught inside.
    pub(super) fn leave(&self, w: Vec3) -> Option<Vec3> {
        let (x, y) = (w[0] * self.ior, w[1] * self.ior);
        let z2 = 1.0 - x * x - y * y;
        (z2 > 0.0).then(|| [x, y, z2.sqrt()])
    }

    #[inline(always)]
    pub(super) fn fresnel(&self, cos: Lanes) -> Lanes {
        let (c2, n2) = (cos * cos, self.ior * self.ior);
        let q = (c2 + self.excess).sqrt();
        let (across, into) = (cos + q, cos * n2 + q);
        let s = Lanes::splat(self.excess) / (across * across);
        let p = (c2 * (n2 + 1.0) - 1.0) * self.excess / (into * into);
        (s * s + p * p) * 0.5
    }
}

/// Half vectors of directions above the horizon.
#[derive(Clone, Copy, Debug)]
pub(super) struct Half {
    pub(super) across: Lanes,
    tan2: Lanes,
    inverse_z4: Lanes,
    pub(super) h_z: Lanes,
    pub(super) h_o: Lanes,
    /// Twice sine and cosine of θd.
    pub(super) sine2: Lanes,
    pub(super) cosine2: Lanes,
}

impl Half {
    #[inline(always)]
    pub(super) fn of(i: Lanes3, o: Lanes3) -> Self {
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
    pub(super) fn beckmann(&self, inverse_alpha2: f32) -> Lanes {
        (self.tan2 * inverse_alpha2).exp_of_negative() * inverse_alpha2 * self.inverse_z4
    }

    #[inline(always)]
    pub(super) fn masking(&self, i_z: Lanes, o_z: Lanes) -> Lanes {
        (Lanes::splat(1.0) / (i_z * o_z)).min(self.h_z * 2.0 / (self.h_o * i_z.max(o_z)))
    }
}

/// A half vector drawn in proportion to D times its cosine.
pub(super) fn beckmann_half(alpha2: f32, u: f32, v: f32) -> Vec3 {
    let tan2 = -alpha2 * (1.0 - u).ln();
    let cos = 1.0 / (1.0 + tan2).sqrt();
    let (sin, turn) = ((1.0 - cos * cos).max(0.0).sqrt(), v * TAU);
    [sin * turn.cos(), sin * turn.sin(), cos]
}

/// Mirror image of `o` in `h`, if it is above the horizon.
pub(super) fn mirrored(o: Vec3, h: Vec3) -> Option<Vec3> {
    let h_o = vector::dot(h, o);
    let i = along(scale(h, 2.0 * h_o), o, -1.0);
    (h_o > 0.0 && i[2] > 0.0).then_some(i)
}
