//! Jobs over HTTP: how they stand, what they tell, and calling them off.

use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures::stream::{self, Stream, StreamExt};
use tokio::sync::watch;

use crate::service::app::App;
use crate::service::http::{Address, Answer, JobProblems, Keep, NoQuery, Problem, ProblemDocument};
use crate::service::work::{JobDocument, runner};

/// Least time between two events.
const PACE: Duration = Duration::from_millis(100);

/// How a job stands.
#[utoipa::path(
    get, operation_id = "show_job", path = "/v1/jobs/{id}", tag = "jobs", params(("id" = String, Path, description = "Job")),
    responses(
        (status = 200, description = "The job", body = JobDocument),
        JobProblems,
    )
)]
pub async fn show(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    Ok(Answer::json(
        &runner::look_up(&app, &id).await?,
        Keep::Never,
    ))
}

/// What a job tells while it goes on.
///
/// Server-sent events, each with the job as JSON: `progress` whenever there is some, and one `end`, after which the
/// stream closes.
#[utoipa::path(
    get, operation_id = "job_events", path = "/v1/jobs/{id}/events", tag = "jobs", params(("id" = String, Path, description = "Job")),
    responses(
        (status = 200, description = "The events", body = String, content_type = "text/event-stream"),
        JobProblems,
    )
)]
pub async fn events(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Response, Problem> {
    let news = runner::follow(&app, &id);
    let now = runner::look_up(&app, &id).await?;
    let stopped = async move { app.stopped().await };
    let events = tell(now, news).take_until(Box::pin(stopped)).map(|job| {
        let name = if job.state.is_final() {
            "end"
        } else {
            "progress"
        };
        // What does not serialise, a bug, ends the stream.
        Event::default().event(name).json_data(&job)
    });
    let mut response = Sse::new(events)
        .keep_alive(KeepAlive::default())
        .into_response();
    response
        .headers_mut()
        .insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(response)
}

/// The job as it is now, then each time it has changed, up to its end.
fn tell(
    now: JobDocument,
    news: Option<watch::Receiver<JobDocument>>,
) -> impl Stream<Item = JobDocument> {
    let later = stream::unfold((now.state.is_final(), news), |(ended, news)| async move {
        let mut news = news.filter(|_| !ended)?;
        tokio::time::sleep(PACE).await;
        news.changed().await.ok()?;
        let job = news.borrow_and_update().clone();
        Some((job.clone(), (job.state.is_final(), Some(news))))
    });
    stream::once(async move { now }).chain(later)
}

/// Cancel a job.
///
/// A queued job is cancelled at once, a running one at its next step. All who wait for the same paint or blend wait for
/// the same job.
#[utoipa::path(
    delete, operation_id = "cancel_job", path = "/v1/jobs/{id}", tag = "jobs", params(("id" = String, Path, description = "Job")),
    responses(
        (status = 200, description = "The job, cancelled or about to be", body = JobDocument),
        (status = 409, description = "The job has ended", body = ProblemDocument, content_type = "application/problem+json"),
        JobProblems,
    )
)]
pub async fn cancel(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    Ok(Answer::json(&runner::cancel(&app, &id).await?, Keep::Never))
}
