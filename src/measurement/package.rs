//! The measured-paint package: what a lab uploads when it has more than one file.
//!
//! A zip archive or a folder; `paint.json` names the rest. Opening a package reads its manifest and the color table and
//! checks that every slice is there; pictures of flakes are decoded one at a time when somebody asks, from any number of
//! threads, so that a package of a gigabyte never stands in memory. Angles are inside the coat where there is one;
//! slices and tables are BRDF in 1/sr.

use std::path::{Path, PathBuf};

use bytes::Bytes;
use rayon::prelude::*;

use super::archive::{Archive, Unpacking};
use super::manifest::{BaseEntry, FlakesEntry, MANIFEST, Manifest, TableEntry};
pub use super::manifest::{MultiAngle, TableLayout};
use super::picture::{Picture, PictureError, PictureScratch};
use crate::color::{Lab, LinearRgb};
use crate::paint::{AngleGrid, Coat, ColorTable, ColorTableError, Limits, Lobe, MAX_LAB};

/// Largest manifest that is read.
const MANIFEST_BYTES: u64 = 16 << 20;
/// Share of a slice's pixels that may be dead.
const DEAD_SHARE: f64 = 0.05;

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

/// Pictures of flakes by angle pair, whoever took them. Slices are numbered θd fastest.
pub trait FlakePictures: Sync {
    /// Half angles of the slices.
    fn theta_h(&self) -> &AngleGrid;
    /// Difference angles of the slices.
    fn theta_d(&self) -> &AngleGrid;
    /// Side of a texel on the paint, micrometres.
    fn texel_um(&self) -> f64;
    /// Texels across and down.
    fn size(&self) -> [u32; 2];
    /// Name of a slice, for messages.
    fn name(&self, slice: usize) -> String;
    /// Takes a slice's picture, BRDF in 1/sr. Threads may ask at once, each with room of its own.
    ///
    /// # Errors
    ///
    /// [`PackageError`] when the picture is missing, damaged or of the wrong size.
    fn read(&self, slice: usize, room: &mut SliceRoom) -> Result<(), PackageError>;

    /// How many slices.
    fn slices(&self) -> usize {
        self.theta_h().len() * self.theta_d().len()
    }
}

/// Room to decode slices in, kept from one to the next.
#[derive(Default)]
pub struct SliceRoom {
    /// The slice read last.
    pub picture: Picture,
    scratch: PictureScratch,
    unpacking: Unpacking,
    bytes: Vec<u8>,
}

impl std::fmt::Debug for SliceRoom {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SliceRoom").finish_non_exhaustive()
    }
}

/// The flake pictures of a package.
#[derive(Clone, Debug)]
pub struct FlakeSlices {
    archive: Archive,
    entry: FlakesEntry,
    limits: Limits,
}

