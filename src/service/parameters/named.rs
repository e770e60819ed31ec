//! A paint, or a blend at some weights, as a body names them.

use std::sync::Arc;

use super::WeightQuery;
use crate::blend::RealisationWeights;
use crate::service::app::App;
use crate::service::http::{Kind, Problem};
use crate::service::shelf::Shelved;

/// A paint or a blend by id; a blend with weights.
#[derive(Debug)]
pub struct Named<'a> {
    /// Id of a paint, which takes no weights.
    pub paint: Option<&'a str>,
    /// Id of a blend.
    pub blend: Option<&'a str>,
    /// Weights of the blend.
    pub weights: WeightQuery,
    /// Whether the weights are even where none is given.
    pub or_even: bool,
}

impl Named<'_> {
    /// What is named, and the weights of a blend.
    ///
    /// # Errors
    ///
    /// [`Problem`] for neither or both, an id that nothing has, and weights that do not fit.
    pub async fn find(
        self,
        app: &App,
    ) -> Result<(Arc<Shelved>, Option<RealisationWeights>), Problem> {
        match (self.paint, self.blend) {
            (Some(id), None) => {
                if let Some(field) = self.weights.first_given() {
                    let detail = format!("One paint takes no {field}.");
                    return Err(Problem::value(format!("/{field}"), detail).accepting("nothing"));
                }
                let paint = app.paint(id).await;
                Ok((paint.map_err(|problem| of_field("paint", problem))?, None))
            }
            (None, Some(id)) => {
                let blend = app.blend(id).await;
                let blend = blend.map_err(|problem| of_field("blend", problem))?;
                let weights = if self.or_even {
                    self.weights.or_even(&blend.names)
                } else {
                    self.weights
                };
                let weights = weights.for_blend(&blend.names).map_err(Problem::in_body)?;
                Ok((blend, Some(weights)))
            }
            _ => Err(
                Problem::value("/paint", "Neither or both of paint and blend are given.")
                    .accepting("the id of a paint, or of a blend"),
            ),
        }
    }
}

/// The problem of an id in a body: when nothing has it, the body is wrong.
pub fn of_field(field: &str, problem: Problem) -> Problem {
    match problem.kind() {
        Kind::UnknownPaint | Kind::UnknownBlend => problem.naming_value(field),
        _ => problem,
    }
}
