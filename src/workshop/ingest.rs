//! Ingest: a measurement becomes a paint.

use std::ops::ControlFlow;
use std::path::Path;

use super::content::content_hash;
use super::thing::first_bytes;
use super::{WorkshopError, read};
use crate::accuracy::{Profile, clustering_error};
use crate::fit::{
    CoatChoice, FittedBase, against_readings, fit_base, fit_base_telling, fit_flakes,
};
use crate::measurement::{
    BrdfMeasurement, HalfAngleTable, Layout, Package, PackageBase, ReadOptions, TableLayout,
    ThetaHSpacing, read_merl, read_mpi, sniff,
};
use crate::paint::{
    CarPaint, Clustering, Coat, FitResiduals, Limits, PaintFile, Provenance, certify,
};

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
    /// Clusters the caller asked for by number.
    pub clusters: Option<usize>,
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
        self.clusters
            .map_or(Ok(()), |wanted| check_clusters(name, paint, wanted))
    }
}

/// Refuses a paint that was clustered otherwise than the caller asked for.
///
/// # Errors
///
/// [`WorkshopError`] with both numbers, and what to do.
pub fn check_clusters(name: &str, paint: &PaintFile, wanted: usize) -> Result<(), WorkshopError> {
    match &paint.clustering {
        Some(had) if had.clusters != wanted && paint.provenance.source != "blend" => {
            let problem = format!(
                "{name} was clustered with {} clusters a slice, {wanted} were asked for: ingest its measurement again \
                 with --clusters {wanted}, or leave the option out",
                had.clusters
            );
            Err(WorkshopError::usage("--clusters", problem))
        }
        _ => Ok(()),
    }
}

/// An opened measurement.
#[derive(Debug)]
pub enum Measurement {
    /// A measured-paint package.
    Package(Box<Package>),
    /// A bare table or tensor.
    Brdf(Box<BareMeasurement>),
}

/// A bare table or tensor.
#[derive(Debug)]
pub struct BareMeasurement {
    /// What was measured.
    pub brdf: BrdfMeasurement,
    /// How its bytes were laid out.
    pub layout: Layout,
    /// BLAKE3 of its bytes.
    pub hash: blake3::Hash,
}

/// Opens a measurement: what it is shows in its first bytes, unless the options say it.
///
/// # Errors
///
/// [`WorkshopError`] naming the file, the file inside it, and what is wrong.
pub fn open_measurement(
    path: &Path,
    options: &IngestOptions,
) -> Result<Measurement, WorkshopError> {
    let wrong = |e: &dyn std::fmt::Display| WorkshopError::input(path.display(), e);
    let is_package = match options.read.layout {
        Some(layout) => layout == Layout::Package,
        None => path.is_dir() || first_bytes(path)?.starts_with(b"PK"),
    };
    if is_package {
        let package = Package::open(path, &options.limits).map_err(|e| wrong(&e))?;
        return Ok(Measurement::Package(Box::new(package)));
    }
    let held = Limits {
        bytes: options.limits.bytes.min(options.limits.table_bytes),
        ..options.limits
    };
    let bytes = read(path, &held)?;
    // What is not recognised can be named.
    let layout = sniff(&bytes, &options.read).map_err(|e| WorkshopError {
        field: Some("layout".to_owned()),
        ..wrong(&e)
    })?;
    let brdf =
        BrdfMeasurement::read(&bytes, &options.read, &options.limits).map_err(|e| wrong(&e))?;
    let hash = blake3::hash(&bytes);
    Ok(Measurement::Brdf(Box::new(BareMeasurement {
        brdf,
        layout,
        hash,
    })))
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
    let stem = path
        .file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    ingest_called(path, options, |_| stem, progress)
}

/// Fits a measurement that has no name of its own as what `unnamed` calls it.
fn ingest_called(
    path: &Path,
    options: &IngestOptions,
    unnamed: impl FnOnce(&BareMeasurement) -> String,
    progress: &(dyn Fn(f32) + Sync),
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
    let file = match open_measurement(path, options)? {
        Measurement::Brdf(bare) => {
            let named = options.name.clone();
            let name = named.unwrap_or_else(|| as_name(&unnamed(&bare), bare.layout));
            ingest_brdf(&bare, name, options, progress)
        }
        Measurement::Package(package) => {
            let hash = content_hash(path, &options.limits)?;
            ingest_package(*package, hash, options, progress)
        }
    }
    .map_err(|problem| WorkshopError::input(path.display(), problem))?;
    file.paint
        .validate(&options.limits)
        .map_err(|problem| WorkshopError::input(path.display(), problem))?;
    Ok(file)
}

