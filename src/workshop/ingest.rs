//! Ingest: a measurement becomes a paint.

mod fitting;
mod measurement;
mod readings;

use std::path::Path;

pub(super) use self::fitting::{finish, fitted_base, table_of};
use self::fitting::{ingest_brdf, ingest_package};
pub use self::measurement::{BareMeasurement, Measurement, ReadingsUpload, open_measurement};
use self::readings::ingest_readings;
use super::content::content_hash;
use super::thing::first_bytes;
use super::{WorkshopError, read};
use crate::accuracy::{Knobs, Profile};
use crate::measurement::{Layout, ReadOptions};
use crate::paint::{Limits, PaintFile, certify};

/// Characters a paint's name may have.
pub const NAME_CHARACTERS: std::ops::RangeInclusive<usize> = 1..=crate::paint::NAME_CHARACTERS;

/// How a measurement is ingested.
#[derive(Clone, Debug, Default)]
pub struct IngestOptions {
    /// Name of the paint, in place of the measurement's own.
    pub name: Option<String>,
    /// What the file's bytes do not say.
    pub read: ReadOptions,
    /// Index of refraction of the coat, where the caller knows it.
    pub coat_ior: Option<f64>,
    /// Knobs the caller turned by name: they are part of `profile`, and refused by what was made otherwise.
    pub asked: Knobs,
    /// Accuracy.
    pub profile: Profile,
    /// Limits on what is read.
    pub limits: Limits,
}

impl IngestOptions {
    /// Refuses options that only a measurement can follow.
    fn check_measured(&self) -> Result<(), WorkshopError> {
        let given = [
            ("layout", self.read.layout.is_some()),
            ("theta_h", self.read.theta_h.is_some()),
            ("header_bytes", self.read.header_bytes.is_some()),
            ("coat_ior", self.coat_ior.is_some()),
        ];
        match given.iter().find(|(_, given)| *given) {
            None => Ok(()),
            Some((field, _)) => Err(WorkshopError::usage(
                field,
                format!("{field} was given for a .paint, accepted is a measurement beside it"),
            )),
        }
    }

    /// [`check_clusters`] of what the caller asked for.
    pub(super) fn check_clusters(
        &self,
        name: &str,
        paint: &PaintFile,
    ) -> Result<(), WorkshopError> {
        let wanted = self.asked.clusters;
        wanted.map_or(Ok(()), |wanted| {
            check_clusters(name, paint, wanted as usize)
        })
    }
}

/// Refuses a paint that was clustered otherwise than the caller asked for.
///
/// # Errors
///
/// [`WorkshopError`] with both numbers, and what to do.
pub fn check_clusters(name: &str, paint: &PaintFile, wanted: usize) -> Result<(), WorkshopError> {
    match &paint.clustering {
        Some(had) if had.clusters != wanted && !paint.provenance.is_blend() => {
            let problem = format!(
                "{name} was clustered with {} clusters a slice, {wanted} were asked for: ingest its measurement again \
                 with --clusters {wanted}, or clusters={wanted} in a query, or leave it out",
                had.clusters
            );
            Err(WorkshopError::usage("clusters", problem))
        }
        _ => Ok(()),
    }
}

