//! The study: what accuracy costs.

use axum::extract::State;

use crate::accuracy::study::Study;
use crate::service::app::App;
use crate::service::calibration::STUDY;
use crate::service::http::{Answer, Keep, NoQuery, Problem, Problems};

/// The study that ships with the program.
const SHIPPED: &str = include_str!("../../../docs/study/study.json");

/// What accuracy costs: the study of this installation, or the one that was shipped.
///
/// `carpaint study --out DIR` makes one; the service serves `study.json` in its data folder.
#[utoipa::path(
    get, operation_id = "show_accuracy", path = "/v1/accuracy", tag = "accuracy",
    responses(
        (status = 200, description = "The study: error against time for ingesting, blending, joining, realising and previewing, growth, presets, this machine's figures", body = Object),
        Problems,
    )
)]
pub async fn show(State(app): State<App>, _: NoQuery) -> Result<Answer, Problem> {
    let own = app.config.data.join(STUDY);
    let study = match tokio::fs::read(&own).await {
        Ok(bytes) if serde_json::from_slice::<Study>(&bytes).is_ok() => bytes,
        Ok(_) => {
            tracing::warn!(file = %own.display(), "this is no study of this version; the shipped one is served");
            SHIPPED.as_bytes().to_vec()
        }
        Err(_) => SHIPPED.as_bytes().to_vec(),
    };
    Ok(Answer::bytes("application/json", study, Keep::Revalidated))
}
