//! The bundle of a whole blend: one request, and then sliders move without any.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use serde::Deserialize;
use utoipa::IntoParams;

use crate::service::app::App;
use crate::service::http::{Address, Answer, BlendProblems, Problem, Query};
use crate::service::ids;
use crate::service::parameters::{ProfileText, targets};
use crate::service::work::Asked;

/// How accurately a bundle is written.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct BundleQuery {
    /// Accuracy: `draft`, `standard`, `reference`, and knobs such as `standard,precision=f32`.
    #[param(value_type = Option<String>, example = "standard")]
    profile: Option<ProfileText>,
    /// In place of a profile: the cheapest whose error is at most this, Lab.
    #[param(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[param(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
}

/// All paints of a blend in one archive.
///
/// A texture bundle whose shader mixes the paints: `blendAt` of the archive's `carpaint.js` gives the paint at any weights
/// within milliseconds, so that users move sliders without a request each. One realisation at fixed weights is
/// `realisation.zip`.
#[utoipa::path(
    get, operation_id = "bundle_blend", path = "/v1/blends/{id}/bundle.zip", tag = "blends",
    params(("id" = String, Path, description = "Blend"), BundleQuery),
    responses(
        (status = 200, description = "The archive", content((Vec<u8> = "application/zip"))),
        BlendProblems,
    )
)]
pub async fn bundle(
    State(app): State<App>,
    Address(id): Address<String>,
    Query(query): Query<BundleQuery>,
) -> Result<Answer, Problem> {
    let begun = Instant::now();
    let blend = app.blend(&id).await?;
    let target = targets::of_query(query.max_error, query.max_seconds, query.profile.is_some())?;
    let asked = query.profile.unwrap_or_default();
    asked.fits(&blend)?;
    let mut profile = asked.of_query()?;
    let mut picked = None;
    if target.is_some() {
        let whole = ("bundle", &blend.id, blend.file, target);
        let (works, blend) = (Arc::clone(&app.works), Arc::clone(&blend));
        let found = app.pick(&whole, move || {
            let asked = Asked::Bundle {
                thing: &blend.thing,
            };
            works.pick(&asked, &target).map_err(Problem::of_query)
        });
        let found = found.await?;
        profile = *found.profile();
        picked = Some(found);
    }
    let key = ids::result("blend_bundle", &(&blend.id, blend.file, profile.export));
    let name = format!("{}.zip", blend.id);
    // What a target picks may change with the machine's load.
    let keep = match picked {
        Some(_) => blend.keep().revalidated(),
        None => blend.keep(),
    };
    let on = app.clone();
    let compute = move || async move {
        let (works, counter) = (
            Arc::clone(&on.works),
            on.metrics.blend_bundles_computed.clone(),
        );
        let made = on
            .bench
            .run(move || works.bundle(&blend.thing, &profile))
            .await?;
        let bytes = made.map_err(Problem::of_query)?;
        counter.increment(1);
        Ok(bytes.into())
    };
    let result = app.results.get_or_compute(key, compute).await?;
    let answer = Answer::result("application/zip", result, keep).saved_as(&name);
    Ok(answer
        .picked(picked.as_ref())
        .stage("bundle", begun.elapsed()))
}
