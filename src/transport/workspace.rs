//! Memory that solvers keep between problems, so that many problems in a row allocate nothing once it has grown.

use super::cost::{Cost, CostMatrix, LANES};
use super::problem::Problem;
use super::simplex::SimplexMemory;
use super::sinkhorn::Scaling;
use super::start::StartMemory;
use super::units::Units;
use super::vertex::Flow;

/// Memory for one thread's solvers. Keep one a thread; it holds nothing that changes a result.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    pub(super) matrix: CostMatrix,
    pub(super) units: Units,
    pub(super) start: StartMemory,
    pub(super) simplex: SimplexMemory,
    pub(super) flows: Vec<Flow>,
    pub(super) scaling: Scaling,
    pub(super) source_duals: Vec<f64>,
    pub(super) target_duals: Vec<[f64; LANES]>,
}

impl Workspace {
    /// Fills costs and units for a problem.
    pub(super) fn prepare(&mut self, problem: &Problem, cost: Cost) {
        self.matrix.fill(problem, cost);
        self.units.fill(problem);
    }
}