/// Fits a measurement: base, flakes, certificate. `progress` hears the share done.
///
/// # Errors
///
/// [`WorkshopError`] naming the file, the file inside it, and what is wrong.
pub fn ingest(
    path: &Path,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<PaintFile, WorkshopError> {
    ingest_in_stages(path, options, progress, &|_| ())
}

/// The same, telling `ended` the name of each stage when it is over: `open`, `hash`, `base`, `flakes`, `error` (what the
/// clusters miss of the pictures), `certificate`; `base` after `flakes` where it is fitted to readings. Stages that a
/// measurement does not need are not told.
///
/// # Errors
///
/// As [`ingest`].
pub fn ingest_in_stages(
    path: &Path,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
    ended: &dyn Fn(&'static str),
) -> Result<PaintFile, WorkshopError> {
    let stem = path
        .file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    ingest_called(path, options, |_| stem, progress, ended)
}

/// Fits a measurement that has no name of its own as what `unnamed` calls it, who hears how it describes itself.
fn ingest_called(
    path: &Path,
    options: &IngestOptions,
    unnamed: impl FnOnce(Option<&str>) -> String,
    progress: &(dyn Fn(f32) + Sync),
    ended: &dyn Fn(&'static str),
) -> Result<PaintFile, WorkshopError> {
    if let Some(name) = &options.name {
        let length = name.chars().count();
        if !NAME_CHARACTERS.contains(&length) || name.chars().any(char::is_control) {
            let problem = format!(
                "the name has {length} characters, accepted are {} to {}, none of them control characters",
                NAME_CHARACTERS.start(),
                NAME_CHARACTERS.end()
            );
            return Err(WorkshopError::usage("name", problem));
        }
    }
    let opened = open_measurement(path, options)?;
    ended("open");
    let file = match opened {
        Measurement::Brdf(bare) => {
            let named = options.name.clone();
            let called = || as_name(&unnamed(bare.brdf.description()), bare.layout);
            let name = named.unwrap_or_else(called);
            ingest_brdf(&bare, name, options, progress, ended)
        }
        Measurement::Readings(upload) => {
            let asked = options.name.clone().filter(|_| !upload.file.asked_by_id);
            let named = asked.or_else(|| upload.file.name.clone());
            let named = named.or_else(|| options.name.clone());
            let name = named.unwrap_or_else(|| as_name(&unnamed(None), upload.layout));
            ingest_readings(*upload, name, options, ended)
        }
        Measurement::Package(package) => {
            let hash = content_hash(path, &options.limits)?;
            ended("hash");
            ingest_package(*package, hash, options, progress, ended)
        }
    }
    .map_err(|refusal| WorkshopError::refused(path.display(), refusal))?;
    file.paint
        .validate(&options.limits)
        .map_err(|problem| WorkshopError::input(path.display(), problem))?;
    Ok(file)
}

/// Whether an upload is a `.paint`, which is taken as it is and not fitted.
///
/// # Errors
///
/// [`WorkshopError`] when the upload cannot be read.
pub fn is_paint_file(path: &Path) -> Result<bool, WorkshopError> {
    Ok(PaintFile::recognises(&first_bytes(path)?))
}

/// Ingests an upload: a measurement, or a `.paint` that this program wrote. `path` is where the upload is kept, which
/// its owner does not know and errors do not name. `ended` hears of stages as in [`ingest_in_stages`].
///
/// # Errors
///
/// [`WorkshopError`] naming the file inside the upload, and what is wrong.
pub fn ingest_upload(
    path: &Path,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
    ended: &dyn Fn(&'static str),
) -> Result<PaintFile, WorkshopError> {
    let named = |error: WorkshopError| error.without(&path.display().to_string());
    if !is_paint_file(path)? {
        // The file is called by the hash of its bytes, which is no name: better what it says about itself.
        let description = |said: Option<&str>| said.unwrap_or_default().to_owned();
        return ingest_called(path, options, description, progress, ended).map_err(named);
    }
    options.check_measured()?;
    // It is held in memory as a whole, as a table is.
    let limits = Limits {
        bytes: options.limits.bytes.min(options.limits.table_bytes),
        ..options.limits
    };
    let bytes = read(path, &limits).map_err(named)?;
    let mut paint = PaintFile::from_bytes(&bytes, &limits)
        .map_err(|e| WorkshopError::input("the upload", e))?;
    ended("open");
    options.check_clusters("the upload", &paint)?;
    // What a file says of itself is checked where that can be done, and marked where not.
    paint.energy = certify(&paint.paint);
    ended("certificate");
    if paint.residuals.is_some() || paint.clustering.is_some() {
        paint.warnings.push(AS_UPLOADED.to_owned());
    }
    if let Some(name) = &options.name {
        paint.name.clone_from(name);
    }
    Ok(paint)
}

/// Said of an uploaded `.paint`.
const AS_UPLOADED: &str =
    "residuals and errors are those that the uploaded .paint states; they were not measured here";

/// A text as the name of a paint; where nothing is left of it, the layout's.
fn as_name(text: &str, layout: Layout) -> String {
    let printable = text.trim().chars().filter(|c| !c.is_control());
    let name: String = printable.take(*NAME_CHARACTERS.end()).collect();
    if name.is_empty() {
        format!("unnamed {}", layout.name())
    } else {
        name
    }
}
