//! Weighted geometric means: how widths, sizes and lasting angles blend.
//!
//! ```text
//! x = Π x_m^(w_m/Σw)
//! ```
//!
//! What is known by its ratio stays above 0 at any weights, and a flake that never changes does not outweigh all others.
//! Where the weights sum to nearly nothing the shares `w_m/Σw` have a pole. Below `|Σw| = δ` they pass through the even
//! mean instead, without a jump:
//!
//! ```text
//! share_m = 1/n + (w_m − Σw/n) Σw / max(Σw², δ²),  δ = 0.1
//! ```
//!
//! which is `w_m/Σw` from δ on.

/// Sum of weights below which the shares turn to the even mean.
const LEAST_SUM: f64 = 0.1;

/// The mean of positive values; of equal ones themselves, and at weight 1 that paint's own to the bit. Even where the
/// weights sum to 0. In `0..=f64::MAX`.
pub(super) fn geometric_mean(values: &(impl Iterator<Item = f64> + Clone), weights: &[f64]) -> f64 {
    let mut others = values.clone();
    if let Some(first) = others.next()
        && others.all(|other| other == first)
    {
        return first;
    }
    let sum: f64 = weights.iter().sum();
    #[allow(clippy::cast_precision_loss)] // at most five paints
    let even = 1.0 / weights.len() as f64;
    let share = |w: f64| {
        if sum.abs() >= LEAST_SUM {
            w / sum
        } else {
            even + (w - sum * even) * sum / (LEAST_SUM * LEAST_SUM)
        }
    };
    let pairs = || values.clone().zip(weights);
    let mean = pairs().map(|(x, &w)| x.powf(share(w))).product::<f64>();
    // Far extrapolation can give 0 · ∞; the logarithm's sum still knows which of the two it is.
    let mean = if mean.is_nan() {
        pairs().map(|(x, &w)| share(w) * x.ln()).sum::<f64>().exp()
    } else {
        mean
    };
    mean.min(f64::MAX)
}

#[cfg(test)]
mod tests {
    use super::geometric_mean;

    fn mean<const N: usize>(values: [f64; N], weights: [f64; N]) -> f64 {
        geometric_mean(&values.into_iter(), &weights)
    }

    #[test]
    fn halfway_is_the_root_of_the_product_and_ends_are_exact() {
        assert!((mean([4.0, 9.0], [0.5, 0.5]) - 6.0).abs() < 1e-14);
        assert_eq!(mean([0.1, 0.3], [1.0, 0.0]), 0.1);
        assert_eq!(mean([0.1, 0.1, 0.1], [0.3, 0.3, 0.4]), 0.1);
    }

    #[test]
    fn beyond_a_paint_nothing_vanishes_at_once() {
        // Of a flake that never changes and one that does within 558 degrees: a fifth beyond the second.
        let beyond = mean([1e4, 558.0], [-0.2, 1.2]);
        assert!((beyond - 558.0 * (558.0_f64 / 1e4).powf(0.2)).abs() < 1e-9);
        assert!(mean([20.0, 30.0], [4.0, -3.0]) > 0.0);
    }

    #[test]
    fn weights_that_sum_to_nothing_are_passed_without_a_jump() {
        // The slope of a share is 1/δ + |w|/δ² at most: 210 at weights up to 2, times ln 9 for the mean's logarithm.
        let at = |sum: f64| mean([1.0, 9.0], [-2.0, 2.0 + sum]).ln();
        let step = 1e-4;
        for k in -3000..3000 {
            let sum = f64::from(k) * step;
            let moved = (at(sum + step) - at(sum)).abs();
            assert!(moved <= 2.0 * 210.0 * 9.0_f64.ln() * step, "{sum}: {moved}");
        }
        assert_eq!(mean([1.0, 9.0], [-2.0, 2.0]), 3.0);
    }

    #[test]
    fn absurd_weights_are_finite() {
        assert!((mean([2.0, 8.0], [1.0, -1.0]) - 4.0).abs() < 1e-14);
        for w in [1e12, -1e12] {
            let far = mean([1e-300, 1e300], [w, 1.0 - w]);
            assert!(far.is_finite() && far >= 0.0, "{far}");
        }
    }
}
