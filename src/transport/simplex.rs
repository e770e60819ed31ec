//! The exact solver: a transportation simplex in whole numbers.
//!
//! Dantzig's method on the bipartite graph: a spanning tree is a basis; potentials with `u_i + v_j = w_ij` on its edges
//! price all others; an edge with `w_ij < u_i + v_j` enters, the flow turns around the cycle it closes, and the edge whose
//! flow falls to zero first leaves. Masses are whole grains (see [`super::units`]), so no pivot is degenerate, arithmetic
//! on flows is exact and the cost falls at every pivot. Rows are priced one at a time, each until all its pairs are right.
//!
//! Potentials drift by a rounding a pivot. Before a basis is accepted they are computed afresh, and all pairs are priced
//! against those; the target duals of the plan come out of the same pass.
//!
//! G. B. Dantzig, "Application of the simplex method to a transportation problem", 1951; R. K. Ahuja, T. L. Magnanti,
//! J. B. Orlin, *Network Flows*, 1993, chapter 11.

use super::cost::{Cost, CostMatrix, LANES};
use super::plan::{Plan, target_duals_for};
use super::problem::{Problem, TransportError};
use super::start::{StartMemory, cheaper_start, column_of, row_minimum};
use super::tree::{Tree, shift};
use super::units::Units;
use super::workspace::Workspace;
use super::{LinearProgram, Solver};

/// Pairs are taken as priced right down to minus this times the largest cost: several roundings of a potential.
const PRICE_TOLERANCE: f64 = 4e-15;

/// Pivots per point after which that tolerance is doubled. An honest problem never gets there; one in which roundings
/// alone drive the pivots ends soon after, and its gap tells.
const PATIENCE: usize = 20;

/// Pivots after which the method is given up, per point. Paint slices of 50 clusters take about 1.
const MOST_PIVOTS_PER_POINT: usize = 400;

/// The exact solver.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransportSimplex;

impl Solver for TransportSimplex {
    fn solve_into(
        &self,
        problem: &Problem,
        cost: Cost,
        workspace: &mut Workspace,
        plan: &mut Plan,
    ) -> Result<(), TransportError> {
        problem.check_filled()?;
        workspace.prepare(problem, cost);
        let Workspace {
            matrix,
            units,
            start,
            simplex,
            ..
        } = workspace;
        let most_pivots = MOST_PIVOTS_PER_POINT * (problem.source().len() + problem.target().len());
        let job = Job {
            problem,
            matrix,
            units,
            cost,
            most_pivots,
        };
        let points = problem.source().len().max(problem.target().len());
        let scratch = &mut simplex.scratch;
        let solved = match points {
            0..=64 => job.dispatch(&mut simplex.to_64, start, scratch, plan),
            65..=128 => job.dispatch(&mut simplex.to_128, start, scratch, plan),
            129..=256 => job.dispatch(&mut simplex.to_256, start, scratch, plan),
            257..=512 => job.dispatch(&mut simplex.to_512, start, scratch, plan),
            513..=1024 => job.dispatch(&mut simplex.to_1024, start, scratch, plan),
            _ => job.dispatch(&mut simplex.to_4096, start, scratch, plan),
        };
        if solved {
            return Ok(());
        }
        LinearProgram.solve_into(problem, cost, workspace, plan)
    }
}

/// The solver's memory between problems.
#[derive(Clone, Debug, Default)]
pub(super) struct SimplexMemory {
    to_64: Tree<1>,
    to_128: Tree<2>,
    to_256: Tree<4>,
    to_512: Tree<8>,
    to_1024: Tree<16>,
    to_4096: Tree<64>,
    scratch: Scratch,
}

#[derive(Clone, Debug, Default)]
struct Scratch {
    source_values: Vec<f64>,
    target_values: Vec<[f64; LANES]>,
    allowed: Vec<[f64; LANES]>,
}

struct Job<'a> {
    problem: &'a Problem,
    matrix: &'a CostMatrix,
    units: &'a Units,
    cost: Cost,
    most_pivots: usize,
}

/// A job with all it needs, compiled once for every processor and once for those with wide registers. Both do the same
/// operations on the same lanes, so that the bits are the same.
struct Run<'a, const W: usize> {
    job: Job<'a>,
    tree: &'a mut Tree<W>,
    start: &'a mut StartMemory,
    scratch: &'a mut Scratch,
    plan: &'a mut Plan,
}

impl<const W: usize> pulp::NullaryFnOnce for Run<'_, W> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        self.job.run(self.tree, self.start, self.scratch, self.plan)
    }
}

