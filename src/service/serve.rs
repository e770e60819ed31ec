//! Listening: addresses and their handlers, connections with time limits, and a quiet end.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use axum::error_handling::HandleErrorLayer;
use axum::extract::DefaultBodyLimit;
use axum::routing::get;
use axum::{BoxError, Router, middleware};
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_io_timeout::TimeoutStream;
use tower::ServiceBuilder;
use tower::limit::GlobalConcurrencyLimitLayer;

use super::app::App;
use super::http::{JSON_BYTES, Problem, cors, envelope, held_to_pages};
use super::resources::{
    accuracy, blend_bundles, blends, docs, environments, estimates, home, jobs, operations, paints,
    previews, readings, realisations, uploads, visibility,
};
use super::work::{Works, runner};
use crate::service::ServiceConfig;
use crate::store::StoreError;

/// Why a service did not start, or did not go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The store.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// What the last process left behind could not be tidied up or gone on with.
    #[error("the jobs on record could not be begun again; the log says why")]
    Jobs,
    /// The address.
    #[error("cannot listen on {address}: {source}")]
    Listen {
        /// Where it should have listened.
        address: std::net::SocketAddr,
        /// What the system said.
        source: io::Error,
    },
}

/// Opens the store and begins again what was under way. The service is ready once [`App::set_ready`] was called.
///
/// # Errors
///
/// [`ServeError`] when the data folder is in use, full, or not this program's.
pub async fn open(config: ServiceConfig, works: Arc<dyn Works>) -> Result<App, ServeError> {
    let app = App::open(config, works).await?;
    app.sweep().await.map_err(|_| ServeError::Jobs)?;
    runner::resume(&app).await.map_err(|_| ServeError::Jobs)?;
    Ok(app)
}

/// All addresses.
///
/// No more requests are under way at a time than the settings have it, and those beyond are refused at once instead of
/// standing in a line that nobody sees. Health, counts and pages answer all the same.
pub fn router(app: App) -> Router {
    let most = Arc::new(Semaphore::new(app.config.most_requests));
    let held = ServiceBuilder::new()
        .layer(HandleErrorLayer::new(|_: BoxError| async {
            Problem::overloaded()
        }))
        .load_shed()
        .layer(GlobalConcurrencyLimitLayer::with_semaphore(most));
    let around = ServiceBuilder::new()
        .layer(middleware::from_fn_with_state(app.clone(), envelope))
        .option_layer((!app.config.origins.is_empty()).then(|| cors(&app.config.origins)))
        .layer(middleware::from_fn_with_state(app.clone(), held_to_pages))
        // Uploads hold themselves to their own limit, piece by piece.
        .layer(DefaultBodyLimit::max(JSON_BYTES));
    resources()
        .layer(held)
        .merge(pages())
        .fallback(|| async { axum::http::StatusCode::NOT_FOUND })
        .method_not_allowed_fallback(docs::method_not_allowed)
        .layer(around)
        .with_state(app)
}

/// What works on paints.
fn resources() -> Router<App> {
    Router::new()
        .route("/v1/paints", get(paints::list).post(uploads::upload))
        .route(
            "/v1/paints/{id}",
            get(paints::show)
                .patch(visibility::change)
                .delete(paints::delete),
        )
        .route("/v1/paints/{id}/paint", get(paints::file))
        .route("/v1/paints/{id}/measurement", get(paints::measurement))
        .route(
            "/v1/paints/{id}/realisation.{format}",
            get(realisations::of_paint),
        )
        .route("/v1/paints/{id}/preview.{format}", get(previews::of_paint))
        .route("/v1/paints/{id}/readings", get(readings::show))
        .route("/v1/paints/{id}/readings.csv", get(readings::table))
        .route("/v1/paints/{id}/readings.cxf", get(readings::document))
        .route("/v1/blends", axum::routing::post(blends::create))
        .route("/v1/previews", axum::routing::post(previews::create))
        .route("/v1/blends/{id}", get(blends::show).delete(blends::delete))
        .route("/v1/blends/{id}/bundle.zip", get(blend_bundles::bundle))
        .route(
            "/v1/blends/{id}/realisation.{format}",
            get(realisations::of_blend),
        )
        .route("/v1/blends/{id}/preview.{format}", get(previews::of_blend))
        .route(
            "/v1/environments",
            get(environments::list).post(environments::upload),
        )
        .route(
            "/v1/environments/{id}",
            get(environments::show).delete(environments::delete),
        )
        .route("/v1/environments/{id}/file", get(environments::file))
        .route("/v1/estimates", axum::routing::post(estimates::create))
        .route(
            "/v1/estimates/ingest",
            axum::routing::post(estimates::of_upload),
        )
        .route("/v1/accuracy", get(accuracy::show))
        .route("/v1/jobs/{id}", get(jobs::show).delete(jobs::cancel))
        .route("/v1/jobs/{id}/events", get(jobs::events))
}

