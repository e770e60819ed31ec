//! What the service asks of the workshop: synchronous work that computes.

use std::fmt::Debug;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::accuracy::Profile;
use crate::blend::{Blend, RealisationWeights};
use crate::paint::PaintFile;
use crate::workshop::Environment;

/// Share done, from 0 to 1. It does not return when the work was called off.
pub type Progress<'a> = &'a (dyn Fn(f32) + Sync);

pub use crate::measurement::{Layout, ThetaHSpacing};
pub use crate::workshop::{
    CXF_MEDIA_TYPE, Estimate, Fault, Format, Gloss, Lap, Light, Picked, PictureFormat, Readings,
    Shape, Show, Target, Thing, WorkshopError,
};

/// How an upload becomes a paint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IngestOrder {
    /// Name of the paint, in place of the measurement's own.
    pub name: Option<String>,
    /// What the file is, where its bytes do not say.
    pub layout: Option<Layout>,
    /// Spacing of θh.
    pub theta_h: Option<ThetaHSpacing>,
    /// Bytes before the values of an MPI 2005 table.
    pub header_bytes: Option<u64>,
    /// Index of refraction of the coat, where the caller knows it.
    pub coat_ior: Option<f64>,
    /// How accurate.
    pub profile: Profile,
    /// Clusters that were asked for by number.
    pub clusters: Option<u32>,
}

/// What a picture shows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct View {
    /// The paint, or its aspecular angles.
    #[serde(skip_serializing_if = "Show::is_paint")]
    pub show: Show,
    /// What the paint is on.
    pub scene: Shape,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples_per_pixel: u32,
    /// Id of an environment in place of the built-in studio; its light stands beside the view where work is done.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub environment: Option<String>,
    /// Lights in place of the scene's usual one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lights: Option<Vec<Light>>,
}

/// Work that can be estimated.
#[derive(Clone, Copy, Debug)]
pub enum Asked<'a> {
    /// An upload becomes a paint.
    Ingest {
        /// The upload.
        upload: &'a Path,
        /// How it is read.
        order: &'a IngestOrder,
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
    },
    /// All paints of a blend become one texture bundle.
    Bundle {
        /// The blend.
        thing: &'a Thing,
    },
    /// A paint, or a blend at some weights, becomes a picture.
    Preview {
        /// The paint or blend.
        thing: &'a Thing,
        /// Weights of a blend.
        weights: Option<&'a RealisationWeights>,
        /// What it shows; the profile says how many samples.
        view: &'a View,
        /// The light of its environment, where that is not the built-in studio.
        environment: Option<&'a Environment>,
        /// What it is written as.
        format: PictureFormat,
    },
}

/// A file with the account of its accuracy.
#[derive(Clone, Debug)]
pub struct MadeFile {
    /// The file.
    pub bytes: Vec<u8>,
    /// How accurate it is, as the value of a header: the same for the same file. Empty where nothing of it is
    /// known.
    pub accuracy: String,
    /// What is in it, what was left out, what had to be clamped.
    pub report: Value,
    /// How long each stage took.
    pub stages: Vec<Lap>,
}

/// The pieces of work.
pub trait Works: Debug + Send + Sync {
    /// An upload becomes a paint; `ended` hears of each stage when it is over.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for an upload that is no measurement.
    fn ingest(
        &self,
        upload: &Path,
        order: &IngestOrder,
        progress: Progress<'_>,
        ended: &dyn Fn(&'static str),
    ) -> Result<PaintFile, WorkshopError>;

    /// Paints become a blend.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for paints that cannot be blended.
    fn blend(
        &self,
        paints: &[&PaintFile],
        profile: &Profile,
        progress: Progress<'_>,
    ) -> Result<Blend, WorkshopError>;

    /// A paint, or a blend at some weights, becomes a file.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for weights that are refused.
    fn realise(
        &self,
        thing: &Thing,
        weights: Option<&RealisationWeights>,
        format: Format,
        profile: &Profile,
    ) -> Result<MadeFile, WorkshopError>;

    /// All paints of a blend become one texture bundle.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for a thing that is no blend.
    fn bundle(&self, blend: &Thing, profile: &Profile) -> Result<MadeFile, WorkshopError>;

    /// A paint, or a blend at some weights, becomes a picture, lit by the environment that the view names.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for weights or a view that is refused.
    fn preview(
        &self,
        thing: &Thing,
        weights: Option<&RealisationWeights>,
        view: &View,
        environment: Option<&Environment>,
        format: PictureFormat,
        progress: Progress<'_>,
    ) -> Result<MadeFile, WorkshopError>;

    /// A paint is read by a virtual multi-angle instrument, at its own angles where none are given.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for angles that no instrument reads at.
    fn readings(
        &self,
        paint: &Thing,
        aspecular_deg: Option<&[f64]>,
    ) -> Result<Readings, WorkshopError>;

    /// The same as a `CxF3` document.
    ///
    /// # Errors
    ///
    /// As [`Works::readings`].
    fn readings_document(
        &self,
        paint: &Thing,
        aspecular_deg: Option<&[f64]>,
    ) -> Result<String, WorkshopError>;

    /// What a glossmeter reads of a paint.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for a blend, which has no gloss of its own.
    fn gloss(&self, paint: &Thing) -> Result<Gloss, WorkshopError>;

    /// What some work will take with a profile.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for what would be refused when it is done.
    fn estimate(&self, asked: &Asked<'_>, profile: &Profile) -> Result<Estimate, WorkshopError>;

    /// The profile that meets a target on some work.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for a target that is none, and what would be refused when the work is done.
    fn pick(&self, asked: &Asked<'_>, target: &Target) -> Result<Picked, WorkshopError>;

    /// What the caller of a blend with this profile should know.
    fn notes(&self, blend: &Blend, profile: &Profile) -> Vec<String>;

    /// What is known about a paint or a blend.
    fn describe(&self, thing: &Thing) -> Value;
}
