//! Energy certificate: how much of the light that falls on a paint leaves it.
//!
//! ```text
//! ρ(i) = ∫ f(i,o) o_z dω + R(i)  (the coat's mirror image where it is one)
//! ```
//!
//! integrated by a product rule over the outer hemisphere, dense where the half vector is near the normal and where the
//! paint's own angles are. Incidences are a few fixed ones, some next to grazing where Fresnel's factor rises to 1, and
//! each at which a column of the color table or of the flakes outshines its neighbours: light reflected back along
//! `h = n` has `θd` of that column, and between columns the paint is a mixture of them. A measured paint may exceed 1 (uncalibrated tables do); the certificate says so, it changes
//! nothing.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::reflectance::{Chi, Reflectance};
use super::{AngleGrid, CarPaint};
use crate::color::LinearRgb;

/// Directional albedo of a paint at the incidences where it can be largest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyCertificate {
    /// Incidence angles in air, degrees, ascending.
    pub incidence_deg: Vec<f64>,
    /// Largest channel's albedo at each incidence.
    pub albedo: Vec<f64>,
    /// Whether every albedo is at most 1.001.
    pub conserves: bool,
}

impl EnergyCertificate {
    /// The largest albedo, where light would come from nowhere.
    #[must_use]
    pub fn excess(&self) -> Option<f64> {
        let most = self.albedo.iter().copied().fold(0.0, f64::max);
        (!self.conserves).then_some(most)
    }

    /// What is wrong with a certificate that was read from a file.
    pub(super) fn check(&self) -> Result<(), &'static str> {
        let count = self.incidence_deg.len();
        if count == 0 || count != self.albedo.len() {
            return Err(
                "has not one albedo for each of its incidences, of which there is at least one",
            );
        }
        if !self.incidence_deg.iter().all(|a| (0.0..=90.0).contains(a)) {
            return Err("has an incidence outside 0 to 90 degrees");
        }
        if !self.albedo.iter().all(|a| *a >= 0.0 && a.is_finite()) {
            return Err("has an albedo that is negative or not finite");
        }
        if self.conserves != conserves(&self.albedo) {
            return Err("says of conserving energy what its albedos do not");
        }
        Ok(())
    }
}

fn conserves(albedo: &[f64]) -> bool {
    albedo.iter().all(|&a| a <= 1.001)
}

/// Incidences of every certificate, degrees.
const INCIDENCE_DEG: [f64; 6] = [0.0, 30.0, 50.0, 65.0, 80.0, 89.0];

/// More of them where no smooth coat reflects grazing light before it gets in: there a lobe of little F0 comes to shine as
/// one of F0 1, and masking lets go of it, within as many radians of grazing as its α.
const GRAZING_DEG: [f64; 4] = [89.9, 89.99, 89.999, 89.9999];

/// A column is looked at when no neighbour is brighter, and it is so many times as bright as one of them.
const OUTSHINES: f64 = 1.05;

/// Rings are not divided into parts below this part of a ring.
const LEAST_RING: f64 = 0.1;

/// Integrates the directional albedo of a paint.
#[must_use]
pub fn certify(paint: &CarPaint) -> EnergyCertificate {
    let reflectance = Reflectance::new(paint);
    let incidence_deg = incidences(&reflectance);
    let tangents = own_tangents(paint);
    let albedo: Vec<f64> = incidence_deg
        .par_iter()
        .map(|&theta| directional_albedo(&reflectance, theta, &tangents))
        .collect();
    EnergyCertificate {
        conserves: conserves(&albedo),
        incidence_deg,
        albedo,
    }
}

/// Those of every paint, next to grazing where light gets in there, and those at which a column outshines its neighbours by more than [`OUTSHINES`].
fn incidences(reflectance: &Reflectance<'_>) -> Vec<f64> {
    let paint = reflectance.paint();
    let table = &paint.color_table;
    let mut degrees = INCIDENCE_DEG.to_vec();
    if !paint
        .coat
        .is_some_and(|coat| coat.is_mirror() && coat.ior > 1.1)
    {
        degrees.extend(GRAZING_DEG);
    }
    let mut add = |colors: &[LinearRgb], columns: &AngleGrid| {
        let brightest: Vec<f64> = (0..columns.len())
            .map(|d| {
                let column = colors.iter().skip(d).step_by(columns.len());
                column.flatten().copied().fold(0.0, f64::max)
            })
            .collect();
        for (d, &angle) in columns.degrees().iter().enumerate() {
            let beside = |k: Option<usize>| k.and_then(|k| brightest.get(k));
            let beside = [beside(d.checked_sub(1)), beside(d.checked_add(1))];
            let beside = || beside.iter().flatten();
            // A plateau is looked at where it begins and where it ends.
            if beside().all(|b| brightest[d] >= **b)
                && beside().any(|b| brightest[d] > OUTSHINES * **b)
            {
                degrees.extend(in_air(angle, paint));
            }
        }
    };
    add(reflectance.chi_nodes(), table.theta_d());
    if let Some(flakes) = &paint.flakes {
        add(reflectance.flake_means(), &flakes.theta_d);
    }
    degrees.sort_by(f64::total_cmp);
    degrees.dedup();
    degrees
}

