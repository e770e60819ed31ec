//! How long a caller waits for a job, and what is answered then.

use std::convert::Infallible;
use std::time::{Duration, Instant};

use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{HeaderName, StatusCode};
use axum::response::{IntoResponse, Response};

use super::answer::{Answer, Keep};
use super::kind::Kind;
use super::problem::Problem;
use crate::service::app::App;
use crate::service::work::{JobDocument, Picked, TargetDocument, runner};
use crate::store::JobState;

/// The `Prefer` header (RFC 7240): `wait=N` seconds, or `respond-async` for none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Prefer {
    wait: Option<Duration>,
}

/// Longest wait that is granted.
const LONGEST: Duration = Duration::from_mins(5);

/// Wait of a caller who has no preference: quick work is answered at once, and so are quick refusals.
const UNASKED: Duration = Duration::from_secs(3);

const PREFER: HeaderName = HeaderName::from_static("prefer");
const PREFERENCE_APPLIED: HeaderName = HeaderName::from_static("preference-applied");

impl<S: Send + Sync> FromRequestParts<S> for Prefer {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        let texts = parts
            .headers
            .get_all(PREFER)
            .iter()
            .filter_map(|value| value.to_str().ok());
        // Who gives both asks for the job only when the wait is over (RFC 7240, 4.3).
        let waits = texts.flat_map(|text| text.split([',', ';']));
        Ok(Self {
            wait: waits.filter_map(wait).max(),
        })
    }
}

/// A preference that is none of ours is left alone, as the RFC wants it.
fn wait(preference: &str) -> Option<Duration> {
    let (name, value) = preference.split_once('=').unwrap_or((preference, ""));
    match name.trim().to_ascii_lowercase().as_str() {
        "respond-async" => Some(Duration::ZERO),
        "wait" => value
            .trim()
            .trim_matches('"')
            .parse()
            .ok()
            .map(|seconds| Duration::from_secs(seconds).min(LONGEST)),
        _ => None,
    }
}

/// The answer that work was taken on, with the job that does it.
fn accepted(job: JobDocument, picked: Option<&Picked>) -> Answer {
    let address = format!("/v1/jobs/{}", job.id);
    let target = picked.map(TargetDocument::of);
    Answer::json(&JobDocument { target, ..job }, Keep::Never)
        .status(StatusCode::ACCEPTED)
        .location(&address)
}

impl Prefer {
    /// The answer to who asked for what a job makes: the thing itself, the problem, or the job when it takes longer, with
    /// what was picked for a target.
    ///
    /// # Errors
    ///
    /// [`Problem`] why the job failed.
    pub async fn answer<F>(
        self,
        app: &App,
        job: &str,
        address: &str,
        picked: Option<&Picked>,
        made: impl FnOnce() -> F,
    ) -> Result<Response, Problem>
    where
        F: Future<Output = Result<Answer, Problem>>,
    {
        let begun = Instant::now();
        let job = runner::wait_for(app, job, self.wait.unwrap_or(UNASKED)).await?;
        let waited = begun.elapsed();
        // Who does not wait gets the job, however far it came meanwhile.
        let at_once = self.wait == Some(Duration::ZERO);
        let stages = job.stages.clone();
        let answer = match job.state {
            _ if at_once => accepted(job, picked),
            JobState::Done => made().await?.status(StatusCode::CREATED).location(address),
            JobState::Failed => {
                let told = job.problem.map(Problem::of_document);
                return Err(told.unwrap_or_else(|| {
                    Problem::internal(format!("job {} failed without a word", job.id))
                }));
            }
            JobState::Cancelled => {
                return Err(Problem::new(
                    Kind::JobCancelled,
                    "Somebody cancelled this while it was waited for.",
                ));
            }
            JobState::Queued | JobState::Running => accepted(job, picked),
        };
        // Those of the job itself, as far as it has come, beside what its caller waited.
        let answer = stages.into_iter().fold(answer, |answer, over| {
            let time = Duration::try_from_secs_f64(over.seconds).unwrap_or_default();
            answer.stage(over.stage, time)
        });
        let answer = answer.stage("job", waited);
        let applied = match self.wait {
            None => return Ok(answer.into_response()),
            Some(Duration::ZERO) => "respond-async".to_owned(),
            Some(wait) => format!("wait={}", wait.as_secs()),
        };
        Ok(answer.header(PREFERENCE_APPLIED, &applied).into_response())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn preferences_are_granted_within_reason() {
        let seconds = |text| wait(text).map(|wait| wait.as_secs());
        assert_eq!(seconds("wait=10"), Some(10));
        assert_eq!(seconds(" Wait = \"7\""), Some(7));
        assert_eq!(seconds("wait=100000"), Some(300));
        assert_eq!(seconds("respond-async"), Some(0));
        assert_eq!(seconds("wait=-1"), None);
        assert_eq!(seconds("return=minimal"), None);
    }
}