impl Job<'_> {
    fn dispatch<const W: usize>(
        self,
        tree: &mut Tree<W>,
        start: &mut StartMemory,
        scratch: &mut Scratch,
        plan: &mut Plan,
    ) -> bool {
        pulp::Arch::new().dispatch(Run {
            job: self,
            tree,
            start,
            scratch,
            plan,
        })
    }

    /// Solves; false if the pivots ran out.
    #[inline(always)]
    fn run<const W: usize>(
        &self,
        tree: &mut Tree<W>,
        start: &mut StartMemory,
        scratch: &mut Scratch,
        plan: &mut Plan,
    ) -> bool {
        let matrix = self.matrix;
        let (sources, targets) = (self.units.supplies.len(), self.units.demands.len());
        let Scratch {
            source_values,
            target_values,
            allowed,
        } = scratch;
        cheaper_start(self.problem, matrix, self.units, start);
        tree.plant(sources, targets, &start.steps);
        source_values.clear();
        source_values.resize(sources, 0.0);
        for values in [&mut *target_values, &mut *allowed] {
            values.clear();
            values.resize(matrix.stride(), [0.0; LANES]);
        }
        let mut pricing = Pricing {
            tolerance: PRICE_TOLERANCE * matrix.largest(),
            pivots: 0,
            most_pivots: self.most_pivots,
            patience: PATIENCE * (sources + targets),
        };
        let cost = |source, target| matrix.at(source, target);
        tree.potentials(cost, source_values, target_values.as_flattened_mut());
        loop {
            let before = pricing.pivots;
            if !pricing.pivot_until_right(tree, matrix, target_values) {
                return false;
            }
            let pivoted = pricing.pivots > before;
            if pivoted {
                tree.potentials(cost, source_values, target_values.as_flattened_mut());
            }
            target_duals_for(matrix, source_values, allowed);
            let (values, allowed) = (target_values.as_flattened(), allowed.as_flattened());
            // Rows and columns round differently. What the rows call right with fresh potentials is right, or the two
            // would argue for ever about a pair on the very edge of the tolerance.
            if !pivoted || (0..targets).all(|j| allowed[j] >= values[j] - pricing.tolerance) {
                break;
            }
        }
        plan.restart();
        tree.for_each_edge(|source, target, grains| plan.push(self.units, source, target, grains));
        plan.price(self.problem, self.cost);
        plan.offer(
            self.problem,
            self.cost,
            source_values,
            allowed.as_flattened(),
        );
        true
    }
}

/// How far pairs may be from right, and the pivots made to get them there.
struct Pricing {
    tolerance: f64,
    pivots: usize,
    most_pivots: usize,
    /// Pivots after which the tolerance doubles.
    patience: usize,
}

impl Pricing {
    /// Pivots until every row in a round is priced right; false if the pivots ran out.
    #[inline(always)]
    fn pivot_until_right<const W: usize>(
        &mut self,
        tree: &mut Tree<W>,
        matrix: &CostMatrix,
        target_values: &mut [[f64; LANES]],
    ) -> bool {
        let rows = matrix.rows().len();
        let mut source = 0;
        let mut right_in_turn = 0;
        while right_in_turn < rows {
            let row = matrix.row(source);
            let minimum = row_minimum(row, target_values);
            // The source's value: the edge to its parent is tight.
            let parent = tree.parent_of(source);
            let value = row.as_flattened()[parent] - target_values.as_flattened()[parent];
            let reduced = minimum - value;
            if reduced < -self.tolerance {
                if self.pivots == self.most_pivots {
                    return false;
                }
                self.pivots += 1;
                if self.pivots.is_multiple_of(self.patience) {
                    self.tolerance *= 2.0;
                }
                right_in_turn = 0;
                let target = column_of(row, target_values, minimum);
                let swing = tree.pivot(source, target);
                // The entering edge becomes tight: its moved end takes the whole reduced cost.
                let step = if swing.with_source { reduced } else { -reduced };
                shift(&swing.moved, target_values, -step);
                // The same row again: that takes fewer pricings than going on to the next.
                continue;
            }
            right_in_turn += 1;
            source += 1;
            if source == rows {
                source = 0;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Clouds whose start is not the optimum.
    fn crossed() -> Problem {
        let at = |x: f64, y: f64| [x, y, 0.0];
        let source: Vec<_> = (0..12)
            .map(|i| at(f64::from(i * 7 % 12), f64::from(i * i % 11)))
            .collect();
        let target: Vec<_> = (0..12)
            .map(|i| at(f64::from(i * 5 % 13), f64::from(i * i * i % 13)))
            .collect();
        Problem::new(&source, &[1.0; 12], &target, &[1.0; 12]).expect("a fine problem")
    }

    fn run(most_pivots: usize) -> (bool, Plan) {
        let problem = crossed();
        let mut workspace = Workspace::default();
        workspace.prepare(&problem, Cost::Distance);
        let job = Job {
            problem: &problem,
            matrix: &workspace.matrix,
            units: &workspace.units,
            cost: Cost::Distance,
            most_pivots,
        };
        let mut plan = Plan::default();
        let solved = job.run(
            &mut Tree::<1>::default(),
            &mut workspace.start,
            &mut Scratch::default(),
            &mut plan,
        );
        (solved, plan)
    }

    #[test]
    fn running_out_of_pivots_is_noticed() {
        assert!(!run(0).0);
        let (solved, plan) = run(100);
        assert!(solved && plan.gap <= 1e-9 * plan.cost + 1e-13, "{plan:?}");
    }
}
