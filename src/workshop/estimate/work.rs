//! A request as it can be estimated, whoever asks.

use std::path::Path;

use super::{
    Estimate, PictureWork, estimate_blend, estimate_blend_of, estimate_bundle, estimate_ingest,
    estimate_preview, estimate_realise,
};
use crate::accuracy::Profile;
use crate::blend::RealisationWeights;
use crate::paint::PaintFile;
use crate::workshop::{Format, IngestOptions, Thing, WorkshopError};

/// What is to be done.
#[derive(Clone, Copy, Debug)]
pub enum Work<'a> {
    /// A measurement becomes a paint.
    Ingest {
        /// The measurement.
        path: &'a Path,
        /// How; the profile in it is not looked at.
        options: &'a IngestOptions,
    },
    /// What names mean becomes a blend in a file, opened and ingested first.
    BlendNames {
        /// Paints, measurements, samples.
        names: &'a [String],
        /// How; the profile in it is not looked at.
        options: &'a IngestOptions,
    },
    /// Paints become a blend.
    Blend {
        /// The paints.
        paints: &'a [&'a PaintFile],
    },
    /// A paint, or a blend at some weights, becomes a file.
    Realise {
        /// The paint or blend.
        thing: &'a Thing,
        /// Weights of a blend.
        weights: Option<&'a RealisationWeights>,
        /// What it is written as.
        format: Format,
        /// Whether it is written to disk.
        written: bool,
    },
    /// All paints of a blend become one texture bundle.
    Bundle {
        /// The blend.
        thing: &'a Thing,
        /// Whether it is written to disk.
        written: bool,
    },
    /// A paint, or a blend at some weights, becomes a picture.
    Preview(PictureWork<'a>),
}

impl Work<'_> {
    /// What it will take with a profile.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for what would be refused when it is done.
    pub fn estimate(&self, profile: &Profile) -> Result<Estimate, WorkshopError> {
        match *self {
            Self::Ingest { path, options } => {
                estimate_ingest(&path.display().to_string(), &with(options, profile))
            }
            Self::BlendNames { names, options } => estimate_blend(names, &with(options, profile)),
            Self::Blend { paints } => estimate_blend_of(paints, profile),
            Self::Realise {
                thing,
                weights,
                format,
                written,
            } => estimate_realise(thing, weights, format, profile, written),
            Self::Bundle { thing, written } => estimate_bundle(thing, profile, written),
            Self::Preview(picture) => estimate_preview(&picture, profile),
        }
    }
}

fn with(options: &IngestOptions, profile: &Profile) -> IngestOptions {
    IngestOptions {
        profile: *profile,
        ..options.clone()
    }
}
