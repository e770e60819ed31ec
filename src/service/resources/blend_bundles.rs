//! The bundle of a whole blend: one request, and then sliders move without any.

use axum::extract::State;

use super::files::FileAnswer;
use crate::accuracy::Profile;
use crate::service::app::App;
use crate::service::http::{Address, Answer, BlendProblems, Problem, ProblemDocument, Query};
use crate::service::ids;
use crate::service::parameters::ProfileQuery;
use crate::service::shelf::Shelved;
use crate::service::work::{Asked, Works};
use crate::store::Hash;

/// Key of a blend's archive: everything that makes it.
pub fn key(blend: &Shelved, profile: &Profile) -> Hash {
    ids::result("blend_bundle", &(&blend.id, blend.file, profile.export))
}

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
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"),
            ("Carpaint-Accuracy" = String, description = "`flakes-lab`: error of the flakes at weights within the paints, Lab, where it is known")),
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
    let answer = FileAnswer {
        key: key(&blend, &profile),
        media_type: "application/zip",
        name: format!("{}.zip", blend.id),
        keep: blend.keep(),
        picked: picked.as_ref(),
        stage: "bundle",
        counter: app.metrics.blend_bundles_computed.clone(),
    };
    let work = move |works: &dyn Works| works.bundle(&blend.thing, &profile);
    answer.make(&app, work).await
}
