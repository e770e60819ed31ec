//! Where the service works: what it asks of the workshop, at which places it computes, and its jobs.
//!
//! `works` says what can be asked, `workshop` has it done by the use cases that the command line calls too, and the
//! `workbench` keeps it off the threads that talk to the network. What takes longer is a job of the `runner`:
//! `ingesting` and `blending`; `drawing` pictures is quick enough to be waited for. What is made is kept as a `kept_file`, with
//! what is told about it.
//!
//! Promised: a job that was acknowledged is done once, also after a kill; what nobody waits for any more is called off.
//! Left to others: what requests look like (`resources`), how paints are made (`crate::workshop`).

mod blending;
pub mod colors;
pub mod drawing;
mod ingesting;
mod job_document;
mod kept_file;
mod picks;
pub mod runner;
mod under_way;
mod watchers;
mod workbench;
mod works;
mod workshop;

pub use blending::{BlendOptions, BlendRequest};
pub use ingesting::IngestRequest;
pub use job_document::JobDocument;
pub use kept_file::KeptFile;
pub use picks::{Picks, TargetDocument};
pub use runner::Jobs;
pub use watchers::Watchers;
pub use workbench::{Workbench, call_off};
pub use works::{
    Asked, CXF_MEDIA_TYPE, Estimate, Fault, Format, Gloss, IngestOrder, Layout, Light, MadeFile,
    Picked, PictureFormat, Progress, Readings, Shape, Show, Target, ThetaHSpacing, Thing, View,
    Works, WorkshopError,
};
pub use workshop::Workshop;
