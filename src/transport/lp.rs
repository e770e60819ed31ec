//! The transport problem handed to a general linear-programming library, as a second opinion.
//!
//! Slow (milliseconds where the simplex of this room takes tens of microseconds) and inexact, but written by others. Costs
//! are divided by the largest, masses multiplied by 1e5, and the last target's equality, which the others imply, is left
//! out: that is what the library copes with best. It still fails on some hard problems, and says so.
//!
//! Its flow is brought to a vertex with exact marginals, and certified by duals of our own making, so that a wrong answer
//! shows as a gap.

use good_lp::solvers::microlp::microlp;
use good_lp::{Expression, ProblemVariables, Solution, SolverModel, variable};

use super::Solver;
use super::cost::Cost;
use super::plan::Plan;
use super::problem::{Problem, TransportError};
use super::vertex::{residual_duals, vertex_below};
use super::workspace::Workspace;

/// What masses are multiplied by for the library, whose tolerances are absolute.
const MASS_SCALE: f64 = 1e5;

/// How far the library's own marginals may be off, of a total of 1.
const MARGINAL_TOLERANCE: f64 = 1e-9;

/// The reference solver.
#[derive(Clone, Copy, Debug, Default)]
pub struct LinearProgram;

impl Solver for LinearProgram {
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
            source_duals,
            target_duals,
            ..
        } = workspace;
        let (sources, targets) = (problem.source().len(), problem.target().len());
        let mut variables = ProblemVariables::new();
        let flows = variables.add_vector(variable().min(0.0), sources * targets);
        let scale = 1.0 / matrix.largest().max(f64::MIN_POSITIVE);
        let objective: Expression = (0..sources * targets)
            .map(|k| flows[k] * (matrix.at(k / targets, k % targets) * scale))
            .sum();
        let mut model = variables.minimise(objective).using(microlp);
        for (i, &mass) in problem.source().masses().iter().enumerate() {
            let row: Expression = flows[i * targets..(i + 1) * targets].iter().sum();
            model.add_constraint(row.eq(mass * MASS_SCALE));
        }
        for (j, &mass) in problem.target().masses()[..targets - 1].iter().enumerate() {
            let column: Expression = flows[j..].iter().step_by(targets).sum();
            model.add_constraint(column.eq(mass * MASS_SCALE));
        }
        let solution = model
            .solve()
            .map_err(|error| TransportError::LinearProgram(error.to_string()))?;
        let masses: Vec<f64> = flows
            .iter()
            .map(|&flow| solution.value(flow) / MASS_SCALE)
            .collect();
        check_marginals(problem, &masses)?;

        let moved = masses.iter().enumerate();
        vertex_below(
            problem,
            matrix,
            units,
            start,
            moved.map(|(k, &mass)| (k / targets, k % targets, mass)),
            plan,
        );
        plan.price(problem, cost);
        residual_duals(problem, matrix, plan, source_duals, target_duals);
        plan.certify(problem, matrix, cost, source_duals, target_duals);
        Ok(())
    }
}

fn check_marginals(problem: &Problem, masses: &[f64]) -> Result<(), TransportError> {
    let targets = problem.target().len();
    let sent = masses
        .chunks_exact(targets)
        .map(|row| row.iter().sum::<f64>());
    let received = (0..targets).map(|j| masses[j..].iter().step_by(targets).sum::<f64>());
    let wanted = problem
        .source()
        .masses()
        .iter()
        .chain(problem.target().masses());
    for (moved, &mass) in sent.chain(received).zip(wanted) {
        let off = moved - mass;
        if off.abs() > MARGINAL_TOLERANCE || off.is_nan() {
            return Err(TransportError::LinearProgram(format!(
                "its answer moves {moved} where the mass is {mass}"
            )));
        }
    }
    if let Some(negative) = masses.iter().find(|mass| **mass < -MARGINAL_TOLERANCE) {
        return Err(TransportError::LinearProgram(format!(
            "its answer moves {negative}"
        )));
    }
    Ok(())
}
