//! From an opened measurement to a paint: base, flakes, what is known about how well.

use super::IngestOptions;
use super::measurement::BareMeasurement;
use super::readings;
use crate::accuracy::clustering_error;
use crate::fit::{CoatChoice, FittedBase, fit_base, fit_base_telling, fit_flakes};
use crate::measurement::{
    HalfAngleTable, Layout, Package, PackageBase, TableLayout, ThetaHSpacing, read_merl, read_mpi,
};
use crate::paint::{
    CarPaint, Clustering, Coat, ColorTable, FitResiduals, PaintFile, Provenance, certify,
};
use crate::workshop::error::Refusal;

pub(super) fn ingest_brdf(
    bare: &BareMeasurement,
    name: String,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
    ended: &dyn Fn(&'static str),
) -> Result<PaintFile, Refusal> {
    let brdf = &bare.brdf;
    let coat = options
        .coat_ior
        .map_or(CoatChoice::ByResidual, CoatChoice::Ior);
    let base = fit_base_telling(brdf, coat, progress).map_err(|e| e.to_string())?;
    ended("base");
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
    let file = finish(
        name,
        provenance,
        base_paint(&base, coat),
        Some(base.residuals),
        None,
        warnings,
    );
    ended("certificate");
    Ok(file)
}

pub(super) fn ingest_package(
    package: Package,
    hash: blake3::Hash,
    options: &IngestOptions,
    progress: &(dyn Fn(f32) + Sync),
    ended: &dyn Fn(&'static str),
) -> Result<PaintFile, Refusal> {
    let mut warnings = package.warnings.clone();
    let mut residuals = None;
    let coat = coat_of(&package, options);
    // Share of the time that goes into the base: nothing where the lab fitted it, everything where there are no flakes.
    let based = match (&package.base, &package.flakes) {
        (Some(PackageBase::Table { .. }), Some(_)) => 0.4,
        (Some(PackageBase::Table { .. }), None) => 1.0,
        _ => 0.0,
    };
    let mut paint = match &package.base {
        // What the readings say of a base is known once the flakes are.
        None => CarPaint {
            coat,
            diffuse: [0.0; 3],
            lobes: Vec::new(),
            color_table: ColorTable::white(),
            flakes: None,
        },
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
            let table = table_of(base).map_err(|e| Refusal::in_file(file, e))?;
            let choice = CoatChoice::Inside(coat.map_or(1.0, |c| c.ior));
            let tell = |share: f32| progress(based * share);
            let base = fit_base_telling(&table, choice, &tell)
                .map_err(|e| Refusal::in_file(file, format!("{file}: {e}")))?;
            warnings.extend(base.warnings.iter().cloned());
            residuals = Some(base.residuals.clone());
            base_paint(&base, coat)
        }
    };
    let of_readings = package.base.is_none();
    if !of_readings {
        ended("base");
    }
    let mut clustering = None;
    if let Some(pictures) = &package.flakes {
        let tell = |done: usize, of: usize| {
            #[allow(clippy::cast_precision_loss)] // a progress bar
            progress(based + (1.0 - based) * done as f32 / of as f32);
        };
        let fitted = fit_flakes(pictures, &options.profile.flakes, &tell)?;
        warnings.extend(fitted.warnings);
        paint.flakes = Some(fitted.flakes);
        ended("flakes");
        clustering = Some(fitted.clustering);
    }
    if of_readings {
        let readings = package.multi_angle.as_ref();
        let readings = readings.ok_or_else(|| {
            let problem = "there is neither a model, a brdf_table nor multi_angle";
            Refusal::in_manifest("base", problem)
        })?;
        let fitted = readings::fitted(readings, coat, paint.flakes.take(), &mut warnings)
            .map_err(|problem| Refusal::in_manifest("multi_angle", problem))?;
        paint = fitted.paint;
        ended("base");
    }
    if let (Some(pictures), Some(clustering)) = (&package.flakes, &mut clustering) {
        clustering.error = clustering_error(pictures, &paint);
        ended("error");
    }
    let mut notes = package.notes;
    if let Some(readings) = package.multi_angle.as_ref().filter(|_| of_readings) {
        notes.extend(readings.texture_notes());
    }
    let provenance = Provenance {
        source: Layout::Package.name().to_owned(),
        hashes: vec![hash.to_hex().to_string()],
        notes,
        ..Provenance::default()
    };
    let name = options.name.clone().unwrap_or(package.name);
    let against = package
        .multi_angle
        .as_ref()
        .and_then(|readings| readings::compared(&paint, readings, &mut warnings));
    if package.multi_angle.is_some() && against.is_none() {
        warnings.push(
            "multi_angle holds no L, a, b and no usable spectrum at an angle above the surface: it was not compared with the \
             fit"
                .to_owned(),
        );
    }
    let file = finish(name, provenance, paint, residuals, clustering, warnings);
    ended("certificate");
    Ok(PaintFile {
        readings: against,
        ..file
    })
}

/// The coat of a package, of the index that the caller says where he says one.
fn coat_of(package: &Package, options: &IngestOptions) -> Option<Coat> {
    let Some(ior) = options.coat_ior else {
        return package.coat;
    };
    let of_index = readings::coat_of_index(ior)?;
    Some(package.coat.map_or(of_index, |coat| Coat { ior, ..coat }))
}

/// Fits the table of a package inside its coat.
pub(in crate::workshop) fn fitted_base(
    base: &PackageBase,
    coat: Option<Coat>,
) -> Result<CarPaint, String> {
    let table = table_of(base)?;
    let fitted = fit_base(&table, CoatChoice::Inside(coat.map_or(1.0, |c| c.ior)))
        .map_err(|e| e.to_string())?;
    Ok(base_paint(&fitted, coat))
}

/// The measured table of a package.
pub(in crate::workshop) fn table_of(base: &PackageBase) -> Result<HalfAngleTable, String> {
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
pub(in crate::workshop) fn finish(
    name: String,
    provenance: Provenance,
    paint: CarPaint,
    residuals: Option<FitResiduals>,
    clustering: Option<Clustering>,
    mut warnings: Vec<String>,
) -> PaintFile {
    let energy = certify(&paint);
    if let Some(most) = energy.excess() {
        warnings.push(format!(
            "the paint reflects up to {most:.2} times the light it gets: the measurement may be uncalibrated, or what was \
             not measured be guessed too bright"
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
