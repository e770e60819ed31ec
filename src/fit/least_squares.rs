//! Robust nonlinear least squares for a dozen bounded parameters.
//!
//! Minimises `Σ ρ(r)`, `ρ(r) = 2 c² (√(1 + r²/c²) − 1)`, quadratic below c and linear above, by Levenberg and Marquardt
//! on reweighted residuals. Bounds are kept by projection: a parameter that stands at a bound and wants out is left out
//! of the step. Dense normal equations: not for more than some twenty parameters, and not for ill-scaled ones.

use crate::descent::damped_step;

/// Sums that a residual adds to.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    count: usize,
    scale: f64,
    /// Lower triangle of `Σ w JᵀJ`, row-major in a full square.
    matrix: Vec<f64>,
    gradient: Vec<f64>,
    cost: f64,
}

impl Normal {
    fn new(count: usize, scale: f64) -> Self {
        Self {
            count,
            scale,
            matrix: vec![0.0; count * count],
            gradient: vec![0.0; count],
            cost: 0.0,
        }
    }

    /// Adds one residual and its derivatives by parameter.
    pub fn add(&mut self, residual: f64, derivatives: &[f64]) {
        let root = (1.0 + (residual / self.scale).powi(2)).sqrt();
        self.cost += 2.0 * self.scale * self.scale * (root - 1.0);
        let weight = 1.0 / root;
        for (row, &d) in derivatives.iter().enumerate() {
            let wd = weight * d;
            self.gradient[row] += wd * residual;
            let start = row * self.count;
            for (m, &e) in self.matrix[start..=start + row].iter_mut().zip(derivatives) {
                *m += wd * e;
            }
        }
    }

    /// Adds one residual to the cost alone.
    pub fn add_cost(&mut self, residual: f64) {
        self.cost +=
            2.0 * self.scale * self.scale * ((1.0 + (residual / self.scale).powi(2)).sqrt() - 1.0);
    }
}

/// Something whose residuals are to be made small.
pub(super) trait Problem {
    /// Adds every residual at these parameters; derivatives only where `derivatives` is set.
    fn accumulate(&self, parameters: &[f64], derivatives: bool, sums: &mut Normal);
    /// Least and largest value of each parameter.
    fn bounds(&self) -> &[(f64, f64)];
}

/// Where a descent ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Minimum {
    pub parameters: Vec<f64>,
    pub cost: f64,
}

/// Descends from `start` in at most `iterations` steps; `scale` is the residual from which errors count linearly.
pub(super) fn minimise(
    problem: &impl Problem,
    start: &[f64],
    scale: f64,
    iterations: usize,
) -> Minimum {
    let bounds = problem.bounds();
    let clamp = |p: Vec<f64>| -> Vec<f64> {
        p.iter()
            .zip(bounds)
            .map(|(v, b)| v.clamp(b.0, b.1))
            .collect()
    };
    let mut at = clamp(start.to_vec());
    let n = at.len();
    let mut damping = 1e-2;
    let evaluate = |p: &[f64], derivatives: bool| {
        let mut sums = Normal::new(n, scale);
        problem.accumulate(p, derivatives, &mut sums);
        sums
    };
    let mut sums = evaluate(&at, true);
    for _ in 0..iterations {
        let free: Vec<usize> = (0..n)
            .filter(|&k| {
                let (low, high) = bounds[k];
                !((at[k] <= low && sums.gradient[k] > 0.0)
                    || (at[k] >= high && sums.gradient[k] < 0.0))
            })
            .collect();
        let gradient: Vec<f64> = free.iter().map(|&k| sums.gradient[k]).collect();
        let matrix = |r: usize, c: usize| sums.matrix[free[r] * n + free[c]];
        let Some(step) = damped_step(&gradient, matrix, damping, 1e-12) else {
            damping *= 10.0;
            if damping > 1e12 {
                break;
            }
            continue;
        };
        let mut next = at.clone();
        for (&k, d) in free.iter().zip(&step) {
            // Parameters are logarithms: a step beyond a factor of twenty is a leap in the dark.
            next[k] -= d.clamp(-3.0, 3.0);
        }
        let next = clamp(next);
        let cost = evaluate(&next, false).cost;
        if cost < sums.cost {
            let gain = (sums.cost - cost) / sums.cost.max(f64::MIN_POSITIVE);
            at = next;
            sums = evaluate(&at, true);
            damping = (damping / 5.0).max(1e-9);
            if gain < 1e-7 {
                break;
            }
        } else {
            damping *= 4.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    Minimum {
        cost: sums.cost,
        parameters: at,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `y = exp(p0) exp(−exp(p1) x)`, one point a hundred times too high.
    struct Decay {
        bounds: [(f64, f64); 2],
        outlier: bool,
    }

    impl Problem for Decay {
        fn accumulate(&self, p: &[f64], _derivatives: bool, sums: &mut Normal) {
            for k in 0..20 {
                let x = f64::from(k) / 4.0;
                let mut y = 2.0 * (-0.7 * x).exp();
                if self.outlier && k == 7 {
                    y *= 100.0;
                }
                let residual = p[0] - p[1].exp() * x - y.ln();
                sums.add(residual, &[1.0, -p[1].exp() * x]);
            }
        }
        fn bounds(&self) -> &[(f64, f64)] {
            &self.bounds
        }
    }

    #[test]
    fn finds_what_made_the_data() {
        let decay = Decay {
            bounds: [(-9.0, 9.0); 2],
            outlier: false,
        };
        let found = minimise(&decay, &[3.0, 1.0], 0.1, 100);
        assert!(
            (found.parameters[0] - 2.0_f64.ln()).abs() < 1e-6,
            "{found:?}"
        );
        assert!(
            (found.parameters[1] - 0.7_f64.ln()).abs() < 1e-6,
            "{found:?}"
        );
    }

    #[test]
    fn one_outlier_pulls_by_no_more_than_its_share() {
        let decay = Decay {
            bounds: [(-9.0, 9.0); 2],
            outlier: true,
        };
        let found = minimise(&decay, &[3.0, 1.0], 0.01, 200);
        // The outlier's pull is that of a residual of c = 0.01, spread over 20 points.
        assert!(
            (found.parameters[0] - 2.0_f64.ln()).abs() < 5e-3,
            "{found:?}"
        );
    }

    #[test]
    fn a_bound_that_bites_is_kept_and_the_rest_still_fits() {
        let decay = Decay {
            bounds: [(-9.0, 9.0), (-9.0, -1.0)],
            outlier: false,
        };
        let found = minimise(&decay, &[0.0, -2.0], 0.1, 100);
        assert_eq!(found.parameters[1], -1.0);
        assert!(found.parameters[0].is_finite() && found.cost.is_finite());
    }
}
