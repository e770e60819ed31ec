//! Accuracy: the profiles that trade time against it, and what a result's profile costs in it.
//!
//! Every room owns its settings; a [`Profile`] is those settings together, handed down as they are. No room below asks
//! what the profile is called. What a result's settings cost in accuracy is measured here: [`clustering_error`] of an
//! ingest, [`blend_deviation`] of a correspondence, [`left_out_w1`] of angles, [`reduced_w1`] of clusters,
//! [`seen_between`] of either, [`writing_error`] of a file, [`sparkle`] of any paint.
//!
//! Promised: an error is measured or bounded, says which, and is none at all where it is not known. Left to others: time,
//! which only `workshop` can measure; picking a profile for a target (`workshop`).

mod clustering;
mod correspondence;
mod error;
mod fewer;
mod geometries;
mod knobs;
mod profile;
mod seen;
mod sparkle;
pub mod study;
mod writing;

pub use clustering::{clustering_error, predicted_clustering_error};
pub use correspondence::blend_deviation;
pub use error::{
    PictureError, ResultError, SeenError, Term, blend_error, bundle_error, file_error, paint_error,
};
pub use fewer::{left_out_w1, reduced_w1, seen_between};
pub use knobs::{CostKnob, Draw, Knobs, Preset, ProfileError, Transport};
pub use profile::{PRESETS, Profile};
pub use sparkle::{Sparkle, sparkle};
pub use writing::{WritingError, writing_error};
