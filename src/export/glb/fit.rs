//! A glTF material for a paint, fitted to how the paint looks, and how far it stays away.
//!
//! Minimised are color differences between [`GltfMaterial`] and [`Reflectance`] at the six instrument geometries, and
//! with a tenth of the weight at six more pairs. A glTF material has one lobe under one coat: the paint's lobes and the
//! mean of its flakes become the specular lobe of a dielectric whose F0 is free (`KHR_materials_specular`), its flop
//! the diffuse base. A paint's own coat becomes the clear coat; without one its narrowest lobe does, when it is as narrow
//! as lacquer, since the geometries do not see a highlight. Where the hue travels and one color cannot follow it,
//! iridescence is tried, and kept when it brings the material nearer.
//!
//! Levenberg-Marquardt on differences in the metric of CIEDE2000 at the paint's colors, from fixed starts: the same
//! paint gives the same material. The reported loss is CIEDE2000 itself.

mod loss;
mod targets;

use std::cell::RefCell;

pub use self::loss::LossReport;
pub(super) use self::loss::loss;
use self::loss::reflected;
use self::targets::{Target, targets};
use super::brdf::{GltfMaterial, dielectric_f0};
use super::search::{Problem, minimise};
use crate::color::LinearRgb;
use crate::paint::Reflectance;

/// Share of the merit by which iridescence must improve it.
const WORTH_A_FILM: f64 = 0.7;
/// Sum of squared differences below which no film is tried.
const GOOD_ENOUGH: f64 = 6.0;
/// Hue, in degrees, that must change between the geometries before a film is tried.
const HUE_TRAVEL_DEG: f64 = 20.0;
/// Widest lobe that looks like lacquer: a highlight with a visible rim.
const LACQUER_ALPHA: f64 = 0.1;
/// Largest F0 of a paint with flakes: texels around a mean nearer to 1 could not differ.
const F0_WITH_FLAKES: f64 = 0.94;
/// Weight by which the base takes the flop's chromaticity. Under an F0 near 1 it hardly shows, so nothing else decides.
const BASE_CHROMATICITY: f64 = 0.7;

/// Whether the instrument sees hues that no single color explains.
fn hue_travels(targets: &[Target]) -> bool {
    let colors = targets.iter().filter(|t| t.weight == 1.0).map(|t| t.lab);
    let colored: Vec<f64> = colors
        .filter(|lab| lab.a.hypot(lab.b) > 10.0)
        .map(|lab| lab.b.atan2(lab.a).to_degrees())
        .collect();
    colored.iter().any(|x| {
        colored
            .iter()
            .any(|y| ((x - y + 540.0).rem_euclid(360.0) - 180.0).abs() > HUE_TRAVEL_DEG)
    })
}

/// The material, with the loss that it has.
pub(super) fn fit(reflectance: &Reflectance<'_>) -> (GltfMaterial, LossReport) {
    let targets = targets(reflectance);
    let mut best = fit_plain(reflectance, &targets);
    if best.merit > GOOD_ENOUGH && hue_travels(&targets) {
        let film = fit_film(&best, &targets, brightest(reflectance));
        if film.merit < WORTH_A_FILM * best.merit {
            best = film;
        }
    }
    (best.material, loss(&best.material, reflectance, None))
}

/// A candidate.
struct Candidate {
    material: GltfMaterial,
    merit: f64,
}

struct Fitting<'a> {
    targets: &'a [Target],
    /// Shares of the channels in what the paint shows farthest from the gloss.
    flop: LinearRgb,
    layout: Layout,
    /// What is not free.
    fixed: GltfMaterial,
    bounds: Vec<(f64, f64)>,
    films: RefCell<Films>,
}

/// What films reflect at the targets: most of a film's residuals. Half of a derivative's columns leave the film and what
/// is under it as they are, so that the one that was asked for again is kept beside the newest.
#[derive(Default)]
struct Films {
    kept: [Option<(FilmKey, Vec<Option<LinearRgb>>)>; 2],
    /// Which of them the next unknown one replaces.
    newest: usize,
}

/// What a film's reflection depends on beside the angle: whether there is one, the factor on F0, the film's index and
/// thickness, and the F0 under it.
type FilmKey = (bool, f64, f64, f64, LinearRgb);

