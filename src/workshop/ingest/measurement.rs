//! A measurement, opened: a package, or a bare table or tensor.

use std::path::Path;

use super::IngestOptions;
use crate::measurement::{BrdfMeasurement, Layout, Package, sniff};
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
