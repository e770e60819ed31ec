//! Entropic transport: smooth, approximate, stabilised in the log domain.
//!
//! Minimises `Σ w_ij x_ij + η Σ x_ij (ln x_ij − 1)` with `η = ε · mean cost` by scaling rows and columns in turn:
//!
//! ```text
//! x_ij = a_i K_ij b_j,   K_ij = exp((f_i + g_j − w_ij) / η),   a ← p / (K b),   b ← q / (Kᵀ a)
//! ```
//!
//! Scalings that grow out of `e^±200` are absorbed into the potentials `f`, `g` and the kernel is built anew; where the kernel
//! underflows, a step is made on the potentials themselves with shifted exponentials. `η` starts at the mean cost and is
//! divided by 4 until it is what was asked for. It stops when the masses arriving at the sources are off by at most
//! [`Sinkhorn::RESIDUAL`] in all (targets are exact after each step), or is refused with [`TransportError::NotConverged`].
//!
//! The flow is then rounded to a feasible vertex, and the potentials certify its gap. Valid for `1e-9 ≤ ε ≤ 1e3`; small ε
//! on hard problems ends in the error, and the exact solver is faster long before.
//!
//! M. Cuturi, "Sinkhorn distances", NIPS 2013; B. Schmitzer, "Stabilized sparse scaling algorithms for entropy regularized
//! transport problems", SIAM J. Sci. Comput. 41(3), 2019; rounding after J. Altschuler, J. Weed, P. Rigollet, "Near-linear
//! time approximation algorithms for optimal transport via Sinkhorn iteration", NIPS 2017.

use super::Solver;
use super::cost::{Cost, CostMatrix};
use super::plan::Plan;
use super::problem::{Problem, TransportError};
use super::vertex::vertex_below;
use super::workspace::Workspace;

/// Largest size of a scaling's logarithm before it is absorbed.
const ABSORB: f64 = 200.0;

/// Steps between two looks at the residual.
const LOOK_EVERY: usize = 10;

/// What `η` is divided by from one stage to the next.
const STAGE: f64 = 4.0;

/// The entropic solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sinkhorn {
    /// Smoothing, as a part of the mean of all `w_ij`.
    pub epsilon: f64,
}

impl Sinkhorn {
    /// Promised sum of the sources' absolute marginal errors before rounding, of a total mass of 1.
    pub const RESIDUAL: f64 = 1e-6;

    /// Steps, of all stages together, after which the solver gives up.
    pub const MOST_STEPS: usize = 20_000;
}

impl Solver for Sinkhorn {
    fn solve_into(
        &self,
        problem: &Problem,
        cost: Cost,
        workspace: &mut Workspace,
        plan: &mut Plan,
    ) -> Result<(), TransportError> {
        problem.check_filled()?;
        if !(1e-9..=1e3).contains(&self.epsilon) {
            return Err(TransportError::Epsilon(self.epsilon));
        }
        workspace.prepare(problem, cost);
        let Workspace {
            matrix,
            units,
            start,
            scaling,
            source_duals,
            target_duals,
            ..
        } = workspace;
        scaling.fit(problem, matrix, self.epsilon)?;
        let targets = problem.target().len();
        let pairs = (0..problem.source().len()).flat_map(|i| (0..targets).map(move |j| (i, j)));
        let moved = pairs.map(|(i, j)| (i, j, scaling.mass(i, j)));
        vertex_below(problem, matrix, units, start, moved, plan);
        plan.price(problem, cost);
        source_duals.clear();
        source_duals.extend_from_slice(&scaling.f);
        target_duals.clear();
        target_duals.resize(matrix.stride(), [0.0; super::cost::LANES]);
        plan.certify(problem, matrix, cost, source_duals, target_duals);
        Ok(())
    }
}

/// Potentials, scalings and kernel.
#[derive(Clone, Debug, Default)]
pub(super) struct Scaling {
    f: Vec<f64>,
    g: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    kernel: Vec<f64>,
    sums: Vec<f64>,
}

impl Scaling {
    fn mass(&self, source: usize, target: usize) -> f64 {
        self.a[source] * self.kernel[source * self.b.len() + target] * self.b[target]
    }

    /// Runs all stages; ends with the scalings absorbed.
    fn fit(
        &mut self,
        problem: &Problem,
        matrix: &CostMatrix,
        epsilon: f64,
    ) -> Result<(), TransportError> {
        let (p, q) = (problem.source().masses(), problem.target().masses());
        let (sources, targets) = (p.len(), q.len());
        #[expect(clippy::cast_precision_loss, reason = "at most 2^24 pairs")]
        let pairs = (sources * targets) as f64;
        let mean = matrix
            .rows()
            .flat_map(|row| &row.as_flattened()[..targets])
            .sum::<f64>()
            / pairs;
        for (values, size, value) in [
            (&mut self.f, sources, 0.0),
            (&mut self.g, targets, 0.0),
            (&mut self.a, sources, 1.0),
            (&mut self.b, targets, 1.0),
        ] {
            values.clear();
            values.resize(size, value);
        }
        // All costs 0: any smoothing gives the product plan at once.
        let last = if mean > 0.0 { epsilon * mean } else { 1.0 };
        let mut eta = last.max(mean);
        let mut steps_left = Sinkhorn::MOST_STEPS;
        loop {
            self.step_on_potentials(p, q, matrix, eta);
            let residual = self.fit_stage(p, q, matrix, eta, &mut steps_left);
            if residual > Sinkhorn::RESIDUAL || residual.is_nan() {
                return Err(TransportError::NotConverged {
                    steps: Sinkhorn::MOST_STEPS,
                    residual,
                    promised: Sinkhorn::RESIDUAL,
                });
            }
            if eta <= last {
                return Ok(());
            }
            eta = (eta / STAGE).max(last);
        }
    }

