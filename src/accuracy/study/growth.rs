//! Time against size, with its exponent.

use serde::{Deserialize, Serialize};

/// How the time of some work grows with its size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Growth {
    /// What grows: `slices`, `pixels`, …
    pub with: String,
    /// What is done.
    pub about: String,
    /// Sizes and seconds.
    pub points: Vec<[f64; 2]>,
    /// Exponent p of the fitted `seconds = c size^p`; `None` where there are too few sizes to tell.
    pub exponent: Option<f64>,
    /// What it should be at most.
    pub limit: f64,
}

/// Room for noise in a measured exponent that should be exactly 1.
const NOISE: f64 = 0.1;

/// Sizes below which a fitted exponent says nothing.
const LEAST_SIZES: usize = 3;

impl Growth {
    /// Fits the exponent, by least squares on logarithms.
    #[must_use]
    #[allow(clippy::cast_precision_loss)] // a few points
    pub fn new(with: &str, about: &str, limit: f64, points: Vec<[f64; 2]>) -> Self {
        let logs: Vec<(f64, f64)> = points
            .iter()
            .map(|[size, seconds]| (size.ln(), seconds.max(1e-9).ln()))
            .collect();
        let n = logs.len().max(1) as f64;
        let (mx, my) = (
            logs.iter().map(|l| l.0).sum::<f64>() / n,
            logs.iter().map(|l| l.1).sum::<f64>() / n,
        );
        let (xy, xx) = logs.iter().fold((0.0, 0.0), |(xy, xx), (x, y)| {
            (xy + (x - mx) * (y - my), xx + (x - mx) * (x - mx))
        });
        Self {
            with: with.to_owned(),
            about: about.to_owned(),
            exponent: (points.len() >= LEAST_SIZES && xx > 0.0).then(|| xy / xx),
            points,
            limit,
        }
    }

    /// Whether the exponent, as far as it can be told, keeps to its limit, within what such a fit scatters.
    #[must_use]
    pub fn is_within(&self) -> bool {
        self.exponent
            .is_none_or(|exponent| exponent <= self.limit + NOISE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_gives_its_exponent_back() {
        let points = [1.0, 2.0, 5.0, 11.0]
            .map(|n: f64| [n, 0.3 * n.powf(1.4)])
            .to_vec();
        let growth = Growth::new("clusters", "", 1.6, points);
        assert!((growth.exponent.expect("told") - 1.4).abs() < 1e-12);
        assert!(growth.is_within());
        let two = Growth::new("paints", "", 1.0, vec![[2.0, 0.1], [3.0, 0.9]]);
        assert_eq!(two.exponent, None);
    }
}
