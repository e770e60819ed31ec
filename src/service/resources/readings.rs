//! Readings: a paint under a virtual multi-angle instrument.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use serde::{Deserialize, Serialize};
use utoipa::IntoParams;

use crate::service::app::App;
use crate::service::http::{Address, Answer, Keep, PaintProblems, Problem, ProblemDocument, Query};
use crate::service::work::{CXF_MEDIA_TYPE, Gloss, Readings, Thing, Works, WorkshopError};

/// Where an instrument looks from.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ReadingQuery {
    /// Aspecular angles in degrees, above -45 and below 135, separated by commas; those of the six-angle instruments
    /// unless given.
    #[param(style = Form, explode = false, max_items = 256, example = json!([-15, 15, 25, 45, 75, 110]))]
    angles: Option<Vec<f64>>,
}

/// What instruments say of a paint.
#[derive(Serialize)]
struct ReadingDocument {
    #[serde(flatten)]
    readings: Readings,
    gloss: Gloss,
}

/// Readings of a paint, as the `multi_angle` part of a measured-paint package, and its gloss.
///
/// L, a, b of the reflectance factor under D65 for the 2° observer, light at 45°, the coat's mirror image left out.
/// `gloss` is what a glossmeter reads at 20°, 60° and 85°, in gloss units (ASTM D523).
#[utoipa::path(
    get, operation_id = "paint_readings", path = "/v1/paints/{id}/readings", tag = "paints",
    params(("id" = String, Path, description = "Paint"), ReadingQuery),
    responses(
        (status = 200, description = "A row for each angle, in the order asked for", body = serde_json::Value),
        (status = 400, description = "An angle that no instrument reads at", body = ProblemDocument, content_type = "application/problem+json"),
        PaintProblems,
    )
)]
pub async fn show(
    State(app): State<App>,
    Address(id): Address<String>,
    Query(query): Query<ReadingQuery>,
) -> Result<Answer, Problem> {
    let instruments = move |works: &dyn Works, paint: &Thing| {
        let readings = works.readings(paint, query.angles.as_deref())?;
        let gloss = works.gloss(paint)?;
        Ok(ReadingDocument { readings, gloss })
    };
    let answer = |document: ReadingDocument, keep| Answer::json(&document, keep);
    read(&app, &id, instruments, answer).await
}

/// Readings of a paint as comma-separated values, a line of column names first.
#[utoipa::path(
    get, operation_id = "paint_readings_table", path = "/v1/paints/{id}/readings.csv", tag = "paints",
    params(("id" = String, Path, description = "Paint"), ReadingQuery),
    responses(
        (status = 200, description = "A line for each angle, in the order asked for", body = String, content_type = "text/csv"),
        (status = 400, description = "An angle that no instrument reads at", body = ProblemDocument, content_type = "application/problem+json"),
        PaintProblems,
    )
)]
pub async fn table(
    State(app): State<App>,
    Address(id): Address<String>,
    Query(query): Query<ReadingQuery>,
) -> Result<Answer, Problem> {
    let instrument =
        move |works: &dyn Works, paint: &Thing| works.readings(paint, query.angles.as_deref());
    let answer = |readings: Readings, keep| {
        let table = Answer::bytes("text/csv", readings.to_csv(), keep);
        table.saved_as(&format!("{id}.readings.csv"))
    };
    read(&app, &id, instrument, answer).await
}

/// Readings of a paint as a `CxF3` document (ISO 17972-1), which measuring and recipe software reads.
///
/// One object with an L, a, b for each angle, each of a specification with the geometry `MultiAngle`. Its dates are the
/// day of the measurement where the paint knows it (`measured_on`), and 1970-01-01 where it does not.
#[utoipa::path(
    get, operation_id = "paint_readings_document", path = "/v1/paints/{id}/readings.cxf", tag = "paints",
    params(("id" = String, Path, description = "Paint"), ReadingQuery),
    responses(
        (status = 200, description = "A color for each angle, in the order asked for", body = String, content_type = "application/xml"),
        (status = 400, description = "An angle that no instrument reads at", body = ProblemDocument, content_type = "application/problem+json"),
        PaintProblems,
    )
)]
pub async fn document(
    State(app): State<App>,
    Address(id): Address<String>,
    Query(query): Query<ReadingQuery>,
) -> Result<Answer, Problem> {
    let instrument = move |works: &dyn Works, paint: &Thing| {
        works.readings_document(paint, query.angles.as_deref())
    };
    let answer = |document: String, keep| {
        let document = Answer::bytes(CXF_MEDIA_TYPE, document, keep);
        document.saved_as(&format!("{id}.readings.cxf"))
    };
    read(&app, &id, instrument, answer).await
}

/// Holds instruments against a paint and answers with what they say.
async fn read<T: Send + 'static>(
    app: &App,
    id: &str,
    instruments: impl FnOnce(&dyn Works, &Thing) -> Result<T, WorkshopError> + Send + 'static,
    answer: impl FnOnce(T, Keep) -> Answer,
) -> Result<Answer, Problem> {
    let begun = Instant::now();
    let paint = app.paint(id).await?;
    let (works, keep) = (Arc::clone(&app.works), paint.keep_changing());
    let read = app.bench.run(move || instruments(&*works, &paint.thing));
    let told = read.await?.map_err(Problem::of_query)?;
    Ok(answer(told, keep).stage("reading", begun.elapsed()))
}