impl Films {
    fn of(
        &mut self,
        material: &GltfMaterial,
        f0: LinearRgb,
        targets: &[Target],
    ) -> &[Option<LinearRgb>] {
        let key = (
            material.iridescence > 0.0,
            material.specular,
            material.iridescence_ior,
            material.iridescence_thickness_nm,
            f0,
        );
        let known = |kept: &Option<(FilmKey, _)>| kept.as_ref().is_some_and(|(own, _)| *own == key);
        let place = self.kept.iter().position(known);
        if let Some(place) = place {
            self.newest = 1 - place;
        } else {
            let films = targets.iter().map(|t| material.film(&t.cosines, f0));
            self.kept[self.newest] = Some((key, films.collect()));
        }
        let place = place.unwrap_or(self.newest);
        self.kept[place].as_ref().map_or(&[], |(_, films)| films)
    }
}

/// Shares of the channels in a color, none of them for black.
fn chromaticity(color: LinearRgb) -> LinearRgb {
    let sum: f64 = color.iter().map(|v| v.max(0.0)).sum();
    color.map(|v| v.max(0.0) / (sum + 1e-6))
}

/// Which numbers of the material are free beside diffuse, F0 and the lobe's α.
#[derive(Clone, Copy, PartialEq)]
enum Layout {
    /// None: the clear coat is the paint's own.
    Lobe,
    /// The clear coat's α: its weight is the lacquer lobe's.
    Lacquer,
    /// The clear coat's weight and α: a second lobe.
    SecondLobe,
    /// The film's strength, index and thickness.
    Film,
}

impl Problem for Fitting<'_> {
    fn residuals(&self, x: &[f64], out: &mut Vec<f64>) {
        let material = self.material(x);
        let f0 = dielectric_f0(material.ior, material.specular_color);
        let mut films = self.films.borrow_mut();
        out.clear();
        for (t, film) in self
            .targets
            .iter()
            .zip(films.of(&material, f0, self.targets))
        {
            let shown = reflected(material.under_film(&t.cosines, f0, *film));
            let difference = t.metric.difference(t.lab, shown);
            out.extend(difference.map(|d| d * t.weight.sqrt()));
        }
        let base = chromaticity(material.base_color);
        out.extend((0..3).map(|k| BASE_CHROMATICITY * (base[k] - self.flop[k])));
    }

    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }
}

impl<'a> Fitting<'a> {
    fn new(targets: &'a [Target], layout: Layout, fixed: GltfMaterial, brightest: f64) -> Self {
        let mut bounds = vec![(0.0, 1.0), (0.0, 1.0), (0.0, 1.0)];
        bounds.extend([(0.0, brightest); 3]);
        let lacquer = fixed.clearcoat_roughness.powi(2);
        match layout {
            Layout::Lobe => bounds.push((0.02, 1.0)),
            Layout::Lacquer => {
                bounds.extend([(2.0 * lacquer, 1.0), (0.5 * lacquer, 1.01 * lacquer)]);
            }
            Layout::SecondLobe => bounds.extend([(0.02, 1.0), (0.0, 1.0), (0.02, 0.8)]),
            Layout::Film => bounds.extend([(0.02, 1.0), (0.0, 1.0), (1.1, 3.0), (100.0, 1200.0)]),
        }
        // The last of the instrument's geometries.
        let flop = targets.get(5).map_or([0.0; 3], |t| chromaticity(t.color));
        Self {
            targets,
            flop,
            layout,
            fixed,
            bounds,
            films: RefCell::default(),
        }
    }

    fn material(&self, x: &[f64]) -> GltfMaterial {
        let f0 = dielectric_f0(1.5, [1.0; 3])[0];
        let mut material = GltfMaterial {
            base_color: [x[0], x[1], x[2]],
            specular_color: [x[3] / f0, x[4] / f0, x[5] / f0],
            roughness: x[6].sqrt(),
            ..self.fixed
        };
        match self.layout {
            Layout::Lobe => {}
            Layout::Lacquer => material.clearcoat_roughness = x[7].sqrt(),
            Layout::SecondLobe => {
                (material.clearcoat, material.clearcoat_roughness) = (x[7], x[8].sqrt());
            }
            Layout::Film => {
                (
                    material.iridescence,
                    material.iridescence_ior,
                    material.iridescence_thickness_nm,
                ) = (x[7], x[8], x[9]);
            }
        }
        material
    }
}

/// What the paint itself says about the clear coat, and what is left to find.
fn clear_coat(reflectance: &Reflectance<'_>) -> (Layout, GltfMaterial) {
    let paint = reflectance.paint();
    let with = |clearcoat: f64, alpha: f64| GltfMaterial {
        clearcoat: clearcoat.clamp(0.0, 1.0),
        clearcoat_roughness: alpha.clamp(0.0, 1.0).sqrt(),
        ..GltfMaterial::default()
    };
    if let Some(coat) = paint.coat {
        let alpha = if coat.is_mirror() {
            0.0
        } else {
            coat.roughness
        };
        return (
            Layout::Lobe,
            with(crate::paint::fresnel(1.0, coat.ior) / 0.04, alpha),
        );
    }
    let lobes = paint
        .lobes
        .iter()
        .filter(|lobe| !lobe.is_absent() && lobe.alpha < LACQUER_ALPHA);
    lobes.min_by(|a, b| a.alpha.total_cmp(&b.alpha)).map_or(
        (Layout::SecondLobe, GltfMaterial::default()),
        |lobe| {
            // At the normal a lobe reflects 4 s F0, the clear coat 0.04 of its factor.
            let albedo = 4.0 * lobe.f0 * crate::color::luminance(lobe.weight);
            (Layout::Lacquer, with(albedo / 0.04, lobe.alpha))
        },
    )
}

