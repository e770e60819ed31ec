//! Weights in a query: which realisation of a blend.

use serde::Deserialize;
use utoipa::IntoParams;

use crate::blend::RealisationWeights;
use crate::service::http::Problem;

/// Largest magnitude of a weight.
const MOST: f64 = 1e12;

/// Which realisation of a blend. Weights follow the order of its paints and may lie outside 0 to 1.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct WeightQuery {
    /// One weight per paint, separated by commas. Either this or `alpha`, `beta`, … A mixture's weights sum to 1; others
    /// add or take away light, flakes' lightness and refraction.
    #[param(style = Form, explode = false, min_items = 2, max_items = 5)]
    weights: Option<Vec<f64>>,
    /// Weight of the first paint.
    alpha: Option<f64>,
    /// Weight of the second paint.
    beta: Option<f64>,
    /// Weight of the third paint.
    gamma: Option<f64>,
    /// Weight of the fourth paint.
    delta: Option<f64>,
    /// Weight of the fifth paint.
    epsilon: Option<f64>,
    /// Weights of coat, diffuse, lobes and color table alone.
    #[param(style = Form, explode = false, min_items = 2, max_items = 5)]
    base: Option<Vec<f64>>,
    /// Weights of the flakes' lightness, grain and lifetime alone.
    #[param(style = Form, explode = false, min_items = 2, max_items = 5)]
    flake_lightness: Option<Vec<f64>>,
    /// Weights of the flakes' color alone.
    #[param(style = Form, explode = false, min_items = 2, max_items = 5)]
    flake_color: Option<Vec<f64>>,
    /// Factor on the flakes' color: 0 makes them white, 1 leaves them.
    flake_saturation: Option<f64>,
}

const GREEK: [&str; 5] = ["alpha", "beta", "gamma", "delta", "epsilon"];

impl WeightQuery {
    /// The same from lists, as they stand in a body.
    #[must_use]
    pub fn of_lists(
        weights: Option<Vec<f64>>,
        base: Option<Vec<f64>>,
        flake_lightness: Option<Vec<f64>>,
        flake_color: Option<Vec<f64>>,
        flake_saturation: Option<f64>,
    ) -> Self {
        Self {
            weights,
            base,
            flake_lightness,
            flake_color,
            flake_saturation,
            ..Self::default()
        }
    }

    /// The same with as much of each of these paints, where the weights of the whole are not given.
    #[must_use]
    pub fn or_even(mut self, names: &[String]) -> Self {
        if self.weights.is_none() && self.greek().iter().all(Option::is_none) {
            self.weights = Some(vec![1.0 / names.len() as f64; names.len()]);
        }
        self
    }

    const fn greek(&self) -> [Option<f64>; 5] {
        [self.alpha, self.beta, self.gamma, self.delta, self.epsilon]
    }

    /// The first field that is given.
    #[must_use]
    pub fn first_given(&self) -> Option<&'static str> {
        let greek = self.greek().map(|weight| weight.is_some());
        let greek = GREEK.into_iter().zip(greek);
        let others = [
            ("weights", self.weights.is_some()),
            ("base", self.base.is_some()),
            ("flake_lightness", self.flake_lightness.is_some()),
            ("flake_color", self.flake_color.is_some()),
            ("flake_saturation", self.flake_saturation.is_some()),
        ];
        let mut fields = others.into_iter().chain(greek);
        fields.find_map(|(field, is)| is.then_some(field))
    }

    /// The weights for a blend of these paints.
    ///
    /// # Errors
    ///
    /// [`Problem`] that names the parameter and how many numbers it needs.
    pub fn for_blend(self, names: &[String]) -> Result<RealisationWeights, Problem> {
        let weights = self.weights(names)?;
        let own = |field: &str, list: Option<Vec<f64>>| {
            list.map(|list| checked(field, list, names)).transpose()
        };
        let base = own("base", self.base)?;
        let flake_lightness = own("flake_lightness", self.flake_lightness)?;
        let flake_color = own("flake_color", self.flake_color)?;
        let saturation = self.flake_saturation.unwrap_or(1.0);
        if saturation.abs() > MOST {
            return Err(Problem::parameter(
                "flake_saturation",
                format!("flake_saturation is {saturation}."),
            )
            .accepting("a number from -1e12 to 1e12"));
        }
        let parts = [&base, &flake_lightness, &flake_color];
        let weights = match weights {
            Some(weights) => weights,
            // All that weights are for have weights of their own.
            None if parts.iter().all(|part| part.is_some()) => base.clone().unwrap_or_default(),
            None => {
                return Err(Problem::parameter("weights", "The weights are missing.")
                    .accepting(needed(names)));
            }
        };
        Ok(RealisationWeights {
            weights,
            base,
            flake_lightness,
            flake_color,
            flake_saturation: saturation + 0.0,
        })
    }

    fn weights(&self, names: &[String]) -> Result<Option<Vec<f64>>, Problem> {
        let greek = self.greek();
        if let Some(list) = &self.weights {
            return match greek.iter().position(Option::is_some) {
                Some(k) => {
                    let detail = format!("{} stands beside weights.", GREEK[k]);
                    Err(Problem::parameter(GREEK[k], detail).accepting("one or the other"))
                }
                None => checked("weights", list.clone(), names).map(Some),
            };
        }
        if greek.iter().all(Option::is_none) {
            return Ok(None);
        }
        if let Some(k) = (0..greek.len()).find(|&k| greek[k].is_some() != (k < names.len())) {
            let what = if greek[k].is_some() {
                "is one too many"
            } else {
                "is missing"
            };
            let detail = format!("{} {what}.", GREEK[k]);
            let accepted = format!(
                "{}, for {}",
                GREEK[..names.len().min(GREEK.len())].join(", "),
                names.join(", ")
            );
            return Err(Problem::parameter(GREEK[k], detail).accepting(accepted));
        }
        let list: Vec<f64> = greek.into_iter().flatten().collect();
        match list.iter().position(|w| w.abs() > MOST) {
            Some(k) => Err(too_far(GREEK[k], list[k])),
            None => checked("weights", list, names).map(Some),
        }
    }
}

