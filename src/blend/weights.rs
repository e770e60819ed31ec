//! The weights of a realisation.

use serde::{Deserialize, Serialize};

/// How much of each paint, in the order the paints were asked for; inside or beyond 0..1.
///
/// `base` moves coat, diffuse, lobes and color table; `flake_lightness` the L of the boxes, with grain and lifetime;
/// `flake_color` their a and b. Each follows `weights` unless given (Golla and Klein 2018, 4.4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealisationWeights {
    /// Weights of everything that has none of its own.
    pub weights: Vec<f64>,
    /// Weights of the base.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<Vec<f64>>,
    /// Weights of the flakes' lightness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flake_lightness: Option<Vec<f64>>,
    /// Weights of the flakes' color.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flake_color: Option<Vec<f64>>,
    /// Factor on a and b of the flakes: 0 makes them white, 1 leaves them.
    #[serde(default = "unchanged", skip_serializing_if = "is_unchanged")]
    pub flake_saturation: f64,
}

const fn unchanged() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_unchanged(saturation: &f64) -> bool {
    *saturation == 1.0
}

/// Largest magnitude of a weight or of the saturation. Beyond it everything is clamped anyway.
const MOST: f64 = 1e12;

/// Why weights are none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WeightError {
    /// Not one weight per paint.
    #[error("{field} has {given} numbers, this blend of {needed} paints needs {needed}: {paints}")]
    Count {
        /// `weights`, `base`, `flake_lightness` or `flake_color`.
        field: &'static str,
        /// How many were given.
        given: usize,
        /// How many are needed.
        needed: usize,
        /// The paints, in order.
        paints: String,
    },
    /// Not a finite number of reasonable size.
    #[error("{field}[{index}] is {value}, accepted is any finite number from -1e12 to 1e12")]
    Value {
        /// Which list.
        field: &'static str,
        /// Position in it.
        index: usize,
        /// The offending number.
        value: f64,
    },
}

impl RealisationWeights {
    /// The same list of weights for base, lightness and color.
    #[must_use]
    pub fn uniform(weights: Vec<f64>) -> Self {
        Self {
            weights,
            base: None,
            flake_lightness: None,
            flake_color: None,
            flake_saturation: 1.0,
        }
    }

    /// So many paints in equal parts.
    #[must_use]
    #[allow(clippy::cast_precision_loss)] // a few paints
    pub fn equal(paints: usize) -> Self {
        Self::uniform(vec![1.0 / paints as f64; paints])
    }

    /// Weights of the base.
    #[must_use]
    pub fn base(&self) -> &[f64] {
        self.base.as_deref().unwrap_or(&self.weights)
    }

    /// Weights of the flakes' lightness.
    #[must_use]
    pub fn flake_lightness(&self) -> &[f64] {
        self.flake_lightness.as_deref().unwrap_or(&self.weights)
    }

    /// Weights of the flakes' color.
    #[must_use]
    pub fn flake_color(&self) -> &[f64] {
        self.flake_color.as_deref().unwrap_or(&self.weights)
    }

    /// Checks every list against the number of paints.
    pub(super) fn check<'a>(
        &self,
        names: impl Iterator<Item = &'a str> + Clone,
    ) -> Result<(), WeightError> {
        let needed = names.clone().count();
        let lists = [
            ("weights", self.weights.as_slice()),
            ("base", self.base()),
            ("flake_lightness", self.flake_lightness()),
            ("flake_color", self.flake_color()),
        ];
        for (field, list) in lists {
            if list.len() != needed {
                let paints = names.collect::<Vec<_>>().join(", ");
                return Err(WeightError::Count {
                    field,
                    given: list.len(),
                    needed,
                    paints,
                });
            }
            check_values(field, list)?;
        }
        check_values("flake_saturation", &[self.flake_saturation])
    }
}

fn check_values(field: &'static str, list: &[f64]) -> Result<(), WeightError> {
    list.iter()
        .position(|w| !(-MOST..=MOST).contains(w))
        .map_or(Ok(()), |index| {
            Err(WeightError::Value {
                field,
                index,
                value: list[index],
            })
        })
}
