//! What a machine takes for steps that depend on it alone.

use serde::{Deserialize, Serialize};

/// Evaluations of a paint that fitting a reflectance table takes as long as.
const EVALUATIONS_OF_A_FIT: f64 = 1.0e7;

/// Seconds of steps that depend on the machine and on sizes, not on what paints are like.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Writing a small file durably.
    pub write: f64,
    /// Writing each byte beside.
    pub write_byte: f64,
    /// Reading and hashing a byte of a file that the system has at hand.
    pub hash_byte: f64,
    /// Evaluating a paint at a pair of directions.
    pub evaluation: f64,
}

impl Machine {
    /// Whether every figure is a time.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        [self.write, self.write_byte, self.hash_byte, self.evaluation]
            .iter()
            .all(|time| time.is_finite() && *time >= 0.0)
    }

    /// Writing a file of this size durably.
    #[must_use]
    pub fn write_seconds(&self, bytes: f64) -> f64 {
        self.write + self.write_byte * bytes
    }

    /// Reading and hashing a file of this size.
    #[must_use]
    pub fn hash_seconds(&self, bytes: f64) -> f64 {
        self.hash_byte * bytes
    }

    /// Fitting a reflectance table.
    #[must_use]
    pub fn fit_seconds(&self) -> f64 {
        self.evaluation * EVALUATIONS_OF_A_FIT
    }
}
