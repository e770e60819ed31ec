//! The color table: per (θh, θd), the color that the shape must be multiplied by.
//!
//! ```text
//! chi(θh, θd) = median over φd and a small cell of  (measured − highlight) / (transmission · shape),  per channel
//! ```
//!
//! A median, because a flaky sample is noise around it, and neither clamped sensor noise nor a few spoiled entries move
//! it. Nodes stand densely next to the mirror direction, and where the six-angle instruments read; there the cell is
//! half a degree wide, so that what an instrument reads is fitted and not interpolated. Nodes without data take their
//! neighbours' color. A color outside the gamut becomes the nearest one inside, since reflectance is not negative.
//!
//! Golla and Klein 2018, 3.1 (color as the per-angle residual).

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::directions::{Sample, TRUSTED_DEG};
use super::lobes::{DARK, Shape};
use super::steps::{Steps, Tell};
use super::stream::Stream;
use crate::color::{Lab, LinearRgb, ciede2000, luminance};
use crate::measurement::{MeasuredBrdf, half_frame_pair};
use crate::paint::{AngleGrid, ColorTable, Direction, half_angles, instrument_pairs, refract};

/// Most angles of half and difference angle that a fitted color table has.
pub const FITTED_ANGLES: [usize; 2] = [THETA_H.len(), THETA_D.len()];

const THETA_H: [f64; 31] = [
    0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.5, 9.0, 10.5, 12.5, 15.0, 17.5, 20.0, 22.5,
    26.0, 30.0, 34.0, 37.5, 42.0, 46.0, 50.0, 55.0, 60.0, 65.0, 70.0, 80.0, 90.0,
];
const THETA_D: [f64; 20] = [
    0.0, 3.0, 7.5, 10.0, 14.0, 18.0, 22.5, 27.5, 32.5, 37.5, 42.0, 47.0, 52.5, 57.0, 61.0, 65.0,
    70.0, 75.0, 80.0, 90.0,
];

/// Beyond this nothing measured is believed.
const OUTERMOST_DEG: f64 = 76.0;
/// Weight of samples between what is trusted and what is believed.
const OUTER_WEIGHT: f64 = 0.05;
/// Samples of an ordinary node, and of one that an instrument reads.
const NODE_SAMPLES: usize = 384;
const INSTRUMENT_SAMPLES: usize = 2048;
/// Least weight of samples that makes a node.
const LEAST_WEIGHT: f64 = 8.0;
/// What a factor e in luminance weighs against one CIEDE2000 when a color is brought into the gamut.
const LIGHTNESS_WEIGHT: f64 = 10.0;
/// The same where an instrument reads: there color decides.
const INSTRUMENT_LIGHTNESS_WEIGHT: f64 = 2.0;

/// In which medium a measurement's directions are, and which coat stands between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Frame {
    /// Measured in air.
    Air,
    /// Measured inside a coat of this index.
    Inside(f64),
}

/// A fitted table and what had to be done to it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TableFit {
    pub table: ColorTable,
    /// Nodes brought into the gamut.
    pub mapped: usize,
    /// Which nodes have a color of their neighbours, for nothing was measured there.
    pub guessed: Vec<bool>,
}

/// The grid's angles, those of the instruments among them.
fn angles(base: &[f64], instrument: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut angles = base.to_vec();
    let mut taken = vec![false; angles.len()];
    for value in instrument {
        let inner = 1..angles.len() - 1;
        let near = inner.filter(|&k| !taken[k]).min_by(|&a, &b| {
            let off = |k: usize| (angles[k] - value).abs();
            off(a).total_cmp(&off(b))
        });
        if let Some(k) = near {
            angles[k] = value;
            taken[k] = true;
        }
    }
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|b, a| *b - *a < 1e-6);
    angles
}

/// Borders of the cells around grid angles: halfway to the neighbours.
fn cell(angles: &[f64], k: usize) -> (f64, f64) {
    let low = if k == 0 {
        angles[0]
    } else {
        f64::midpoint(angles[k - 1], angles[k])
    };
    let high = if k + 1 == angles.len() {
        angles[k]
    } else {
        f64::midpoint(angles[k], angles[k + 1])
    };
    (low, high)
}

/// One node's colors before the gaps are filled.
struct Node {
    color: Option<LinearRgb>,
    mapped: bool,
}

struct TableProblem<'a> {
    measured: &'a dyn MeasuredBrdf,
    shape: &'a Shape,
    unit: f64,
}

