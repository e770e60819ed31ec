//! The color table of readings: what a curve must be multiplied by to read what was read.
//!
//! ```text
//! minimise Σ_k (chi(θh_k,θd_k) − read_k/curve_k)² + μ_d Σ (chi_rc − chi_rc')² + μ_h Σ (chi_rc − chi_r'c)²
//! ```
//!
//! over the table's nodes, per channel of linear sRGB. Rows stand at the half angles of the readings. A table has one
//! column, and two where readings of nearly one θh see it under θd that differ, as those at −15° and 15° do: what the
//! second of them saw is then believed for large θd, and only at that θh. μ is small: it leaves the readings as they are,
//! and gives nodes that nobody read their neighbours' color, that of the same θh first.

use std::f64::consts::PI;

use super::Read;
use super::curve::{Curve, SAME_ANGLE_DEG};
use crate::color::{Lab, LinearRgb, ciede2000, luminance};
use crate::descent::damped_step;
use crate::paint::{AngleGrid, Bracket, ColorTable, LEAST_STEP_DEG};

/// Weight of a difference along θd and along θh against that from a reading.
const ALONG_D: f64 = 1e-4;
const ALONG_H: f64 = 1e-6;
/// θd that differ by less are one, degrees: a color table's own step is of that size.
const APART_D_DEG: f64 = 4.0;
/// Luminance of a curve that is none, 1/sr: there any color will do.
const NOTHING: f64 = 1e-7;
/// Largest factor on a curve, far above what its fit leaves.
pub(super) const MOST_OF_CURVE: f64 = 1e3;
/// CIEDE2000 by which a color may move into the gamut before that is told: what nobody sees.
const UNSEEN: f64 = 0.1;

/// A fitted table and what had to be done to it.
pub(super) struct FittedColors {
    pub table: ColorTable,
    /// Aspecular angles of readings that were brought into the gamut.
    pub mapped: Vec<f64>,
    /// Aspecular angles of readings that are more than [`MOST_OF_CURVE`] times the curve.
    pub held: Vec<f64>,
}

/// Fits the color table that makes a curve read what was read; `None` where none does.
pub(super) fn fit_colors(reads: &[Read], curve: &Curve) -> Option<FittedColors> {
    let (mut mapped, mut held) = (Vec::new(), Vec::new());
    let ratio = |read: &Read| -> LinearRgb {
        let (base, moved) = inside_gamut(read.base);
        // What flakes outshine is black, which is told as that.
        if moved > UNSEEN && read.below_zero == 0.0 {
            mapped.push(read.aspecular_deg);
        }
        let shape = curve.at(read);
        if shape < NOTHING {
            return [1.0; 3];
        }
        let factors = base.map(|v| v / shape);
        if factors.iter().any(|&v| v > MOST_OF_CURVE) {
            held.push(read.aspecular_deg);
        }
        factors.map(|v| v.min(MOST_OF_CURVE))
    };
    let ratios: Vec<LinearRgb> = reads.iter().map(ratio).collect();
    let places: Vec<[f64; 2]> = reads
        .iter()
        .map(|r| [r.half.theta_h.to_degrees(), r.half.theta_d.to_degrees()])
        .collect();
    let [rows, columns] = grids(&places);
    let nodes = nodes(&places, &ratios, &rows, &columns)?;
    // Least squares may go a rounding below what was read.
    let lab = |rgb: &LinearRgb| Lab::from_rgb(rgb.map(|v| v.clamp(0.0, MOST_OF_CURVE)));
    let labs = nodes.iter().map(lab).collect();
    let table = ColorTable::new(rows, columns, labs, lab(&overall(&ratios))).ok()?;
    Some(FittedColors {
        table,
        mapped,
        held,
    })
}

/// A color of which no channel is negative, and its CIEDE2000 to the one given: cut, or made grayer at its luminance
/// (black where that is negative), whichever is nearer.
pub(super) fn inside_gamut(rgb: LinearRgb) -> (LinearRgb, f64) {
    let least = rgb.iter().copied().fold(f64::INFINITY, f64::min);
    let gray = luminance(rgb);
    if least >= 0.0 {
        return (rgb, 0.0);
    }
    let away = |other: LinearRgb| {
        let lab = |rgb: LinearRgb| Lab::from_rgb(rgb.map(|v| v * PI));
        ciede2000(lab(rgb), lab(other))
    };
    let cut = rgb.map(|v| v.max(0.0));
    // The share of gray at which the least channel is 0.
    let grayer = if gray > 0.0 {
        let share = least / (least - gray);
        rgb.map(|v| (v + share * (gray - v)).max(0.0))
    } else {
        [0.0; 3]
    };
    if away(cut) < away(grayer) {
        (cut, away(cut))
    } else {
        (grayer, away(grayer))
    }
}

