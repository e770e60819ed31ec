//! The measured-paint package: what a lab uploads when it has more than one file.
//!
//! A zip archive or a folder; `paint.json` names the rest. Opening a package reads its manifest and the color table and
//! checks that every slice is there; pictures of flakes are decoded one at a time when somebody asks, from any number of
//! threads, so that a package of a gigabyte never stands in memory. Angles are inside the coat where there is one;
//! slices and tables are BRDF in 1/sr.

mod color_table;
mod error;
mod slices;

use std::path::Path;

use bytes::Bytes;

use self::color_table::color_table_of;
pub use self::error::PackageError;
pub use self::slices::{FlakePictures, FlakeSlices, SliceRoom};
use super::archive::{Archive, Unpacking};
pub use super::manifest::TableLayout;
use super::manifest::{BaseEntry, MANIFEST, Manifest};
use super::multi_angle::MultiAngle;
use crate::color::LinearRgb;
use crate::paint::{Coat, ColorTable, Limits, Lobe};

/// Largest manifest that is read.
const MANIFEST_BYTES: u64 = 16 << 20;
/// A measured-paint package, opened and checked.
#[derive(Clone, Debug)]
pub struct Package {
    /// Name the lab gave it.
    pub name: String,
    /// License, instrument, maker, color code, date, where given.
    pub notes: std::collections::BTreeMap<String, String>,
    /// Clear coat, where there is one.
    pub coat: Option<Coat>,
    /// The base; `None` when there are only multi-angle readings.
    pub base: Option<PackageBase>,
    /// Pictures of the flakes; `None` for a paint without flakes.
    pub flakes: Option<FlakeSlices>,
    /// Readings of a portable instrument, where given.
    pub multi_angle: Option<MultiAngle>,
    /// What the user should know: keys that were not read.
    pub warnings: Vec<String>,
}

/// The base of a package.
#[derive(Clone, Debug)]
pub enum PackageBase {
    /// Parameters that the lab fitted itself.
    Model {
        /// Lambertian albedo.
        diffuse: LinearRgb,
        /// Cook-Torrance lobes.
        lobes: Vec<Lobe>,
        /// Color by angle.
        color_table: ColorTable,
    },
    /// A measured half-angle table, bytes as they came. Neither transmission, highlight nor flakes are in it.
    Table {
        /// Name in the package, for errors.
        file: String,
        /// The file, its header included.
        bytes: Vec<u8>,
        /// How the bytes are laid out.
        layout: TableLayout,
        /// Bytes before the values.
        header_bytes: u64,
    },
}

impl Package {
    /// Opens a zip archive or a folder.
    ///
    /// # Errors
    ///
    /// [`PackageError`] with the file inside the package and what is wrong with it.
    pub fn open(path: &Path, limits: &Limits) -> Result<Self, PackageError> {
        Self::of(Archive::at(path, limits)?, limits)
    }

    /// Opens a zip archive in memory.
    ///
    /// # Errors
    ///
    /// As [`Package::open`].
    pub fn from_bytes(bytes: impl Into<Bytes>, limits: &Limits) -> Result<Self, PackageError> {
        Self::of(Archive::in_memory(bytes.into(), limits)?, limits)
    }

    fn of(archive: Archive, limits: &Limits) -> Result<Self, PackageError> {
        let (mut bytes, mut unpacking) = (Vec::new(), Unpacking::default());
        let most = MANIFEST_BYTES.min(limits.bytes);
        archive.read(MANIFEST, most, &mut bytes, &mut unpacking)?;
        let manifest = Manifest::parse(&bytes, limits)?;
        let base = match manifest.base {
            None => None,
            Some(BaseEntry::Model {
                diffuse,
                lobes,
                color_table,
            }) => {
                let table = color_table
                    .map(|entry| color_table_of(&archive, entry, limits))
                    .transpose()?;
                Some(PackageBase::Model {
                    diffuse,
                    lobes,
                    color_table: table.unwrap_or_else(ColorTable::white),
                })
            }
            Some(BaseEntry::Table {
                file,
                layout,
                header_bytes,
            }) => {
                let mut bytes = Vec::new();
                let most = (64 << 20) + header_bytes;
                archive.read(&file, most, &mut bytes, &mut unpacking)?;
                Some(PackageBase::Table {
                    file,
                    bytes,
                    layout,
                    header_bytes,
                })
            }
        };
        let flakes = manifest.flakes.map(|entry| FlakeSlices {
            archive,
            entry,
            limits: *limits,
        });
        if let Some(flakes) = &flakes {
            let missing = (0..flakes.slices())
                .map(|k| flakes.name(k))
                .find(|name| !flakes.archive.holds(name));
            if let Some(file) = missing {
                return Err(PackageError::Missing { file, inside: None });
            }
        }
        let (name, notes, coat) = (manifest.name, manifest.notes, manifest.coat);
        Ok(Self {
            name,
            notes,
            coat,
            base,
            flakes,
            multi_angle: manifest.multi_angle,
            warnings: manifest.warnings,
        })
    }
}

#[cfg(test)]
mod tests;