/// Largest F0 that is fitted.
fn brightest(reflectance: &Reflectance<'_>) -> f64 {
    if reflectance.paint().flakes.is_some() {
        F0_WITH_FLAKES
    } else {
        1.0
    }
}

/// Starts of the lobe's α.
const ALPHAS: [f64; 5] = [0.08, 0.15, 0.25, 0.4, 0.65];

fn fit_plain(reflectance: &Reflectance<'_>, targets: &[Target]) -> Candidate {
    let (layout, fixed) = clear_coat(reflectance);
    let problem = Fitting::new(targets, layout, fixed, brightest(reflectance));
    let starts = ALPHAS.iter().map(|&alpha| {
        let rest = match layout {
            Layout::Lacquer => vec![0.7 * fixed.clearcoat_roughness.powi(2)],
            Layout::SecondLobe => vec![0.2, 0.5 * alpha],
            Layout::Lobe | Layout::Film => vec![],
        };
        split(targets, alpha)
            .into_iter()
            .chain([alpha])
            .chain(rest)
            .collect()
    });
    best_of(&problem, starts.collect())
}

/// Diffuse and F0 of every channel for a lobe of this α: the least relative squares, neither negative.
fn split(targets: &[Target], alpha: f64) -> [f64; 6] {
    let mut out = [0.0; 6];
    for k in 0..3 {
        let (mut dd, mut ds, mut ss, mut df, mut sf) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for t in targets {
            let (d, s) = (
                std::f64::consts::FRAC_1_PI,
                super::brdf::specular(alpha, &t.cosines),
            );
            let w = t.weight / (t.color[k].abs() + 1e-3).powf(4.0 / 3.0);
            dd += w * d * d;
            ds += w * d * s;
            ss += w * s * s;
            df += w * d * t.color[k];
            sf += w * s * t.color[k];
        }
        let determinant = dd * ss - ds * ds;
        let (mut diffuse, mut f0) = (
            (df * ss - sf * ds) / determinant,
            (sf * dd - df * ds) / determinant,
        );
        if !(f0.is_finite() && f0 > 0.0) {
            (diffuse, f0) = (df / dd, 1e-4);
        }
        if !(diffuse.is_finite() && diffuse > 0.0) {
            (diffuse, f0) = (1e-4, sf / ss);
        }
        out[k] = diffuse.clamp(1e-5, 0.98);
        out[3 + k] = f0.clamp(1e-4, 0.95);
    }
    out
}

/// Every start followed a little, the two best of them to their end.
fn best_of(problem: &Fitting<'_>, starts: Vec<Vec<f64>>) -> Candidate {
    let mut tried: Vec<(f64, Vec<f64>)> = starts
        .into_iter()
        .map(|start| minimise(problem, start, 6))
        .collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    tried.truncate(2);
    let finished = tried.into_iter().map(|(_, x)| minimise(problem, x, 40));
    let best = finished.min_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or(
        Candidate {
            material: problem.fixed,
            merit: f64::INFINITY,
        },
        |(merit, x)| Candidate {
            material: problem.material(&x),
            merit,
        },
    )
}

/// Thicknesses of the film to start from, nanometres: one to three orders of visible light.
const THICKNESSES: [f64; 6] = [150.0, 250.0, 350.0, 450.0, 600.0, 800.0];

fn fit_film(plain: &Candidate, targets: &[Target], brightest: f64) -> Candidate {
    let m = plain.material;
    let f0 = dielectric_f0(m.ior, m.specular_color);
    let problem = Fitting::new(targets, Layout::Film, m, brightest);
    let keep = |v: f64| v.clamp(1e-4, 0.95);
    let starts = THICKNESSES.iter().flat_map(|&thickness| {
        [1.4, 2.0].map(|ior| {
            let colors = m.base_color.into_iter().chain(f0).map(keep);
            colors
                .chain([m.roughness.powi(2), 0.4, ior, thickness])
                .collect()
        })
    });
    best_of(&problem, starts.collect())
}

#[cfg(test)]
mod tests;
