//! The service: paints, blends, realisations, previews and jobs over HTTP.
//!
//! | room | what is in it |
//! |---|---|
//! | `serve` | addresses and connections: begin here |
//! | `http` | what holds for every request: reading it strictly, answers, problems |
//! | `parameters` | what several resources are asked in the same words: accuracy, targets, weights, views |
//! | `resources` | one file per resource: paints, blends, realisations, previews, jobs … |
//! | `work` | what computes: the workshop, places to compute at, jobs |
//! | `app` | what all handlers share: the store, the work, the counts |
//! | `shelf`, `keeping`, `uploading` | paints and blends as they are read, kept and removed, and uploads until they are named |
//! | `environments` | environments as pictures are lit with them |
//! | `calibration` | what this machine takes, learned before anybody asks; estimates learn it again after a while |
//!
//! Promised: what was acknowledged survives a kill; the same request gives the same bytes, computed once however many
//! ask; nothing internal leaves in an error. Left to others: what a paint is (`workshop`), how bytes are kept (`store`),
//! who calls: whoever reaches the service may do all it does, and what is private is only left out of lists.

mod app;
mod calibration;
mod environments;
mod http;
mod ids;
mod keeping;
mod metrics;
mod parameters;
mod resources;
mod samples;
mod serve;
mod shelf;
mod uploading;
mod work;

pub use app::App;
pub use calibration::calibrate;
pub use http::Origin;
pub use resources::docs::interface;
pub use samples::load_samples;
pub use serve::{ServeError, open, router, serve};
pub use work::{
    Asked, Estimate, Fault, Format, Gloss, IngestOrder, Layout, Light, MadeFile, Picked,
    PictureFormat, Progress, Readings, Shape, Show, Target, ThetaHSpacing, Thing, View, Works,
    Workshop, WorkshopError,
};

use std::path::PathBuf;
use std::time::Duration;

use crate::paint::Limits;

/// Settings of a service.
#[derive(Clone, Debug)]
pub struct ServiceConfig {
    /// Folder of catalogue, uploads and results.
    pub data: PathBuf,
    /// Limits on everything untrusted.
    pub limits: Limits,
    /// Memory for results, paints, blends and environments, bytes.
    pub memory_bytes: u64,
    /// Disk for results, bytes.
    pub disk_bytes: u64,
    /// Requests that may wait for a processor.
    pub most_waiting: usize,
    /// Jobs that may be queued or running.
    pub most_jobs: usize,
    /// Requests for paints and what is made of them, under way at a time; those that wait for a job are among them.
    pub most_requests: usize,
    /// Connections at a time.
    pub most_connections: usize,
    /// Longest time for the header of a request.
    pub header_time: Duration,
    /// Longest time for a JSON body.
    pub body_time: Duration,
    /// Longest time in which a caller takes nothing of its answer.
    pub write_time: Duration,
    /// Longest time for requests under way when the service goes down.
    pub grace: Duration,
    /// Other addresses whose pages may call from a browser.
    pub origins: Vec<Origin>,
}

impl ServiceConfig {
    /// The usual settings, with everything kept under `data`.
    #[must_use]
    pub fn new(data: PathBuf) -> Self {
        Self {
            data,
            limits: Limits::default(),
            memory_bytes: 512 << 20,
            disk_bytes: 8 << 30,
            most_waiting: 64,
            most_jobs: 256,
            most_requests: 512,
            most_connections: 1024,
            header_time: Duration::from_secs(10),
            body_time: Duration::from_secs(10),
            write_time: Duration::from_secs(30),
            grace: Duration::from_secs(5),
            origins: Vec::new(),
        }
    }
}
