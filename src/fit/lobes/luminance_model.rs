//! The luminance of diffuse, lobes and coat as a descent sees it: by logarithms, with derivatives.
//!
//! The formulas are those of [`Lobe::shape`](crate::paint::Lobe::shape) and [`Coat::highlight`](crate::paint::Coat),
//! taken apart into what depends on directions alone and what on the parameters.

use std::f64::consts::PI;

use super::LOBES;
use crate::paint::{Direction, fresnel, half_angles, masking, refract, transmission};

pub(super) const COAT_ROUGHNESS: usize = 1 + 3 * LOBES;
pub(super) const COAT_IOR: usize = COAT_ROUGHNESS + 1;
pub(super) const MOST: usize = COAT_IOR + 1;

/// A sample's geometry, everything that does not depend on roughness and weight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Geometry {
    tan2: f64,
    /// `−4 ln h_z`.
    spread: f64,
    schlick: f64,
    masking: f64,
    transmission: f64,
    coat_tan2: f64,
    /// Coat's highlight without its distribution.
    coat_rest: f64,
}

pub(super) fn geometry(wi: Direction, wo: Direction, ior: Option<f64>) -> Geometry {
    let outer = half_angles(wi, wo);
    let spread = |h_z: f64| -4.0 * h_z.ln();
    let Some(ior) = ior else {
        return Geometry {
            tan2: outer.tan2_h,
            spread: spread(outer.h_z),
            schlick: (1.0 - outer.h_o).powi(5),
            masking: masking(&outer, wi[2], wo[2]),
            transmission: 1.0,
            coat_tan2: 0.0,
            coat_rest: 0.0,
        };
    };
    let (i, o) = (refract(wi, ior), refract(wo, ior));
    let inner = half_angles(i, o);
    Geometry {
        tan2: inner.tan2_h,
        spread: spread(inner.h_z),
        schlick: (1.0 - inner.h_o).powi(5),
        masking: masking(&inner, i[2], o[2]),
        transmission: transmission(wi, wo, ior),
        coat_tan2: outer.tan2_h,
        coat_rest: fresnel(outer.h_o, ior) / 4.0
            * masking(&outer, wi[2], wo[2])
            * spread(outer.h_z).exp(),
    }
}

impl Geometry {
    /// Luminance, and its derivatives by the parameters other than the index.
    pub fn luminance(&self, p: &[f64], derivatives: Option<&mut [f64; MOST]>) -> f64 {
        let mut local = [0.0; MOST];
        let d = derivatives.unwrap_or(&mut local);
        d[0] = self.transmission * p[0].exp() / PI;
        let mut sum = d[0];
        for k in 0..LOBES {
            let (s, alpha, f0) = (p[1 + 3 * k], p[2 + 3 * k], p[3 + 3 * k].exp());
            let slope = self.tan2 * (-2.0 * alpha).exp();
            let rest =
                (s - slope + self.spread - 2.0 * alpha).exp() * self.masking * self.transmission
                    / PI;
            let value = rest * (f0 + (1.0 - f0) * self.schlick);
            d[1 + 3 * k] = value;
            d[2 + 3 * k] = value * (2.0 * slope - 2.0);
            d[3 + 3 * k] = rest * f0 * (1.0 - self.schlick);
            sum += value;
        }
        if p.len() > COAT_ROUGHNESS {
            let alpha = p[COAT_ROUGHNESS];
            let slope = self.coat_tan2 * (-2.0 * alpha).exp();
            let value = (-slope - 2.0 * alpha).exp() / PI * self.coat_rest;
            d[COAT_ROUGHNESS] = value * (2.0 * slope - 2.0);
            sum += value;
        }
        sum
    }
}
