//! A job under way, as the work that it does sees it.

use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Deserialize;
use tokio::sync::watch;

use super::job_document::{JobDocument, StageDocument};
use super::workbench::{CalledOff, call_off};
use crate::service::app::App;
use crate::service::http::Problem;
use crate::store::{JobRecord, StoreError};

/// First pauses between questions to a store that does not answer.
const PAUSES: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(5)];
/// The pauses after them.
const LONGEST_PAUSE: Duration = Duration::from_mins(1);

/// A job that is queued or running in this process.
#[derive(Debug)]
pub struct UnderWay {
    pub(super) job: JobRecord,
    pub(super) told: watch::Sender<JobDocument>,
    pub(super) cancelled: watch::Sender<bool>,
    /// When the stage that goes on began.
    since: Mutex<Instant>,
}

impl UnderWay {
    /// A job that begins to wait for its turn.
    #[must_use]
    pub fn new(job: JobRecord) -> Self {
        Self {
            told: watch::Sender::new(JobDocument::of(&job)),
            cancelled: watch::Sender::new(false),
            since: Mutex::new(Instant::now()),
            job,
        }
    }

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

    /// Says that what was done since the last such word is over, and what it is called.
    pub fn ended(&self, stage: &str) {
        let now = Instant::now();
        let since = {
            let mut since = self.since.lock().unwrap_or_else(PoisonError::into_inner);
            std::mem::replace(&mut *since, now)
        };
        let over = StageDocument {
            stage: stage.to_owned(),
            seconds: now.duration_since(since).as_secs_f64(),
        };
        self.told.send_modify(|told| told.stages.push(over));
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

    /// Asks the store until it answers: a disk that is full may be made room on, a database that is busy comes to rest.
    ///
    /// # Errors
    ///
    /// [`Problem`] for a record that does not read back, which no time mends.
    pub async fn insist<T, F>(
        &self,
        app: &App,
        ask: impl Fn() -> F,
    ) -> Result<Result<T, CalledOff>, Problem>
    where
        F: Future<Output = Result<T, StoreError>>,
    {
        let called_off = async {
            tokio::select! {
                () = self.called_off() => {}
                () = app.stopped() => {}
            }
        };
        self.ask_until(called_off, ask).await
    }

    /// The same for what a job that was cancelled has still to say: nothing but the end of the service ends it.
    ///
    /// # Errors
    ///
    /// As [`UnderWay::insist`].
    pub async fn insist_though_cancelled<T, F>(
        &self,
        app: &App,
        ask: impl Fn() -> F,
    ) -> Result<Result<T, CalledOff>, Problem>
    where
        F: Future<Output = Result<T, StoreError>>,
    {
        self.ask_until(app.stopped(), ask).await
    }

    async fn ask_until<T, F>(
        &self,
        called_off: impl Future<Output = ()>,
        ask: impl Fn() -> F,
    ) -> Result<Result<T, CalledOff>, Problem>
    where
        F: Future<Output = Result<T, StoreError>>,
    {
        let mut called_off = pin!(called_off);
        let stage = self.told.borrow().stage.clone();
        let mut pauses = PAUSES.into_iter();
        loop {
            match ask().await {
                Ok(answer) => {
                    self.stage(&stage);
                    return Ok(Ok(answer));
                }
                Err(error @ StoreError::Corrupt { .. }) => return Err(error.into()),
                Err(error) => {
                    tracing::warn!(%error, job = self.job.id, "the store does not answer; the job asks again");
                }
            }
            self.stage("waiting for the store");
            let pause = pauses.next().unwrap_or(LONGEST_PAUSE);
            tokio::select! {
                () = tokio::time::sleep(pause) => {}
                () = &mut called_off => return Ok(Err(CalledOff)),
            }
        }
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