    /// Scales until the residual is met or the steps run out; gives the residual.
    fn fit_stage(
        &mut self,
        p: &[f64],
        q: &[f64],
        matrix: &CostMatrix,
        eta: f64,
        steps_left: &mut usize,
    ) -> f64 {
        loop {
            let residual = self.residual(p);
            if residual <= Sinkhorn::RESIDUAL || *steps_left == 0 {
                self.absorb(matrix, eta);
                return residual;
            }
            for _ in 0..LOOK_EVERY.min(*steps_left) {
                *steps_left -= 1;
                let sound = self.scale(p, q);
                if !sound {
                    // What this step did to the scalings is not to be absorbed.
                    self.a.fill(1.0);
                    self.b.fill(1.0);
                    self.step_on_potentials(p, q, matrix, eta);
                    continue;
                }
                let grown = |s: &f64| s.ln().abs() > ABSORB;
                if self.a.iter().any(grown) || self.b.iter().any(grown) {
                    self.absorb(matrix, eta);
                }
            }
        }
    }

    /// One step on rows and columns; false where the kernel has no grip.
    fn scale(&mut self, p: &[f64], q: &[f64]) -> bool {
        let targets = q.len();
        self.sums.clear();
        self.sums.resize(targets, 0.0);
        let mut sound = true;
        for ((row, a), &mass) in self.kernel.chunks_exact(targets).zip(&mut self.a).zip(p) {
            let sum: f64 = row.iter().zip(&self.b).map(|(k, b)| k * b).sum();
            *a = mass / sum;
            sound &= a.is_normal();
            for (sum, k) in self.sums.iter_mut().zip(row) {
                *sum += *a * k;
            }
        }
        for ((b, &sum), &mass) in self.b.iter_mut().zip(&self.sums).zip(q) {
            *b = mass / sum;
            sound &= b.is_normal();
        }
        sound
    }

    /// Sum of the sources' marginal errors.
    fn residual(&self, p: &[f64]) -> f64 {
        let rows = self.kernel.chunks_exact(self.b.len());
        rows.zip(&self.a)
            .zip(p)
            .map(|((row, a), mass)| {
                let sum: f64 = row.iter().zip(&self.b).map(|(k, b)| k * b).sum();
                (a * sum - mass).abs()
            })
            .sum()
    }

    /// Moves the scalings into the potentials and builds the kernel anew.
    fn absorb(&mut self, matrix: &CostMatrix, eta: f64) {
        for (f, a) in self.f.iter_mut().zip(&mut self.a) {
            *f += eta * a.ln();
            *a = 1.0;
        }
        for (g, b) in self.g.iter_mut().zip(&mut self.b) {
            *g += eta * b.ln();
            *b = 1.0;
        }
        self.build_kernel(matrix, eta);
    }

    fn build_kernel(&mut self, matrix: &CostMatrix, eta: f64) {
        self.kernel.clear();
        for (row, f) in matrix.rows().zip(&self.f) {
            let costs = row.as_flattened().iter().zip(&self.g);
            self.kernel
                .extend(costs.map(|(cost, g)| ((f + g - cost) / eta).exp()));
        }
    }

    /// One step on the potentials, exponentials shifted by the largest exponent; always finite.
    fn step_on_potentials(&mut self, p: &[f64], q: &[f64], matrix: &CostMatrix, eta: f64) {
        for ((row, f), mass) in matrix.rows().zip(&mut self.f).zip(p) {
            let exponents = row.as_flattened().iter().zip(&self.g);
            let exponents = exponents.map(|(cost, g)| (g - cost) / eta);
            *f = eta * (mass.ln() - log_sum_exp(exponents));
        }
        for (j, (g, mass)) in self.g.iter_mut().zip(q).enumerate() {
            let exponents = matrix.rows().zip(&self.f);
            let exponents = exponents.map(|(row, f)| (f - row.as_flattened()[j]) / eta);
            *g = eta * (mass.ln() - log_sum_exp(exponents));
        }
        self.build_kernel(matrix, eta);
    }
}

/// `ln Σ exp(x)` without overflow.
fn log_sum_exp(exponents: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = exponents.clone().fold(f64::NEG_INFINITY, f64::max);
    largest + exponents.map(|x| (x - largest).exp()).sum::<f64>().ln()
}