/// Why something is no measured-paint package. Names the file inside and what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackageError {
    /// The path cannot be opened.
    #[error("{} cannot be opened: {source}", path.display())]
    Open {
        /// What was to be opened.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// No zip archive, or a cut one.
    #[error("the package is no readable zip archive: {reason}")]
    Archive {
        /// What the archive reader says.
        reason: String,
    },
    /// Too many files.
    #[error("the package holds {count} files, accepted are {accepted}")]
    Entries {
        /// How many there are.
        count: usize,
        /// The limit.
        accepted: usize,
    },
    /// A file that is not there.
    #[error("{file} is not in the package")]
    Missing {
        /// Name in the package.
        file: String,
    },
    /// A file that is too large, packed or unpacked.
    #[error("{file} has {bytes} bytes or more, accepted are {accepted}")]
    Size {
        /// Name in the package.
        file: String,
        /// How many bytes.
        bytes: u64,
        /// The limit.
        accepted: u64,
    },
    /// A file that cannot be read as what it should be.
    #[error("{file} is damaged: {reason}")]
    Damaged {
        /// Name in the package.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// A field of the manifest.
    #[error("{MANIFEST}: {field} is {value}, accepted is {accepted}")]
    Field {
        /// Path of the field.
        field: String,
        /// The offending value.
        value: String,
        /// What would be accepted.
        accepted: String,
    },
    /// A package of a later format.
    #[error(
        "{MANIFEST}: version is {found}, this carpaint reads up to version {known}: update carpaint"
    )]
    Newer {
        /// Version of the package.
        found: u64,
        /// Latest version that is read.
        known: u64,
    },
    /// A picture that cannot be used.
    #[error("{file}: {source}")]
    Picture {
        /// Name in the package.
        file: String,
        /// What is wrong with it.
        source: PictureError,
    },
    /// A slice with too many dead pixels.
    #[error("{file} has {dead} pixels of {pixels} that are not finite, accepted are 5 %")]
    DeadPixels {
        /// Name in the package.
        file: String,
        /// Pixels with a channel that is not finite.
        dead: usize,
        /// Pixels in all.
        pixels: usize,
    },
    /// The color table's colors.
    #[error("{file}: {source}")]
    ColorTable {
        /// Name in the package.
        file: String,
        /// What is wrong with them.
        source: ColorTableError,
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
                return Err(PackageError::Missing { file });
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

/// Most bytes a picture's file can sensibly have: uncompressed float with a few spare channels, and a header.
fn picture_bytes(size: [u32; 2]) -> u64 {
    64 * u64::from(size[0]) * u64::from(size[1]) + (1 << 20)
}

fn color_table_of(
    archive: &Archive,
    entry: TableEntry,
    limits: &Limits,
) -> Result<ColorTable, PackageError> {
    let TableEntry {
        file,
        theta_h,
        theta_d,
    } = entry;
    let side = |grid: &AngleGrid| u32::try_from(grid.len()).unwrap_or(u32::MAX);
    let size = [side(&theta_d), side(&theta_h)];
    let mut bytes = Vec::new();
    let most = picture_bytes(size);
    archive.read(&file, most, &mut bytes, &mut Unpacking::default())?;
    let picture = Picture::read_exr(&bytes, Some(size), limits, &mut PictureScratch::default());
    let picture = picture.map_err(|source| PackageError::Picture {
        file: file.clone(),
        source,
    })?;
    let colors =
        (0..picture.pixels()).map(|k| picture.planes.each_ref().map(|plane| f64::from(plane[k])));
    let nodes: Vec<Lab> = colors.map(Lab::from_rgb).collect();
    if let Some(k) = nodes
        .iter()
        .position(|lab| lab.to_array().iter().any(|v| v.abs() > MAX_LAB))
    {
        let (row, column) = (k / theta_d.len(), k % theta_d.len());
        let reason = format!("the color at row {row}, column {column} is beyond 2000 in L, a or b");
        return Err(PackageError::Damaged { file, reason });
    }
    let overall = overall_color(&theta_h, &theta_d, &nodes);
    ColorTable::new(theta_h, theta_d, nodes, overall)
        .map_err(|source| PackageError::ColorTable { file, source })
}

/// Mean of a table in linear light, each angle with the share of the axis that is nearest to it.
fn overall_color(theta_h: &AngleGrid, theta_d: &AngleGrid, nodes: &[Lab]) -> Lab {
    let shares = |grid: &AngleGrid| -> Vec<f64> {
        let d = grid.degrees();
        let share = |k: usize| d[(k + 1).min(d.len() - 1)] - d[k.saturating_sub(1)];
        if d.len() == 1 {
            vec![1.0]
        } else {
            (0..d.len()).map(share).collect()
        }
    };
    let (rows, columns) = (shares(theta_h), shares(theta_d));
    let (mut sum, mut weight) = ([0.0; 3], 0.0);
    for (k, lab) in nodes.iter().enumerate() {
        let share = rows[k / columns.len()] * columns[k % columns.len()];
        weight += share;
        for (s, c) in sum.iter_mut().zip(lab.to_rgb()) {
            *s += share * c;
        }
    }
    Lab::from_rgb(sum.map(|s| s / weight))
}

impl FlakeSlices {
    /// Mean color of the finite texels of every slice, 1/sr, θd fastest.
    ///
    /// # Errors
    ///
    /// [`PackageError`] for the first slice that is missing, damaged or of the wrong size.
    pub fn mean_colors(&self) -> Result<Vec<LinearRgb>, PackageError> {
        (0..self.slices())
            .into_par_iter()
            .map_init(SliceRoom::default, |room, k| {
                self.read(k, room)?;
                let mut sum = [0.0; 3];
                let mut count = 0.0;
                for texel in 0..room.picture.pixels() {
                    let color = room
                        .picture
                        .planes
                        .each_ref()
                        .map(|plane| f64::from(plane[texel]));
                    if color.iter().all(|v| v.is_finite()) {
                        count += 1.0;
                        for k in 0..3 {
                            sum[k] += color[k];
                        }
                    }
                }
                Ok(sum.map(|s| s / f64::max(count, 1.0)))
            })
            .collect()
    }
}

impl FlakePictures for FlakeSlices {
    fn theta_h(&self) -> &AngleGrid {
        &self.entry.theta_h
    }

    fn theta_d(&self) -> &AngleGrid {
        &self.entry.theta_d
    }

    fn texel_um(&self) -> f64 {
        self.entry.texel_um
    }

    fn size(&self) -> [u32; 2] {
        self.entry.size
    }

    fn name(&self, slice: usize) -> String {
        self.entry.pattern.name(
            slice / self.entry.theta_d.len(),
            slice % self.entry.theta_d.len(),
        )
    }

    fn read(&self, slice: usize, room: &mut SliceRoom) -> Result<(), PackageError> {
        let file = self.name(slice);
        let most = picture_bytes(self.entry.size);
        self.archive
            .read(&file, most, &mut room.bytes, &mut room.unpacking)?;
        let decoded = room.picture.decode_exr(
            &room.bytes,
            Some(self.entry.size),
            &self.limits,
            &mut room.scratch,
        );
        let dead = match decoded {
            Ok(dead) => dead,
            Err(source) => return Err(PackageError::Picture { file, source }),
        };
        let pixels = room.picture.pixels();
        #[allow(clippy::cast_precision_loss)] // counts of pixels
        if dead as f64 > DEAD_SHARE * pixels as f64 {
            return Err(PackageError::DeadPixels { file, dead, pixels });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
