//! The luminance of readings by angle: a diffuse part and up to three lobes.
//!
//! ```text
//! minimise Σ_k ρ( (y_k − a/π − Σ_j s_j f(θh_k; α_j)) / (y_k + ε) ),   a, s ≥ 0
//! ```
//!
//! Half a dozen readings do not tell a dozen parameters, so few are asked for: roughnesses are chosen from a grid, n half
//! angles are given at most (n − 1) / 2 lobes, and a lobe that explains less than a hundredth of one reading is left
//! out. For given roughnesses the problem is linear; every choice of them is tried, so that there is no start to depend
//! on and no local minimum. No lobe is narrower than the half angle that was read nearest to the mirror direction: at the
//! mirror direction, which nobody saw, it is at most e times as bright as there. ρ grows as the square of 5 % and less,
//! and linearly beyond, by reweighting. At last the whole is scaled so that it is too bright as often as too dark.
//!
//! Readings cannot tell F0 from a lobe's weight: under a coat Schlick's term adds a thousandth at most. It is fixed at that
//! of aluminium, of which flakes are made. A smaller one would let the lobes of an uncoated paint grow towards grazing,
//! where nothing was read, until they give back more light than they get.

use std::f64::consts::PI;

use super::{BLACK, Read};
use crate::color::luminance;
use crate::descent::damped_step;
use crate::paint::Lobe;

/// Fresnel value of every lobe.
const F0: f64 = 0.9;
/// Most lobes.
const LOBES: usize = 3;
/// Roughnesses to choose from.
const ROUGHNESSES: usize = 26;
/// Widest lobe, and narrowest whatever was read.
const WIDEST: f64 = 1.0;
const NARROWEST: f64 = 0.02;
/// Lobes of one paint differ in roughness by this factor at least; nearer ones are one lobe to half a dozen readings.
const APART: f64 = 1.3;
/// Relative error from which readings count linearly.
const ROBUST: f64 = 0.05;
/// How often they are reweighted.
const REWEIGHTED: usize = 3;
/// Relative error of one reading that is worth a lobe.
const WORTH_A_LOBE: f64 = 0.01;
/// Half angles nearer than this are one angle, degrees: a lens of an instrument sees several degrees.
pub(super) const SAME_ANGLE_DEG: f64 = 1.5;

/// Everything of a base but its color.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    /// Lambertian albedo.
    pub diffuse: f64,
    /// By ascending roughness, weights equal in all channels.
    pub lobes: Vec<Lobe>,
    /// How many half angles told it.
    pub angles: usize,
}

impl Curve {
    /// Luminance of the base at a reading, inside the coat, 1/sr.
    pub fn at(&self, read: &Read) -> f64 {
        let lobes = self
            .lobes
            .iter()
            .map(|lobe| lobe.weight[0] * lobe.shape(&read.half, read.cosines.0, read.cosines.1));
        self.diffuse / PI + lobes.sum::<f64>()
    }
}

/// Fits the luminance of readings.
pub(super) fn fit_curve(reads: &[Read]) -> Curve {
    let angles = distinct_angles(reads);
    let nearest = reads
        .iter()
        .map(|r| r.half.tan2_h.sqrt())
        .fold(WIDEST, f64::min);
    let narrowest = nearest.max(NARROWEST);
    let most = LOBES.min(angles.saturating_sub(1) / 2);
    let roughness =
        |k: usize| narrowest * (WIDEST / narrowest).powf(k as f64 / (ROUGHNESSES - 1) as f64);
    let lobes: Vec<Lobe> = (0..ROUGHNESSES)
        .map(|k| Lobe {
            weight: [1.0; 3],
            alpha: roughness(k),
            f0: F0,
        })
        .collect();
    let columns = |read: &Read| -> Vec<f64> {
        let shape = |lobe: &Lobe| lobe.shape(&read.half, read.cosines.0, read.cosines.1);
        std::iter::once(1.0 / PI)
            .chain(lobes.iter().map(shape))
            .collect()
    };
    let rows: Vec<(Vec<f64>, f64)> = reads
        .iter()
        .map(|read| (columns(read), luminance(read.base).max(0.0)))
        .collect();
    let mut weights: Vec<f64> = rows.iter().map(|(_, y)| 1.0 / (y + BLACK)).collect();
    let mut found = Choice::default();
    for _ in 0..=REWEIGHTED {
        found = Sums::new(&rows, &weights).best(&lobes, most);
        for ((columns, y), weight) in rows.iter().zip(&mut weights) {
            let error = (found.value(columns) - y) / (y + BLACK);
            *weight = (1.0 + (error / ROBUST).powi(2)).powf(-0.25) / (y + BLACK);
        }
    }
    let scale = middle_ratio(&rows, &found);
    let mut curve = Curve {
        diffuse: 0.0,
        lobes: Vec::new(),
        angles,
    };
    for (&column, &value) in found.columns.iter().zip(&found.values) {
        match column.checked_sub(1).and_then(|k| lobes.get(k)) {
            None => curve.diffuse = scale * value,
            Some(lobe) => curve.lobes.push(Lobe {
                weight: [scale * value; 3],
                ..*lobe
            }),
        }
    }
    curve
}

