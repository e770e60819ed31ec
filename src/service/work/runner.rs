//! Jobs: work on record that is done once, whatever happens to the process or to who asked for it.
//!
//! A job is acknowledged when it is on record. Whatever is queued or running when the process ends is begun again at the
//! next start, from the record alone; one that was begun too often without an end has failed.

use std::collections::HashMap;
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use futures::FutureExt;
use serde::{Deserialize, Serialize};
use tokio::sync::{Semaphore, watch};
use utoipa::ToSchema;

use super::workbench::{CalledOff, Workbench, call_off};
use crate::service::app::App;
use crate::service::http::{Kind, Problem, ProblemDocument};
use crate::service::ids;
use crate::service::resources::{blends, paints};
use crate::store::{JobKind, JobRecord, JobState, NewJob};

/// How often a job is begun before it is given up: each time the process died over it.
const MOST_ATTEMPTS: u32 = 10;

/// Ended jobs that can still be asked for.
const JOBS_KEPT: u32 = 10_000;

/// A job as it is told.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct JobDocument {
    /// Address: `j_` and 32 hexadecimal digits.
    #[schema(pattern = "^j_[0-9a-f]{32}$")]
    pub id: String,
    /// What it makes: `ingest` a paint, `blend` a blend.
    #[schema(value_type = String)]
    pub kind: JobKind,
    /// `queued`, `running`, `done`, `failed` or `cancelled`.
    #[schema(value_type = String)]
    pub state: JobState,
    /// Share done.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub progress: f32,
    /// What is being done.
    pub stage: String,
    /// Seconds left as far as one can tell, while it runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_left: Option<f32>,
    /// Address of what was made, when done.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(format = "uri-reference")]
    pub result: Option<String>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<ProblemDocument>,
}

/// Jobs under way.
#[derive(Debug)]
pub struct Jobs {
    lanes: Arc<Semaphore>,
    bench: Workbench,
    under_way: Mutex<HashMap<String, Arc<UnderWay>>>,
    submitting: tokio::sync::Mutex<()>,
    most: usize,
}

/// A job that is queued or running in this process.
#[derive(Debug)]
pub struct UnderWay {
    job: JobRecord,
    told: watch::Sender<JobDocument>,
    cancelled: watch::Sender<bool>,
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
        if app.jobs.find(&id).is_none() {
            start(&app, submitted.job);
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
            end(app, &job, JobState::Failed, Some(&given_up)).await?;
        } else {
            start(app, job);
        }
    }
    Ok(())
}

fn start(app: &App, job: JobRecord) {
    let under_way = Arc::new(UnderWay {
        told: watch::Sender::new(document(&job)),
        cancelled: watch::Sender::new(false),
        job,
    });
    app.jobs
        .under_way()
        .insert(under_way.job.id.clone(), Arc::clone(&under_way));
    tokio::spawn(run(app.clone(), under_way));
}

async fn run(app: App, under_way: Arc<UnderWay>) {
    let job = &under_way.job;
    let last = match AssertUnwindSafe(run_to_end(&app, &under_way))
        .catch_unwind()
        .await
    {
        Ok(Ok(ended)) => ended,
        Ok(Err(problem)) => ended_badly(&app, job, problem).await,
        Err(_) => {
            ended_badly(
                &app,
                job,
                Problem::internal(format!("job {} panicked", job.id)),
            )
            .await
        }
    };
    app.jobs.under_way().remove(&job.id);
    if let Some(last) = last {
        under_way.told.send_replace(last);
    }
}

async fn ended_badly(app: &App, job: &JobRecord, problem: Problem) -> Option<JobDocument> {
    match end(app, job, JobState::Failed, Some(&problem)).await {
        Ok(document) => Some(document),
        Err(_) => Some(told(job, JobState::Failed, Some(problem.document(None)))),
    }
}

/// Runs a job and records its end; `None` when it goes on after a restart.
async fn run_to_end(app: &App, under_way: &Arc<UnderWay>) -> Result<Option<JobDocument>, Problem> {
    let job = &under_way.job;
    let lane = tokio::select! {
        lane = app.jobs.lanes.acquire() => Some(lane.map_err(Problem::internal)?),
        () = under_way.called_off() => None,
        () = app.stopped() => return Ok(None),
    };
    if lane.is_none() {
        return end(app, job, JobState::Cancelled, None).await.map(Some);
    }
    app.catalogue.begin_job(&job.id).await?;
    under_way
        .told
        .send_modify(|told| told.state = JobState::Running);
    let ended = match job.kind {
        JobKind::Ingest => paints::ingest(app, under_way).await?,
        JobKind::Blend => blends::blend(app, under_way).await?,
    };
    match ended {
        Ok(()) => end(app, job, JobState::Done, None).await.map(Some),
        Err(CalledOff) if under_way.is_cancelled() => {
            end(app, job, JobState::Cancelled, None).await.map(Some)
        }
        Err(CalledOff) => {
            // The service goes down: the next one begins it again.
            app.catalogue.return_job(&job.id).await?;
            Ok(None)
        }
    }
}

