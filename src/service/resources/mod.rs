//! One file per resource: what can be asked of it, and what is answered. `making` and `files` are how several answer: with
//! what a job makes, and with a file.
//!
//! Promised: a handler reads its request, has the work done and answers; `docs` documents every one of them. Left to
//! others: how requests are read and answers written (`http`), where they compute and how jobs run (`work`).

pub mod accuracy;
pub mod blend_bundles;
pub mod blends;
pub mod docs;
pub mod documents;
pub mod environments;
pub mod estimates;
mod files;
pub mod home;
pub mod jobs;
mod making;
mod nearest;
pub mod operations;
pub mod paints;
pub mod previews;
pub mod readings;
pub mod realisations;
pub mod uploads;
pub mod visibility;
