//! The job that makes a paint of an upload.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::runner::Ended;
use super::under_way::UnderWay;
use super::workbench::CalledOff;
use super::works::{IngestOrder, WorkError};
use crate::service::app::App;
use crate::service::http::Problem;
use crate::store::{Hash, JobRecord};

/// What a job needs to make a paint.
#[derive(Debug, Serialize, Deserialize)]
pub struct IngestRequest {
    upload: Hash64,
    order: IngestOrder,
}

/// A hash in JSON.
#[derive(Debug, Serialize, Deserialize)]
struct Hash64(String);

impl Hash64 {
    fn hash(&self) -> Result<Hash, Problem> {
        self.0.parse().map_err(Problem::internal)
    }
}

impl IngestRequest {
    /// Of a blob that was kept.
    #[must_use]
    pub fn new(upload: Hash, order: IngestOrder) -> Self {
        Self {
            upload: Hash64(upload.to_string()),
            order,
        }
    }
}

/// The job: fits an upload and keeps the paint.
pub async fn ingest(app: &App, under_way: &Arc<UnderWay>) -> Result<Ended, Problem> {
    let id = &under_way.job().subject;
    if app.catalogue.paint(id).await?.is_some() {
        return Ok(Ok(()));
    }
    let IngestRequest { upload, order } = under_way.request()?;
    let upload = upload.hash()?;
    let local = app.blobs.local(upload).await?;
    let local = local.ok_or_else(|| Problem::internal(format!("upload {upload} is not there")))?;
    let works = Arc::clone(&app.works);
    let fitted = under_way.compute(app, "fitting", move |progress| {
        let fitted = works.ingest(local.path(), &order, progress);
        // The caller knows the upload, not the file it was kept in.
        let folder = local.path().display().to_string();
        fitted.map_err(|error| error.without(&folder))
    });
    let Ok(fitted) = fitted.await? else {
        return Ok(Err(CalledOff));
    };
    let file = fitted.map_err(WorkError::of_upload)?;
    app.metrics.paints_fitted.increment(1);
    under_way.stage("storing");
    app.keep_paint(id, file, Some(upload)).await.map(Ok)
}

/// Lets go of the upload of a job that came to nothing.
pub async fn forget_upload(app: &App, job: &JobRecord) -> Result<(), Problem> {
    let request: IngestRequest = serde_json::from_str(&job.request).map_err(Problem::internal)?;
    app.forget_upload(request.upload.hash()?).await
}
