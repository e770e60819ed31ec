//! What a correspondence costs pair by pair, and how far that is from the best that the pair alone could have.
//!
//! ```text
//! cost(i, j) = Σ_k p_k w(c_k^i, c_k^j)  ≥  optimum(i, j)  ≥  dual bound(i, j)
//! ```
//!
//! in distances, Lab units, whatever cost the correspondence was found with, so that `gap = cost − dual bound` bounds the
//! pair's excess and can be compared. Of two paints whose distance was minimised exactly it is the gap of the plans
//! themselves, over all slices. Otherwise pairs are transported alone, exactly, on at most [`CHECKED`] slices spread evenly over the
//! grid; the report says how many.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::BlendError;
use super::correspondence::{BlendSettings, Grid};
use super::mixture::clusters_at;
use super::slice::{Scratch, SliceBlend};
use crate::paint::CarPaint;
use crate::transport::{Cost, Method, Solver};

/// Most slices on which pairs are transported alone.
pub(super) const CHECKED: usize = 64;

/// How well two paints of a blend correspond.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairReport {
    /// The two paints, by place in hash order.
    pub paints: [usize; 2],
    /// Mean distance in Lab between corresponding clusters, over all slices.
    pub mean_cost: f64,
    /// Mean excess over the dual bound of the pair alone, Lab units, over the slices that were checked.
    pub mean_gap: f64,
    /// Largest such excess.
    pub largest_gap: f64,
    /// Slices that were checked.
    pub checked: usize,
}

/// Reports of all pairs, in the order of `(first, second)`.
pub(super) fn pair_reports(
    paints: &[&CarPaint],
    slices: &[SliceBlend],
    grid: Grid<'_>,
    settings: &BlendSettings,
    order: &[usize],
) -> Result<Vec<PairReport>, BlendError> {
    let count = slices.len();
    let mut reports = Vec::new();
    for i in 0..order.len() {
        for j in i + 1..order.len() {
            let costs: Vec<f64> = slices
                .par_iter()
                .map(|s| s.cost_of_pair(i, j, Cost::Distance))
                .collect();
            #[allow(clippy::cast_precision_loss)] // a count of slices
            let mean_cost = costs.iter().sum::<f64>() / count.max(1) as f64;
            let exact = settings.method == Method::Exact && settings.cost == Cost::Distance;
            let gaps: Vec<f64> = if order.len() == 2 && exact {
                slices.iter().map(|s| s.gap).collect()
            } else {
                let step = count.div_ceil(CHECKED).max(1);
                (0..count)
                    .into_par_iter()
                    .step_by(step)
                    .map_init(Scratch::default, |scratch, k| {
                        bound_alone([paints[i], paints[j]], grid.angles(k), scratch)
                            .map(|bound| (costs[k] - bound).max(0.0))
                            .map_err(|source| grid.refused(k, source))
                    })
                    .collect::<Result<_, _>>()?
            };
            #[allow(clippy::cast_precision_loss)] // a count of slices
            let mean_gap = gaps.iter().sum::<f64>() / gaps.len().max(1) as f64;
            reports.push(PairReport {
                paints: [i, j],
                mean_cost,
                mean_gap,
                largest_gap: gaps.iter().copied().fold(0.0, f64::max),
                checked: gaps.len(),
            });
        }
    }
    Ok(reports)
}

/// Dual bound of the distance of one paint's slice from the other's.
fn bound_alone(
    pair: [&CarPaint; 2],
    (theta_h_deg, theta_d_deg): (f64, f64),
    scratch: &mut Scratch,
) -> Result<f64, crate::transport::TransportError> {
    let mut clouds = [Vec::new(), Vec::new()];
    for (paint, cloud) in pair.iter().zip(&mut clouds) {
        clusters_at(
            paint.flakes.as_ref(),
            theta_h_deg,
            theta_d_deg,
            &mut scratch.clusters,
        );
        cloud.extend(scratch.clusters.iter().map(|c| (c.center(), c.probability)));
    }
    let [source, target] = clouds;
    scratch.problem.refill(source, target)?;
    Method::Exact.solve_into(
        &scratch.problem,
        Cost::Distance,
        &mut scratch.workspace,
        &mut scratch.plan,
    )?;
    Ok(scratch.plan.cost - scratch.plan.gap)
}

impl SliceBlend {
    /// Cost of the correspondence between two of its paints.
    fn cost_of_pair(&self, i: usize, j: usize, cost: Cost) -> f64 {
        let center = |(lower, upper): &([f32; 3], [f32; 3])| -> [f64; 3] {
            std::array::from_fn(|k| f64::midpoint(f64::from(lower[k]), f64::from(upper[k])))
        };
        let ends = self.boxes[i].iter().zip(&self.boxes[j]);
        ends.zip(&self.probability)
            .map(|((from, to), p)| p * cost.between(center(from), center(to)))
            .sum()
    }

    /// Cost of the correspondence over all pairs of its paints.
    pub(super) fn pairwise_cost(&self, cost: Cost) -> f64 {
        let paints = self.boxes.len();
        (0..paints)
            .flat_map(|i| (i + 1..paints).map(move |j| (i, j)))
            .map(|(i, j)| self.cost_of_pair(i, j, cost))
            .sum()
    }
}
