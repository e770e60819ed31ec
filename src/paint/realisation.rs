//! How a realised paint came about: which paints, at which weights, and what had to be clamped.

use serde::{Deserialize, Serialize};

/// One bound that bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clamp {
    /// What was clamped.
    pub field: String,
    /// What was done.
    pub bound: String,
    /// How many numbers.
    pub count: usize,
    /// Of how many.
    pub of: usize,
    /// How far the worst of them was beyond the bound, in the field's unit.
    pub worst: f64,
}

impl std::fmt::Display for Clamp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            field,
            bound,
            count,
            of,
            worst,
        } = self;
        write!(
            f,
            "{field}: {bound}, {count} of {of}, the worst by {worst:.4}"
        )
    }
}

/// The blend that a paint is a realisation of. Weights stand in the order of `paints`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Realisation {
    /// Names of the paints; their content hashes are those of the provenance, in the same order.
    pub paints: Vec<String>,
    /// Weights of coat, diffuse, lobes and color table.
    pub base: Vec<f64>,
    /// Weights of the flakes' lightness, grain and lifetime.
    pub flake_lightness: Vec<f64>,
    /// Weights of the flakes' color.
    pub flake_color: Vec<f64>,
    /// Factor on the flakes' color.
    pub flake_saturation: f64,
    /// Every bound that bit.
    pub clamps: Vec<Clamp>,
}
