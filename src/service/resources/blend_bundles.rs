//! The bundle of a whole blend: one request, and then sliders move without any.

use std::sync::{Arc, OnceLock};
use std::time::Instant;

use axum::extract::State;

use crate::service::app::App;
use crate::service::http::{Address, Answer, BlendProblems, Problem, ProblemDocument, Query};
use crate::service::ids;
use crate::service::parameters::ProfileQuery;
use crate::service::work::Asked;

/// All paints of a blend in one archive.
///
/// A texture bundle whose shader mixes the paints: `blendAt` of the archive's `carpaint.js` gives the paint at any weights
/// within milliseconds, so that users move sliders without a request each. One realisation at fixed weights is
/// `realisation.zip`.
#[utoipa::path(
    get, operation_id = "bundle_blend", path = "/v1/blends/{id}/bundle.zip", tag = "blends",
    params(("id" = String, Path, description = "Blend"), ProfileQuery),
    responses(
        (status = 200, description = "The archive", headers(
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated")),
            content((Vec<u8> = "application/zip"))),
        (status = 400, description = "A profile or a target that is none", body = ProblemDocument, content_type = "application/problem+json"),
        BlendProblems,
    )
)]
pub async fn bundle(
    State(app): State<App>,
    Address(id): Address<String>,
    Query(query): Query<ProfileQuery>,
) -> Result<Answer, Problem> {
    let blend = app.blend(&id).await?;
    let whole = ("bundle", &blend.id, blend.file);
    let found = query.profile_of(&app, &blend, &whole, |works, thing, target| {
        works.pick(&Asked::Bundle { thing }, target)
    });
    let (profile, picked) = found.await?;
    let begun = Instant::now();
    let key = ids::result("blend_bundle", &(&blend.id, blend.file, profile.export));
    let name = format!("{}.zip", blend.id);
    // What a target picks may change with the machine's load.
    let keep = match picked {
        Some(_) => blend.keep().revalidated(),
        None => blend.keep(),
    };
    let took = Arc::new(OnceLock::new());
    let (on, told) = (app.clone(), Arc::clone(&took));
    let compute = move || async move {
        let (works, counter) = (
            Arc::clone(&on.works),
            on.metrics.blend_bundles_computed.clone(),
        );
        let made = on
            .bench
            .run(move || works.bundle(&blend.thing, &profile))
            .await?;
        let made = made.map_err(Problem::of_query)?;
        let _ = told.set(made.stages);
        counter.increment(1);
        Ok(made.bytes.into())
    };
    let result = app.results.get_or_compute(key, compute).await?;
    let answer = Answer::result("application/zip", result, keep).saved_as(&name);
    Ok(answer
        .picked(picked.as_ref())
        .stages(took.get().map_or(&[], Vec::as_slice))
        .stage("bundle", begun.elapsed()))
}
