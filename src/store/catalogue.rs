//! The catalogue: which paints, blends and environments there are, and which jobs are to be done.
//!
//! Records are names, hashes and opaque JSON. Four small traits, one per resource; [`Catalogue`] is all of them.

use serde::{Deserialize, Serialize};

use super::blobs::{Hash, Task};

/// A paint that was ingested or given as a sample.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PaintRecord {
    /// Address.
    pub id: String,
    /// Name, as people search for it.
    pub name: String,
    /// Kind of source, as the provenance has it.
    pub source: String,
    /// Blob of the measurement, where there was one.
    pub measurement: Option<Hash>,
    /// Blob of the `.paint` file.
    pub paint: Hash,
    /// Hash of the physical content: equal for equal paints of different names.
    pub content: Hash,
    /// Whether lists show it.
    pub visibility: Visibility,
}

/// Whether lists show a paint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Visibility {
    /// They do.
    #[default]
    Published,
    /// Only where private paints are asked for.
    Private,
}

/// A page of paints, in the order they came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PaintPage {
    /// The paints.
    pub paints: Vec<PaintRecord>,
    /// Where the next page begins; `None` after the last.
    pub next: Option<i64>,
}

/// A paint with the numbers that were noted of it.
#[derive(Clone, Debug, PartialEq)]
pub struct NotedPaint {
    /// Address.
    pub id: String,
    /// Blob of the `.paint` file.
    pub paint: Hash,
    /// What was noted of the blob; `None` when nothing was yet.
    pub numbers: Option<Vec<f64>>,
}

/// A blend that was computed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlendRecord {
    /// Address.
    pub id: String,
    /// Ids of its paints, in the order they were asked for.
    pub paints: Vec<String>,
    /// What else was asked for: a JSON object.
    pub options: String,
    /// Blob of the `.blend` file.
    pub blend: Hash,
}

/// An environment that was uploaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EnvironmentRecord {
    /// Address.
    pub id: String,
    /// Ending of the file's name.
    pub format: String,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Blob of the file.
    pub file: Hash,
    /// What of its light is not drawn as bright as it was, a JSON object; `None` where all of it is.
    pub held: Option<String>,
}

/// A page of environments, in the order they came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EnvironmentPage {
    /// The environments.
    pub environments: Vec<EnvironmentRecord>,
    /// Where the next page begins; `None` after the last.
    pub next: Option<i64>,
}

/// What a job makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// A paint from an upload.
    Ingest,
    /// A blend of paints.
    Blend,
}

/// How far a job is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits for its turn.
    Queued,
    /// Is being worked on.
    Running,
    /// Its result exists.
    Done,
    /// It could not be done.
    Failed,
    /// Somebody called it off.
    Cancelled,
}

/// A job to be recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewJob {
    /// Address, not used before.
    pub id: String,
    /// What it makes.
    pub kind: JobKind,
    /// Id of the paint or blend that it makes.
    pub subject: String,
    /// Everything needed to do it, again if need be: a JSON object.
    pub request: String,
}

/// A job on record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobRecord {
    /// Address.
    pub id: String,
    /// What it makes.
    pub kind: JobKind,
    /// Id of the paint or blend that it makes.
    pub subject: String,
    /// Everything needed to do it.
    pub request: String,
    /// How far it is.
    pub state: JobState,
    /// How often it was begun.
    pub attempts: u32,
    /// Why it failed: a JSON object.
    pub problem: Option<String>,
    /// What its stages took, once it has ended: a JSON list.
    pub stages: Option<String>,
}

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobEnd<'a> {
    /// Done, failed or cancelled.
    pub state: JobState,
    /// Why it failed: a JSON object.
    pub problem: Option<&'a str>,
    /// What its stages took: a JSON list.
    pub stages: &'a str,
}

/// What came of submitting a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Submitted {
    /// The one unfinished job of the subject.
    pub job: JobRecord,
    /// Whether this call made it.
    pub new: bool,
}

/// Paints on record.
pub trait Paints: Send + Sync {
    /// Adds a paint; `false` when its id is there already, which changes nothing.
    fn add_paint<'a>(&'a self, paint: &'a PaintRecord) -> Task<'a, bool>;

    /// The paint of this id.
    fn paint<'a>(&'a self, id: &'a str) -> Task<'a, Option<PaintRecord>>;

