//! `carpaint serve`: the HTTP service.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

use crate::service::{self, ServiceConfig};
use crate::workshop::WorkshopError;

/// Serve paints over HTTP, with the sample paints loaded.
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
    pub fn run(&self, _json: bool) -> Result<(), WorkshopError> {
        service::run(ServiceConfig { listen: self.listen, data: self.data.clone(), samples: !self.no_samples })
    }
}
