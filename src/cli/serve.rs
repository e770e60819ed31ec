//! `carpaint serve`: the HTTP service.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use tokio::net::TcpListener;
use tokio::sync::Notify;

use crate::paint::Limits;
use crate::service::{self, App, Origin, ServeError, ServiceConfig, Workshop};
use crate::workshop::WorkshopError;

/// Serve paints over HTTP, with the sample paints loaded.
///
/// The data folder holds a SQLite catalogue and a folder of blobs; what was acknowledged survives a kill. Stop with
/// Ctrl-C or SIGTERM: requests under way are answered, jobs go on at the next start.
///
/// Whoever reaches the address may read, upload and delete: beyond this machine, put a proxy in front that asks who calls.
#[derive(Args, Clone, Debug)]
pub struct Serve {
    /// Address to listen on.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080", allow_hyphen_values = true, value_parser = listen_address)]
    listen: SocketAddr,
    /// Folder for catalogue, uploads and results; created if it is not there.
    #[arg(long, value_name = "DIR", default_value = "carpaint-data")]
    data: PathBuf,
    /// Another address whose pages may ask for paints from a browser, such as `https://cars.example`; `*` is all of
    /// them. May be given several times. They read and make; none of them changes or deletes.
    #[arg(long, value_name = "ORIGIN")]
    allow_origin: Vec<Origin>,
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
        if !address.ip().is_loopback() {
            tracing::warn!(
                %address,
                "whoever reaches this address may read, upload and delete; put a proxy in front that asks who calls"
            );
        }
        let config = ServiceConfig {
            origins: self.allow_origin.clone(),
            ..ServiceConfig::new(self.data.clone())
        };
        let app = service::open(config, Arc::new(Workshop::new(Limits::default())))
            .await
            .map_err(refused)?;
        // Requests are answered while the samples load, /readyz says when they have.
        let failed = Arc::new(Notify::new());
        let loading = tokio::spawn(load(
            app.clone(),
            self.no_samples,
            json,
            address,
            Arc::clone(&failed),
        ));
        let stop = async {
            tokio::select! {
                () = stop_asked() => {}
                () = failed.notified() => {}
            }
        };
        service::serve(app, listener, stop).await;
        if loading.is_finished() {
            return loading.await.map_err(WorkshopError::internal)?;
        }
        Ok(())
    }
}

fn listen_address(text: &str) -> Result<SocketAddr, String> {
    let wrong = |_| "accepted is an IP address and a port, such as 127.0.0.1:8080".to_owned();
    text.parse().map_err(wrong)
}

/// Loads the samples and says that the service is ready; where that fails the service ends.
async fn load(
    app: App,
    no_samples: bool,
    json: bool,
    address: SocketAddr,
    failed: Arc<Notify>,
) -> Result<(), WorkshopError> {
    let loaded = async {
        service::calibrate(&app).await;
        let whole = no_samples
            || service::load_samples(&app)
                .await
                .map_err(|_| WorkshopError::internal("the sample paints could not be loaded"))?;
        if !whole {
            // The service goes down before it was ready.
            return Ok(());
        }
        app.set_ready();
        if json {
            let told = serde_json::json!({ "listening": format!("http://{address}") });
            super::output::print_json(&told)
        } else {
            eprintln!("carpaint is ready: open http://{address}");
            Ok(())
        }
    };
    let loaded = loaded.await;
    if loaded.is_err() {
        failed.notify_one();
    }
    loaded
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
