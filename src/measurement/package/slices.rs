//! Pictures of flakes, decoded one at a time when somebody asks.

use rayon::prelude::*;

use super::PackageError;
use crate::color::LinearRgb;
use crate::measurement::archive::{Archive, Unpacking};
use crate::measurement::manifest::FlakesEntry;
use crate::measurement::picture::{Picture, PictureScratch};
use crate::paint::{AngleGrid, Limits};

/// Share of a slice's pixels that may be dead.
const DEAD_SHARE: f64 = 0.05;

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
    pub(super) archive: Archive,
    pub(super) entry: FlakesEntry,
    pub(super) limits: Limits,
}

/// Most bytes a picture's file can sensibly have: uncompressed float with a few spare channels, and a header.
pub(super) fn picture_bytes(size: [u32; 2]) -> u64 {
    64 * u64::from(size[0]) * u64::from(size[1]) + (1 << 20)
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
