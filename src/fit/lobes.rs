//! Diffuse, three lobes and perhaps a coat from samples of luminance.
//!
//! ```text
//! minimise Σ w ρ(e) + w ρ(e − ē),   e = ln(model + ε) − ln(measured + ε),   ē the mean over samples of equal (θh, θd)
//! ```
//!
//! The logarithm keeps the peak from eating the rest, ρ keeps outliers from pulling, and the second term keeps
//! azimuths right, which no color table can mend afterwards. Samples next to the mirror direction count less: there
//! the table can mend, and a measurement is noisiest. Several starts descend on a part of the samples, the best of
//! them on all. Fresnel values have a floor, so that weights of different paints stay comparable when blended.
//!
//! One luminance in, one weight per lobe out; color is the table's. Golla and Klein 2018, 3.1.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::directions::{NEAR_MIRROR_DEG, Sample};
use super::least_squares::{Minimum, Normal, Problem, minimise};
use super::steps::{Steps, Tell};
use crate::paint::{Direction, fresnel, half_angles, refract};

/// Lobes of a fitted paint.
pub(super) const LOBES: usize = 3;

/// Luminance below which differences stop counting, 1/sr, for data of ordinary brightness.
pub(super) const DARK: f64 = 1e-3;

/// Error from which samples count linearly, in the logarithm.
const ROBUST: f64 = 0.05;
/// Weight of the azimuth term.
const AZIMUTH: f64 = 1.0;
/// Weight of samples next to the mirror direction.
const NEAR_WEIGHT: f64 = 0.3;

const COAT_ROUGHNESS: usize = 1 + 3 * LOBES;
const COAT_IOR: usize = COAT_ROUGHNESS + 1;
const MOST: usize = COAT_IOR + 1;

/// Which coat a fit looks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CoatSearch {
    /// None: light meets the base.
    Bare,
    /// Of this index, roughness to be found.
    Index(f64),
    /// Index and roughness to be found.
    Free,
}

/// Luminance model: everything of the base but its color.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shape {
    /// Lambertian albedo.
    pub diffuse: f64,
    /// Weight, roughness, Fresnel value; by ascending roughness.
    pub lobes: [(f64, f64, f64); LOBES],
    /// Index and roughness.
    pub coat: Option<(f64, f64)>,
    /// Cost of the fit, for comparing starts.
    pub cost: f64,
    /// How many starts came within 2 % of the best cost.
    pub agreeing: usize,
    /// How many starts there were.
    pub starts: usize,
}

/// A sample's geometry, everything that does not depend on roughness and weight.
#[derive(Clone, Copy, Debug)]
struct Geometry {
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

fn geometry(wi: Direction, wo: Direction, ior: Option<f64>) -> Geometry {
    let outer = half_angles(wi, wo);
    let spread = |h_z: f64| -4.0 * h_z.ln();
    let masking = |h: &crate::paint::HalfAngles, i: f64, o: f64| {
        (1.0 / (i * o)).min(2.0 * h.h_z / (h.h_o * i.max(o)))
    };
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
        transmission: (1.0 - fresnel(wi[2], ior)) * (1.0 - fresnel(wo[2], ior)),
        coat_tan2: outer.tan2_h,
        coat_rest: fresnel(outer.h_o, ior) / 4.0
            * masking(&outer, wi[2], wo[2])
            * spread(outer.h_z).exp(),
    }
}