/// Records the end of a job, and lets go of an upload that came to nothing.
async fn end(
    app: &App,
    job: &JobRecord,
    state: JobState,
    problem: Option<&Problem>,
) -> Result<JobDocument, Problem> {
    let problem = problem.map(|problem| problem.document(None));
    let stored = problem
        .as_ref()
        .map(serde_json::to_string)
        .transpose()
        .map_err(Problem::internal)?;
    app.catalogue
        .end_job(&job.id, state, stored.as_deref())
        .await?;
    app.catalogue.forget_ended_jobs(JOBS_KEPT).await?;
    if job.kind == JobKind::Ingest && state != JobState::Done {
        paints::forget_upload(app, job).await?;
    }
    Ok(told(job, state, problem))
}

fn told(job: &JobRecord, state: JobState, problem: Option<ProblemDocument>) -> JobDocument {
    document(&JobRecord {
        state,
        problem: problem.and_then(|problem| serde_json::to_string(&problem).ok()),
        ..job.clone()
    })
}

/// A job on record as it is told.
fn document(job: &JobRecord) -> JobDocument {
    let done = job.state == JobState::Done;
    let made = match job.kind {
        JobKind::Ingest => "/v1/paints/",
        JobKind::Blend => "/v1/blends/",
    };
    JobDocument {
        id: job.id.clone(),
        kind: job.kind,
        state: if job.state.is_final() {
            job.state
        } else {
            JobState::Queued
        },
        progress: if done { 1.0 } else { 0.0 },
        stage: if job.state.is_final() {
            job.state.word()
        } else {
            "waiting"
        }
        .to_owned(),
        seconds_left: None,
        result: done.then(|| format!("{made}{}", job.subject)),
        problem: job
            .problem
            .as_deref()
            .and_then(|problem| serde_json::from_str(problem).ok()),
    }
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
    Ok(document(&job))
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

impl UnderWay {
    /// What it is about.
    #[must_use]
    pub const fn job(&self) -> &JobRecord {
        &self.job
    }

    /// The request it was recorded with.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the record does not read back.
    pub fn request<T: for<'de> Deserialize<'de>>(&self) -> Result<T, Problem> {
        serde_json::from_str(&self.job.request).map_err(Problem::internal)
    }

    /// Says what is being done now.
    pub fn stage(&self, stage: &str) {
        self.told
            .send_modify(|told| stage.clone_into(&mut told.stage));
    }

    /// Whether somebody called the job off.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        *self.cancelled.borrow()
    }

    /// Returns once somebody called the job off.
    pub async fn called_off(&self) {
        let _ = self
            .cancelled
            .subscribe()
            .wait_for(|&cancelled| cancelled)
            .await;
    }

    /// Computes one stage of the job. The work hears of a call through its progress.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the work panicked.
    pub async fn compute<T: Send + 'static>(
        self: &Arc<Self>,
        app: &App,
        stage: &str,
        work: impl FnOnce(&(dyn Fn(f32) + Sync)) -> T + Send + 'static,
    ) -> Result<Result<T, CalledOff>, Problem> {
        self.stage(stage);
        let (this, on, begun) = (Arc::clone(self), app.clone(), Instant::now());
        let progress = move |share: f32| {
            if on.is_stopping() || this.is_cancelled() {
                call_off();
            }
            this.tell(share.clamp(0.0, 1.0), begun.elapsed());
        };
        app.jobs
            .bench
            .run_or_call_off(move || work(&progress))
            .await
    }

    /// Tells the share done, in steps that are worth a message.
    fn tell(&self, share: f32, time: Duration) {
        self.told.send_if_modified(|told| {
            if (share - told.progress).abs() < 1e-3 {
                return false;
            }
            told.progress = share;
            told.seconds_left = (share > 0.02).then(|| time.as_secs_f32() * (1.0 - share) / share);
            true
        });
    }
}
