//! What is known of a blend's paint that its parameters do not say.

use serde::{Deserialize, Serialize};

use crate::paint::{Clamp, EnergyCertificate, FitResiduals};

/// Clusters of a paint that had too many and was reduced before it was blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reduction {
    /// Clusters of its widest slice before.
    pub from: usize,
    /// Most clusters of a slice after.
    pub to: usize,
}

/// Angles of a paint that were left out before it was blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Thinning {
    /// Every so many-th angle was kept, on either grid.
    pub step: usize,
    /// Slices before.
    pub from: usize,
    /// Slices after.
    pub to: usize,
}

/// Where one paint of a blend comes from, and what was known of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Whether its flakes were simulated instead of measured.
    #[serde(default)]
    pub simulated_flakes: bool,
    /// How its clusters were reduced, where they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduced: Option<Reduction>,
    /// How its angles were thinned, where they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thinned: Option<Thinning>,
    /// How well its base was fitted, where it was fitted to a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residuals: Option<FitResiduals>,
    /// How much of the light that falls on it it gives back.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy: Option<EnergyCertificate>,
    /// What had to be clamped, where it is itself a realisation.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clamps: Vec<Clamp>,
    /// What its user should know.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

impl Origin {
    /// A measured paint, blended as it is.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }
}