/// The middle one of what was read over what was found, which the color table must not have to make good: a relative
/// error forgives a curve that is too dark more than one that is too bright.
fn middle_ratio(rows: &[(Vec<f64>, f64)], found: &Choice) -> f64 {
    let ratio = |(columns, y): &(Vec<f64>, f64)| (y + BLACK) / (found.value(columns) + BLACK);
    let mut ratios: Vec<f64> = rows.iter().map(ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let (low, high) = (ratios.len().saturating_sub(1) / 2, ratios.len() / 2);
    match (ratios.get(low), ratios.get(high)) {
        (Some(low), Some(high)) => (low * high).sqrt(),
        _ => 1.0,
    }
}

/// Half angles that are not nearly the same.
fn distinct_angles(reads: &[Read]) -> usize {
    let mut angles: Vec<f64> = reads.iter().map(|r| r.half.theta_h.to_degrees()).collect();
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|above, kept| *above - *kept < SAME_ANGLE_DEG);
    angles.len()
}

/// Columns, diffuse or lobes, and how much of each.
#[derive(Clone, Debug, Default, PartialEq)]
struct Choice {
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl Choice {
    fn value(&self, columns: &[f64]) -> f64 {
        let terms = self.columns.iter().zip(&self.values);
        terms
            .map(|(&k, v)| v * columns.get(k).copied().unwrap_or(0.0))
            .sum()
    }
}

/// Sums over readings that every choice of columns is judged by.
struct Sums {
    products: Vec<Vec<f64>>,
    with_data: Vec<f64>,
    data: f64,
}

impl Sums {
    fn new(rows: &[(Vec<f64>, f64)], weights: &[f64]) -> Self {
        let count = rows.first().map_or(0, |row| row.0.len());
        let mut sums = Self {
            products: vec![vec![0.0; count]; count],
            with_data: vec![0.0; count],
            data: 0.0,
        };
        for ((columns, y), weight) in rows.iter().zip(weights) {
            let squared = weight * weight;
            for (r, &column) in columns.iter().enumerate() {
                for (sum, other) in sums.products[r].iter_mut().zip(columns) {
                    *sum += squared * column * other;
                }
                sums.with_data[r] += squared * column * y;
            }
            sums.data += squared * y * y;
        }
        sums
    }

    /// The cheapest choice of at most so many lobes with or without a diffuse part, of which none is negative.
    fn best(&self, lobes: &[Lobe], most: usize) -> Choice {
        let mut best = (self.data, Choice::default());
        let mut chosen = Vec::with_capacity(most);
        self.try_more(lobes, most, &mut chosen, &mut best);
        best.1
    }

    fn try_more(
        &self,
        lobes: &[Lobe],
        most: usize,
        chosen: &mut Vec<usize>,
        best: &mut (f64, Choice),
    ) {
        for diffuse in [true, false] {
            let columns: Vec<usize> = diffuse
                .then_some(0)
                .into_iter()
                .chain(chosen.iter().copied())
                .collect();
            if let Some((cost, values)) = self.solved(&columns) {
                let cost = cost + WORTH_A_LOBE * WORTH_A_LOBE * chosen.len() as f64;
                if cost < best.0 {
                    *best = (cost, Choice { columns, values });
                }
            }
        }
        if chosen.len() == most {
            return;
        }
        let after = chosen.last().copied().unwrap_or(0);
        for k in after + 1..=lobes.len() {
            let apart = after == 0 || lobes[k - 1].alpha >= APART * lobes[after - 1].alpha;
            if apart {
                chosen.push(k);
                self.try_more(lobes, most, chosen, best);
                chosen.pop();
            }
        }
    }

    /// Least squares with these columns, unless one of them would be negative.
    fn solved(&self, columns: &[usize]) -> Option<(f64, Vec<f64>)> {
        if columns.is_empty() {
            return None;
        }
        let data: Vec<f64> = columns.iter().map(|&k| self.with_data[k]).collect();
        // The floor is a rounding of the diagonal: columns that are one to the readings are refused, not divided.
        let values = damped_step(
            &data,
            |r, c| self.products[columns[r]][columns[c]],
            1e-13,
            0.0,
        )?;
        let explained: f64 = values.iter().zip(&data).map(|(v, d)| v * d).sum();
        values
            .iter()
            .all(|&v| v >= 0.0)
            .then(|| ((self.data - explained).max(0.0), values))
    }
}
