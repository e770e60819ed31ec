//! Descent: the damped step that least-squares searches share. Numbers only, no paint.
//!
//! Promised: a finite step or none, the same for the same numbers. Left to others: what is minimised, how bounds are
//! kept, when a step is taken (`fit`, `export`).
//!
//! D. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", J. SIAM 11 (1963).

/// Solves `(A + μ diag A + floor) d = g` by Cholesky's decomposition.
///
/// `matrix(r, c)` gives `A` at and below its diagonal, `c <= r`. `None` where the damped matrix is not positive or the
/// step not finite: more damping helps.
///
/// ```
/// use carpaint::descent::damped_step;
///
/// let a = [[4.0, 0.0], [2.0, 3.0]];
/// let step = damped_step(&[8.0, 7.0], |r, c| a[r][c], 0.0, 0.0).expect("positive");
/// assert!((step[0] - 1.25).abs() < 1e-15 && (step[1] - 1.5).abs() < 1e-15);
/// ```
pub fn damped_step(
    gradient: &[f64],
    matrix: impl Fn(usize, usize) -> f64,
    damping: f64,
    floor: f64,
) -> Option<Vec<f64>> {
    let n = gradient.len();
    let mut lower = vec![0.0; n * n];
    for r in 0..n {
        for c in 0..=r {
            let mut v = matrix(r, c);
            if r == c {
                v += damping * v + floor;
            }
            for k in 0..c {
                v -= lower[r * n + k] * lower[c * n + k];
            }
            lower[r * n + c] = if r == c {
                positive_root(v)?
            } else {
                v / lower[c * n + c]
            };
        }
    }
    let mut step = gradient.to_vec();
    for r in 0..n {
        for k in 0..r {
            step[r] -= lower[r * n + k] * step[k];
        }
        step[r] /= lower[r * n + r];
    }
    for r in (0..n).rev() {
        for k in r + 1..n {
            step[r] -= lower[k * n + r] * step[k];
        }
        step[r] /= lower[r * n + r];
    }
    step.iter().all(|v| v.is_finite()).then_some(step)
}

fn positive_root(v: f64) -> Option<f64> {
    (v.is_finite() && v > 0.0).then(|| v.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_that_is_not_positive_has_no_step_until_it_is_damped() {
        let a = [[1.0, 0.0], [1.0, 1.0]];
        assert_eq!(damped_step(&[1.0, 1.0], |r, c| a[r][c], 0.0, 0.0), None);
        let step = damped_step(&[1.0, 1.0], |r, c| a[r][c], 1.0, 0.0).expect("positive");
        // (2 1; 1 2) d = (1; 1)
        assert!(
            step.iter().all(|d| (d - 1.0 / 3.0).abs() < 1e-15),
            "{step:?}"
        );
    }

    #[test]
    fn what_is_not_finite_has_no_step() {
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(damped_step(&[1.0], |_, _| bad, 0.0, 0.0), None);
            assert_eq!(damped_step(&[bad], |_, _| 1.0, 0.0, 0.0), None);
        }
    }
}
