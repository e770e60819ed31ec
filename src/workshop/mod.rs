//! The use cases: ingest, blend, realise, bundle, preview, evaluate, describe; the estimate of each and the profile that
//! meets a target; the self-test; the study. What both doors, HTTP and command line, call.
//!
//! Functions here are synchronous and compute; they read the files they are told to read, and give bytes to whoever keeps
//! them. Estimates and the study look at a clock, and write small files that they take away again to learn what writing
//! takes; what was made tells beside itself how long its stages took. No bytes depend on a clock, but for the profile that
//! is picked for a time. Long work takes a function that hears the share done. Knobs by which a paint or a blend was made
//! are not turned afterwards: [`settled`] says which. Every failure is a [`WorkshopError`] that says whose fault it is.

mod blending;
mod bundling;
mod content;
mod describing;
mod error;
mod estimate;
mod evaluating;
mod ingest;
mod laps;
mod previewing;
mod reading;
mod realising;
mod samples;
mod selftest;
mod settled;
mod study;
mod target;
mod thing;

pub use crate::export::{CXF_MEDIA_TYPE, Gloss, Readings, companions_hash};
pub use crate::render::{Environment, EnvironmentError, EnvironmentFile, EnvironmentFormat, Shape};
pub use blending::{Blended, blend_paints};
pub use bundling::bundle_blend;
pub use describing::{blend_notes, describe_blend, describe_paint};
pub use error::{Fault, Inside, WorkshopError, accepted};
pub use estimate::{
    Estimate, EstimatedError, PictureWork, Stage, Work, learn_machine, receive_stage,
    sample_to_estimate,
};
pub use evaluating::{Pairs, Values, evaluate, evaluate_raw};
pub use ingest::{
    BareMeasurement, IngestOptions, Measurement, NAME_CHARACTERS, ReadingsUpload, check_clusters,
    ingest, ingest_in_stages, ingest_upload, is_paint_file, open_measurement,
};
pub use laps::{Lap, Laps};
pub use previewing::{
    Light, MOST_SAMPLES, PictureFormat, PreviewOptions, Show, preview, read_environment, texels,
};
pub use reading::{MOST_ANGLES, color_difference, gloss, readings, readings_document};
pub use realising::{Format, Made, realise};
pub use samples::{SAMPLES, Sample, by_name as sample_by_name};
pub use selftest::{Check, selftest};
pub use settled::{Settled, settled};
pub use study::{StudyOptions, study};
pub use target::{Picked, Target};
pub use thing::{Source, Thing, find, open, open_paint, open_paints, read};

#[cfg(test)]
mod tests;