impl TableProblem<'_> {
    #[allow(clippy::cast_precision_loss)] // A few thousand at most.
    /// What was measured in a cell over what the shape reflects there, or over `terms` where they are given.
    fn cell_samples(
        &self,
        h: (f64, f64),
        d: (f64, f64),
        seed: u64,
        terms: Option<Terms>,
    ) -> Vec<Ratio> {
        let count = if terms.is_some() {
            INSTRUMENT_SAMPLES
        } else {
            NODE_SAMPLES
        };
        let mut stream = Stream::new(seed);
        let trusted = TRUSTED_DEG.to_radians().cos();
        let outermost = OUTERMOST_DEG.to_radians().cos();
        let mut out = Vec::with_capacity(count);
        for k in 0..count {
            let theta_h = h.0 + stream.unit() * (h.1 - h.0);
            let theta_d = d.0 + stream.unit() * (d.1 - d.0);
            // Azimuths in even steps: flakes make them the noisiest of the three.
            let phi_d = TAU * k as f64 / count as f64;
            let pair = half_frame_pair(theta_h.to_radians(), theta_d.to_radians(), phi_d);
            let ior = self.shape.coat.map_or(1.0, |c| c.0);
            let (Some(wi), Some(wo)) = (outside(pair.0, ior), outside(pair.1, ior)) else {
                continue;
            };
            let least = wi[2].min(wo[2]);
            if least <= outermost {
                continue;
            }
            let Some(sample) = Sample::take(self.measured, wi, wo) else {
                continue;
            };
            let weight = if least > trusted { 1.0 } else { OUTER_WEIGHT };
            let terms = terms.unwrap_or_else(|| self.shape.terms(wi, wo));
            out.push(ratio(terms, &sample, weight, self.unit));
        }
        out
    }

    fn node(&self, samples: &mut [Ratio], lightness_weight: f64) -> Node {
        let total: f64 = samples.iter().map(|s| s.weight).sum();
        if total < LEAST_WEIGHT {
            return Node {
                color: None,
                mapped: false,
            };
        }
        let color: LinearRgb = std::array::from_fn(|k| weighted_median(samples, |s| s.color[k]));
        if color.iter().all(|v| *v >= 0.0) {
            return Node {
                color: Some(color),
                mapped: false,
            };
        }
        let shape = weighted_median(samples, |s| s.shape);
        let highlight = weighted_median(samples, |s| s.highlight);
        if highlight > 0.1 * shape || shape <= 0.0 {
            // The coat is brighter than the sample there: no color of the base can darken it.
            return Node {
                color: Some(color.map(|v| v.max(0.0))),
                mapped: false,
            };
        }
        let seen = color.map(|v| v * shape * PI / self.unit);
        let inside = nearest_in_gamut(seen, lightness_weight);
        Node {
            color: Some(inside.map(|v| v * self.unit / (shape * PI))),
            mapped: true,
        }
    }
}

/// Base, transmission and highlight of a shape.
type Terms = (f64, f64, f64);

/// A sample's color relative to the shape.
#[derive(Clone, Copy, Debug)]
struct Ratio {
    color: LinearRgb,
    shape: f64,
    highlight: f64,
    weight: f64,
}

fn ratio((base, transmission, highlight): Terms, sample: &Sample, weight: f64, unit: f64) -> Ratio {
    let base = (base * transmission).max(1e-9 * unit);
    Ratio {
        color: sample.rgb.map(|v| (v - highlight) / base),
        shape: base,
        highlight,
        weight,
    }
}

/// Direction in air of a direction inside; `None` for what is reflected totally or lies below the horizon.
fn outside(w: Direction, ior: f64) -> Option<Direction> {
    let (x, y) = (w[0] * ior, w[1] * ior);
    let z2 = 1.0 - x * x - y * y;
    (w[2] > 0.0 && z2 > 0.0).then(|| if ior == 1.0 { w } else { [x, y, z2.sqrt()] })
}

fn weighted_median(samples: &mut [Ratio], value: impl Fn(&Ratio) -> f64) -> f64 {
    samples.sort_by(|a, b| value(a).total_cmp(&value(b)));
    let half = samples.iter().map(|s| s.weight).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    for s in samples.iter() {
        sum += s.weight;
        if sum >= half {
            return value(s);
        }
    }
    0.0
}

/// The color with no negative channel that lies nearest, `lightness_weight` per factor e of luminance included.
///
/// Negative channels become 0, the others are searched by halving steps in their logarithm.
fn nearest_in_gamut(seen: LinearRgb, lightness_weight: f64) -> LinearRgb {
    let bright = luminance(seen);
    let mut best = seen.map(|v| v.max(0.0));
    if bright <= 0.0 {
        return best;
    }
    let (target, dark) = (Lab::from_rgb(seen), DARK * PI);
    let distance = |rgb: LinearRgb| {
        let off = ((luminance(rgb) + dark) / (bright + dark)).ln().abs();
        ciede2000(Lab::from_rgb(rgb), target) + lightness_weight * off
    };
    let mut least = distance(best);
    let mut step = 0.4;
    while step > 2e-3 {
        let mut moved = false;
        for k in 0..3 {
            for factor in [f64::exp(step), f64::exp(-step)] {
                let mut next = best;
                next[k] *= factor;
                let d = distance(next);
                if d < least {
                    (best, least, moved) = (next, d, true);
                }
            }
        }
        if !moved {
            step /= 2.0;
        }
    }
    best
}