/// The angle outside at which light goes at `degrees` inside the coat; `None` where none does, and next to grazing, where
/// the last fixed incidence is.
fn in_air(degrees: f64, paint: &CarPaint) -> Option<f64> {
    let ior = paint.coat.map_or(1.0, |coat| coat.ior);
    let angle = (ior * degrees.to_radians().sin()).asin().to_degrees();
    (angle < 89.0).then_some(angle)
}

/// Tangents of the paint's own `θh`, seen from outside, ascending: where the integrand bends.
fn own_tangents(paint: &CarPaint) -> Vec<f64> {
    let flakes = paint.flakes.iter().map(|f| &f.theta_h);
    let mut tangents: Vec<f64> = flakes
        .chain([paint.color_table.theta_h()])
        .filter(|grid| grid.len() > 1)
        .flat_map(AngleGrid::degrees)
        .filter_map(|&degrees| in_air(degrees, paint))
        .map(|degrees| degrees.to_radians().tan())
        .collect();
    tangents.sort_by(f64::total_cmp);
    tangents
}

/// Integral over half vectors, `dω_o = 4 (h·o) dω_h`, in rings of even steps of `t`, `tan θh = α sinh t`: even inside the
/// narrowest width `α` present, growing outside. Next to grazing lobes of several units' width come out up to 0.7 % too bright.
fn directional_albedo(reflectance: &Reflectance<'_>, theta_deg: f64, tangents: &[f64]) -> f64 {
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
    // A paint reflects alike to both sides of the plane of incidence: the spokes of one side are looked at.
    let (rings, spokes) = (192_u32, 48_u32);
    let mut sum = [0.0; 3];
    // tan θh = narrowest · sinh(t): even steps inside the narrowest lobe, growing steps outside.
    let reach = (200.0 / narrowest).asinh();
    let step = reach / f64::from(rings);
    let mut edges: Vec<f64> = (0..=rings).map(|ring| f64::from(ring) * step).collect();
    // A ring that the paint's own angles divide is divided there.
    edges.extend(tangents.iter().map(|tangent| (tangent / narrowest).asinh()));
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|above, kept| *above - *kept < LEAST_RING * step);
    let directions: Vec<[f64; 2]> = (0..spokes)
        .map(|spoke| (f64::from(spoke) + 0.5) / f64::from(spokes) * PI)
        .map(|phi| [phi.cos(), phi.sin()])
        .collect();
    for ring in edges.windows(2) {
        let (t, width) = (f64::midpoint(ring[0], ring[1]), ring[1] - ring[0]);
        let tangent = narrowest * t.sinh();
        let width = narrowest * t.cosh() * width;
        let cos_h = 1.0 / (1.0 + tangent * tangent).sqrt();
        let solid = tangent * width * cos_h.powi(3) * TAU / f64::from(spokes);
        for [cos_phi, sin_phi] in &directions {
            let h = [tangent * cos_h * cos_phi, tangent * cos_h * sin_phi, cos_h];
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
    use crate::color::Lab;
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

    /// A table whose color is `l` at one node and `around` elsewhere.
    fn spiked(theta_h: &[f64], theta_d: &[f64], at: &[usize], l: f64, around: f64) -> ColorTable {
        let gray = |l| Lab { l, a: 0.0, b: 0.0 };
        let mut nodes = vec![gray(around); theta_h.len() * theta_d.len()];
        let columns = theta_d.len();
        for (k, node) in nodes.iter_mut().enumerate() {
            let hit = if columns > 1 { k % columns } else { k };
            if at.contains(&hit) {
                *node = gray(l);
            }
        }
        let grid = |degrees: &[f64]| AngleGrid::new(degrees.to_vec()).expect("a grid");
        ColorTable::new(grid(theta_h), grid(theta_d), nodes, gray(around)).expect("a table")
    }

    #[test]
    fn a_table_that_is_bright_between_the_fixed_incidences_is_not_certified() {
        let mut paint = one_lobe(0.02, None);
        paint.lobes[0].weight = [0.2; 3];
        paint.color_table = spiked(&[0.0], &[0.0, 66.0, 68.0, 76.0, 78.0], &[2, 3], 180.0, 30.0);
        let certificate = certify(&paint);
        // 4 s times the table's light, ((180 + 16)/116)³ = 4.82, over the plateau; at its ends a part of that.
        let brightest = certificate.albedo.iter().copied().fold(0.0, f64::max);
        assert!(
            brightest > 0.5 * 0.8 * 4.82 && brightest < 0.8 * 4.9,
            "{certificate:?}"
        );
        assert!(!certificate.conserves);
    }

    #[test]
    fn a_table_that_is_bright_between_two_rings_is_not_certified() {
        let paint = CarPaint {
            diffuse: [0.5; 3],
            lobes: Vec::new(),
            color_table: spiked(&[0.0, 25.9, 26.1, 26.3, 26.5], &[0.0], &[2], 2000.0, 0.0),
            ..one_lobe(0.1, None)
        };
        // At normal incidence: a/π times the light, (2016/116)³ = 5249, times 2π ∫ 4 cos θh cos 2θh sin θh dθh over a
        // triangle 0.2° wide at half height.
        let h = 26.1_f64.to_radians();
        let ring = std::f64::consts::TAU * 4.0 * h.cos() * (2.0 * h).cos() * h.sin();
        let want = 0.5 / std::f64::consts::PI * 5249.0 * ring * 0.2_f64.to_radians();
        let found = certify(&paint).albedo[0];
        assert!(
            (found / want - 1.0).abs() < 0.05,
            "{found} instead of {want}"
        );
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
