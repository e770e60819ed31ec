//! The inverse cumulative distribution in steps, as Golla and Klein's shaders read it, and what it loses.
//!
//! Step `s` of `n` holds the cluster at cumulative probability `(s + 1/2)/n`. A cluster rarer than 1/n may be dropped
//! altogether, and the rare clusters are the sparkle: the loss is stated per slice, as half the sum of |Δp| and as the
//! change of the slice's mean luminance. New shaders should draw by cumulative probability or alias table instead.

/// Steps of the texture.
pub const STEPS: usize = 500;

/// The steps of one slice.
#[derive(Clone, Debug, PartialEq)]
pub struct InverseCdf {
    /// Cluster of each step, counted within the slice.
    pub steps: Vec<u32>,
    /// Half the sum of |Δp|, `0..=1`: the share of draws that show another cluster than they should.
    pub probability_loss: f64,
    /// Change of the mean luminance, relative to the mean; 0 where the mean is below 1e-6 1/sr.
    pub mean_luminance_change: f64,
}

/// The inverse distribution of a slice of clusters with these probabilities and mean luminances.
#[must_use]
pub fn inverse_cdf(probability: &[f64], luminance: &[f64]) -> InverseCdf {
    let mut steps = vec![0; STEPS];
    let [probability_loss, mean_luminance_change] = write(probability, luminance, &mut steps);
    InverseCdf {
        steps,
        probability_loss,
        mean_luminance_change,
    }
}

/// A cluster's number within its slice, as a texture or list holds it.
pub(super) trait Step: Copy {
    /// The number `k`; callers see to it that it fits.
    fn of(k: usize) -> Self;
}

impl Step for u32 {
    #[allow(clippy::cast_possible_truncation)] // slices have at most 2^24 clusters
    fn of(k: usize) -> Self {
        k as Self
    }
}

impl Step for u16 {
    #[allow(clippy::cast_possible_truncation)] // checked where the texture is sized
    fn of(k: usize) -> Self {
        k as Self
    }
}

impl Step for u8 {
    #[allow(clippy::cast_possible_truncation)] // checked where the texture is sized
    fn of(k: usize) -> Self {
        k as Self
    }
}

/// Steps that are written at once, wanted or not: a cluster of fifty has ten, and the next one overwrites what is too much.
const RUN: usize = 16;

/// Writes the [`STEPS`] steps of a slice and returns its two losses.
#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation)] // at most 500
#[allow(clippy::cast_sign_loss)] // cumulative probabilities are none
pub(super) fn write<T: Step>(probability: &[f64], luminance: &[f64], steps: &mut [T]) -> [f64; 2] {
    let (count, width) = (STEPS as f64, 1.0 / STEPS as f64);
    let (mut next, mut cumulative, mut moved) = (0_usize, 0.0, 0.0);
    let (mut mean, mut stepped_mean) = (0.0, 0.0);
    // Room for the run of a cluster behind the last step.
    let mut row = [T::of(0); STEPS + RUN];
    let last = probability.len().saturating_sub(1);
    for (k, (&p, &y)) in probability.iter().zip(luminance).enumerate() {
        cumulative += p;
        // Steps whose middle lies below the cumulative probability; the last cluster takes the rest.
        let end = if k == last {
            STEPS
        } else {
            ((cumulative * count + 0.5) as usize).clamp(next, STEPS)
        };
        let mut at = next;
        loop {
            row[at..at + RUN].copy_from_slice(&[T::of(k); RUN]);
            at += RUN;
            if at >= end {
                break;
            }
        }
        let share = (end - next) as f64 * width;
        next = end;
        moved += (p - share).abs();
        mean += p * y;
        stepped_mean += share * y;
    }
    steps.copy_from_slice(&row[..STEPS]);
    let change = if mean.abs() < 1e-6 {
        0.0
    } else {
        (stepped_mean - mean) / mean
    };
    [moved / 2.0, change]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn halves_are_drawn_by_half_the_steps() {
        let cdf = inverse_cdf(&[0.5, 0.5], &[0.0, 1.0]);
        assert_eq!(cdf.steps.iter().filter(|&&c| c == 1).count(), 250);
        assert!(cdf.probability_loss < 1e-12 && cdf.mean_luminance_change.abs() < 1e-12);
    }

    #[test]
    fn a_rare_bright_cluster_is_dropped_and_the_loss_says_so() {
        let cdf = inverse_cdf(&[0.9995, 0.0005], &[0.01, 20.0]);
        assert!(cdf.steps.iter().all(|&c| c == 0));
        assert!((cdf.probability_loss - 0.0005).abs() < 1e-12);
        let mean = 0.9995 * 0.01 + 0.0005 * 20.0;
        assert!((cdf.mean_luminance_change - (0.01 - mean) / mean).abs() < 1e-12);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn the_stated_losses_are_those_of_the_steps(
            weights in prop::collection::vec((1e-6..1.0_f64, 0.0..3.0_f64), 1..120),
        ) {
            let sum: f64 = weights.iter().map(|w| w.0).sum();
            let p: Vec<f64> = weights.iter().map(|w| w.0 / sum).collect();
            let y: Vec<f64> = weights.iter().map(|w| w.1).collect();
            let cdf = inverse_cdf(&p, &y);
            prop_assert_eq!(cdf.steps.len(), STEPS);
            prop_assert!(cdf.steps.is_sorted());
            let drawn: f64 = cdf.steps.iter().map(|&c| y[c as usize]).sum::<f64>() / 500.0;
            let mean: f64 = p.iter().zip(&y).map(|(p, y)| p * y).sum();
            prop_assert!((drawn - mean * (1.0 + cdf.mean_luminance_change)).abs() < 1e-9);
            let loss: f64 = (0..p.len())
                .map(|k| (p[k] - cdf.steps.iter().filter(|&&c| c as usize == k).count() as f64 / 500.0).abs())
                .sum::<f64>() / 2.0;
            prop_assert!((loss - cdf.probability_loss).abs() < 1e-9);
        }
    }
}
