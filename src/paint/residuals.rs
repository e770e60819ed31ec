//! What is kept of a fit: how far the paint is from its measurement, and how near anything of its form could come.

use serde::{Deserialize, Serialize};

/// Residuals of a fitted base, with the floor: what a free function of (θh, θd) reaches on the same measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitResiduals {
    /// Relative root mean square error of luminance over all samples.
    pub relative_rmse: f64,
    /// Relative luminance error with θh of 5° and more, directions within 70° of the normal.
    pub all: LuminanceError,
    /// The same with θh below 5°, next to the mirror direction.
    pub near_mirror: LuminanceError,
    /// CIEDE2000 at the six instrument geometries.
    pub instrument: Vec<InstrumentError>,
    /// Share of the table's entries that were invalid, 0 to 1.
    pub invalid_share: f64,
}

/// Percentiles of the relative luminance error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LuminanceError {
    /// Median of the fit.
    pub median: f64,
    /// 90th percentile of the fit.
    pub p90: f64,
    /// Median of the floor.
    pub floor_median: f64,
    /// 90th percentile of the floor.
    pub floor_p90: f64,
}

/// How far a paint is from the readings that came with its measurement, flakes at their mean.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReadingResiduals {
    /// Angle of the light from the normal, degrees.
    pub illumination_deg: f64,
    /// Angle by angle, in the order of the readings.
    pub rows: Vec<ReadingError>,
    /// Median CIEDE2000.
    pub median: f64,
    /// Largest CIEDE2000.
    pub worst: f64,
    /// Whether the readings were made by another observer than the 2°, and compared as they are.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub approximate: bool,
}

/// Color error against one reading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReadingError {
    /// Aspecular angle, degrees.
    pub aspecular_deg: f64,
    /// CIEDE2000 between paint and reading.
    pub delta_e_2000: f64,
}

/// Color error at one instrument geometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InstrumentError {
    /// Aspecular angle, degrees.
    pub aspecular_deg: f64,
    /// CIEDE2000 of the fit.
    pub fit: f64,
    /// CIEDE2000 of the floor.
    pub floor: f64,
}

/// How far the clusters of a paint's flakes are from the pixels they were made of.
///
/// Compared on slices that were read again: those around the six instrument geometries, and some spread evenly over
/// the measured grid. A measured slice that was not fitted is compared with the mixture of its fitted neighbours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClusteringError {
    /// Slices that were compared.
    pub slices: usize,
    /// Slices that were measured.
    pub of: usize,
    /// Distance W1 of the lightnesses, Lab units, exact; what W1 in all three axes is at least.
    pub lightness_w1: Percentiles,
    /// Relative error of the mean luminance, over the slices among them that are light enough.
    pub mean_luminance: Percentiles,
    /// Relative error of the 99.9th percentile of luminance, over the slices among them that are light enough.
    pub sparkle: Percentiles,
    /// CIEDE2000 at the six instrument geometries between the means of clusters and pixels, base included.
    pub instrument: [f64; 6],
    /// Relative error at those geometries of how many flakes are lit, fewer than one texel in a thousand counted as that many.
    /// `None` by versions that did not count them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lit: Option<[f64; 6]>,
}

/// What a change of the flakes changes at the six instrument geometries, in the order of
/// [`ASPECULAR_DEG`](super::ASPECULAR_DEG). Relative differences are 0 or more, 1 is all.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenDifference {
    /// CIEDE2000 of the mean color, base included.
    pub delta_e_2000: [f64; 6],
    /// Relative difference of the 99.9th percentile of the flakes' luminance; the worst at all of them, where no more is
    /// known.
    pub sparkle: [f64; 6],
    /// Relative difference of how many flakes are lit, fewer than one texel in a thousand counted as that many.
    pub lit: [f64; 6],
}

/// A list of errors in three numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Percentiles {
    /// Half of them are no larger.
    pub median: f64,
    /// Nine of ten are no larger.
    pub p90: f64,
    /// None is larger.
    pub worst: f64,
}

impl Percentiles {
    /// Of these values; all 0 where there is none.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |share: f64| {
            #[allow(
                clippy::cast_precision_loss,
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss
            )] // ranks in a list
            let rank = (share * (values.len().max(1) - 1) as f64).round() as usize;
            values.get(rank).copied().unwrap_or(0.0)
        };
        Self {
            median: at(0.5),
            p90: at(0.9),
            worst: at(1.0),
        }
    }
}
