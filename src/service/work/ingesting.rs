//! The job that makes a paint of an upload.
//!
//! What was acknowledged is not lost over a fault that is none of the upload's: while the disk is full or the store does
//! not answer, the paint that was fitted is held and the job tries again to keep it, until somebody makes room, cancels
//! the job or ends the service, whose next start begins the job again.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use tokio::sync::SemaphorePermit;

use super::runner::Ended;
use super::under_way::UnderWay;
use super::workbench::CalledOff;
use super::works::IngestOrder;
use crate::service::app::App;
use crate::service::http::{Kind, Problem};
use crate::store::{Hash, JobRecord};
use crate::workshop::is_paint_file;

/// What a job needs to make a paint.
#[derive(Debug, Serialize, Deserialize)]
pub struct IngestRequest {
    upload: Hash,
    order: IngestOrder,
}

impl IngestRequest {
    /// Of a blob that was kept.
    #[must_use]
    pub fn new(upload: Hash, order: IngestOrder) -> Self {
        Self { upload, order }
    }
}

/// The job: fits an upload and keeps the paint.
pub async fn ingest(
    app: &App,
    under_way: &Arc<UnderWay>,
    lane: SemaphorePermit<'_>,
) -> Result<Ended, Problem> {
    let id = &under_way.job().subject;
    let IngestRequest { upload, order } = under_way.request()?;
    let Ok(there) = under_way.insist(app, || app.catalogue.paint(id)).await? else {
        return Ok(Err(CalledOff));
    };
    if there.is_some() {
        return Ok(Ok(()));
    }
    let Ok(local) = under_way.insist(app, || app.blobs.local(upload)).await? else {
        return Ok(Err(CalledOff));
    };
    let local = local.ok_or_else(|| Problem::internal(format!("upload {upload} is not there")))?;
    let works = Arc::clone(&app.works);
    let on = Arc::clone(under_way);
    let fitted = under_way.compute(app, "fitting", move |progress| {
        let ended = |stage: &'static str| on.ended(stage);
        let fitted = works.ingest(local.path(), &order, progress, &ended);
        let is_fit = is_paint_file(local.path()).is_ok_and(|as_it_is| !as_it_is);
        fitted.map(|file| (file, is_fit))
    });
    let Ok(fitted) = fitted.await? else {
        return Ok(Err(CalledOff));
    };
    let (file, is_fit) = fitted.map_err(Problem::of_upload)?;
    if is_fit {
        app.metrics.paints_fitted.increment(1);
    }
    let written = app.written_out(file).await?;
    // Others go on while a few wait for room on the disk.
    let held = app.jobs.held.try_acquire();
    let _lane = held.is_err().then_some(lane);
    under_way.stage("storing");
    let kept = under_way
        .insist(app, || app.keep_paint(id, &written, Some(upload)))
        .await?;
    if kept.is_ok() {
        under_way.ended("store");
    }
    Ok(kept)
}

/// Lets go of the upload of a job that came to nothing, unless that was our own fault.
pub async fn forget_upload(
    app: &App,
    job: &JobRecord,
    problem: Option<Kind>,
) -> Result<(), Problem> {
    let request: IngestRequest = serde_json::from_str(&job.request).map_err(Problem::internal)?;
    let upload = request.upload;
    if matches!(problem, Some(Kind::Internal | Kind::StorageFull)) {
        tracing::error!(%upload, job = job.id, "a job failed that its upload is not to blame for; the upload stays until the next start");
        return Ok(());
    }
    app.forget_upload(upload).await
}
