//! The study: what accuracy costs.

use axum::extract::State;
use axum::http::HeaderName;

use crate::accuracy::study::Study;
use crate::service::app::App;
use crate::service::calibration::STUDY;
use crate::service::http::{Answer, Keep, NoQuery, Problem, Problems};

/// Says whose study it is: the times of another machine are not this one's.
const WHOSE: HeaderName = HeaderName::from_static("carpaint-study");

/// The study that ships with the program.
const SHIPPED: &str = include_str!("../../../docs/study/study.json");

/// What accuracy costs: the study of this installation, or the one that was shipped.
///
/// `carpaint study --out DIR` makes one; the service serves `study.json` in its data folder.
#[utoipa::path(
    get, operation_id = "show_accuracy", path = "/v1/accuracy", tag = "accuracy",
    responses(
        (status = 200, headers(("Carpaint-Study" = String, description = "Whose it is: `installation`, or `shipped`, of another machine")), description = "The study: error against time for ingesting, blending, joining, realising and previewing, growth, presets, this machine's figures", body = Object),
        Problems,
    )
)]
pub async fn show(State(app): State<App>, _: NoQuery) -> Result<Answer, Problem> {
    let own = app.config.data.join(STUDY);
    let shipped = || (SHIPPED.as_bytes().to_vec(), "shipped");
    let (study, whose) = match tokio::fs::read(&own).await {
        Ok(bytes) if serde_json::from_slice::<Study>(&bytes).is_ok() => (bytes, "installation"),
        Ok(_) => {
            tracing::warn!(file = %own.display(), "this is no study of this version; the shipped one is served");
            shipped()
        }
        Err(_) => shipped(),
    };
    Ok(Answer::bytes("application/json", study, Keep::Revalidated).header(WHOSE, whose))
}