/// Fills nodes without data from their neighbours, ring by ring.
fn fill(nodes: &[Node], columns: usize) -> Vec<LinearRgb> {
    let mut colors: Vec<Option<LinearRgb>> = nodes.iter().map(|n| n.color).collect();
    let rows = colors.len() / columns;
    while colors.iter().any(Option::is_none) && colors.iter().any(Option::is_some) {
        let before = colors.clone();
        for r in 0..rows {
            for c in 0..columns {
                if before[r * columns + c].is_some() {
                    continue;
                }
                let around = [
                    (r.wrapping_sub(1), c),
                    (r + 1, c),
                    (r, c.wrapping_sub(1)),
                    (r, c + 1),
                ];
                let known: Vec<LinearRgb> = around
                    .into_iter()
                    .filter(|&(r, c)| r < rows && c < columns)
                    .filter_map(|(r, c)| before[r * columns + c])
                    .collect();
                let Some(count) = u32::try_from(known.len()).ok().filter(|&n| n > 0) else {
                    continue;
                };
                let mean =
                    |k: usize| known.iter().map(|rgb| rgb[k]).sum::<f64>() / f64::from(count);
                colors[r * columns + c] = Some(std::array::from_fn(mean));
            }
        }
    }
    colors.into_iter().map(|c| c.unwrap_or([1.0; 3])).collect()
}

/// Fits the color table of a shape, and the one color that stands for it.
///
/// `samples` are those that the shape was fitted to; `unit` the brightness they are judged in.
pub(super) fn fit_color_table(
    measured: &dyn MeasuredBrdf,
    shape: &Shape,
    frame: Frame,
    samples: &[Sample],
    unit: f64,
    tell: Tell<'_>,
) -> TableFit {
    let bent = match frame {
        Frame::Air => shape.coat.map_or(1.0, |c| c.0),
        Frame::Inside(ior) => ior,
    };
    let read: Vec<(f64, f64, Terms)> = instrument_pairs()
        .iter()
        .map(|&(wi, wo)| {
            let inner = (refract(wi, bent), refract(wo, bent));
            let half = half_angles(inner.0, inner.1);
            let measured = if frame == Frame::Air { (wi, wo) } else { inner };
            (
                half.theta_h.to_degrees(),
                half.theta_d.to_degrees(),
                shape.terms(measured.0, measured.1),
            )
        })
        .collect();
    let rows = angles(&THETA_H, read.iter().map(|a| a.0));
    let columns = angles(&THETA_D, read.iter().map(|a| a.1));
    let problem = TableProblem {
        measured,
        shape,
        unit,
    };
    let steps = Steps::new(rows.len() * columns.len(), tell);
    let nodes: Vec<Node> = (0..rows.len() * columns.len())
        .into_par_iter()
        .map(|k| {
            steps.done(1);
            let (r, c) = (k / columns.len(), k % columns.len());
            let here = |a: &&(f64, f64, Terms)| {
                (a.0 - rows[r]).abs() < 1e-5 && (a.1 - columns[c]).abs() < 1e-5
            };
            let seed = 0x5EED ^ (k as u64).wrapping_mul(0x2545_F491_4F6C_DD1D);
            if let Some(&(_, _, terms)) = read.iter().find(here) {
                let (h, d) = (
                    (rows[r] - 0.25, rows[r] + 0.25),
                    (columns[c] - 0.25, columns[c] + 0.25),
                );
                let mut samples = problem.cell_samples(h, d, seed, Some(terms));
                return problem.node(&mut samples, INSTRUMENT_LIGHTNESS_WEIGHT);
            }
            let mut samples = problem.cell_samples(cell(&rows, r), cell(&columns, c), seed, None);
            problem.node(&mut samples, LIGHTNESS_WEIGHT)
        })
        .collect();
    let mapped = nodes.iter().filter(|n| n.mapped).count();
    let colors = fill(&nodes, columns.len());

    let mut ratios: Vec<Ratio> = samples
        .iter()
        .map(|s| ratio(shape.terms(s.wi, s.wo), s, 1.0, unit))
        .collect();
    let overall: LinearRgb =
        std::array::from_fn(|k| weighted_median(&mut ratios, |s| s.color[k]).max(0.0));
    // The shape was fitted to luminance: the one color must not change it.
    let bright = luminance(overall);
    let overall = if bright > 1e-6 {
        overall.map(|v| v / bright)
    } else {
        [1.0; 3]
    };

    let grid = |angles: Vec<f64>| AngleGrid::new(angles).unwrap_or_else(|_| AngleGrid::single());
    let lab = |rgb: &LinearRgb| Lab::from_rgb(rgb.map(|v| v.clamp(0.0, 1e4)));
    let labs: Vec<Lab> = colors.iter().map(lab).collect();
    let table = ColorTable::new(grid(rows), grid(columns), labs, lab(&overall))
        .unwrap_or_else(|_| ColorTable::white());
    TableFit {
        table,
        mapped,
        guessed: nodes.iter().map(|node| node.color.is_none()).collect(),
    }
}

#[cfg(test)]
mod tests;
