//! Jobs: work on record that is done once, whatever happens to the process or to who asked for it.
//!
//! A job is acknowledged when it is on record. Whatever is queued or running when the process ends is begun again at the
//! next start, from the record alone; one that was begun too often without an end has failed.

use std::collections::HashMap;
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use futures::FutureExt;
use serde::Serialize;
use tokio::sync::{Semaphore, watch};

use super::job_document::{JobDocument, StageDocument};
use super::under_way::UnderWay;
use super::workbench::{CalledOff, Workbench};
use super::{blending, ingesting};
use crate::service::app::App;
use crate::service::http::{Kind, Problem};
use crate::service::ids;
use crate::store::{JobEnd, JobKind, JobRecord, JobState, NewJob, StoreError};

/// How often a job is begun before it is given up: each time the process died over it.
const MOST_ATTEMPTS: u32 = 10;

/// Paints that are held in memory until the store takes them, beside those that hold a lane.
const MOST_HELD: usize = 8;

/// Ended jobs that can still be asked for.
const JOBS_KEPT: u32 = 10_000;

/// Jobs under way.
#[derive(Debug)]
pub struct Jobs {
    lanes: Arc<Semaphore>,
    pub(super) bench: Workbench,
    /// Places of paints that are fitted and wait for the store.
    pub(super) held: Semaphore,
    under_way: Mutex<HashMap<String, Arc<UnderWay>>>,
    submitting: tokio::sync::Mutex<()>,
    most: usize,
}

/// How a job ended that did not fail.
pub type Ended = Result<(), CalledOff>;

impl Jobs {
    /// So many at a time, and so many under way in all.
    #[must_use]
    pub fn new(at_a_time: usize, most: usize) -> Self {
        Self {
            lanes: Arc::new(Semaphore::new(at_a_time)),
            bench: Workbench::new(at_a_time, usize::MAX),
            held: Semaphore::new(MOST_HELD),
            under_way: Mutex::default(),
            submitting: tokio::sync::Mutex::default(),
            most,
        }
    }

    fn under_way(&self) -> MutexGuard<'_, HashMap<String, Arc<UnderWay>>> {
        self.under_way
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    fn find(&self, id: &str) -> Option<Arc<UnderWay>> {
        self.under_way().get(id).cloned()
    }

    /// The job that makes this, if one is under way and goes on.
    fn making(&self, subject: &str) -> Option<String> {
        let under_way = self.under_way();
        let at_it = under_way
            .values()
            .find(|job| job.job.subject == subject && !job.is_cancelled());
        at_it.map(|job| job.job.id.clone())
    }

    /// Whether nothing is under way.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.under_way().is_empty()
    }
}

/// Records a job, or finds the unfinished one that makes the same. When this returns the job will be done.
///
/// # Errors
///
/// [`Problem`] when too many are under way or the store fails.
pub async fn submit(
    app: &App,
    kind: JobKind,
    subject: &str,
    request: &impl Serialize,
) -> Result<String, Problem> {
    let request = serde_json::to_string(request).map_err(Problem::internal)?;
    let job = NewJob {
        id: ids::random("j_"),
        kind,
        subject: subject.to_owned(),
        request,
    };
    let app = app.clone();
    to_its_end(async move {
        let _one_at_a_time = app.jobs.submitting.lock().await;
        if let Some(at_it) = app.jobs.making(&job.subject) {
            return Ok(at_it);
        }
        if app.jobs.under_way().len() >= app.jobs.most {
            return Err(Problem::overloaded());
        }
        let submitted = app.catalogue.submit_job(&job).await?;
        let id = submitted.job.id.clone();
        match app.jobs.find(&id) {
            None => start(&app, submitted.job),
            // Its end is not on record yet, and then its upload goes.
            Some(at_it) if at_it.is_cancelled() => return Err(Problem::overloaded()),
            Some(_) => {}
        }
        Ok(id)
    })
    .await
}