/// What tells about the service.
fn pages() -> Router<App> {
    Router::new()
        .route("/healthz", get(operations::healthz))
        .route("/readyz", get(operations::readyz))
        .route("/metrics", get(operations::metrics))
        .route("/", get(home::page))
        .route("/studio/page.js", get(home::script))
        .route("/studio/page.css", get(home::style))
        .route("/docs", get(docs::page))
        .route("/docs/page.js", get(docs::script))
        .route("/docs/page.css", get(docs::style))
        .route("/openapi.json", get(docs::openapi))
        .route("/problems/{kind}", get(docs::problem))
}

/// Serves until `stop` returns, then ends: no new connections, requests under way are answered, jobs stay on record.
pub async fn serve(app: App, listener: TcpListener, stop: impl Future<Output = ()>) {
    let router = router(app.clone());
    let connections = Arc::new(Semaphore::new(app.config.most_connections));
    let graceful = GracefulShutdown::new();
    // HTTP/1 from the first byte on: while the version is still to be told, no timer would run.
    let mut builder = Builder::new(TokioExecutor::new()).http1_only();
    builder
        .http1()
        .timer(TokioTimer::new())
        .header_read_timeout(app.config.header_time);

    let mut stop = std::pin::pin!(stop);
    let tidying = tokio::spawn(tidy_now_and_then(app.clone()));
    loop {
        let room = tokio::select! {
            room = Arc::clone(&connections).acquire_owned() => room,
            () = &mut stop => break,
        };
        let stream = tokio::select! {
            stream = accept(&listener) => stream,
            () = &mut stop => break,
        };
        let connection = builder.serve_connection(
            TokioIo::new(Box::pin(held_to_pace(stream, app.config.write_time))),
            TowerToHyperService::new(router.clone()),
        );
        let connection = graceful.watch(connection.into_owned());
        tokio::spawn(async move {
            // How a connection ends is the caller's business.
            let _ = connection.await;
            drop(room);
        });
    }
    drop(listener);
    app.stop();
    // It does not hold the data folder any longer.
    let _ = tidying.await;
    let grace = app.config.grace;
    let _ = tokio::time::timeout(grace, async {
        graceful.shutdown().await;
        while !app.jobs.is_idle() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    app.give_up();
}

async fn tidy_now_and_then(app: App) {
    let mut every = tokio::time::interval(Duration::from_secs(10));
    loop {
        tokio::select! {
            _ = every.tick() => app.metrics.tidy(),
            () = app.stopped() => return,
        }
    }
}

/// A connection that ends when its peer takes nothing of an answer for so long.
fn held_to_pace(stream: TcpStream, write_time: Duration) -> TimeoutStream<TcpStream> {
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(write_time));
    stream
}

/// The next connection. Where the system has none to give it is asked again a little later.
async fn accept(listener: &TcpListener) -> TcpStream {
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                // Small answers go out at once.
                let _ = stream.set_nodelay(true);
                return stream;
            }
            Err(error) => {
                tracing::warn!(%error, "no connection was accepted");
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        }
    }
}