impl Geometry {
    /// Luminance, and its derivatives by the parameters other than the index.
    fn luminance(&self, p: &[f64], derivatives: Option<&mut [f64; MOST]>) -> f64 {
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

struct LobeProblem<'a> {
    /// Sorted by cell of equal angles.
    samples: &'a [Target],
    /// Geometry where the index is not searched for.
    fixed: Option<Vec<Geometry>>,
    epsilon: f64,
    bounds: Vec<(f64, f64)>,
}

#[derive(Clone, Copy, Debug)]
struct Target {
    wi: Direction,
    wo: Direction,
    log: f64,
    weight: f64,
    cell: (u32, u32),
}

impl Problem for LobeProblem<'_> {
    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn accumulate(&self, p: &[f64], derivatives: bool, sums: &mut Normal) {
        let n = p.len();
        let mut rows: Vec<[f64; MOST]> = Vec::new();
        let mut errors: Vec<f64> = Vec::new();
        let ior = p.get(COAT_IOR).copied();
        let step = 1e-4;
        let mut index = 0;
        for cell in self.samples.chunk_by(|a, b| a.cell == b.cell) {
            errors.clear();
            rows.clear();
            let (mut mean, mut mean_row, mut counted) = (0.0, [0.0; MOST], 0.0);
            for target in cell {
                let g = match &self.fixed {
                    Some(fixed) => fixed[index],
                    None => geometry(target.wi, target.wo, ior),
                };
                index += 1;
                let mut row = [0.0; MOST];
                let model = g.luminance(p, derivatives.then_some(&mut row)) + self.epsilon;
                if derivatives {
                    for d in &mut row[..n] {
                        *d /= model;
                    }
                    if let Some(ior) = ior {
                        let beside = geometry(target.wi, target.wo, Some(ior + step));
                        row[COAT_IOR] =
                            ((beside.luminance(p, None) + self.epsilon) / model).ln() / step;
                    }
                }
                let error = model.ln() - target.log;
                mean += error.clamp(-1.0, 1.0);
                if error.abs() < 1.0 {
                    for (m, d) in mean_row.iter_mut().zip(row) {
                        *m += d;
                    }
                }
                counted += 1.0;
                errors.push(error);
                rows.push(row);
            }
            mean /= counted;
            for m in &mut mean_row {
                *m /= counted;
            }
            for ((target, &error), row) in cell.iter().zip(&errors).zip(&rows) {
                let (w, v) = (target.weight, target.weight * AZIMUTH.sqrt());
                if derivatives {
                    let scaled: [f64; MOST] = std::array::from_fn(|k| w * row[k]);
                    sums.add(w * error, &scaled[..n]);
                    let scaled: [f64; MOST] = std::array::from_fn(|k| v * (row[k] - mean_row[k]));
                    sums.add(v * (error - mean), &scaled[..n]);
                } else {
                    sums.add_cost(w * error);
                    sums.add_cost(v * (error - mean));
                }
            }
        }
    }
}

fn bounds(search: CoatSearch, unit: f64) -> Vec<(f64, f64)> {
    let least_f0: f64 = if search == CoatSearch::Bare {
        0.05
    } else {
        0.1
    };
    let lift = unit.ln();
    let mut out = vec![(-14.0 + lift, 2.0 + lift)];
    for _ in 0..LOBES {
        out.extend([
            (-16.0 + lift, 4.0_f64.ln() + lift),
            (0.004_f64.ln(), 0.0),
            (least_f0.ln(), 0.0),
        ]);
    }
    if search != CoatSearch::Bare {
        out.push((0.002_f64.ln(), 0.8_f64.ln()));
    }
    if search == CoatSearch::Free {
        out.push((1.2, 1.8));
    }
    out
}

/// Roughnesses of lobes that a descent starts from.
const ROUGHNESSES: [[f64; LOBES]; 6] = [
    [0.04, 0.12, 0.40],
    [0.015, 0.06, 0.25],
    [0.08, 0.20, 0.60],
    [0.03, 0.25, 0.80],
    [0.10, 0.15, 0.35],
    [0.006, 0.10, 0.45],
];

/// Roughness and index of coats that a descent starts from, beside [`ROUGHNESSES`].
const COATS: [(f64, f64); 6] = [
    (0.03, 1.5),
    (0.08, 1.4),
    (0.3, 1.3),
    (0.01, 1.5),
    (0.5, 1.25),
    (0.15, 1.5),
];

/// Parameters in the order of [`Geometry::luminance`].
fn parameters(shape: &Shape, search: CoatSearch) -> Vec<f64> {
    let mut p = vec![shape.diffuse.ln()];
    for (s, alpha, f0) in shape.lobes {
        p.extend([s.ln(), alpha.ln(), f0.ln()]);
    }
    let (ior, roughness) = shape.coat.unwrap_or((1.5, 0.03));
    if search != CoatSearch::Bare {
        p.push(roughness.ln());
    }
    if search == CoatSearch::Free {
        p.push(ior);
    }
    p
}