/// Does what must not stop in the middle when the caller goes away.
///
/// # Errors
///
/// What the work says, or [`Kind::Internal`] when it panicked.
pub async fn to_its_end<T: Send + 'static>(
    work: impl Future<Output = Result<T, Problem>> + Send + 'static,
) -> Result<T, Problem> {
    tokio::spawn(work).await.map_err(Problem::internal)?
}

/// Begins again what was under way when the last process ended.
///
/// # Errors
///
/// [`Problem`] when the store fails.
pub async fn resume(app: &App) -> Result<(), Problem> {
    for job in app.catalogue.unfinished_jobs().await? {
        if job.attempts >= MOST_ATTEMPTS {
            let given_up = Problem::new(
                Kind::Internal,
                "The service ended several times over this job.",
            );
            end(app, &job, JobState::Failed, Some(&given_up), &[]).await?;
        } else {
            start(app, job);
        }
    }
    Ok(())
}

fn start(app: &App, job: JobRecord) {
    let under_way = Arc::new(UnderWay::new(job));
    app.jobs
        .under_way()
        .insert(under_way.job.id.clone(), Arc::clone(&under_way));
    tokio::spawn(run(app.clone(), under_way));
}

async fn run(app: App, under_way: Arc<UnderWay>) {
    let job = &under_way.job;
    let worked = AssertUnwindSafe(work(&app, &under_way)).catch_unwind();
    let ended = match worked.await {
        Ok(Ok(ended)) => ended.map(|state| (state, None)),
        Ok(Err(problem)) => Some((JobState::Failed, Some(problem))),
        Err(_) => {
            let problem = Problem::internal(format!("job {} panicked", job.id));
            Some((JobState::Failed, Some(problem)))
        }
    };
    let last = if let Some((state, problem)) = ended {
        end_insisting(&app, &under_way, state, problem).await
    } else {
        // What is left running on record is begun again all the same.
        if let Err(error) = app.catalogue.return_job(&job.id).await {
            tracing::warn!(%error, job = job.id, "a job was not returned to the queue");
        }
        None
    };
    app.jobs.under_way().remove(&job.id);
    // What has no end on record is begun again at the next start.
    if let Some(last) = last {
        under_way.told.send_replace(last);
    }
}

/// Does the work of a job and says how it ended; `None` when it goes on after a restart.
async fn work(app: &App, under_way: &Arc<UnderWay>) -> Result<Option<JobState>, Problem> {
    let job = &under_way.job;
    let called_off = || under_way.is_cancelled().then_some(JobState::Cancelled);
    let lane = tokio::select! {
        lane = app.jobs.lanes.acquire() => lane.map_err(Problem::internal)?,
        () = under_way.called_off() => return Ok(called_off()),
        () = app.stopped() => return Ok(None),
    };
    let begun = under_way.insist(app, || app.catalogue.begin_job(&job.id));
    if begun.await?.is_err() {
        return Ok(called_off());
    }
    under_way
        .told
        .send_modify(|told| told.state = JobState::Running);
    under_way.ended("waiting");
    let ended = match job.kind {
        JobKind::Ingest => ingesting::ingest(app, under_way, lane).await?,
        JobKind::Blend => blending::blend(app, under_way).await?,
    };
    Ok(match ended {
        Ok(()) => Some(JobState::Done),
        Err(CalledOff) => called_off(),
    })
}

/// Records the end of a job however long the store takes; `None` when the service ended before.
async fn end_insisting(
    app: &App,
    under_way: &Arc<UnderWay>,
    state: JobState,
    problem: Option<Problem>,
) -> Option<JobDocument> {
    let problem = problem.as_ref();
    let stages = under_way.told.borrow().stages.clone();
    let record = || end(app, &under_way.job, state, problem, &stages);
    let ended = under_way.insist_though_cancelled(app, record);
    match ended.await {
        Ok(ended) => ended.ok(),
        Err(problem) => {
            tracing::error!(
                ?problem,
                job = under_way.job.id,
                "a job's end is not on record"
            );
            None
        }
    }
}

