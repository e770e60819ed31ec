//! What this machine takes, learned before anybody asks for an estimate.

use crate::accuracy::study::Study;
use crate::service::app::App;
use crate::workshop::{known_machine, this_machine};

/// Name of a study in the data folder.
pub const STUDY: &str = "study.json";

/// Takes the figures of the study in the data folder, where there is one that has them; calibrates quickly otherwise.
pub async fn calibrate(app: &App) {
    let study = tokio::fs::read(app.config.data.join(STUDY)).await;
    let study = study
        .ok()
        .and_then(|bytes| serde_json::from_slice::<Study>(&bytes).ok());
    let known = study
        .and_then(|study| study.machine)
        .is_some_and(known_machine);
    if known {
        tracing::info!("estimates take this machine's figures from {STUDY}");
        return;
    }
    // It waits for the disk. What a panic leaves unknown is calibrated at the first estimate.
    let calibrated = tokio::task::spawn_blocking(|| *this_machine()).await;
    if let Ok(machine) = calibrated {
        tracing::debug!(?machine, "calibrated");
    }
}
