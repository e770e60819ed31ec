//! What is answered to who asks for a paint or a blend: the thing itself, or the job that makes it.

use std::sync::Arc;

use axum::response::{IntoResponse, Response};

use crate::service::app::App;
use crate::service::http::{Prefer, Problem};
use crate::service::parameters::targets;
use crate::service::shelf::Shelved;
use crate::service::work::Picked;

/// The answer about what is at `address`: made before when there is no job, otherwise as far as the job has come when
/// the caller stops waiting. It says what was picked for a target.
///
/// # Errors
///
/// [`Problem`] why the job failed.
pub async fn answer<F>(
    app: &App,
    prefer: Prefer,
    job: Option<String>,
    address: &str,
    picked: Option<&Picked>,
    made: impl FnOnce() -> F,
) -> Result<Response, Problem>
where
    F: Future<Output = Result<Arc<Shelved>, Problem>>,
{
    let told = async || targets::told_with(&*made().await?, picked);
    let answer = match job {
        None => told().await?.location(address).into_response(),
        Some(job) => prefer.answer(app, &job, address, picked, told).await?,
    };
    Ok(targets::told(answer, picked))
}
