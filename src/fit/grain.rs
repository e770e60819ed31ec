//! Grain: how large flakes look, from the autocorrelation of the texels.
//!
//! ```text
//! c(d) = mean over pairs d texels apart of (Y − Ȳ)(Y' − Ȳ),  over both axes and several lit slices, c(0) = 1
//! grain = the distance at which c falls to one half, linear between whole texels
//! ```
//!
//! Texels that know nothing of each other have a grain of half a texel. Pairs are taken inside the picture only, never
//! around its border: a photograph of paint does not continue on its other side. A handful of texels is enough to find
//! the fall, so lags are summed directly.

/// Luminance of a slice's texels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Luminance {
    /// Texels across; the length is a multiple of it.
    pub width: usize,
    /// Values in 1/sr, row by row.
    pub values: Vec<f32>,
}

impl Luminance {
    /// Mean value.
    pub(super) fn mean(&self) -> f64 {
        self.values.iter().map(|v| f64::from(*v)).sum::<f64>() / self.values.len().max(1) as f64
    }

    /// Autocovariance at `lag` texels, averaged over both axes; `None` where the picture is too small.
    fn covariance(&self, mean: f64, lag: usize) -> Option<f64> {
        let height = self.values.len() / self.width;
        if lag >= self.width.min(height) {
            return None;
        }
        let product = |x: &f32, y: &f32| (f64::from(*x) - mean) * (f64::from(*y) - mean);
        let (mut across, mut down) = (0.0, 0.0);
        for row in self.values.chunks_exact(self.width) {
            across += row
                .iter()
                .zip(&row[lag..])
                .map(|(x, y)| product(x, y))
                .sum::<f64>();
        }
        for (x, y) in self.values.iter().zip(&self.values[lag * self.width..]) {
            down += product(x, y);
        }
        let (across_pairs, down_pairs) = ((self.width - lag) * height, (height - lag) * self.width);
        Some(f64::midpoint(
            across / across_pairs as f64,
            down / down_pairs as f64,
        ))
    }
}

/// Grain in texels over several slices, each with equal weight; `None` when none of them varies.
pub(super) fn grain_texels(slices: &[&Luminance]) -> Option<f64> {
    let statistics = slices.iter().filter_map(|slice| {
        let mean = slice.mean();
        let variance = slice.covariance(mean, 0)?;
        (variance > 0.0 && variance.is_finite()).then_some((*slice, mean, variance))
    });
    let varying: Vec<_> = statistics.collect();
    if varying.is_empty() {
        return None;
    }
    let mut before = 1.0;
    for lag in 1.. {
        let at_lag: Option<Vec<f64>> = varying
            .iter()
            .map(|(s, m, v)| Some(s.covariance(*m, lag)? / v))
            .collect();
        // A flake as large as the picture: the picture is all that is known of it.
        let Some(at_lag) = at_lag else {
            return Some((lag - 1).max(1) as f64);
        };
        let now = at_lag.iter().sum::<f64>() / at_lag.len() as f64;
        if now < 0.5 {
            return Some((lag - 1) as f64 + (before - 0.5) / (before - now));
        }
        before = now;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, value: impl Fn(usize, usize) -> f32) -> Luminance {
        let values = (0..width * width)
            .map(|k| value(k % width, k / width))
            .collect();
        Luminance { width, values }
    }

    /// White noise with a period of 101 and 97, long against the lags.
    fn noise(x: usize, y: usize) -> f32 {
        let mut h = (x * 7919 + y * 104_729 + 12345) as u64;
        h = (h ^ (h >> 16)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        h = (h ^ (h >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
        (h >> 40) as f32 / (1 << 24) as f32
    }

    #[test]
    fn texels_that_know_nothing_of_each_other_have_half_a_texel_of_grain() {
        let grain = grain_texels(&[&picture(128, noise)]).expect("varies");
        // The correlation at lag 1 has a standard error of 1/√(2 · 128²) = 0.0055, the grain half of that.
        assert!((grain - 0.5).abs() < 0.01, "{grain}");
    }

    /// Blocks of b: correlation 1 − d/b, which is one half at b/2.
    #[test]
    fn blocks_have_a_grain_of_half_their_side() {
        let grain = grain_texels(&[&picture(384, |x, y| noise(x / 6, y / 6))]).expect("varies");
        // 64² blocks: the correlation has a standard error of 1/64, and falls by 1/6 per texel.
        assert!((grain - 3.0).abs() < 3.0 * 6.0 / 64.0, "{grain}");
    }

    #[test]
    fn one_color_has_no_grain_and_one_gradient_ends() {
        assert_eq!(grain_texels(&[&picture(8, |_, _| 0.25)]), None);
        assert_eq!(grain_texels(&[]), None);
        assert!(grain_texels(&[&picture(8, |x, _| x as f32)]).is_some_and(|g| g <= 8.0));
        assert_eq!(grain_texels(&[&picture(1, |_, _| 0.25)]), None);
    }
}
