//! Realisations: a paint, or a blend at some weights, as a file that others use.

use std::sync::Arc;

use axum::extract::State;

use super::files::FileAnswer;
use crate::accuracy::Profile;
use crate::blend::RealisationWeights;
use crate::service::app::App;
use crate::service::http::{
    Address, Answer, BlendProblems, PaintProblems, Problem, ProblemDocument, Query, QueryOfTwo,
};
use crate::service::ids;
use crate::service::parameters::{ProfileQuery, WeightQuery};
use crate::service::shelf::Shelved;
use crate::service::work::{Asked, Format, Works};
use crate::store::Hash;

/// A blend at some weights, as a file.
///
/// `zip` is the texture bundle with its shader, `glb` a glTF binary, `json` the bundle's `material.json` with the
/// textures inline, `paint` a paint that can be blended again.
#[utoipa::path(
    get, operation_id = "realise_blend", path = "/v1/blends/{id}/realisation.{format}", tag = "realisations",
    params(("id" = String, Path, description = "Blend"), ("format" = Format, Path, description = "File"), WeightQuery, ProfileQuery),
    responses(
        (status = 200, description = "The file", headers(
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"),
            ("Carpaint-Accuracy" = String, description = "`flakes-lab`: error of the flakes, Lab, where it is known; of a GLB also `gltf-median-de2000`: what its material loses, CIEDE2000 in the median of the instrument geometries")), content(
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
        (status = 200, description = "The file", headers(
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"),
            ("Carpaint-Accuracy" = String, description = "`flakes-lab`: error of the flakes, Lab, where it is known; of a GLB also `gltf-median-de2000`: what its material loses, CIEDE2000 in the median of the instrument geometries")), content(
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

/// Key of a file: everything that makes it.
pub fn key(
    thing: &Shelved,
    weights: Option<&RealisationWeights>,
    format: Format,
    profile: &Profile,
) -> Hash {
    let parts = (&thing.id, thing.file, weights, format, profile.export);
    ids::result("realisation", &parts)
}

async fn realise(
    app: &App,
    thing: Arc<Shelved>,
    weights: Option<RealisationWeights>,
    format: Format,
    query: ProfileQuery,
) -> Result<Answer, Problem> {
    let whole = (&thing.id, thing.file, &weights, format);
    let of = weights.clone();
    let found = query.profile_of(app, &thing, &whole, move |works, thing, target| {
        let asked = Asked::Realise {
            thing,
            weights: of.as_ref(),
            format,
        };
        works.pick(&asked, target)
    });
    let (profile, picked) = found.await?;
    let answer = FileAnswer {
        key: key(&thing, weights.as_ref(), format, &profile),
        media_type: format.media_type(),
        name: format!("{}.{}", thing.id, format.ending()),
        keep: thing.keep(),
        picked: picked.as_ref(),
        stage: "realisation",
        counter: app.metrics.realisations_computed.clone(),
    };
    let work =
        move |works: &dyn Works| works.realise(&thing.thing, weights.as_ref(), format, &profile);
    answer.make(app, work).await
}