fn needed(names: &[String]) -> String {
    format!(
        "{} numbers separated by commas, for {}",
        names.len(),
        names.join(", ")
    )
}

fn too_far(field: &str, value: f64) -> Problem {
    Problem::parameter(field, format!("{field} holds {value}."))
        .accepting("numbers from -1e12 to 1e12")
}

fn checked(field: &str, list: Vec<f64>, names: &[String]) -> Result<Vec<f64>, Problem> {
    if list.len() != names.len() {
        let detail = format!(
            "{field} has {} numbers, the blend {} paints.",
            list.len(),
            names.len()
        );
        return Err(Problem::parameter(field, detail).accepting(needed(names)));
    }
    match list.iter().find(|w| w.abs() > MOST) {
        Some(&value) => Err(too_far(field, value)),
        // -0 and 0 are one weight and one address in the cache.
        None => Ok(list.into_iter().map(|w| w + 0.0).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> Vec<String> {
        vec!["silver".to_owned(), "blue".to_owned()]
    }

    #[test]
    fn greek_letters_and_a_list_say_the_same() {
        let greek = WeightQuery {
            alpha: Some(0.25),
            beta: Some(-0.0),
            ..WeightQuery::default()
        };
        let list = WeightQuery {
            weights: Some(vec![0.25, 0.0]),
            ..WeightQuery::default()
        };
        let (greek, list) = (
            greek.for_blend(&names()).expect("accepted"),
            list.for_blend(&names()).expect("accepted"),
        );
        assert_eq!(
            serde_json::to_string(&greek).expect("JSON"),
            serde_json::to_string(&list).expect("JSON")
        );
    }

    #[test]
    fn what_does_not_fit_the_blend_is_named() {
        let cases = [
            (WeightQuery::default(), "/weights"),
            (
                WeightQuery {
                    weights: Some(vec![1.0]),
                    ..WeightQuery::default()
                },
                "/weights",
            ),
            (
                WeightQuery {
                    alpha: Some(1.0),
                    ..WeightQuery::default()
                },
                "/beta",
            ),
            (
                WeightQuery {
                    alpha: Some(1.0),
                    beta: Some(0.0),
                    gamma: Some(0.0),
                    ..WeightQuery::default()
                },
                "/gamma",
            ),
            (
                WeightQuery {
                    weights: Some(vec![1.0, 0.0]),
                    beta: Some(0.0),
                    ..WeightQuery::default()
                },
                "/beta",
            ),
            (
                WeightQuery {
                    weights: Some(vec![1e13, 0.0]),
                    ..WeightQuery::default()
                },
                "/weights",
            ),
            (
                WeightQuery {
                    weights: Some(vec![1.0, 0.0]),
                    base: Some(vec![1.0; 3]),
                    ..WeightQuery::default()
                },
                "/base",
            ),
        ];
        for (query, pointer) in cases {
            let problem = query.for_blend(&names()).expect_err(pointer).document(None);
            assert_eq!(problem.pointer.as_deref(), Some(pointer));
        }
        let parts = Some(vec![1.0, 0.0]);
        let all = WeightQuery {
            base: parts.clone(),
            flake_lightness: parts.clone(),
            flake_color: parts,
            ..WeightQuery::default()
        };
        assert!(all.for_blend(&names()).is_ok());
    }
}
