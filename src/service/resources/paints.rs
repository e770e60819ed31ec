//! Paints: they can be listed, read, taken back and deleted.

use axum::extract::State;
use axum::http::StatusCode;
use serde::Deserialize;
use utoipa::IntoParams;

use super::documents::{PaintDocument, PaintList, PaintSummary};
use super::nearest::Color;
use super::visibility::Visibility;
use crate::service::app::App;
use crate::service::http::{
    Address, Answer, Keep, Kind, NoQuery, PaintProblems, Problem, ProblemDocument, Problems, Query,
};
use crate::service::parameters::page;
use crate::service::work::{Format, runner};

/// Which paints to list.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ListQuery {
    /// Words that name or source contain, whatever the case.
    q: Option<String>,
    /// L, a, b under D65 for the 2° observer: paints in the order of their CIEDE2000 to it, nearest first.
    #[param(style = Form, explode = false, min_items = 3, max_items = 3, example = json!([60.5, -1.2, -3.0]))]
    near: Option<Vec<f64>>,
    /// Aspecular angle in degrees at which paints are compared with `near`, light at 45°: -15, 15, 25, 45, 75 or 110; 45
    /// unless given.
    #[param(example = 45)]
    angle: Option<f64>,
    /// `private` lists paints that are not published, in place of those that are.
    visibility: Option<Visibility>,
    /// `next` of the page before.
    cursor: Option<String>,
    /// Most paints on the page, 50 unless given.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
}

/// List paints, in the order they came or, with `near`, in that of their distance to a color.
#[utoipa::path(
    get, operation_id = "list_paints", path = "/v1/paints", tag = "paints", params(ListQuery),
    responses(
        (status = 200, description = "A page of paints", body = PaintList),
        Problems,
    )
)]
pub async fn list(
    State(app): State<App>,
    Query(query): Query<ListQuery>,
) -> Result<Answer, Problem> {
    let limit = page::limit(query.limit)?;
    let (q, cursor) = (query.q.as_deref(), query.cursor.as_deref());
    let visibility = query.visibility.unwrap_or_default().into();
    let list = if let Some(color) = Color::of_query(query.near.as_deref(), query.angle)? {
        color
            .page(&app, q, visibility, cursor, limit as usize)
            .await?
    } else {
        let begin = page::begin(cursor)?;
        let page = app.catalogue.paints(q, visibility, begin, limit).await?;
        PaintList {
            paints: page.paints.into_iter().map(PaintSummary::from).collect(),
            next: page.next.map(page::cursor),
        }
    };
    Ok(Answer::json(&list, Keep::Revalidated))
}

/// What is known about a paint.
///
/// Provenance, parameters, fit residuals with their floor, energy certificate, flake statistics, warnings.
#[utoipa::path(
    get, operation_id = "show_paint", path = "/v1/paints/{id}", tag = "paints", params(("id" = String, Path, description = "Paint")),
    responses(
        (status = 200, description = "The paint", body = PaintDocument),
        PaintProblems,
    )
)]
pub async fn show(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    Ok(app.paint(&id).await?.told())
}

/// A paint as a `.paint` file.
#[utoipa::path(
    get, operation_id = "paint_file", path = "/v1/paints/{id}/paint", tag = "paints", params(("id" = String, Path, description = "Paint")),
    responses(
        (status = 200, description = "The file", body = Vec<u8>, content_type = "application/vnd.carpaint.paint"),
        PaintProblems,
    )
)]
pub async fn file(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    let blob = app.stream_of(&id, paint.file).await?;
    Ok(
        Answer::blob(Format::Paint.media_type(), paint.file, blob, paint.keep())
            .saved_as(&format!("{id}.paint")),
    )
}

/// The measurement a paint was made of: the very bytes that were uploaded.
#[utoipa::path(
    get, operation_id = "paint_measurement", path = "/v1/paints/{id}/measurement", tag = "paints", params(("id" = String, Path, description = "Paint")),
    responses(
        (status = 200, description = "The bytes", body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 404, description = "There is no such paint, or it had no measurement", body = ProblemDocument, content_type = "application/problem+json"),
        Problems,
    )
)]
pub async fn measurement(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    let none = || {
        Problem::new(
            Kind::NoMeasurement,
            "This paint was not uploaded as a measurement.",
        )
    };
    let upload = paint.measurement.ok_or_else(none)?;
    let blob = app.stream_of(&id, upload).await?;
    Ok(
        Answer::blob("application/octet-stream", upload, blob, Keep::Own)
            .saved_as(&format!("{id}.measurement")),
    )
}

/// Delete a paint with its measurement. Blends that were made of it stay.
#[utoipa::path(
    delete, operation_id = "delete_paint", path = "/v1/paints/{id}", tag = "paints", params(("id" = String, Path, description = "Paint")),
    responses(
        (status = 204, description = "It is gone"),
        (status = 409, description = "It is a sample", body = ProblemDocument, content_type = "application/problem+json"),
        PaintProblems,
    )
)]
pub async fn delete(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    let record = app.catalogue.paint(&id).await?;
    if record.is_some_and(|of| of.source == "sample" && of.measurement.is_none()) {
        let detail = "This paint is a sample: it would be there again at the next start.";
        return Err(Problem::new(Kind::SamplePaint, detail).accepting(
            "PATCH with {\"visibility\": \"private\"}, or a service started with --no-samples",
        ));
    }
    runner::to_its_end(async move { app.forget_paint(&id).await }).await?;
    Ok(StatusCode::NO_CONTENT)
}
