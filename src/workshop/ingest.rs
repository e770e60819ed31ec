//! Ingest: a measurement becomes a paint.

use std::ops::ControlFlow;
use std::path::Path;

use super::thing::first_bytes;
use super::{WorkshopError, read};
use crate::accuracy::{Profile, clustering_error};
use crate::fit::{CoatChoice, FittedBase, fit_base, fit_flakes};
use crate::measurement::{
    BrdfMeasurement, HalfAngleTable, Layout, Package, PackageBase, ReadOptions, TableLayout,
    ThetaHSpacing, read_merl, read_mpi,
};
use crate::paint::{
    CarPaint, Clustering, Coat, FitResiduals, Limits, PaintFile, Provenance, certify,
};

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
    /// Refuses a paint that was clustered otherwise than the caller asked for.
    pub(super) fn check_clusters(
        &self,
        name: &str,
        paint: &PaintFile,
    ) -> Result<(), WorkshopError> {
        match (self.clusters, &paint.clustering) {
            (Some(wanted), Some(had))
                if had.clusters != wanted && paint.provenance.source != "blend" =>
            {
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
}

/// An opened measurement.
#[derive(Debug)]
pub enum Measurement {
    /// A measured-paint package.
    Package(Box<Package>),
    /// A bare table or tensor, with the BLAKE3 of its bytes.
    Brdf(Box<BrdfMeasurement>, blake3::Hash),
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
    let bytes = read(path, &options.limits)?;
    let brdf =
        BrdfMeasurement::read(&bytes, &options.read, &options.limits).map_err(|e| wrong(&e))?;
    Ok(Measurement::Brdf(Box::new(brdf), blake3::hash(&bytes)))
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
    let name = match &options.name {
        Some(name) => name.clone(),
        None => path.file_stem().map_or_else(
            || "paint".to_owned(),
            |stem| stem.to_string_lossy().into_owned(),
        ),
    };
    if !(1..=200).contains(&name.chars().count()) {
        let problem = format!(
            "the name has {} characters, accepted are 1 to 200",
            name.chars().count()
        );
        return Err(WorkshopError::usage("name", problem));
    }
    let file = match open_measurement(path, options)? {
        Measurement::Brdf(brdf, hash) => ingest_brdf(&brdf, hash, name, options),
        Measurement::Package(package) => ingest_package(*package, options, progress),
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
        return ingest(path, options, progress).map_err(named);
    }
    let bytes = read(path, &options.limits).map_err(named)?;
    let mut paint = PaintFile::from_bytes(&bytes, &options.limits)
        .map_err(|e| WorkshopError::input("the upload", e))?;
    options.check_clusters("the upload", &paint)?;
    if let Some(name) = &options.name {
        paint.name.clone_from(name);
    }
    Ok(paint)
}

fn ingest_brdf(
    brdf: &BrdfMeasurement,
    hash: blake3::Hash,
    name: String,
    options: &IngestOptions,
) -> Result<PaintFile, String> {
    let coat = options
        .coat_ior
        .map_or(CoatChoice::ByResidual, CoatChoice::Ior);
    let base = fit_base(brdf, coat).map_err(|e| e.to_string())?;
    let mut warnings = brdf.warnings();
    warnings.extend(base.warnings.iter().cloned());
    let mut provenance = Provenance {
        source: match brdf {
            BrdfMeasurement::Rgl(_) => "rgl",
            BrdfMeasurement::Table(_) => "table",
        }
        .to_owned(),
        hashes: vec![hash.to_hex().to_string()],
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
            let base = fit_base(&table, choice).map_err(|e| format!("{file}: {e}"))?;
            warnings.extend(base.warnings.iter().cloned());
            residuals = Some(base.residuals.clone());
            base_paint(&base, coat)
        }
    };
    let mut clustering = None;
    if let Some(pictures) = &package.flakes {
        let tell = |done: usize, of: usize| {
            #[allow(clippy::cast_precision_loss)] // a progress bar
            progress(done as f32 / of as f32);
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
        source: "package".to_owned(),
        notes: package.notes,
        ..Provenance::default()
    };
    let name = options.name.clone().unwrap_or(package.name);
    Ok(finish(
        name, provenance, paint, residuals, clustering, warnings,
    ))
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
        energy,
        warnings,
    }
}
