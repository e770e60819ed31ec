//! A measurement, opened: a package, a bare table or tensor, or readings of an instrument.

use std::path::Path;

use super::IngestOptions;
use crate::measurement::{BrdfMeasurement, Layout, Package, ReadOptions, ReadingsFile, sniff};
use crate::paint::Limits;
use crate::workshop::thing::first_bytes;
use crate::workshop::{WorkshopError, read};

/// An opened measurement.
#[derive(Debug)]
pub enum Measurement {
    /// A measured-paint package.
    Package(Box<Package>),
    /// A bare table or tensor.
    Brdf(Box<BareMeasurement>),
    /// Readings at a few angles.
    Readings(Box<ReadingsUpload>),
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

/// Readings of an instrument that came as a file of their own.
#[derive(Debug)]
pub struct ReadingsUpload {
    /// What was read.
    pub file: ReadingsFile,
    /// How its bytes were laid out.
    pub layout: Layout,
    /// BLAKE3 of its bytes.
    pub hash: blake3::Hash,
}

/// Refuses what only an MPI 2005 table leaves open, said of anything else; a package's manifest says what its table is.
fn check_mpi_only(layout: Layout, said: &ReadOptions) -> Result<(), WorkshopError> {
    let given = [
        ("theta_h", said.theta_h.is_some()),
        ("header_bytes", said.header_bytes.is_some()),
    ];
    match given.iter().find(|(_, given)| *given) {
        Some((field, _)) if layout != Layout::Mpi2005 => {
            let problem = format!(
                "{field} was given for a measurement of layout {}, accepted is layout mpi-2005 beside it",
                layout.name()
            );
            Err(WorkshopError::usage(field, problem))
        }
        _ => Ok(()),
    }
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
        check_mpi_only(Layout::Package, &options.read)?;
        let package = Package::open(path, &options.limits)
            .map_err(|e| WorkshopError::refused(path.display(), e.into()))?;
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
    check_mpi_only(layout, &options.read)?;
    if layout.is_of_readings() {
        let file = ReadingsFile::read(&bytes, layout, options.name.as_deref(), &options.limits)
            .map_err(|e| wrong(&e))?;
        let hash = blake3::hash(&bytes);
        return Ok(Measurement::Readings(Box::new(ReadingsUpload {
            file,
            layout,
            hash,
        })));
    }
    let brdf =
        BrdfMeasurement::read(&bytes, &options.read, &options.limits).map_err(|e| wrong(&e))?;
    let hash = blake3::hash(&bytes);
    Ok(Measurement::Brdf(Box::new(BareMeasurement {
        brdf,
        layout,
        hash,
    })))
}
