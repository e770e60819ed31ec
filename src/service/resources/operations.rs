//! For the operator: is it alive, can it work, what has it done.

use axum::extract::State;
use serde::Serialize;
use utoipa::ToSchema;

use crate::service::app::App;
use crate::service::http::{Answer, Keep, Kind, Problem, ProblemDocument};

/// A sign of life.
#[derive(Debug, Serialize, ToSchema)]
pub struct Health {
    /// `ok`.
    status: &'static str,
    /// Version of carpaint.
    version: &'static str,
}

impl Health {
    fn ok() -> Answer {
        Answer::json(
            &Self {
                status: "ok",
                version: env!("CARGO_PKG_VERSION"),
            },
            Keep::Never,
        )
    }
}

/// Whether the process lives.
#[utoipa::path(
    get, path = "/healthz", tag = "operations",
    responses((status = 200, description = "It lives", body = Health))
)]
pub async fn healthz() -> Answer {
    Health::ok()
}

/// Whether requests are answered: the catalogue answers and the samples are loaded.
#[utoipa::path(
    get, path = "/readyz", tag = "operations",
    responses(
        (status = 200, description = "It is ready", body = Health),
        (status = 503, description = "Not yet, or not any more", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn readyz(State(app): State<App>) -> Result<Answer, Problem> {
    let not = |why| Err(Problem::new(Kind::Overloaded, why));
    if app.is_stopping() {
        return not("The service is going down.");
    }
    if !app.is_ready() {
        return not("The service is still loading its samples.");
    }
    if app.catalogue.ping().await.is_err() {
        return not("The catalogue does not answer.");
    }
    Ok(Health::ok())
}

/// Counts, in Prometheus' text format.
#[utoipa::path(
    get, path = "/metrics", tag = "operations",
    responses((status = 200, description = "The counts", body = String, content_type = "text/plain; version=0.0.4"))
)]
pub async fn metrics(State(app): State<App>) -> Answer {
    Answer::bytes("text/plain; version=0.0.4", app.metrics.text(), Keep::Never)
}
