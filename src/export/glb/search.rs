//! Least squares within bounds: Levenberg and Marquardt's steps on numbers that a logistic curve keeps inside.
//!
//! For a dozen numbers and a few dozen residuals; derivatives by differences. Deterministic, allocates a few vectors.
//! Source: D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", J. SIAM 11 (1963).

use crate::descent::damped_step;

/// Residuals of some numbers, each within its bounds.
pub(super) trait Problem {
    /// Writes the residuals at `x`.
    fn residuals(&self, x: &[f64], out: &mut Vec<f64>);
    /// Least and largest value of every number.
    fn bounds(&self) -> &[(f64, f64)];
}

/// Sum of squares reached, and where.
pub(super) fn minimise(problem: &impl Problem, mut x: Vec<f64>, steps: u32) -> (f64, Vec<f64>) {
    let n = x.len();
    let mut free: Vec<f64> = x
        .iter()
        .zip(problem.bounds())
        .map(|(&v, &b)| released(v, b))
        .collect();
    bind(problem, &free, &mut x);
    let mut residuals = Vec::new();
    problem.residuals(&x, &mut residuals);
    let mut merit = squares(&residuals);
    let mut damping = 1e-2;
    let (mut moved, mut trial) = (Vec::new(), free.clone());
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); n];
    for _ in 0..steps {
        for (k, column) in columns.iter_mut().enumerate() {
            trial.copy_from_slice(&free);
            trial[k] += NUDGE;
            bind(problem, &trial, &mut x);
            problem.residuals(&x, &mut moved);
            column.clear();
            column.extend(moved.iter().zip(&residuals).map(|(a, b)| (a - b) / NUDGE));
        }
        let gradient: Vec<f64> = columns.iter().map(|c| dot(c, &residuals)).collect();
        let before = merit;
        for _ in 0..6 {
            let matrix = |r: usize, c: usize| dot(&columns[r], &columns[c]);
            let Some(step) = damped_step(&gradient, matrix, damping, 1e-9) else {
                damping *= 10.0;
                continue;
            };
            for ((t, f), s) in trial.iter_mut().zip(&free).zip(&step) {
                *t = (f - s.clamp(-3.0, 3.0)).clamp(-FAR, FAR);
            }
            bind(problem, &trial, &mut x);
            problem.residuals(&x, &mut moved);
            let reached = squares(&moved);
            if reached < merit {
                merit = reached;
                free.copy_from_slice(&trial);
                std::mem::swap(&mut residuals, &mut moved);
                damping = (damping * 0.2).max(1e-9);
                break;
            }
            damping *= 5.0;
        }
        if before - merit <= 1e-5 * before {
            break;
        }
    }
    bind(problem, &free, &mut x);
    (merit, x)
}

/// Difference for derivatives, on the free axis.
const NUDGE: f64 = 1e-5;
/// How far the logistic curve is followed: 1e-6 of the range from a bound.
const FAR: f64 = 14.0;

fn squares(residuals: &[f64]) -> f64 {
    dot(residuals, residuals)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// A number within its bounds as a point of the real line.
fn released(value: f64, (low, high): (f64, f64)) -> f64 {
    let share = ((value - low) / (high - low)).clamp(1e-6, 1.0 - 1e-6);
    (share / (1.0 - share)).ln()
}

fn bind(problem: &impl Problem, free: &[f64], x: &mut [f64]) {
    for ((x, &f), &(low, high)) in x.iter_mut().zip(free).zip(problem.bounds()) {
        *x = low + (high - low) / (1.0 + (-f).exp());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Valley;

    impl Problem for Valley {
        /// Rosenbrock's curved valley, least at (1, 1).
        fn residuals(&self, x: &[f64], out: &mut Vec<f64>) {
            out.clear();
            out.extend([10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
        }

        fn bounds(&self) -> &[(f64, f64)] {
            &[(-3.0, 3.0), (-3.0, 3.0)]
        }
    }

    #[test]
    fn the_curved_valley_is_followed_to_its_end() {
        let (merit, x) = minimise(&Valley, vec![-1.2, 1.0], 200);
        assert!(merit < 1e-6 && (x[0] - 1.0).abs() < 1e-2, "{merit} {x:?}");
    }
}
