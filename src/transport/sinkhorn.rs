//! Entropic transport: smooth, approximate, stabilised in the log domain.
//!
//! Minimises `Σ w_ij x_ij + η Σ x_ij (ln x_ij − 1)` with `η = ε · mean cost` by scaling rows and columns in turn:
//!
//! ```text
//! x_ij = a_i K_ij b_j,   K_ij = exp((f_i + g_j − w_ij) / η)
//! a ← a^(1−ω) (p / (K b))^ω,   b ← b^(1−ω) (q / (Kᵀ a))^ω
//! ```
//!
//! A stage begins with plain steps, ω = 1. Where ten of them do not get far they are overrelaxed, ω = 1.875, all but the
//! last of ten, which leaves the targets exact; after ten that raised the residual come plain ones again, more each time.
//! Scalings that grow out of `1e±87` are absorbed into the potentials `f`, `g` and the kernel is built anew; where the
//! kernel underflows, a step is made on the potentials themselves with shifted exponentials. `η` starts at the mean cost
//! and is divided by 4 until it is what was asked for. The last stage stops when the masses arriving at the sources are
//! off by at most [`Sinkhorn::RESIDUAL`] in all, or the problem is refused with [`TransportError::NotConverged`].
//!
//! The flow is then rounded to a feasible vertex, and the potentials certify its gap. Valid for `1e-9 ≤ ε ≤ 1e3`; small ε
//! on hard problems ends in the error, and the exact solver is faster long before.
//!
//! M. Cuturi, "Sinkhorn distances", NIPS 2013; B. Schmitzer, "Stabilized sparse scaling algorithms for entropy regularized
//! transport problems", SIAM J. Sci. Comput. 41(3), 2019; A. Thibault, L. Chizat, C. Dossal, N. Papadakis, "Overrelaxed
//! Sinkhorn-Knopp algorithm for regularized optimal transport", Algorithms 14(5), 2021; rounding after J. Altschuler,
//! J. Weed, P. Rigollet, "Near-linear time approximation algorithms for optimal transport via Sinkhorn iteration", NIPS
//! 2017.

use super::Solver;
use super::cost::{Cost, CostMatrix, LANES};
use super::plan::Plan;
use super::problem::{Problem, TransportError};
use super::vertex::vertex_below;
use super::workspace::Workspace;

/// Scalings that are not absorbed yet: the product of two of them and a kernel entry is no overflow.
const GRIP: std::ops::RangeInclusive<f64> = 1e-87..=1e87;

/// By how much ten plain steps reduce the residual where overrelaxed ones would not do better: those gain at most
/// ω − 1 a step.
const FAST: f64 = 0.26;

/// Steps between two looks at the residual.
const LOOK_EVERY: usize = 10;

/// Residual that ends a stage before the last. Not looser, for what a tiny cluster is behind then it makes up for ever more
/// slowly.
const STAGE_RESIDUAL: f64 = 1e-5;

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
        target_duals.resize(matrix.stride(), [0.0; LANES]);
        plan.certify(problem, matrix, cost, source_duals, target_duals);
        Ok(())
    }
}

/// Potentials, scalings and kernel; the targets' scalings and the kernel's rows are padded with zeros.
#[derive(Clone, Debug, Default)]
pub(super) struct Scaling {
    f: Vec<f64>,
    g: Vec<f64>,
    a: Vec<f64>,
    b: Vec<[f64; LANES]>,
    kernel: Vec<[f64; LANES]>,
    sums: Vec<[f64; LANES]>,
}

