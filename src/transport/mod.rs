//! Optimal transport between two weighted point clouds: numbers only, no paint.
//!
//! ```text
//! minimise Σ w_ij x_ij   with x ≥ 0,  Σ_j x_ij = p_i,  Σ_i x_ij = q_j
//! ```
//!
//! A [`Problem`] holds two clouds, a [`Cost`] says what moving a unit of mass costs, a [`Method`] says which solver to use,
//! and the answer is a [`Plan`]: at most `ns + nt − 1` pairs with their masses, and duals that bound how far it is from the
//! optimum. Promised of every plan, whoever solved it:
//!
//! - regrouped by source or by target it gives the masses back to 1e-12, and no source or target is missing from it;
//! - its gap to the dual bound is stated, and the exact solver's is at most 1e-9 of the cost plus rounding;
//! - the same problem gives the same plan, bit for bit, whatever was solved before in the same [`Workspace`].
//!
//! Not promised: that two solvers give the same plan, which is not unique, or that the plan from `A` to `B` is that from
//! `B` to `A` turned round; a caller that needs the latter fixes an order of the two.
//!
//! # Examples
//!
//! ```
//! use carpaint::transport::{Cost, Method, Problem, Workspace, solve};
//!
//! let problem = Problem::new(&[[0.0; 3], [1.0, 0.0, 0.0]], &[0.5, 0.5], &[[2.0, 0.0, 0.0]], &[1.0])?;
//! let plan = solve(&problem, Method::Exact, Cost::Distance, &mut Workspace::default())?;
//! assert_eq!(plan.cost, 1.5);
//! # Ok::<(), carpaint::transport::TransportError>(())
//! ```

mod cost;
mod greedy;
mod lp;
mod plan;
mod problem;
mod simplex;
mod sinkhorn;
mod start;
mod tree;
mod units;
mod vertex;
mod workspace;

pub use cost::Cost;
pub use greedy::Greedy;
pub use lp::LinearProgram;
pub use plan::{Plan, PlanEntry};
pub use problem::{Cloud, MOST_POINTS, Problem, Side, TransportError};
pub use simplex::TransportSimplex;
pub use sinkhorn::Sinkhorn;
pub use workspace::Workspace;

/// A way to solve transport problems.
pub trait Solver {
    /// Solves into the memory of an earlier plan. After an error the plan's content means nothing.
    ///
    /// # Errors
    ///
    /// [`TransportError::Empty`] for a problem that was never filled, and what the solver could not keep its promise on.
    fn solve_into(
        &self,
        problem: &Problem,
        cost: Cost,
        workspace: &mut Workspace,
        plan: &mut Plan,
    ) -> Result<(), TransportError>;
}

/// Which solver: a setting that can be stored and sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Method {
    /// [`TransportSimplex`].
    #[default]
    Exact,
    /// [`Sinkhorn`].
    Sinkhorn {
        /// Smoothing, as a part of the mean cost.
        epsilon: f64,
    },
    /// [`Greedy`].
    Greedy,
    /// [`LinearProgram`].
    LinearProgram,
}

impl Solver for Method {
    fn solve_into(
        &self,
        problem: &Problem,
        cost: Cost,
        workspace: &mut Workspace,
        plan: &mut Plan,
    ) -> Result<(), TransportError> {
        match *self {
            Self::Exact => TransportSimplex.solve_into(problem, cost, workspace, plan),
            Self::Sinkhorn { epsilon } => {
                Sinkhorn { epsilon }.solve_into(problem, cost, workspace, plan)
            }
            Self::Greedy => Greedy.solve_into(problem, cost, workspace, plan),
            Self::LinearProgram => LinearProgram.solve_into(problem, cost, workspace, plan),
        }
    }
}

/// Solves a problem. Keep the workspace for the next one; use [`Solver::solve_into`] to keep the plan's memory too.
///
/// # Errors
///
/// As [`Solver::solve_into`].
pub fn solve(
    problem: &Problem,
    method: Method,
    cost: Cost,
    workspace: &mut Workspace,
) -> Result<Plan, TransportError> {
    let mut plan = Plan::default();
    method.solve_into(problem, cost, workspace, &mut plan)?;
    Ok(plan)
}

#[cfg(test)]
mod tests;