/// Ingests an upload: a measurement, or a `.paint` that this program wrote. `path` is where the upload is kept, which
/// its owner does not know and errors do not name.
///
/// # Errors
///
/// [`WorkshopError`] naming the file inside the upload, and what is wrong.
pub fn ingest_upload(
    path: &Path,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<PaintFile, WorkshopError> {
    let named = |error: WorkshopError| WorkshopError {
        message: error
            .message
            .replace(&path.display().to_string(), "the upload"),
        ..error
    };
    if !PaintFile::recognises(&first_bytes(path)?) {
        // The file is called by the hash of its bytes, which is no name: better what it says about itself.
        let description =
            |bare: &BareMeasurement| bare.brdf.description().unwrap_or_default().to_owned();
        return ingest_called(path, options, description, progress).map_err(named);
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
    options.check_clusters("the upload", &paint)?;
    // What a file says of itself is checked where that can be done, and marked where not.
    paint.energy = certify(&paint.paint);
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

fn ingest_brdf(
    bare: &BareMeasurement,
    name: String,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<PaintFile, String> {
    let brdf = &bare.brdf;
    let coat = options
        .coat_ior
        .map_or(CoatChoice::ByResidual, CoatChoice::Ior);
    let base = fit_base_telling(brdf, coat, progress).map_err(|e| e.to_string())?;
    let mut warnings = brdf.warnings();
    warnings.extend(base.warnings.iter().cloned());
    let mut provenance = Provenance {
        source: bare.layout.name().to_owned(),
        hashes: vec![bare.hash.to_hex().to_string()],
        ..Provenance::default()
    };
    if let Some(description) = brdf.description() {
        provenance
            .notes
            .insert("description".to_owned(), description.to_owned());
    }
    let coat = base.coat;
    Ok(finish(
        name,
        provenance,
        base_paint(&base, coat),
        Some(base.residuals),
        None,
        warnings,
    ))
}

fn ingest_package(
    package: Package,
    hash: blake3::Hash,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<PaintFile, String> {
    let mut warnings = package.warnings.clone();
    let mut residuals = None;
    let coat = match (package.coat, options.coat_ior) {
        (coat, None) => coat,
        (coat, Some(ior)) => Some(Coat {
            ior,
            ..coat.unwrap_or(Coat::smooth(ior))
        }),
    };
    // Share of the time that goes into the base: nothing where the lab fitted it, everything where there are no flakes.
    let based = match (&package.base, &package.flakes) {
        (Some(PackageBase::Table { .. }), Some(_)) => 0.4,
        (Some(PackageBase::Table { .. }), None) => 1.0,
        _ => 0.0,
    };
    let mut paint = match &package.base {
        None => {
            return Err("base: there is neither a model nor a brdf_table; a paint cannot be fitted from multi_angle \
                        readings alone yet"
                .to_owned());
        }
        Some(PackageBase::Model {
            diffuse,
            lobes,
            color_table,
        }) => CarPaint {
            coat,
            diffuse: *diffuse,
            lobes: lobes.clone(),
            color_table: color_table.clone(),
            flakes: None,
        },
        Some(base @ PackageBase::Table { file, .. }) => {
            let table = table_of(base)?;
            let choice = CoatChoice::Inside(coat.map_or(1.0, |c| c.ior));
            let tell = |share: f32| progress(based * share);
            let base =
                fit_base_telling(&table, choice, &tell).map_err(|e| format!("{file}: {e}"))?;
            warnings.extend(base.warnings.iter().cloned());
            residuals = Some(base.residuals.clone());
            base_paint(&base, coat)
        }
    };
    let mut clustering = None;
    if let Some(pictures) = &package.flakes {
        let tell = |done: usize, of: usize| {
            #[allow(clippy::cast_precision_loss)] // a progress bar
            progress(based + (1.0 - based) * done as f32 / of as f32);
            ControlFlow::Continue(())
        };
        let fitted =
            fit_flakes(pictures, &options.profile.flakes, &tell).map_err(|e| e.to_string())?;
        warnings.extend(fitted.warnings);
        paint.flakes = Some(fitted.flakes);
        clustering = Some(Clustering {
            error: clustering_error(pictures, &paint),
            ..fitted.clustering
        });
    }
    let provenance = Provenance {
        source: Layout::Package.name().to_owned(),
        hashes: vec![hash.to_hex().to_string()],
        notes: package.notes,
        ..Provenance::default()
    };
    let name = options.name.clone().unwrap_or(package.name);
    let readings = package
        .multi_angle
        .as_ref()
        .and_then(|readings| against_readings(&paint, readings));
    let file = finish(name, provenance, paint, residuals, clustering, warnings);
    Ok(PaintFile { readings, ..file })
}

/// Fits the table of a package inside its coat.
pub(super) fn fitted_base(base: &PackageBase, coat: Option<Coat>) -> Result<CarPaint, String> {
    let table = table_of(base)?;
    let fitted = fit_base(&table, CoatChoice::Inside(coat.map_or(1.0, |c| c.ior)))
        .map_err(|e| e.to_string())?;
    Ok(base_paint(&fitted, coat))
}

/// The measured table of a package.
pub(super) fn table_of(base: &PackageBase) -> Result<HalfAngleTable, String> {
    let PackageBase::Table {
        file,
        bytes,
        layout,
        header_bytes,
    } = base
    else {
        return Err("the base is a model, not a table".to_owned());
    };
    match layout {
        TableLayout::Mpi2005 => read_mpi(bytes, *header_bytes, ThetaHSpacing::Linear),
        TableLayout::Merl => read_merl(bytes, ThetaHSpacing::SquareRoot),
    }
    .map_err(|e| format!("{file}: {e}"))
}

fn base_paint(base: &FittedBase, coat: Option<Coat>) -> CarPaint {
    CarPaint {
        coat,
        diffuse: base.diffuse,
        lobes: base.lobes.clone(),
        color_table: base.color_table.clone(),
        flakes: None,
    }
}

/// Adds what follows from the parameters: the energy certificate, and a warning where it does not hold.
pub(super) fn finish(
    name: String,
    provenance: Provenance,
    paint: CarPaint,
    residuals: Option<FitResiduals>,
    clustering: Option<Clustering>,
    mut warnings: Vec<String>,
) -> PaintFile {
    let energy = certify(&paint);
    if !energy.conserves {
        let most = energy.albedo.iter().copied().fold(0.0, f64::max);
        warnings.push(format!(
            "the paint reflects up to {most:.2} times the light it gets: the measurement may be uncalibrated"
        ));
    }
    PaintFile {
        name,
        provenance,
        paint,
        clustering,
        residuals,
        readings: None,
        energy,
        warnings,
    }
}