/// Rows at the half angles that were read; a second column where two of them are nearly one and θd is not.
fn grids(places: &[[f64; 2]]) -> [AngleGrid; 2] {
    // Of two readings of one θh that with the smaller θd, the one on the light's side of the mirror, comes first.
    let mut order: Vec<[f64; 2]> = places.to_vec();
    order.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let twin = |of: &[f64; 2]| {
        let near = |other: &&[f64; 2]| (other[0] - of[0]).abs() < SAME_ANGLE_DEG;
        let wider = |other: &&[f64; 2]| other[1] - of[1] >= APART_D_DEG;
        order.iter().filter(near).find(wider).map(|other| other[1])
    };
    let (mut rows, mut narrow, mut wide) = (Vec::new(), Vec::new(), Vec::new());
    for place in &order {
        if let Some(other) = twin(place) {
            narrow.push(place[1]);
            wide.push(other);
        }
    }
    for place in &order {
        let is_twin = wide.contains(&place[1])
            && order.iter().any(|of| {
                (of[0] - place[0]).abs() < SAME_ANGLE_DEG && place[1] - of[1] >= APART_D_DEG
            });
        if !is_twin {
            rows.push(place[0]);
        }
    }
    let mean = |angles: &[f64]| angles.iter().sum::<f64>() / angles.len() as f64;
    let columns = if narrow.is_empty() || mean(&wide) - mean(&narrow) < APART_D_DEG {
        vec![0.0]
    } else {
        vec![mean(&narrow), mean(&wide)]
    };
    [rows, columns].map(|mut angles| {
        angles.dedup_by(|above, kept| *above - *kept < 10.0 * LEAST_STEP_DEG);
        AngleGrid::new(angles).unwrap_or_else(|_| AngleGrid::single())
    })
}

/// Colors of the nodes, θd fastest; `None` where they do not follow from the readings.
fn nodes(
    places: &[[f64; 2]],
    ratios: &[LinearRgb],
    rows: &AngleGrid,
    columns: &AngleGrid,
) -> Option<Vec<LinearRgb>> {
    let (width, count) = (columns.len(), rows.len() * columns.len());
    let mut matrix = vec![0.0; count * count];
    let mut data = vec![[0.0; 3]; count];
    let mut add = |terms: &[(usize, f64)], weight: f64| {
        for &(r, x) in terms {
            for &(c, y) in terms {
                matrix[r * count + c] += weight * x * y;
            }
        }
    };
    for (place, ratio) in places.iter().zip(ratios) {
        let [row, column] = [rows.bracket(place[0]), columns.bracket(place[1])];
        let mut terms = Vec::with_capacity(4);
        for (r, u) in ends(row) {
            for (c, v) in ends(column) {
                terms.push((r * width + c, u * v));
            }
        }
        add(&terms, 1.0);
        for (node, share) in terms {
            for k in 0..3 {
                data[node][k] += share * ratio[k];
            }
        }
    }
    for node in 0..count {
        if node % width > 0 {
            add(&[(node, 1.0), (node - 1, -1.0)], ALONG_D);
        }
        if node >= width {
            add(&[(node, 1.0), (node - width, -1.0)], ALONG_H);
        }
    }
    let channel = |k: usize| {
        let data: Vec<f64> = data.iter().map(|rgb| rgb[k]).collect();
        damped_step(&data, |r, c| matrix[r * count + c], 0.0, 1e-12)
    };
    let (r, g, b) = (channel(0)?, channel(1)?, channel(2)?);
    let colors = r.iter().zip(&g).zip(&b);
    Some(colors.map(|((&r, &g), &b)| [r, g, b]).collect())
}

fn ends(bracket: Bracket) -> [(usize, f64); 2] {
    [
        (bracket.low, 1.0 - bracket.fraction),
        (bracket.high, bracket.fraction),
    ]
}

/// The one color that stands for all: the median of each channel, of luminance 1 since the curve has the brightness.
fn overall(ratios: &[LinearRgb]) -> LinearRgb {
    let median = |k: usize| {
        let mut values: Vec<f64> = ratios.iter().map(|rgb| rgb[k]).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(1.0)
    };
    let color: LinearRgb = std::array::from_fn(median);
    let bright = luminance(color);
    if bright > 1e-6 {
        color.map(|v| v / bright)
    } else {
        [1.0; 3]
    }
}