impl Scaling {
    fn mass(&self, source: usize, target: usize) -> f64 {
        let row = &self.kernel[source * self.b.len()..][..self.b.len()];
        self.a[source] * row.as_flattened()[target] * self.b.as_flattened()[target]
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
        ] {
            values.clear();
            values.resize(size, value);
        }
        self.b.clear();
        self.b.resize(matrix.stride(), [0.0; LANES]);
        self.restart_scalings();
        // All costs 0: any smoothing gives the product plan at once.
        let last = if mean > 0.0 { epsilon * mean } else { 1.0 };
        let mut eta = last.max(mean);
        let mut steps_left = Sinkhorn::MOST_STEPS;
        loop {
            self.step_on_potentials(p, q, matrix, eta);
            let promised = if eta <= last {
                Sinkhorn::RESIDUAL
            } else {
                STAGE_RESIDUAL
            };
            let residual = self.fit_stage((p, q), matrix, eta, promised, &mut steps_left);
            if residual > promised || residual.is_nan() {
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
        (p, q): (&[f64], &[f64]),
        matrix: &CostMatrix,
        eta: f64,
        promised: f64,
        steps_left: &mut usize,
    ) -> f64 {
        let mut before = f64::INFINITY;
        let mut relaxes = false;
        let (mut plain_batches, mut plain_next_time) = (0_usize, 1_usize);
        loop {
            let residual = self.residual(p);
            if residual <= promised || *steps_left == 0 {
                self.absorb(matrix, eta);
                return residual;
            }
            // A batch that went too far shows in the residual, which plain steps never raise.
            if relaxes && residual >= before {
                plain_batches = plain_next_time;
                plain_next_time = plain_next_time.saturating_mul(2);
            }
            relaxes = plain_batches == 0 && (relaxes || residual > FAST * before);
            plain_batches = plain_batches.saturating_sub(1);
            before = residual;
            let batch = LOOK_EVERY.min(*steps_left);
            for k in 0..batch {
                *steps_left -= 1;
                // The last one before a look is plain, so that the targets are exact.
                let step = Step {
                    scaling: self,
                    p,
                    q,
                    relaxed: relaxes && k + 1 < batch,
                };
                if !pulp::Arch::new().dispatch(step) {
                    // What this step did to the scalings is not to be absorbed.
                    self.restart_scalings();
                    self.step_on_potentials(p, q, matrix, eta);
                    relaxes = false;
                    continue;
                }
                let grown = |s: &f64| !GRIP.contains(s);
                if self.a.iter().any(grown) || self.b.as_flattened()[..q.len()].iter().any(grown) {
                    self.absorb(matrix, eta);
                }
            }
        }
    }

    fn restart_scalings(&mut self) {
        self.a.fill(1.0);
        self.b.as_flattened_mut()[..self.g.len()].fill(1.0);
    }

    /// Sum of the sources' marginal errors.
    fn residual(&self, p: &[f64]) -> f64 {
        let rows = self.kernel.chunks_exact(self.b.len());
        rows.zip(&self.a)
            .zip(p)
            .map(|((row, a), mass)| (a * dot(row, &self.b) - mass).abs())
            .sum()
    }

    /// Moves the scalings into the potentials and builds the kernel anew.
    fn absorb(&mut self, matrix: &CostMatrix, eta: f64) {
        for (f, a) in self.f.iter_mut().zip(&self.a) {
            *f += eta * a.ln();
        }
        for (g, b) in self.g.iter_mut().zip(self.b.as_flattened()) {
            *g += eta * b.ln();
        }
        self.restart_scalings();
        self.build_kernel(matrix, eta);
    }

    fn build_kernel(&mut self, matrix: &CostMatrix, eta: f64) {
        let targets = self.g.len();
        self.kernel.clear();
        self.kernel
            .resize(matrix.stride() * self.f.len(), [0.0; LANES]);
        let rows = self.kernel.chunks_exact_mut(matrix.stride());
        for ((kernel, costs), f) in rows.zip(matrix.rows()).zip(&self.f) {
            let kernel = &mut kernel.as_flattened_mut()[..targets];
            for ((k, cost), g) in kernel.iter_mut().zip(costs.as_flattened()).zip(&self.g) {
                *k = ((f + g - cost) / eta).exp();
            }
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

/// `Σ x y`, lane by lane: eight sums that do not wait for one another.
#[inline(always)]
fn dot(x: &[[f64; LANES]], y: &[[f64; LANES]]) -> f64 {
    let mut sums = [0.0; LANES];
    for (x, y) in x.iter().zip(y) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum()
}

/// One step on all rows and columns; false where the kernel has no grip.
struct Step<'a> {
    scaling: &'a mut Scaling,
    p: &'a [f64],
    q: &'a [f64],
    relaxed: bool,
}

impl pulp::NullaryFnOnce for Step<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let Scaling {
            a, b, kernel, sums, ..
        } = self.scaling;
        // Relaxed, the scaling goes as s^1.875 = s · √s · √√s · √√√s where the plain step would have it go as s.
        let scaled = |old: f64, plain: f64| {
            if self.relaxed {
                let root = (plain / old).sqrt();
                let root_of_root = root.sqrt();
                plain * root * root_of_root * root_of_root.sqrt()
            } else {
                plain
            }
        };
        sums.clear();
        sums.resize(b.len(), [0.0; LANES]);
        let mut sound = true;
        for ((row, a), &mass) in kernel.chunks_exact(b.len()).zip(a).zip(self.p) {
            *a = scaled(*a, mass / dot(row, b));
            sound &= a.is_normal();
            for (sums, row) in sums.iter_mut().zip(row) {
                for lane in 0..LANES {
                    sums[lane] += *a * row[lane];
                }
            }
        }
        let columns = b.as_flattened_mut().iter_mut().zip(sums.as_flattened());
        for ((b, &sum), &mass) in columns.zip(self.q) {
            *b = scaled(*b, mass / sum);
            sound &= b.is_normal();
        }
        sound
    }
}

/// `ln Σ exp(x)` without overflow.
fn log_sum_exp(exponents: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = exponents.clone().fold(f64::NEG_INFINITY, f64::max);
    largest + exponents.map(|x| (x - largest).exp()).sum::<f64>().ln()
}
