//! The job that makes a paint of an upload.
//!
//! What was acknowledged is not lost over a fault that is none of the upload's: while the disk is full or the store does
//! not answer the job tries again, and when it gives up the upload stays.

use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::runner::Ended;
use super::under_way::UnderWay;
use super::workbench::CalledOff;
use super::works::{IngestOrder, WorkError};
use crate::service::app::App;
use crate::service::http::{Kind, Problem};
use crate::store::{Hash, JobRecord, StoreError};
use crate::workshop::is_paint_file;

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

/// Pauses between tries after a fault that may pass.
const PAUSES: [Duration; 3] = [
    Duration::from_millis(500),
    Duration::from_secs(5),
    Duration::from_mins(1),
];

/// Why a try came to nothing.
enum Fault {
    /// The store's; the next try may go well.
    OfStore(Problem),
    /// The upload's, or our own.
    Lasting(Problem),
}

impl From<Problem> for Fault {
    fn from(problem: Problem) -> Self {
        Self::OfStore(problem)
    }
}

impl From<StoreError> for Fault {
    fn from(error: StoreError) -> Self {
        Self::OfStore(error.into())
    }
}

/// The job: fits an upload and keeps the paint.
pub async fn ingest(app: &App, under_way: &Arc<UnderWay>) -> Result<Ended, Problem> {
    let mut pauses = PAUSES.into_iter();
    loop {
        let problem = match once(app, under_way).await {
            Ok(ended) => return Ok(ended),
            Err(Fault::Lasting(problem)) => return Err(problem),
            Err(Fault::OfStore(problem)) => problem,
        };
        let Some(pause) = pauses.next() else {
            return Err(problem);
        };
        under_way.stage("waiting to try again");
        tokio::select! {
            () = tokio::time::sleep(pause) => {}
            () = under_way.called_off() => return Ok(Err(CalledOff)),
            () = app.stopped() => return Ok(Err(CalledOff)),
        }
    }
}

async fn once(app: &App, under_way: &Arc<UnderWay>) -> Result<Ended, Fault> {
    let id = &under_way.job().subject;
    if app.catalogue.paint(id).await?.is_some() {
        return Ok(Ok(()));
    }
    let IngestRequest { upload, order } = under_way.request().map_err(Fault::Lasting)?;
    let upload = upload.hash().map_err(Fault::Lasting)?;
    let local = app.blobs.local(upload).await?;
    let gone = || Fault::Lasting(Problem::internal(format!("upload {upload} is not there")));
    let local = local.ok_or_else(gone)?;
    let works = Arc::clone(&app.works);
    let fitted = under_way.compute(app, "fitting", move |progress| {
        let fitted = works.ingest(local.path(), &order, progress);
        let is_fit = is_paint_file(local.path()).is_ok_and(|as_it_is| !as_it_is);
        // The caller knows the upload, not the file it was kept in.
        let folder = local.path().display().to_string();
        fitted
            .map(|file| (file, is_fit))
            .map_err(|error| error.without(&folder))
    });
    let Ok(fitted) = fitted.await.map_err(Fault::Lasting)? else {
        return Ok(Err(CalledOff));
    };
    let (file, is_fit) = fitted.map_err(|error| Fault::Lasting(WorkError::of_upload(error)))?;
    if is_fit {
        app.metrics.paints_fitted.increment(1);
    }
    under_way.stage("storing");
    Ok(app.keep_paint(id, file, Some(upload)).await.map(Ok)?)
}

/// Lets go of the upload of a job that came to nothing, unless that was our own fault.
pub async fn forget_upload(
    app: &App,
    job: &JobRecord,
    problem: Option<Kind>,
) -> Result<(), Problem> {
    let request: IngestRequest = serde_json::from_str(&job.request).map_err(Problem::internal)?;
    let upload = request.upload.hash()?;
    if matches!(problem, Some(Kind::Internal | Kind::StorageFull)) {
        tracing::error!(%upload, job = job.id, "a job failed that its upload is not to blame for; the upload stays");
        return Ok(());
    }
    app.forget_upload(upload).await
}