    /// Up to `limit` paints of this visibility whose name or source contains `q`, whatever the case, from `cursor` on.
    fn paints<'a>(
        &'a self,
        q: Option<&'a str>,
        visibility: Visibility,
        cursor: Option<i64>,
        limit: u32,
    ) -> Task<'a, PaintPage>;

    /// Changes whether lists show a paint; `false` when there is none.
    fn show_paint<'a>(&'a self, id: &'a str, visibility: Visibility) -> Task<'a, bool>;

    /// Notes numbers of a paint's blob, in place of those of this kind before. They go when no paint has the blob.
    fn note<'a>(&'a self, paint: Hash, kind: &'a str, numbers: &'a [f64]) -> Task<'a, ()>;

    /// All paints of this visibility whose name or source contains `q`, whatever the case, in the order they came, with
    /// what was noted of this kind.
    fn noted<'a>(
        &'a self,
        q: Option<&'a str>,
        visibility: Visibility,
        kind: &'a str,
    ) -> Task<'a, Vec<NotedPaint>>;

    /// Removes a paint and hands out what was on record.
    fn remove_paint<'a>(&'a self, id: &'a str) -> Task<'a, Option<PaintRecord>>;
}

/// Blends on record.
pub trait Blends: Send + Sync {
    /// Adds a blend; `false` when its id is there already, which changes nothing.
    fn add_blend<'a>(&'a self, blend: &'a BlendRecord) -> Task<'a, bool>;

    /// The blend of this id.
    fn blend<'a>(&'a self, id: &'a str) -> Task<'a, Option<BlendRecord>>;

    /// Removes a blend and hands out what was on record.
    fn remove_blend<'a>(&'a self, id: &'a str) -> Task<'a, Option<BlendRecord>>;
}

/// Environments on record.
pub trait Environments: Send + Sync {
    /// Adds an environment; `false` when its id is there already, which changes nothing.
    fn add_environment<'a>(&'a self, environment: &'a EnvironmentRecord) -> Task<'a, bool>;

    /// The environment of this id.
    fn environment<'a>(&'a self, id: &'a str) -> Task<'a, Option<EnvironmentRecord>>;

    /// Up to `limit` environments from `cursor` on.
    fn environments(&self, cursor: Option<i64>, limit: u32) -> Task<'_, EnvironmentPage>;

    /// Removes an environment and hands out what was on record.
    fn remove_environment<'a>(&'a self, id: &'a str) -> Task<'a, Option<EnvironmentRecord>>;
}

/// Jobs on record.
pub trait JobBook: Send + Sync {
    /// Records a job as queued, unless its subject has an unfinished one: then that one is the answer.
    fn submit_job<'a>(&'a self, job: &'a NewJob) -> Task<'a, Submitted>;

    /// The job of this id.
    fn job<'a>(&'a self, id: &'a str) -> Task<'a, Option<JobRecord>>;

    /// All queued and running jobs in the order they came.
    fn unfinished_jobs(&self) -> Task<'_, Vec<JobRecord>>;

    /// Marks an unfinished job as begun once more.
    fn begin_job<'a>(&'a self, id: &'a str) -> Task<'a, ()>;

    /// Marks a begun job as queued again, as if it had not been begun.
    fn return_job<'a>(&'a self, id: &'a str) -> Task<'a, ()>;

    /// Forgets ended jobs, but for those that came last.
    fn forget_ended_jobs(&self, keep: u32) -> Task<'_, ()>;

    /// Ends an unfinished job as done, failed or cancelled. `false` when it had ended already.
    fn end_job<'a>(&'a self, id: &'a str, end: JobEnd<'a>) -> Task<'a, bool>;
}

/// The whole catalogue.
pub trait Catalogue: Paints + Blends + Environments + JobBook {
    /// Asks the backend for a sign of life.
    fn ping(&self) -> Task<'_, ()>;

    /// Ties a key to a subject unless it is tied, and says to which. Beyond `keep` keys the oldest are forgotten.
    fn tie_key<'a>(&'a self, key: &'a str, subject: &'a str, keep: u32) -> Task<'a, String>;

    /// Whether a paint, a blend, an environment or the request of an unfinished job names this blob.
    fn names_blob(&self, blob: Hash) -> Task<'_, bool>;
}

impl Visibility {
    /// The word that is stored.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Private => "private",
        }
    }

    pub(super) fn of_word(word: &str) -> Option<Self> {
        [Self::Published, Self::Private]
            .into_iter()
            .find(|visibility| visibility.word() == word)
    }
}

impl JobState {
    /// Whether nothing more happens.
    #[must_use]
    pub const fn is_final(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Cancelled)
    }

    /// The word that is stored and told.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    pub(super) fn of_word(word: &str) -> Option<Self> {
        [
            Self::Queued,
            Self::Running,
            Self::Done,
            Self::Failed,
            Self::Cancelled,
        ]
        .into_iter()
        .find(|s| s.word() == word)
    }
}

impl JobKind {
    /// The word that is stored and told.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Ingest => "ingest",
            Self::Blend => "blend",
        }
    }

    pub(super) fn of_word(word: &str) -> Option<Self> {
        [Self::Ingest, Self::Blend]
            .into_iter()
            .find(|k| k.word() == word)
    }
}
