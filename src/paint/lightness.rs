//! The distribution of lightness in a slice: a mixture of uniforms, exactly.
//!
//! Luminance depends on lightness alone, and a box holds its lightness uniformly, so percentiles of luminance, shares of
//! lit texels and the distance to a list of pixels need no draws:
//!
//! ```text
//! F(l) = Σ p_k clamp((l − L0_k)/(L1_k − L0_k), 0, 1),     W1 = ∫ |F(l) − G(l)| dl
//! ```

use super::Slice;

/// Lightness of one slice, or of several mixed.
#[derive(Clone, Debug, Default)]
pub struct LightnessMixture {
    /// Lightness, and by how much the slope and the value of F rise there.
    steps: Vec<(f64, f64, f64)>,
}

impl LightnessMixture {
    /// Slices with their weights, which sum to 1.
    #[must_use]
    pub fn of(slices: &[(f64, Slice<'_>)]) -> Self {
        let mut steps = Vec::new();
        for (weight, slice) in slices {
            for ((p, lower), upper) in slice.probability.iter().zip(slice.lower).zip(slice.upper) {
                let (low, high) = (f64::from(lower[0]), f64::from(upper[0]));
                let share = weight * p;
                let slope = share / (high - low);
                if slope.is_finite() && high > low {
                    steps.push((low, slope, 0.0));
                    steps.push((high, -slope, 0.0));
                } else {
                    steps.push((low, 0.0, share));
                }
            }
        }
        steps.sort_by(|x, y| x.0.total_cmp(&y.0));
        Self { steps }
    }

    /// Share of the texels that are at least this light, `0..=1`.
    #[must_use]
    pub fn above(&self, lightness: f64) -> f64 {
        let (mut slope, mut value, mut at) = (0.0, 0.0, f64::NEG_INFINITY);
        for &(l, rise, jump) in &self.steps {
            if l >= lightness {
                break;
            }
            if at.is_finite() {
                value += slope * (l - at);
            }
            (at, slope, value) = (l, slope + rise, value + jump);
        }
        if at.is_finite() {
            value += slope * (lightness - at);
        }
        (1.0 - value).clamp(0.0, 1.0)
    }

    /// The lightness that a share `p` of the texels does not exceed.
    #[must_use]
    pub fn quantile(&self, p: f64) -> f64 {
        let (mut slope, mut value, mut at) = (0.0_f64, 0.0, f64::NEG_INFINITY);
        for &(l, rise, jump) in &self.steps {
            if at.is_finite() && l > at {
                let next = value + slope * (l - at);
                if next >= p && slope > 0.0 {
                    return (at + (p - value) / slope).min(l);
                }
                value = next;
            }
            value += jump;
            if value >= p {
                return l;
            }
            (at, slope) = (l, slope + rise);
        }
        at
    }

    /// Distance W1 to lightnesses that ascend, each as likely as the others; Lab units.
    #[must_use]
    #[allow(clippy::cast_precision_loss)] // a count of pixels
    pub fn distance_to(&self, sorted: &[f64]) -> f64 {
        let share = 1.0 / sorted.len().max(1) as f64;
        self.distance_to_steps(sorted.iter().map(|&l| (l, 0.0, share)))
    }

    /// Distance W1 to another mixture, Lab units.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        self.distance_to_steps(other.steps.iter().copied())
    }

    /// Integral of the difference from what rises by these steps, which ascend.
    fn distance_to_steps(&self, others: impl Iterator<Item = (f64, f64, f64)>) -> f64 {
        let (mut own, mut others) = (self.steps.iter().copied().peekable(), others.peekable());
        let (mut slope, mut difference, mut sum) = (0.0, 0.0, 0.0);
        let mut at: Option<f64> = None;
        loop {
            let (next, sign) = match (own.peek(), others.peek()) {
                (Some(x), Some(y)) if y.0 < x.0 => (others.next(), -1.0),
                (Some(_), _) => (own.next(), 1.0),
                (None, _) => (others.next(), -1.0),
            };
            let Some((l, rise, jump)) = next else {
                return sum;
            };
            if let Some(at) = at {
                sum += absolute_integral(difference, slope, l - at);
                difference += slope * (l - at);
            }
            slope += sign * rise;
            difference += sign * jump;
            at = Some(l);
        }
    }
}

/// `∫ |d + s t| dt` over `0..=length`.
fn absolute_integral(d: f64, s: f64, length: f64) -> f64 {
    let end = d + s * length;
    if d * end >= 0.0 {
        return f64::midpoint(d.abs(), end.abs()) * length;
    }
    let zero = -d / s;
    0.5 * (d.abs() * zero + end.abs() * (length - zero))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mixture(boxes: &[(f64, f32, f32)]) -> LightnessMixture {
        let probability: Vec<f64> = boxes.iter().map(|b| b.0).collect();
        let lower: Vec<[f32; 3]> = boxes.iter().map(|b| [b.1, 0.0, 0.0]).collect();
        let upper: Vec<[f32; 3]> = boxes.iter().map(|b| [b.2, 1.0, 1.0]).collect();
        LightnessMixture::of(&[(
            1.0,
            Slice {
                probability: &probability,
                lower: &lower,
                upper: &upper,
            },
        )])
    }

    #[test]
    fn a_point_and_a_uniform_are_as_far_apart_as_the_integral_says() {
        // ∫|t − 1/2| over a unit interval scaled to ten: 10/4.
        let m = mixture(&[(1.0, 0.0, 10.0)]);
        assert!((m.distance_to(&[5.0]) - 2.5).abs() < 1e-12);
        assert!((m.distance_to(&[20.0]) - 15.0).abs() < 1e-12);
        let other = mixture(&[(1.0, 3.0, 13.0)]);
        assert!((m.distance(&other) - 3.0).abs() < 1e-9 && m.distance(&m) < 1e-12);
        let flat = mixture(&[(1.0, 4.0, 4.0)]);
        assert!((flat.distance_to(&[1.0, 7.0]) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn rare_light_boxes_are_the_upper_percentiles() {
        let m = mixture(&[(0.999, 0.0, 10.0), (0.001, 100.0, 200.0)]);
        assert!((m.quantile(0.5) - 5.005).abs() < 1e-3);
        assert!((m.quantile(0.9995) - 150.0).abs() < 1e-6);
        assert!((m.above(150.0) - 0.0005).abs() < 1e-9);
        assert_eq!((m.above(-1.0), m.above(300.0)), (1.0, 0.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn quantiles_and_shares_undo_each_other(
            boxes in prop::collection::vec((0.01..1.0_f64, -50.0..100.0_f32, 0.1..80.0_f32), 1..30), p in 0.01..0.99_f64,
        ) {
            let sum: f64 = boxes.iter().map(|b| b.0).sum();
            let boxes: Vec<_> = boxes.iter().map(|b| (b.0 / sum, b.1, b.1 + b.2)).collect();
            let m = mixture(&boxes);
            prop_assert!((1.0 - m.above(m.quantile(p)) - p).abs() < 1e-9);
        }

        #[test]
        fn the_distance_is_that_of_sorted_fine_draws(
            boxes in prop::collection::vec((0.01..1.0_f64, -50.0..100.0_f32, 0.1..80.0_f32), 1..10),
            pixels in prop::collection::vec(-60.0..180.0_f64, 1..50),
        ) {
            let sum: f64 = boxes.iter().map(|b| b.0).sum();
            let boxes: Vec<_> = boxes.iter().map(|b| (b.0 / sum, b.1, b.1 + b.2)).collect();
            let m = mixture(&boxes);
            let mut sorted = pixels.clone();
            sorted.sort_by(f64::total_cmp);
            // The same by quantiles: W1 = ∫ |F⁻¹(p) − G⁻¹(p)| dp, midpoint rule.
            let n = 20_000;
            let by_quantiles: f64 = (0..n)
                .map(|k| {
                    let p = (f64::from(k) + 0.5) / f64::from(n);
                    let pixel = sorted[((p * sorted.len() as f64) as usize).min(sorted.len() - 1)];
                    (m.quantile(p) - pixel).abs()
                })
                .sum::<f64>() / f64::from(n);
            prop_assert!((m.distance_to(&sorted) - by_quantiles).abs() < 0.05, "{} {by_quantiles}", m.distance_to(&sorted));
        }
    }
}
