//! How good a correspondence is, kept with the blend.

use serde::{Deserialize, Serialize};

use super::pairs::PairReport;

/// How far a blend at equal weights is, at one instrument geometry, from the blend by exact transport.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlendDeviation {
    /// Aspecular angle, degrees.
    pub aspecular_deg: f64,
    /// CIEDE2000 of the mean color.
    pub delta_e_2000: f64,
    /// Relative difference of the 99.9th percentile of the flakes' luminance.
    pub sparkle: f64,
    /// Relative difference of how many flakes are lit, fewer than one texel in a thousand counted as that many; `None` by
    /// versions that did not count them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lit: Option<f64>,
}

/// How good a correspondence is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CorrespondenceReport {
    /// Slices of the common grid, 0 when no paint has flakes.
    pub slices: usize,
    /// Clusters in all slices.
    pub clusters: usize,
    /// Mean transport cost of a slice: Lab units for the distance, their square otherwise; summed over the paints.
    pub mean_cost: f64,
    /// Largest gap of a slice between its plan and the dual bound: no plan is further from optimal.
    pub largest_gap: f64,
    /// Slices that [Sinkhorn](crate::transport::Method::Sinkhorn) had to smooth more than asked, to converge.
    #[serde(default, skip_serializing_if = "is_none")]
    pub smoothed_more: usize,
    /// Order in which the paints were joined, by place in hash order.
    #[serde(default)]
    pub order: Vec<usize>,
    /// What the correspondence of each pair of paints costs, and how far that is from the best for the pair alone.
    #[serde(default)]
    pub pairs: Vec<PairReport>,
    /// What exact transport of the distance would have given at equal weights, at the instrument geometries; empty
    /// where that is what was done, and before it was measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub against_exact: Vec<BlendDeviation>,
    /// Paints whose slices were mixed because their angles differ from the common grid's, by place in hash order.
    pub mixed: Vec<usize>,
    /// Paints without flakes, by place in hash order.
    pub without_flakes: Vec<usize>,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde asks
fn is_none(count: &usize) -> bool {
    *count == 0
}