/// Records the end of a job, and lets go of an upload that came to nothing.
async fn end(
    app: &App,
    job: &JobRecord,
    state: JobState,
    problem: Option<&Problem>,
    stages: &[StageDocument],
) -> Result<JobDocument, StoreError> {
    let kind = problem.map(Problem::kind);
    let unwritten = |error: serde_json::Error| StoreError::Corrupt {
        what: "job's end",
        detail: error.to_string(),
    };
    let problem = problem.map(|problem| serde_json::to_string(&problem.document(None)));
    let problem = problem.transpose().map_err(unwritten)?;
    let stages = serde_json::to_string(stages).map_err(unwritten)?;
    let ended = JobEnd {
        state,
        problem: problem.as_deref(),
        stages: &stages,
    };
    if !app.catalogue.end_job(&job.id, ended).await? {
        // It has an end already; that one counts.
        let there = app.catalogue.job(&job.id).await?;
        let gone = || StoreError::Corrupt {
            what: "job",
            detail: format!("{} ended and is not on record", job.id),
        };
        return there.as_ref().map(JobDocument::of).ok_or_else(gone);
    }
    // The end is on record: what tidying up meets does not change it.
    if let Err(error) = app.catalogue.forget_ended_jobs(JOBS_KEPT).await {
        tracing::error!(%error, "ended jobs were not forgotten");
    }
    if job.kind == JobKind::Ingest && state != JobState::Done {
        // A problem says in the log what it is about.
        let _ = ingesting::forget_upload(app, job, kind).await;
    }
    Ok(JobDocument::at_end(job, ended))
}

/// How a job stands.
///
/// # Errors
///
/// [`Kind::UnknownJob`] when there is none.
pub async fn look_up(app: &App, id: &str) -> Result<JobDocument, Problem> {
    if let Some(under_way) = app.jobs.find(id) {
        return Ok(under_way.told.borrow().clone());
    }
    let unknown = || {
        Problem::new(Kind::UnknownJob, format!("There is no job {id:?}."))
            .accepting("the address in a 202's Location")
    };
    let job = app.catalogue.job(id).await?.ok_or_else(unknown)?;
    Ok(JobDocument::of(&job))
}

/// How a job stands once it has ended, or when the time is up or the service goes down.
///
/// # Errors
///
/// As [`look_up`].
pub async fn wait_for(app: &App, id: &str, time: Duration) -> Result<JobDocument, Problem> {
    if let Some(under_way) = app.jobs.find(id) {
        let mut told = under_way.told.subscribe();
        drop(under_way);
        tokio::select! {
            _ = told.wait_for(|job| job.state.is_final()) => {}
            () = tokio::time::sleep(time) => {}
            () = app.stopped() => {}
        }
        return Ok(told.borrow().clone());
    }
    look_up(app, id).await
}

/// What a job has to tell from now on; `None` when it has ended.
pub fn follow(app: &App, id: &str) -> Option<watch::Receiver<JobDocument>> {
    app.jobs
        .find(id)
        .map(|under_way| under_way.told.subscribe())
}

/// Calls a job off and says how it ended.
///
/// # Errors
///
/// [`Kind::UnknownJob`] when there is none, [`Kind::JobEnded`] when it is done or has failed.
pub async fn cancel(app: &App, id: &str) -> Result<JobDocument, Problem> {
    if let Some(under_way) = app.jobs.find(id) {
        under_way.cancelled.send_replace(true);
    }
    // A step of the work that does not look up takes a moment; the job tells its end itself.
    let job = wait_for(app, id, Duration::from_secs(2)).await?;
    match job.state {
        JobState::Done | JobState::Failed => {
            let detail = format!(
                "The job is {} already, it cannot be cancelled.",
                job.state.word()
            );
            Err(Problem::new(Kind::JobEnded, detail).accepting("jobs that are queued or running"))
        }
        _ => Ok(job),
    }
}