/// The bare shape put under coats: its narrowest lobe turned into the coat's highlight, or all of them kept.
fn starts_from(bare: &Shape, search: CoatSearch) -> Vec<Vec<f64>> {
    // Inside a coat of index 1.5 half angles shrink by a third, and D grows by the square of that.
    let under = |l: (f64, f64, f64)| (l.0 / 2.0, l.1 / 1.5, l.2);
    let [a, b, c] = bare.lobes;
    let halved = |l: (f64, f64, f64)| (l.0 / 4.0, l.1 / 2.0, l.2);
    let turned = [under(halved(b)), under(b), under(c)];
    let kept = [under(a), under(b), under(c)];
    [(turned, a.1), (kept, 0.03), (kept, 0.3)]
        .into_iter()
        .map(|(lobes, roughness)| {
            parameters(
                &Shape {
                    lobes,
                    coat: Some((1.45, roughness)),
                    ..bare.clone()
                },
                search,
            )
        })
        .collect()
}

fn starts(search: CoatSearch, samples: &[Target], epsilon: f64) -> Vec<Vec<f64>> {
    let mut logs: Vec<f64> = samples.iter().map(|s| s.log).collect();
    logs.sort_by(f64::total_cmp);
    let at =
        |share: usize| (logs[(logs.len() - 1) * share / 100].exp() - epsilon).max(epsilon / 10.0);
    let (dark, bright) = (at(20), at(95));
    ROUGHNESSES
        .iter()
        .zip(COATS)
        .map(|(alphas, (roughness, ior))| {
            let mut p = vec![(dark * PI).ln()];
            for alpha in alphas {
                let f0: f64 = 0.3;
                p.extend([
                    (bright * PI * alpha * alpha / (3.0 * f0)).ln(),
                    alpha.ln(),
                    f0.ln(),
                ]);
            }
            if search != CoatSearch::Bare {
                p.push(f64::ln(roughness));
            }
            if search == CoatSearch::Free {
                p.push(ior);
            }
            p
        })
        .collect()
}

/// Brightness of the data against what a reflectance may be: 1 unless it is absurd, and then what to divide by.
pub(super) fn unit_of(samples: &[Sample]) -> f64 {
    let mut sorted: Vec<f64> = samples.iter().map(|s| s.luminance).collect();
    sorted.sort_by(f64::total_cmp);
    let high = sorted.get(sorted.len() * 9 / 10).copied().unwrap_or(0.0);
    let peak = sorted.last().copied().unwrap_or(0.0);
    let typical = if high > 0.0 { high } else { peak };
    if typical > 0.0 {
        typical / typical.clamp(1e-2, 1e3)
    } else {
        1.0
    }
}

/// Minima that are refined on all samples, and how many starts each of them is worth in time.
const FINALISTS: usize = 2;
const FINALIST_STEPS: usize = 5;

