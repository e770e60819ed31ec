//! `carpaint serve`: the HTTP service.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use tokio::net::TcpListener;

use crate::paint::Limits;
use crate::service::{self, ServeError, ServiceConfig, Workshop};
use crate::workshop::WorkshopError;

/// Serve paints over HTTP, with the sample paints loaded.
///
/// The data folder holds a SQLite catalogue and a folder of blobs; what was acknowledged survives a kill. Stop with
/// Ctrl-C or SIGTERM: requests under way are answered, jobs go on at the next start.
#[derive(Args, Clone, Debug)]
pub struct Serve {
    /// Address to listen on.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// Folder for catalogue, uploads and results; created if it is not there.
    #[arg(long, value_name = "DIR", default_value = "carpaint-data")]
    data: PathBuf,
    /// Do not load the sample paints.
    #[arg(long)]
    no_samples: bool,
}

impl Serve {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        tracing_subscriber::fmt()
            .with_writer(std::io::stderr)
            .with_env_filter(
                tracing_subscriber::EnvFilter::try_from_default_env()
                    .unwrap_or_else(|_| "carpaint=info".into()),
            )
            .init();
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .enable_all()
            .build()
            .map_err(WorkshopError::internal)?;
        let served = runtime.block_on(self.serve(json));
        // A picture that nobody waits for any more is not waited for either.
        runtime.shutdown_background();
        served
    }

    async fn serve(&self, json: bool) -> Result<(), WorkshopError> {
        let refused = |error: ServeError| match &error {
            ServeError::Listen { .. } => WorkshopError::usage("--listen", error),
            _ => WorkshopError::output(self.data.display(), error),
        };
        let listener = TcpListener::bind(self.listen).await.map_err(|source| {
            refused(ServeError::Listen {
                address: self.listen,
                source,
            })
        })?;
        let address = listener.local_addr().map_err(WorkshopError::internal)?;
        let config = ServiceConfig::new(self.data.clone());
        let app = service::open(config, Arc::new(Workshop::new(Limits::default())))
            .await
            .map_err(refused)?;
        if !self.no_samples {
            service::load_samples(&app)
                .await
                .map_err(|_| WorkshopError::internal("the sample paints could not be loaded"))?;
        }
        app.set_ready();
        if json {
            super::output::print_json(
                &serde_json::json!({ "listening": format!("http://{address}") }),
            )?;
        } else {
            eprintln!("carpaint is ready: open http://{address}");
        }
        service::serve(app, listener, stop_asked()).await;
        Ok(())
    }
}

/// Returns on Ctrl-C or SIGTERM.
async fn stop_asked() {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        if let Ok(mut terminate) = signal(SignalKind::terminate()) {
            tokio::select! {
                _ = tokio::signal::ctrl_c() => {}
                _ = terminate.recv() => {}
            }
            return;
        }
    }
    let _ = tokio::signal::ctrl_c().await;
}
