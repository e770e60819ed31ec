//! Realisations: a paint, or a blend at some weights, as a file that others use.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::blend::RealisationWeights;
use crate::service::app::App;
use crate::service::http::{
    Address, Answer, BlendProblems, PaintProblems, Problem, ProblemDocument, Query, QueryOfTwo,
};
use crate::service::ids;
use crate::service::parameters::{ProfileText, WeightQuery, targets};
use crate::service::shelf::Shelved;
use crate::service::work::{Asked, Format};

/// How accurately a file is written.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ProfileQuery {
    /// Accuracy: `draft`, `standard`, `reference`, and knobs such as `standard,precision=f32,draw=alias`.
    #[param(value_type = Option<String>, example = "standard")]
    profile: Option<ProfileText>,
    /// In place of a profile: the cheapest whose error is at most this, Lab.
    #[param(exclusive_minimum = 0.0)]
    pub max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[param(exclusive_minimum = 0.0)]
    pub max_seconds: Option<f64>,
}

/// A blend at some weights, as a file.
///
/// `zip` is the texture bundle with its shader, `glb` a glTF binary, `json` the bundle's `material.json` with the
/// textures inline, `paint` a paint that can be blended again.
#[utoipa::path(
    get, operation_id = "realise_blend", path = "/v1/blends/{id}/realisation.{format}", tag = "realisations",
    params(("id" = String, Path, description = "Blend"), ("format" = Format, Path, description = "File"), WeightQuery, ProfileQuery),
    responses(
        (status = 200, description = "The file", content(
            (Vec<u8> = "application/zip"), (Vec<u8> = "model/gltf-binary"), (serde_json::Value = "application/json"),
            (Vec<u8> = "application/vnd.carpaint.paint"))),
        (status = 400, description = "Weights that do not fit the blend", body = ProblemDocument, content_type = "application/problem+json"),
        BlendProblems,
    )
)]
pub async fn of_blend(
    State(app): State<App>,
    Address((id, format)): Address<(String, Format)>,
    QueryOfTwo(weights, query): QueryOfTwo<WeightQuery, ProfileQuery>,
) -> Result<Answer, Problem> {
    let blend = app.blend(&id).await?;
    let weights = weights.for_blend(&blend.names)?;
    realise(&app, blend, Some(weights), format, query).await
}

/// A paint as a file.
#[utoipa::path(
    get, operation_id = "realise_paint", path = "/v1/paints/{id}/realisation.{format}", tag = "realisations",
    params(("id" = String, Path, description = "Paint"), ("format" = Format, Path, description = "File"), ProfileQuery),
    responses(
        (status = 200, description = "The file", content(
            (Vec<u8> = "application/zip"), (Vec<u8> = "model/gltf-binary"), (serde_json::Value = "application/json"),
            (Vec<u8> = "application/vnd.carpaint.paint"))),
        PaintProblems,
    )
)]
pub async fn of_paint(
    State(app): State<App>,
    Address((id, format)): Address<(String, Format)>,
    Query(query): Query<ProfileQuery>,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    realise(&app, paint, None, format, query).await
}

async fn realise(
    app: &App,
    thing: Arc<Shelved>,
    weights: Option<RealisationWeights>,
    format: Format,
    query: ProfileQuery,
) -> Result<Answer, Problem> {
    let begun = Instant::now();
    let target = targets::of_query(query.max_error, query.max_seconds, query.profile.is_some())?;
    let asked = query.profile.unwrap_or_default();
    asked.fits(&thing)?;
    let mut profile = asked.of_query()?;
    let mut picked = None;
    if target.is_some() {
        let asked = (&thing.id, thing.file, &weights, format, target);
        let (works, thing, weights) = (Arc::clone(&app.works), Arc::clone(&thing), weights.clone());
        let found = app.pick(&asked, move || {
            let asked = Asked::Realise {
                thing: &thing.thing,
                weights: weights.as_ref(),
                format,
            };
            works.pick(&asked, &target).map_err(Problem::of_query)
        });
        let found = found.await?;
        profile = *found.profile();
        picked = Some(found);
    }
    let key = ids::result(
        "realisation",
        &(&thing.id, thing.file, &weights, format, profile.export),
    );
    let name = format!("{}.{}", thing.id, format.ending());
    let keep = thing.keep();
    let on = app.clone();
    let compute = move || async move {
        let (works, counter) = (
            Arc::clone(&on.works),
            on.metrics.realisations_computed.clone(),
        );
        let made = on
            .bench
            .run(move || works.realise(&thing.thing, weights.as_ref(), format, &profile))
            .await?;
        let bytes = made.map_err(Problem::of_query)?;
        counter.increment(1);
        Ok(bytes.into())
    };
    let result = app.results.get_or_compute(key, compute).await?;
    // What a target picks may change with the machine's load.
    let keep = if picked.is_some() {
        keep.revalidated()
    } else {
        keep
    };
    let answer = Answer::result(format.media_type(), result, keep).saved_as(&name);
    Ok(answer
        .picked(picked.as_ref())
        .stage("realisation", begun.elapsed()))
}
