//! The envelope around every request: its id, its time, what it counts, and what becomes of panics and refusals.

use std::fmt::Write as _;
use std::panic::AssertUnwindSafe;
use std::time::Instant;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures::FutureExt;

use super::answer::{Stages, unless_known};
use super::problem::{self, Problem};
use crate::service::app::App;

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
const SERVER_TIMING: HeaderName = HeaderName::from_static("server-timing");

/// Most characters of a request id that is taken over from the caller.
const LONGEST_ID: usize = 128;

/// Wraps a request.
pub async fn envelope(State(app): State<App>, request: Request, next: Next) -> Response {
    let start = Instant::now();
    let id = request_id(&request);
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().cloned();
    let reads = matches!(method, Method::GET | Method::HEAD);
    let if_none_match = reads
        .then(|| request.headers().get(header::IF_NONE_MATCH).cloned())
        .flatten();

    let answered = AssertUnwindSafe(next.run(request)).catch_unwind().await;
    let response =
        answered.unwrap_or_else(|_| Problem::internal("a handler panicked").into_response());
    let response = problem::finish(response, id.to_str().unwrap_or("-"));
    let mut response = unless_known(response, if_none_match.as_ref());

    let time = start.elapsed();
    let stages = response
        .extensions_mut()
        .remove::<Stages>()
        .unwrap_or_default();
    let mut timing = String::with_capacity(64);
    for (name, time) in stages.0.into_iter().chain([("total".into(), time)]) {
        let separator = if timing.is_empty() { "" } else { ", " };
        let _ = write!(
            timing,
            "{separator}{name};dur={:.3}",
            time.as_secs_f64() * 1e3
        );
    }
    let route = route.as_ref().map_or("none", MatchedPath::as_str);
    app.metrics.request(&method, route, response.status(), time);
    if response.status().is_server_error() {
        let (status, id) = (response.status().as_u16(), id.to_str().unwrap_or("-"));
        if route == "/readyz" {
            tracing::debug!(status, "not ready");
        } else {
            tracing::warn!(%method, route, status, request_id = id, "a request failed");
        }
    }
    let headers = response.headers_mut();
    headers.insert(REQUEST_ID, id);
    headers.insert(
        header::X_CONTENT_TYPE_OPTIONS,
        HeaderValue::from_static("nosniff"),
    );
    if let Ok(timing) = HeaderValue::from_str(&timing) {
        headers.insert(SERVER_TIMING, timing);
    }
    response
}

/// The caller's id where it is short and plain, otherwise a new one.
fn request_id(request: &Request) -> HeaderValue {
    let plain = |id: &&HeaderValue| {
        (1..=LONGEST_ID).contains(&id.len())
            && id
                .as_bytes()
                .iter()
                .all(|&byte| byte.is_ascii_alphanumeric() || b"-_.:".contains(&byte))
    };
    request
        .headers()
        .get(REQUEST_ID)
        .filter(plain)
        .cloned()
        .unwrap_or_else(|| {
            HeaderValue::from_str(&crate::service::ids::random("r_"))
                .unwrap_or(HeaderValue::from_static("r_unknown"))
        })
}
