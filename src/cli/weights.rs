//! The weights of a realisation on the command line.

use std::str::FromStr;

use clap::Args;

use super::number::finite;
use crate::blend::RealisationWeights;
use crate::workshop::{Thing, WorkshopError};

/// Numbers separated by commas.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightList(Vec<f64>);

impl FromStr for WeightList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split(',')
            .enumerate()
            .map(|(k, word)| {
                finite(word.trim()).map_err(|_| {
                    format!("number {} is '{word}'; accepted are finite numbers separated by commas, such as 0.3,0.7", k + 1)
                })
            })
            .collect::<Result<_, _>>()
            .map(Self)
    }
}

/// Which realisation of a blend.
#[derive(Args, Clone, Debug, Default)]
pub struct WeightArgs {
    /// One weight per paint, in the order they were blended: 0.5,0.5. May lie outside 0 to 1, as -0.2,1.2 beyond the
    /// second. A mixture's weights sum to 1; others add or take away light, flakes' lightness and refraction.
    #[arg(long, value_name = "W", allow_hyphen_values = true)]
    pub weights: Option<WeightList>,
    /// Weights of coat, diffuse, lobes and color table alone.
    #[arg(long, value_name = "W", allow_hyphen_values = true)]
    pub base: Option<WeightList>,
    /// Weights of the flakes' lightness (and grain and lifetime) alone.
    #[arg(long, value_name = "W", allow_hyphen_values = true)]
    pub flake_lightness: Option<WeightList>,
    /// Weights of the flakes' color alone.
    #[arg(long, value_name = "W", allow_hyphen_values = true)]
    pub flake_color: Option<WeightList>,
    /// Factor on the flakes' a and b: 0 makes them white.
    #[arg(long, value_name = "S", value_parser = finite, allow_hyphen_values = true)]
    pub flake_saturation: Option<f64>,
}

impl WeightArgs {
    /// Whether nothing was given.
    fn is_empty(&self) -> bool {
        self.weights.is_none()
            && self.base.is_none()
            && self.flake_lightness.is_none()
            && self.flake_color.is_none()
            && self.flake_saturation.is_none()
    }

    /// The weights that this thing needs: a blend needs some, one paint takes none.
    pub fn for_thing(&self, thing: &Thing) -> Result<Option<RealisationWeights>, WorkshopError> {
        match thing {
            Thing::Paint(_) => {
                self.refuse("this is one paint, weights are for a .blend: leave them out")?;
                Ok(None)
            }
            Thing::Blend(blend) => self
                .for_blend(blend.ingredients().map(|(name, _)| name))
                .map(Some),
        }
    }

    /// Weights where there is nothing to weigh are a mistake worth telling.
    pub fn refuse(&self, why: &str) -> Result<(), WorkshopError> {
        if self.is_empty() {
            return Ok(());
        }
        Err(WorkshopError::usage("--weights", why))
    }

    /// The weights for a blend of the named paints.
    fn for_blend<'a>(
        &self,
        names: impl Iterator<Item = &'a str>,
    ) -> Result<RealisationWeights, WorkshopError> {
        let own = |list: &Option<WeightList>| list.as_ref().map(|w| w.0.clone());
        let parts = [&self.base, &self.flake_lightness, &self.flake_color];
        // Where all that weights are for have weights of their own, none are missing.
        let all = self.weights.as_ref().or_else(|| {
            let has_all = parts.iter().all(|part| part.is_some());
            self.base.as_ref().filter(|_| has_all)
        });
        let Some(weights) = all else {
            let names: Vec<&str> = names.collect();
            let problem = format!(
                "a blend needs --weights: {} numbers separated by commas, for {}",
                names.len(),
                names.join(", ")
            );
            return Err(WorkshopError::usage("--weights", problem));
        };
        Ok(RealisationWeights {
            weights: weights.0.clone(),
            base: own(&self.base),
            flake_lightness: own(&self.flake_lightness),
            flake_color: own(&self.flake_color),
            flake_saturation: self.flake_saturation.unwrap_or(1.0),
        })
    }
}
