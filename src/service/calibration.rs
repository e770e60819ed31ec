//! What this machine takes, learned before anybody asks for an estimate.

use crate::accuracy::study::Study;
use crate::service::app::App;
use crate::workshop::learn_machine;

/// Name of a study in the data folder.
pub const STUDY: &str = "study.json";

/// Takes the figures of the study in the data folder, where there is one that has them; calibrates quickly otherwise.
pub async fn calibrate(app: &App) {
    let folder = app.config.data.clone();
    let study = match tokio::fs::read(folder.join(STUDY)).await {
        Ok(bytes) => serde_json::from_slice::<Study>(&bytes)
            .map_err(|error| {
                tracing::warn!(%error, "{STUDY} of the data folder is no study; this machine is calibrated quickly");
            })
            .ok(),
        Err(_) => None,
    };
    let figures = study.and_then(|study| study.machine);
    // It waits for the disk. What a panic leaves unknown is calibrated at the first estimate.
    let learned = tokio::task::spawn_blocking(move || learn_machine(figures, &folder));
    if let Err(error) = learned.await {
        tracing::warn!(%error, "this machine could not be calibrated");
    }
}
