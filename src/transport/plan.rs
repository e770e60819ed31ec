//! A transport plan with the certificate of how good it is.
//!
//! A plan is a list of at most `ns + nt − 1` entries, sorted by source, then target. Its duals `u`, `v` satisfy
//! `u_i + v_j ≤ w_ij` for every pair (up to a few roundings of the largest cost), so that
//!
//! ```text
//! Σ p_i u_i + Σ q_j v_j  ≤  optimum  ≤  cost
//! ```
//!
//! and `gap`, the difference of the two ends, bounds how far the plan is from the optimum whoever made it.
//! Optimal plans are not unique: compare costs and gaps of two solvers, never entries.

use super::cost::{Cost, CostMatrix};
use super::problem::Problem;
use super::units::Units;

/// Mass moved from one source point to one target point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanEntry {
    /// Index of the source point.
    pub source: usize,
    /// Index of the target point.
    pub target: usize,
    /// Mass moved, positive.
    pub mass: f64,
}

/// A feasible transport plan and its dual certificate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// What moves where, sorted by `(source, target)`.
    pub entries: Vec<PlanEntry>,
    /// `Σ w_ij x_ij` of the true cost.
    pub cost: f64,
    /// Dual values of the sources, `u`.
    pub source_duals: Vec<f64>,
    /// Dual values of the targets, `v`.
    pub target_duals: Vec<f64>,
    /// `cost` minus the dual objective, at least 0: the optimum is no further below `cost` than this.
    pub gap: f64,
}

impl Plan {
    /// Starts a new plan in this one's memory.
    pub(super) fn restart(&mut self) {
        self.entries.clear();
        self.source_duals.clear();
        self.target_duals.clear();
        self.cost = 0.0;
        self.gap = f64::INFINITY;
    }

    /// Appends a flow of grains; flows of less than a unit are none.
    pub(super) fn push(&mut self, units: &Units, source: usize, target: usize, grains: i64) {
        if let Some(mass) = units.mass(source, target, grains) {
            self.entries.push(PlanEntry {
                source,
                target,
                mass,
            });
        }
    }

    /// Sums up the cost of the entries.
    pub(super) fn price(&mut self, problem: &Problem, cost: Cost) {
        let (from, to) = (problem.source().points(), problem.target().points());
        self.cost = self
            .entries
            .iter()
            .map(|entry| entry.mass * cost.between(from[entry.source], to[entry.target]))
            .sum();
    }

    /// Takes source duals of the tilted matrix, gives every target the largest dual they allow, and keeps the
    /// certificate if its gap is the smallest seen. Needs [`Plan::price`] before.
    pub(super) fn certify(
        &mut self,
        problem: &Problem,
        matrix: &CostMatrix,
        cost: Cost,
        source_duals: &[f64],
        target_duals: &mut [[f64; super::cost::LANES]],
    ) {
        target_duals_for(matrix, source_duals, target_duals);
        self.offer(problem, cost, source_duals, target_duals.as_flattened());
    }

    /// Keeps duals of the tilted matrix if their gap is the smallest seen.
    pub(super) fn offer(
        &mut self,
        problem: &Problem,
        cost: Cost,
        source_duals: &[f64],
        target_duals: &[f64],
    ) {
        let untilt = 1.0 / cost.tilt();
        let dot = |masses: &[f64], duals: &[f64]| -> f64 {
            masses.iter().zip(duals).map(|(m, d)| m * d).sum()
        };
        let (p, q) = (problem.source().masses(), problem.target().masses());
        let dual = (dot(p, source_duals) + dot(q, target_duals)) * untilt;
        let gap = (self.cost - dual).max(0.0);
        if gap < self.gap {
            self.gap = gap;
            self.source_duals.clear();
            self.source_duals
                .extend(source_duals[..p.len()].iter().map(|u| u * untilt));
            self.target_duals.clear();
            self.target_duals
                .extend(target_duals[..q.len()].iter().map(|v| v * untilt));
        }
    }
}

/// The largest target duals that given source duals allow: `v_j = min_i (w_ij − u_i)`.
pub(super) fn target_duals_for(
    matrix: &CostMatrix,
    source_duals: &[f64],
    target_duals: &mut [[f64; super::cost::LANES]],
) {
    target_duals.fill([f64::INFINITY; super::cost::LANES]);
    for (row, &u) in matrix.rows().zip(source_duals) {
        for (costs, duals) in row.iter().zip(&mut *target_duals) {
            for (cost, dual) in costs.iter().zip(duals) {
                let slack = cost - u;
                *dual = if slack < *dual { slack } else { *dual };
            }
        }
    }
}
