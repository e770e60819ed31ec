//! Error of a picture against the picture that the reference profile would give of the same.

use serde::Serialize;

use super::ResultError;

/// Error of a picture: what its samples leave to chance, and how far off the paint in it is.
///
/// Either is a mean of CIEDE2000, over pixels and over the instrument geometries. Their sum is no bound: light from all
/// sides meets other angles than an instrument does, and flakes of the right mean that sparkle too little are in neither
/// part. Of paints of 4 to 50 clusters in the studio, thinned or not, a picture's difference to the reference's, chance of
/// that one included, was 0.2 to 1.8 times the sum: least where of several paints another than the worst was drawn. Of one
/// cluster a slice it was seven times.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PictureError {
    /// Sum of both parts, CIEDE2000; null where the paint's is not known.
    pub delta_e_2000: Option<f64>,
    /// What the samples leave to chance, mean over the pixels.
    pub samples: f64,
    /// How far off the paint is, mean over the six instrument geometries; null where that is not known.
    pub paint: Option<f64>,
    /// How it is known, or why it is not.
    pub how: &'static str,
}

impl PictureError {
    /// Of a picture that follows from the scene alone.
    #[must_use]
    pub const fn none() -> Self {
        Self {
            delta_e_2000: Some(0.0),
            samples: 0.0,
            paint: Some(0.0),
            how: EXACT,
        }
    }

    /// The same with another part of chance.
    #[must_use]
    pub fn with_samples(&self, samples: f64) -> Self {
        Self {
            delta_e_2000: self.paint.map(|paint| samples + paint),
            samples,
            ..*self
        }
    }

    /// The same of a picture whose chance nobody had time to measure.
    #[must_use]
    pub const fn unmeasured(&self) -> Self {
        Self {
            delta_e_2000: None,
            how: NO_TIME,
            ..*self
        }
    }

    /// Of what a picture's samples leave to chance, and the error of the paint that it shows.
    #[must_use]
    pub fn of(samples: f64, of: &ResultError) -> Self {
        let seen = of.seen_or_why();
        #[allow(clippy::cast_precision_loss)] // six
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
        let paint = seen.map(|seen| mean(&seen.delta_e_2000));
        Self {
            delta_e_2000: paint.ok().map(|paint| samples + paint),
            samples,
            paint: paint.ok(),
            how: paint.err().unwrap_or(HOW),
        }
    }
}

const EXACT: &str = "exact: no paint is in it";
const NO_TIME: &str =
    "no time was left to measure what so many samples leave to chance; the picture tells it";
const HOW: &str = "measured and added up: pixels drawn twice, and the paint's mean color at the six instrument geometries, of several \
                   paints the worst; flakes that sparkle too little, which `seen` tells, change single pixels more";