/// Fits the luminance of samples; `None` where every descent ended in nonsense.
///
/// A search for a coat also starts from the `bare` shape, where there is one.
pub(super) fn fit_shape(
    samples: &[Sample],
    search: CoatSearch,
    unit: f64,
    bare: Option<&Shape>,
    tell: Tell<'_>,
) -> Option<Shape> {
    let epsilon = DARK * unit;
    let near = NEAR_MIRROR_DEG.to_radians();
    let mut targets: Vec<Target> = samples
        .iter()
        .map(|s| {
            let half = s.half();
            Target {
                wi: s.wi,
                wo: s.wo,
                log: (s.luminance.max(0.0) + epsilon).ln(),
                weight: if half.theta_h < near {
                    NEAR_WEIGHT
                } else {
                    1.0
                },
                cell: cell_of(half.theta_h.to_degrees(), half.theta_d.to_degrees()),
            }
        })
        .collect();
    // Stable: samples of a cell keep the order in which they were drawn.
    targets.sort_by_key(|t| t.cell);
    let ior = match search {
        CoatSearch::Bare => Some(None),
        CoatSearch::Index(ior) => Some(Some(ior)),
        CoatSearch::Free => None,
    };
    let problem = |targets: &[Target]| -> Option<Vec<Geometry>> {
        ior.map(|ior| targets.iter().map(|t| geometry(t.wi, t.wo, ior)).collect())
    };
    let part: Vec<Target> = targets
        .iter()
        .step_by((targets.len() / 1500).max(1))
        .copied()
        .collect();
    let quick = LobeProblem {
        samples: &part,
        fixed: problem(&part),
        epsilon,
        bounds: bounds(search, unit),
    };
    let whole = LobeProblem {
        samples: &targets,
        fixed: problem(&targets),
        epsilon,
        bounds: bounds(search, unit),
    };

    let mut starts = starts(search, &targets, epsilon);
    if let Some(bare) = bare {
        starts.extend(starts_from(bare, search));
    }
    // A finalist has as many samples as several starts.
    let steps = Steps::new(starts.len() + FINALISTS * FINALIST_STEPS, tell);
    let mut found: Vec<Minimum> = starts
        .par_iter()
        .map(|p| {
            let minimum = minimise(&quick, p, ROBUST, 40);
            steps.done(1);
            minimum
        })
        .collect();
    found.retain(|m| m.cost.is_finite());
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let best = found.first()?.cost;
    let agreeing = found
        .iter()
        .filter(|m| m.cost <= 1.02 * best + 1e-9)
        .count();
    let finalists = distinct(&found, FINALISTS);
    let mut last: Vec<Minimum> = finalists
        .par_iter()
        .map(|m| {
            let minimum = minimise(&whole, &m.parameters, ROBUST, 40);
            steps.done(FINALIST_STEPS);
            minimum
        })
        .collect();
    last.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let p = last.first().filter(|m| m.cost.is_finite())?;
    let mut shape = shape_of(p, search, agreeing, starts.len());
    drop_what_does_not_show(&mut shape, samples, epsilon);
    Some(shape)
}

/// The best minima that differ in cost by more than rounding.
fn distinct(sorted: &[Minimum], count: usize) -> Vec<Minimum> {
    let mut out: Vec<Minimum> = Vec::new();
    for m in sorted {
        if out.len() < count && out.last().is_none_or(|l| m.cost > 1.001 * l.cost + 1e-12) {
            out.push(m.clone());
        }
    }
    out
}

fn shape_of(found: &Minimum, search: CoatSearch, agreeing: usize, starts: usize) -> Shape {
    let p = &found.parameters;
    let mut lobes: [(f64, f64, f64); LOBES] =
        std::array::from_fn(|k| (p[1 + 3 * k].exp(), p[2 + 3 * k].exp(), p[3 + 3 * k].exp()));
    lobes.sort_by(|a, b| a.1.total_cmp(&b.1));
    let coat = match search {
        CoatSearch::Bare => None,
        CoatSearch::Index(ior) => Some((ior, p[COAT_ROUGHNESS].exp())),
        CoatSearch::Free => Some((p[COAT_IOR], p[COAT_ROUGHNESS].exp())),
    };
    Shape {
        diffuse: p[0].exp(),
        lobes,
        coat,
        cost: found.cost,
        agreeing,
        starts,
    }
}

/// Lobes that nowhere in the samples reach a thousandth of the whole get weight 0.
fn drop_what_does_not_show(shape: &mut Shape, samples: &[Sample], epsilon: f64) {
    for k in 0..LOBES {
        let mut without = shape.clone();
        without.lobes[k].0 = 0.0;
        let shows = samples.iter().any(|s| {
            let (whole, ..) = shape.terms(s.wi, s.wo);
            let (rest, ..) = without.terms(s.wi, s.wo);
            whole - rest > 1e-3 * (whole + epsilon)
        });
        if !shows {
            shape.lobes[k].0 = 0.0;
        }
    }
}

