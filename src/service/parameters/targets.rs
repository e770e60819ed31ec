//! Targets in requests, and what was picked for them in answers.
//!
//! `Carpaint-Target` says whether the target is met, with which profile, and what was estimated: it depends on the
//! machine, so it stands in a header and never in the bytes of a result. Who posts is told the same as `target` in the
//! JSON of the answer, which is no result.

use std::time::Duration;

use axum::http::{HeaderName, HeaderValue};
use axum::response::Response;
use serde_json::{Map, Value};

use crate::service::http::{Answer, Keep, Problem, Stages};
use crate::service::shelf::Shelved;
use crate::service::work::{Picked, Target, TargetDocument, WorkshopError};

const TARGET: HeaderName = HeaderName::from_static("carpaint-target");

/// A target in a query.
///
/// # Errors
///
/// [`Problem`] for a limit that is not above 0, or one beside knobs.
pub fn of_query(
    max_error: Option<f64>,
    max_seconds: Option<f64>,
    knobs: bool,
) -> Result<Target, Problem> {
    let target = checked(max_error, max_seconds, Problem::of_query)?;
    match (target.is_some() && knobs, field(&target)) {
        (true, field) => Err(Problem::parameter(field, beside_knobs(field)).accepting(EITHER)),
        _ => Ok(target),
    }
}

/// A target in a JSON body.
///
/// # Errors
///
/// [`Problem`] for a limit that is not above 0, or one beside knobs.
pub fn of_body(
    max_error: Option<f64>,
    max_seconds: Option<f64>,
    knobs: bool,
) -> Result<Target, Problem> {
    let target = checked(max_error, max_seconds, Problem::of_body)?;
    match (target.is_some() && knobs, field(&target)) {
        (true, field) => {
            Err(Problem::value(format!("/{field}"), beside_knobs(field)).accepting(EITHER))
        }
        _ => Ok(target),
    }
}

const EITHER: &str = "a target or knobs, not both";

fn beside_knobs(field: &str) -> String {
    format!("{field} stands beside knobs.")
}

fn field(target: &Target) -> &'static str {
    if target.max_error.is_some() {
        "max_error"
    } else {
        "max_seconds"
    }
}

fn checked(
    max_error: Option<f64>,
    max_seconds: Option<f64>,
    problem: impl FnOnce(WorkshopError) -> Problem,
) -> Result<Target, Problem> {
    let target = Target {
        max_error,
        max_seconds,
    };
    target.check().map(|()| target).map_err(problem)
}

/// What is told about a paint or a blend, with what was picked for it.
///
/// # Errors
///
/// [`Problem`] when what is told is no object, which it is.
pub fn told_with(thing: &Shelved, picked: Option<&Picked>) -> Result<Answer, Problem> {
    let Some(picked) = picked else {
        return Ok(thing.told());
    };
    let mut document: Map<String, Value> =
        serde_json::from_slice(&thing.document.bytes).map_err(Problem::internal)?;
    let target = serde_json::to_value(TargetDocument::of(picked)).map_err(Problem::internal)?;
    document.insert("target".to_owned(), target);
    Ok(Answer::json(&document, Keep::Never))
}

/// A response that says what was picked, and what looking for it took.
pub fn told(mut response: Response, picked: Option<&Picked>) -> Response {
    let Some(picked) = picked else {
        return response;
    };
    if let Ok(value) = HeaderValue::from_str(&picked.line()) {
        response.headers_mut().insert(TARGET, value);
    }
    let stages = response.extensions_mut().get_or_insert_default::<Stages>();
    let searched = Duration::from_secs_f64(picked.searched);
    stages.0.insert(0, (SEARCH.into(), searched));
    response
}

/// The stage of looking for a profile.
const SEARCH: &str = "search";

impl Answer {
    /// With what was picked for a target, and what looking for it took.
    #[must_use]
    pub fn picked(self, picked: Option<&Picked>) -> Self {
        match picked {
            Some(picked) => self
                .header(TARGET, &picked.line())
                .stage(SEARCH, Duration::from_secs_f64(picked.searched)),
            None => self,
        }
    }
}
