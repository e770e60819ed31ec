//! What knobs choose among, by the names a person types.

use serde::{Deserialize, Serialize};

/// Named profiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Fast.
    Draft,
    /// The knee of blending.
    #[default]
    Standard,
    /// What the others are measured against.
    Reference,
}

/// Solvers of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transport {
    /// The optimum.
    Exact,
    /// Smoothed, stopping at a residual.
    Sinkhorn,
    /// A feasible plan with the gap it may have.
    Greedy,
}

/// Costs of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CostKnob {
    /// `d`.
    Distance,
    /// `d²`.
    Squared,
}

/// Ways to draw a flake from a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Draw {
    /// Alias table: exact.
    Alias,
    /// 500 steps, as older shaders read them: the loss is stated.
    InverseCdf,
    /// Both.
    Both,
}