/// Samples of nearly equal (θh, θd): 4° in θd, growing steps in θh.
fn cell_of(theta_h: f64, theta_d: f64) -> (u32, u32) {
    const EDGES: [f64; 15] = [
        2., 5., 8., 12., 16., 20., 25., 30., 35., 40., 45., 50., 55., 60., 65.,
    ];
    let row = EDGES.partition_point(|&e| e <= theta_h);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0..=22.
    let column = (theta_d / 4.0).clamp(0.0, 22.0) as u32;
    (u32::try_from(row).unwrap_or(u32::MAX), column)
}

impl Shape {
    /// Base luminance under the coat (no transmission), and what of the outside is transmission and highlight.
    pub fn terms(&self, wi: Direction, wo: Direction) -> (f64, f64, f64) {
        let g = geometry(wi, wo, self.coat.map(|c| c.0));
        let mut base = self.diffuse / PI;
        for &(s, alpha, f0) in &self.lobes {
            let a2 = alpha * alpha;
            let d = (-g.tan2 / a2 + g.spread).exp() / a2;
            base += s * d * (f0 + (1.0 - f0) * g.schlick) * g.masking / PI;
        }
        let highlight = self.coat.map_or(0.0, |(_, alpha)| {
            let a2 = alpha * alpha;
            (-g.coat_tan2 / a2).exp() / (PI * a2) * g.coat_rest
        });
        (base, g.transmission, highlight)
    }
}

#[cfg(test)]
mod tests {
    use super::super::directions::measure;
    use super::*;
    use crate::color::LinearRgb;
    use crate::measurement::MeasuredBrdf;

    struct Known(Shape);

    impl MeasuredBrdf for Known {
        fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
            let (base, transmission, highlight) = self.0.terms(wi, wo);
            Some([base * transmission + highlight; 3])
        }
    }

    fn known(coat: Option<(f64, f64)>) -> Shape {
        let lobes = [(0.05, 0.06, 0.5), (0.1, 0.2, 0.4), (0.08, 0.5, 0.3)];
        Shape {
            diffuse: 0.1,
            lobes,
            coat,
            cost: 0.0,
            agreeing: 0,
            starts: 0,
        }
    }

    fn worst(a: &Shape, b: &Shape, samples: &[Sample]) -> f64 {
        let value = |s: &Shape, at: &Sample| {
            let (base, transmission, highlight) = s.terms(at.wi, at.wo);
            base * transmission + highlight
        };
        samples
            .iter()
            .map(|s| (value(a, s) / value(b, s) - 1.0).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn a_model_without_noise_is_found_again() {
        for coat in [None, Some((1.5, 0.03))] {
            let truth = known(coat);
            let samples = measure(&Known(truth.clone()), 4000, 70.0, 3);
            let search = coat.map_or(CoatSearch::Bare, |c| CoatSearch::Index(c.0));
            let found = fit_shape(&samples, search, 1.0, None, &|_| ()).expect("a fit");
            // Weights and Fresnel values trade against each other under a coat; what they reflect does not.
            let worst = worst(&found, &truth, &samples);
            assert!(worst < 0.02, "{coat:?}: {worst}, {found:?}");
        }
    }

    #[test]
    fn derivatives_are_those_of_the_luminance() {
        let g = geometry(
            [0.3, 0.1, 0.9_f64.sqrt()],
            [-0.1, 0.3, 0.9_f64.sqrt()],
            Some(1.4),
        );
        let p: Vec<f64> = vec![
            -2.0, -1.0, -1.5, -0.7, -2.0, -0.9, -1.0, -3.0, -0.5, -0.2, -1.0,
        ];
        let mut row = [0.0; MOST];
        g.luminance(&p, Some(&mut row));
        for k in 0..p.len() {
            let moved = |d: f64| {
                let mut q = p.clone();
                q[k] += d;
                g.luminance(&q, None)
            };
            // Central difference of 1e-5: error 1e-10 relative to the third derivative.
            let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!(
                (slope - row[k]).abs() < 1e-7 * row[k].abs().max(1e-3),
                "{k}: {slope} {}",
                row[k]
            );
        }
    }
}
