//! What a caller names: a sample, a `.paint`, a `.blend` or a measurement.

use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::ingest::{IngestOptions, ingest};
use super::settled::refuse_settled;
use super::{WorkshopError, samples};
use crate::blend::{Blend, RealisationWeights, Realised};
use crate::paint::{Limits, PaintFile};

/// Where a named thing is.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A file or a folder that exists.
    Path(PathBuf),
    /// One of the built-in samples.
    Sample(&'static samples::Sample),
}

/// A paint, or several with their correspondence.
#[derive(Clone, Debug)]
pub enum Thing {
    /// One paint.
    Paint(Box<PaintFile>),
    /// Several paints; needs weights to become one.
    Blend(Box<Blend>),
}

/// Finds what a name means: an existing path wins over a sample's name, `sample:NAME` is always the sample.
///
/// # Errors
///
/// [`WorkshopError`] for a name that is neither, listing the samples.
pub fn find(name: &str) -> Result<Source, WorkshopError> {
    let known = || {
        samples::SAMPLES
            .iter()
            .map(|s| s.name)
            .collect::<Vec<_>>()
            .join(", ")
    };
    if let Some(sample) = name.strip_prefix("sample:") {
        return samples::by_name(sample).map(Source::Sample).ok_or_else(|| {
            WorkshopError::input(
                name,
                format!("there is no sample '{sample}'; there are {}", known()),
            )
        });
    }
    let path = Path::new(name);
    if path.exists() {
        return Ok(Source::Path(path.to_owned()));
    }
    samples::by_name(name).map(Source::Sample).ok_or_else(|| {
        WorkshopError::input(
            name,
            format!(
                "no such file, and no sample of this name; samples are {}",
                known()
            ),
        )
    })
}

/// Reads the bytes of a file, its name in every error.
///
/// # Errors
///
/// [`WorkshopError`] when the file cannot be read or is larger than `limits.bytes`.
pub fn read(path: &Path, limits: &Limits) -> Result<Vec<u8>, WorkshopError> {
    let fail =
        |e: std::io::Error| WorkshopError::input(path.display(), format!("cannot be read: {e}"));
    let known = std::fs::metadata(path).map_err(fail)?;
    // A pipe or a device does not say how much is to come.
    let most = if known.is_file() {
        limits.bytes
    } else {
        limits.bytes.min(limits.table_bytes)
    };
    let mut bytes = Vec::new();
    if known.len() <= most {
        let file = std::fs::File::open(path).map_err(fail)?;
        bytes.reserve(usize::try_from(known.len()).unwrap_or(0));
        file.take(most + 1).read_to_end(&mut bytes).map_err(fail)?;
    }
    let length = known.len().max(bytes.len() as u64);
    if length > most {
        let problem = format!("{length} bytes or more, accepted are up to {most}");
        return Err(WorkshopError::input(path.display(), problem));
    }
    Ok(bytes)
}

/// First bytes of a file, to tell what it is; a folder has none.
pub(super) fn first_bytes(path: &Path) -> Result<Vec<u8>, WorkshopError> {
    if path.is_dir() {
        return Ok(Vec::new());
    }
    let fail =
        |e: std::io::Error| WorkshopError::input(path.display(), format!("cannot be read: {e}"));
    let mut head = Vec::new();
    std::fs::File::open(path)
        .map_err(fail)?
        .take(16)
        .read_to_end(&mut head)
        .map_err(fail)?;
    Ok(head)
}

/// A paint from a measurement, a `.paint` or a sample.
///
/// # Errors
///
/// [`WorkshopError`] for a name that is nothing, a damaged file, a blend, or clusters other than asked for.
pub fn open_paint(
    name: &str,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<PaintFile, WorkshopError> {
    match open_any(name, options, progress)? {
        Thing::Paint(paint) => Ok(*paint),
        Thing::Blend(_) => {
            let problem =
                "this is a blend; realise it to a .paint first, which can be blended again";
            Err(WorkshopError::input(name, problem))
        }
    }
}

/// Several of them side by side, in the order of their names; `progress` hears the share done of all.
///
/// # Errors
///
/// Those of [`open_paint`], for the first name that has one.
pub fn open_paints(
    names: &[String],
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Vec<PaintFile>, WorkshopError> {
    let done: Vec<AtomicU32> = names.iter().map(|_| AtomicU32::new(0)).collect();
    let opened: Vec<_> = (names, &done)
        .into_par_iter()
        .map(|(name, own)| {
            open_paint(name, options, &|share| {
                own.store((share * 1e6) as u32, Ordering::Relaxed);
                let sum: u32 = done.iter().map(|own| own.load(Ordering::Relaxed)).sum();
                progress(sum as f32 / 1e6 / names.len() as f32);
            })
        })
        .collect();
    opened.into_iter().collect()
}

/// Whatever the name means, to make something of it as it is; measurements are ingested.
///
/// # Errors
///
/// [`WorkshopError`] for a name that is nothing, a damaged file, or what was made by other knobs than asked for.
pub fn open(
    name: &str,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Thing, WorkshopError> {
    let thing = open_any(name, options, progress)?;
    refuse_settled(name, &thing, &options.asked)?;
    Ok(thing)
}

fn open_any(
    name: &str,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Thing, WorkshopError> {
    let path = match find(name)? {
        Source::Sample(sample) => {
            return Ok(Thing::Paint(Box::new(
                sample.build(&options.profile, progress)?,
            )));
        }
        Source::Path(path) => path,
    };
    let head = first_bytes(&path)?;
    if Blend::recognises(&head) {
        let bytes = read(&path, &options.limits)?;
        let blend = Blend::from_bytes(&bytes, &options.limits)
            .map_err(|e| WorkshopError::input(name, e))?;
        if let Some(clusters) = options.asked.clusters {
            let problem = format!(
                "{name} is a blend, its clusters correspond already: blend its paints again with --clusters {clusters}, \
                 or leave it out"
            );
            return Err(WorkshopError::usage("clusters", problem));
        }
        return Ok(Thing::Blend(Box::new(blend)));
    }
    if PaintFile::recognises(&head) {
        let bytes = read(&path, &options.limits)?;
        let paint = PaintFile::from_bytes(&bytes, &options.limits)
            .map_err(|e| WorkshopError::input(name, e))?;
        options.check_clusters(name, &paint)?;
        return Ok(Thing::Paint(Box::new(paint)));
    }
    ingest(&path, options, progress).map(|paint| Thing::Paint(Box::new(paint)))
}

impl Thing {
    /// The one paint this is: a paint as it stands, a blend at the given weights.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for weights that the blend refuses.
    pub fn realise(self, weights: Option<&RealisationWeights>) -> Result<Realised, WorkshopError> {
        match self {
            Self::Paint(file) => Ok(Realised {
                paint: file.paint,
                clamps: Vec::new(),
                weight_sums: [1.0; 3],
            }),
            Self::Blend(blend) => {
                let weights = weights
                    .ok_or_else(|| WorkshopError::usage("weights", "a blend needs weights"))?;
                Ok(blend.realise(weights)?)
            }
        }
    }
}
