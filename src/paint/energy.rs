//! Energy certificate: how much of the light that falls on a paint leaves it.
//!
//! ```text
//! ρ(i) = ∫ f(i,o) o_z dω + R(i)  (the coat's mirror image where it is one)
//! ```
//!
//! integrated by a product rule over the outer hemisphere, dense where the half vector is near the normal. A measured
//! paint may exceed 1 (uncalibrated tables do); the certificate says so, it changes nothing.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::CarPaint;
use super::reflectance::{Chi, Reflectance};

/// Directional albedo of a paint at a few incidences.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyCertificate {
    /// Incidence angles in air, degrees.
    pub incidence_deg: Vec<f64>,
    /// Largest channel's albedo at each incidence.
    pub albedo: Vec<f64>,
    /// Whether every albedo is at most 1.001.
    pub conserves: bool,
}

/// Incidences of the certificate, degrees.
const INCIDENCE_DEG: [f64; 6] = [0.0, 30.0, 50.0, 65.0, 80.0, 89.0];

/// Integrates the directional albedo of a paint.
#[must_use]
pub fn certify(paint: &CarPaint) -> EnergyCertificate {
    let reflectance = Reflectance::new(paint);
    let albedo: Vec<f64> = INCIDENCE_DEG
        .iter()
        .map(|&theta| directional_albedo(&reflectance, theta))
        .collect();
    let conserves = albedo.iter().all(|&a| a <= 1.001);
    EnergyCertificate {
        incidence_deg: INCIDENCE_DEG.to_vec(),
        albedo,
        conserves,
    }
}

/// Integral over half vectors, `dω_o = 4 (h·o) dω_h`, in rings of even steps of `t`, `tan θh = α sinh t`: even inside the
/// narrowest width `α` present, growing outside.
fn directional_albedo(reflectance: &Reflectance<'_>, theta_deg: f64) -> f64 {
    let paint = reflectance.paint();
    let narrowest = paint
        .lobes
        .iter()
        .filter(|lobe| !lobe.is_absent())
        .map(|lobe| lobe.alpha)
        .chain(
            paint
                .coat
                .iter()
                .filter(|coat| !coat.is_mirror())
                .map(|coat| coat.roughness),
        )
        .fold(0.5, f64::min)
        .max(1e-4);
    let theta = theta_deg.to_radians();
    let wi = [-theta.sin(), 0.0, theta.cos()];
    let (rings, spokes) = (192_u32, 96_u32);
    let mut sum = [0.0; 3];
    // tan θh = narrowest · sinh(t): even steps inside the narrowest lobe, growing steps outside.
    let reach = (200.0 / narrowest).asinh();
    for ring in 0..rings {
        let t = (f64::from(ring) + 0.5) / f64::from(rings) * reach;
        let tangent = narrowest * t.sinh();
        let width = narrowest * t.cosh() * reach / f64::from(rings);
        let cos_h = 1.0 / (1.0 + tangent * tangent).sqrt();
        let solid = tangent * width * cos_h.powi(3) * TAU / f64::from(spokes);
        for spoke in 0..spokes {
            let phi = (f64::from(spoke) + 0.5) / f64::from(spokes) * TAU;
            let h = [
                tangent * cos_h * phi.cos(),
                tangent * cos_h * phi.sin(),
                cos_h,
            ];
            let h_i = h[0] * wi[0] + h[2] * wi[2];
            let wo: [f64; 3] = std::array::from_fn(|k| 2.0 * h_i * h[k] - wi[k]);
            if h_i <= 0.0 || wo[2] <= 0.0 {
                continue;
            }
            let f = reflectance.evaluate(wi, wo, Chi::Table);
            for k in 0..3 {
                sum[k] += f[k] * wo[2] * 4.0 * h_i * solid;
            }
        }
    }
    sum.into_iter().fold(0.0, f64::max) + reflectance.mirror(wi)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{Coat, ColorTable, Lobe};

    fn one_lobe(alpha: f64, coat: Option<Coat>) -> CarPaint {
        let lobes = vec![Lobe {
            weight: [1.0; 3],
            alpha,
            f0: 1.0,
        }];
        CarPaint {
            coat,
            diffuse: [0.0; 3],
            lobes,
            color_table: ColorTable::white(),
            flakes: None,
        }
    }

    /// Model description, section 1: ρ = 4.0 for α = 0.1 and 3.57 for 0.5 at normal incidence, s = F0 = 1.
    #[test]
    fn a_lobe_of_weight_one_reflects_four_times_the_light() {
        for (alpha, want) in [(0.1, 4.0), (0.5, 3.57)] {
            let albedo = certify(&one_lobe(alpha, None)).albedo[0];
            assert!((albedo - want).abs() < 0.04, "alpha {alpha}: {albedo}");
        }
    }

    /// The same lobe of α = 0.05 under an ior 1.5 coat: 8.29.
    #[test]
    fn refraction_widens_what_a_narrow_lobe_reflects() {
        let paint = one_lobe(0.05, Some(Coat::smooth(1.5)));
        let without_mirror = certify(&paint).albedo[0] - 0.04;
        assert!((without_mirror - 8.29).abs() < 0.04, "{without_mirror}");
    }

    #[test]
    fn a_white_furnace_of_a_diffuse_paint_keeps_its_albedo() {
        let paint = CarPaint {
            diffuse: [0.8; 3],
            lobes: Vec::new(),
            ..one_lobe(0.1, None)
        };
        for albedo in certify(&paint).albedo {
            assert!((albedo - 0.8).abs() < 2e-3, "{albedo}");
        }
    }
}
