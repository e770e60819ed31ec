//! Blends: the correspondence of two to five paints, found once.

use std::sync::Arc;

use axum::extract::State;
use axum::http::StatusCode;
use axum::response::Response;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::documents::BlendDocument;
use super::making;
use crate::accuracy::Profile;
use crate::paint::PaintFile;
use crate::service::app::App;
use crate::service::http::{
    Address, Answer, BlendProblems, Idempotency, Json, NoQuery, Prefer, Problem, ProblemDocument,
    Problems,
};
use crate::service::ids;
use crate::service::parameters::{ProfileDocument, ProfileText, targets};
use crate::service::work::{Asked, BlendRequest, JobDocument, Picked, Target, runner};
use crate::store::JobKind;
use crate::workshop::check_clusters;

/// Paints to blend.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BlendOrder {
    /// Ids of two to five paints. Weights of a realisation follow this order.
    #[schema(min_items = 2, max_items = 5)]
    paints: Vec<String>,
    /// Accuracy: the name of a preset, or an object of knobs.
    #[schema(value_type = Option<ProfileDocument>)]
    profile: Option<ProfileText>,
    /// Clusters per slice, in place of the preset's; refused beside another number in the profile.
    #[schema(minimum = 1, maximum = 4096)]
    clusters: Option<u32>,
    /// In place of a profile: the cheapest whose error is at most this, Lab.
    #[schema(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[schema(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
}

/// Blend paints.
///
/// The same paints in the same order with the same options have the same id: asking again is safe, and the
/// correspondence is found once, however many ask. Another order of the same paints is another blend, whose weights
/// follow that order, of the same correspondence.
#[utoipa::path(
    post, operation_id = "create_blend", path = "/v1/blends", tag = "blends",
    params(("Prefer" = Option<String>, Header, description = "`wait=N` seconds, or `respond-async`"),
        ("Idempotency-Key" = Option<String>, Header, description = "Refuses this key with another request")),
    request_body = BlendOrder,
    responses(
        (status = 200, description = "The blend, made before", body = BlendDocument,
            headers(("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"))),
        (status = 201, description = "The blend", body = BlendDocument, headers(
            ("Location" = String, description = "Its address"),
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"))),
        (status = 202, description = "The job that makes it", body = JobDocument, headers(
            ("Location" = String, description = "The job's address"),
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"))),
        (status = 422, description = "Too few or too many paints, or unknown ones", body = ProblemDocument, content_type = "application/problem+json"),
        Problems,
    )
)]
pub async fn create(
    State(app): State<App>,
    _: NoQuery,
    prefer: Prefer,
    idempotency: Idempotency,
    Json(order): Json<BlendOrder>,
) -> Result<Response, Problem> {
    let most = app.config.limits.paints;
    if !(2..=most).contains(&order.paints.len()) {
        let detail = format!("{} paints are to be blended.", order.paints.len());
        return Err(
            Problem::value("/paints", detail).accepting(format!("2 to {most} ids of paints"))
        );
    }
    let knobs = order.profile.is_some() || order.clusters.is_some();
    let target = targets::of_body(order.max_error, order.max_seconds, knobs)?;
    let asked = order.profile.unwrap_or_default();
    let turned = asked.0.clusters;
    let mut profile = asked.with_clusters(order.clusters).of_body()?;
    for (place, id) in order.paints.iter().enumerate() {
        if !ids::is("p_", id) || app.catalogue.paint(id).await?.is_none() {
            return Err(Problem::value(
                format!("/paints/{place}"),
                format!("There is no paint {id:?}."),
            )
            .accepting("ids that GET /v1/paints lists"));
        }
    }
    if let Some(wanted) = order.clusters.or(turned) {
        clustered_so(&app, &order.paints, wanted, order.clusters.is_some()).await?;
    }
    let whole = (&order.paints, profile, target.max_error, target.max_seconds);
    let claimed = ids::asked("blend", &whole);
    idempotency.claim(&app, &claimed).await?;
    let picked = if target.is_some() {
        let picked = pick(&app, &order.paints, target).await?;
        profile = *picked.profile();
        Some(picked)
    } else {
        None
    };
    let id = id_of(&order.paints, &profile);
    let address = format!("/v1/blends/{id}");
    let job = if app.catalogue.blend(&id).await?.is_some() {
        None
    } else {
        let request = BlendRequest {
            paints: order.paints,
            profile,
        };
        Some(runner::submit(&app, JobKind::Blend, &id, &request).await?)
    };
    let made = || app.blend(&id);
    making::answer(&app, prefer, job, &address, picked.as_ref(), made).await
}

/// Id of the blend of paints with these ids.
pub fn id_of(paints: &[impl Serialize], profile: &Profile) -> String {
    ids::made_of("b_", &(paints, profile))
}

/// Refuses paints that were clustered otherwise than asked for: paints are clustered when they are uploaded.
async fn clustered_so(
    app: &App,
    paints: &[String],
    wanted: u32,
    alone: bool,
) -> Result<(), Problem> {
    let field = if alone {
        "/clusters"
    } else {
        "/profile/clusters"
    };
    for id in paints {
        let shelved = app.paint(id).await?;
        let Some(paint) = shelved.file_of_paint() else {
            continue;
        };
        if check_clusters(id, paint, wanted as usize).is_err() {
            let had = paint.clustering.as_ref().map_or(0, |c| c.clusters);
            let detail = format!("{id} was clustered with {had} clusters a slice, not {wanted}.");
            let upload = format!("{had}, nothing, or a paint uploaded with clusters={wanted}");
            return Err(Problem::value(field, detail).accepting(upload));
        }
    }
    Ok(())
}

/// The profile that meets a target for a blend of these paints.
async fn pick(app: &App, ids: &[String], target: Target) -> Result<Picked, Problem> {
    let mut shelved = Vec::with_capacity(ids.len());
    for id in ids {
        shelved.push(app.paint(id).await?);
    }
    let works = Arc::clone(&app.works);
    let pick = move || {
        let paints: Vec<&PaintFile> = shelved.iter().filter_map(|p| p.file_of_paint()).collect();
        let asked = Asked::Blend { paints: &paints };
        works.pick(&asked, &target).map_err(Problem::of_body)
    };
    app.pick(&("blend", ids, target), pick).await
}

/// What is known about a blend.
#[utoipa::path(
    get, operation_id = "show_blend", path = "/v1/blends/{id}", tag = "blends", params(("id" = String, Path, description = "Blend")),
    responses(
        (status = 200, description = "The blend", body = BlendDocument),
        BlendProblems,
    )
)]
pub async fn show(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    Ok(app.blend(&id).await?.told())
}

/// Delete a blend. Whoever asks for the same again gets the same, found again or from the cache.
#[utoipa::path(
    delete, operation_id = "delete_blend", path = "/v1/blends/{id}", tag = "blends", params(("id" = String, Path, description = "Blend")),
    responses(
        (status = 204, description = "It is gone"),
        BlendProblems,
    )
)]
pub async fn delete(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    runner::to_its_end(async move { app.forget_blend(&id).await }).await?;
    Ok(StatusCode::NO_CONTENT)
}
