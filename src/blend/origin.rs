//! What is known of a blend's paint that its parameters do not say.

use serde::{Deserialize, Serialize};

/// Clusters of a paint that had too many and was reduced before it was blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reduction {
    /// Clusters of its widest slice before.
    pub from: usize,
    /// Most clusters of a slice after.
    pub to: usize,
}

/// Where one paint of a blend comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// Whether its flakes were simulated instead of measured.
    #[serde(default)]
    pub simulated_flakes: bool,
    /// How its clusters were reduced, where they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduced: Option<Reduction>,
}

impl Origin {
    /// A measured paint, blended as it is.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }
}
