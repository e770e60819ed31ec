//! A feasible plan at the price of a few passes over the costs, with the gap it may have.
//!
//! The plan is the exact solver's start, the cheaper of a greedy and a monotone one. Three source duals are tried for its certificate: the tree's own, the row minima,
//! and the row minima after subtracting each target's mean cost. Each is completed to the best target duals it allows;
//! the best certificate is kept. Expect costs some ten percent above the optimum on paints that differ; the gap says how
//! much at most.

use super::Solver;
use super::cost::{Cost, LANES};
use super::plan::Plan;
use super::problem::{Problem, TransportError};
use super::start::{cheaper_start, row_minimum, steps_as_flows};
use super::vertex::Flow;
use super::workspace::Workspace;

/// The cheap solver.
#[derive(Clone, Copy, Debug, Default)]
pub struct Greedy;

impl Solver for Greedy {
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
            flows,
            source_duals,
            target_duals,
            ..
        } = workspace;
        cheaper_start(problem, matrix, units, start);
        flows.clear();
        flows.extend(steps_as_flows(&start.steps));
        flows.sort_unstable_by_key(|flow| (flow.source, flow.target));
        plan.restart();
        for &Flow {
            source,
            target,
            grains,
        } in &*flows
        {
            plan.push(units, source, target, grains);
        }
        plan.price(problem, cost);

        target_duals.clear();
        target_duals.resize(matrix.stride(), [0.0; LANES]);
        for use_means in [false, true] {
            if use_means {
                target_duals.copy_from_slice(matrix.target_means());
            }
            source_duals.clear();
            source_duals.extend(matrix.rows().map(|row| row_minimum(row, target_duals)));
            plan.certify(problem, matrix, cost, source_duals, target_duals);
        }
        start.tree_duals(matrix, source_duals, target_duals);
        plan.certify(problem, matrix, cost, source_duals, target_duals);
        Ok(())
    }
}
