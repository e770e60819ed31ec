//! A job as it is told.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::TargetDocument;
use crate::service::http::ProblemDocument;
use crate::store::{JobEnd, JobKind, JobRecord, JobState};

/// What a stage of a job took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StageDocument {
    /// `waiting` for its turn, and what was done then: of an ingest `open`, `hash`, `base`, `flakes`, `error` (what the
    /// clusters miss of the pictures), `certificate`; of a blend `read`, `blend`; in the end `store`.
    pub stage: String,
    /// Wall time, seconds.
    pub seconds: f64,
}

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
    /// What the stages that are over took, in their order.
    pub stages: Vec<StageDocument>,
    /// Address of what was made, when done.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(format = "uri-reference")]
    pub result: Option<String>,
    /// What was picked for the target of the request that is answered with this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<TargetDocument>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<ProblemDocument>,
}

impl JobDocument {
    /// A job on record as it is told.
    #[must_use]
    pub fn of(job: &JobRecord) -> Self {
        let done = job.state == JobState::Done;
        let made = match job.kind {
            JobKind::Ingest => "/v1/paints/",
            JobKind::Blend => "/v1/blends/",
        };
        Self {
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
            stages: (job.stages.as_deref())
                .and_then(|stages| serde_json::from_str(stages).ok())
                .unwrap_or_default(),
            result: done.then(|| format!("{made}{}", job.subject)),
            target: None,
            problem: job
                .problem
                .as_deref()
                .and_then(|problem| serde_json::from_str(problem).ok()),
        }
    }

    /// A job at its end.
    #[must_use]
    pub fn at_end(job: &JobRecord, end: JobEnd<'_>) -> Self {
        Self::of(&JobRecord {
            state: end.state,
            problem: end.problem.map(str::to_owned),
            stages: Some(end.stages.to_owned()),
            ..job.clone()
        })
    }
}
