//! The service: paints, blends, realisations, previews and jobs over HTTP.
//!
//! One file per resource. What holds for all of them is in few places: every request passes the `envelope` (id, time,
//! counts, panics), every refusal becomes a problem in `problem`, everything read from a request is read strictly in
//! `extract` and `query`, every answer is made in `answer` (`ETag`, how long it keeps), and everything that computes
//! does so at the `workbench`, longer things as a job of the `runner`.
//!
//! Promised: what was acknowledged survives a kill; the same request gives the same bytes, computed once however many
//! ask; nothing internal leaves in an error. Left to others: what a paint is (`workshop`), how bytes are kept (`store`).

mod accepted;
mod accuracy;
mod answer;
mod app;
mod blend_bundles;
mod blends;
mod docs;
mod documents;
mod envelope;
mod estimates;
mod extract;
mod home;
mod idempotency;
mod ids;
mod jobs;
mod metrics;
mod operations;
mod paints;
mod previews;
mod problem;
mod profile;
mod query;
mod readings;
mod realisations;
mod runner;
mod samples;
mod serve;
mod targets;
mod visibility;
mod waiting;
mod watchers;
mod weights;
mod workbench;
mod works;
mod workshop;

pub use app::App;
pub use docs::interface;
pub use samples::load_samples;
pub use serve::{ServeError, open, router, serve};
pub use works::{
    Asked, Estimate, Fault, Format, IngestOrder, Layout, Light, Picked, Picture, PictureFormat,
    Progress, Readings, Scene, Target, ThetaH, Thing, View, WorkError, Works,
};
pub use workshop::Workshop;

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
    /// Memory for results, paints and blends, bytes.
    pub memory_bytes: u64,
    /// Disk for results, bytes.
    pub disk_bytes: u64,
    /// Requests that may wait for a processor.
    pub most_waiting: usize,
    /// Jobs that may be queued or running.
    pub most_jobs: usize,
    /// Connections at a time.
    pub most_connections: usize,
    /// Longest time for the header of a request.
    pub header_time: Duration,
    /// Longest time for a JSON body.
    pub body_time: Duration,
    /// Longest time for requests under way when the service goes down.
    pub grace: Duration,
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
            most_connections: 1024,
            header_time: Duration::from_secs(10),
            body_time: Duration::from_secs(10),
            grace: Duration::from_secs(5),
        }
    }
}
