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

mod coat_search;
mod luminance_model;

use std::f64::consts::PI;

use rayon::prelude::*;

use super::directions::{NEAR_MIRROR_DEG, Sample};
use super::least_squares::{Minimum, Normal, Problem, minimise};
use super::steps::{Steps, Tell};
use crate::paint::{Coat, Direction, Lobe, half_angles, refract, transmission};

pub(super) use coat_search::CoatSearch;
use coat_search::{bounds, starts, starts_from};
use luminance_model::{COAT_IOR, COAT_ROUGHNESS, Geometry, MOST, geometry};

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
        let (i, o, transmission, highlight) = match self.coat {
            None => (wi, wo, 1.0, 0.0),
            Some((ior, roughness)) => {
                let coat = Coat {
                    roughness,
                    ..Coat::smooth(ior)
                };
                let inner = (refract(wi, ior), refract(wo, ior));
                let passed = transmission(wi, wo, ior);
                (inner.0, inner.1, passed, coat.highlight(wi, wo))
            }
        };
        let h = half_angles(i, o);
        let mut base = self.diffuse / PI;
        for &(weight, alpha, f0) in &self.lobes {
            let lobe = Lobe {
                weight: [weight; 3],
                alpha,
                f0,
            };
            base += weight * lobe.shape(&h, i[2], o[2]);
        }
        (base, transmission, highlight)
    }
}

#[cfg(test)]
mod tests;
