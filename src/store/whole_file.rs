//! Files that appear whole or not at all: written beside their place, renamed into it.
//!
//! With [`Durability::Synced`] a file that was acknowledged survives a power cut: its bytes are synced before the
//! rename and its folder after it. Without, it survives the end of the process only; a reader must be able to tell a
//! torn file from a good one.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use tempfile::NamedTempFile;

/// What a finished file survives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Durability {
    /// A power cut.
    Synced,
    /// The end of the process.
    Cached,
}

/// Moves a finished temporary file to its place. The folder of `place` is made where it is missing.
pub(super) fn appear(file: NamedTempFile, place: &Path, durability: Durability) -> io::Result<()> {
    let folder = place
        .parent()
        .ok_or_else(|| io::Error::other("a file needs a folder"))?;
    if durability == Durability::Synced {
        file.as_file().sync_all()?;
    }
    if !folder.is_dir() {
        fs::create_dir_all(folder)?;
        if durability == Durability::Synced
            && let Some(above) = folder.parent()
        {
            sync_folder(above)?;
        }
    }
    file.persist(place).map_err(|error| error.error)?;
    if durability == Durability::Synced {
        sync_folder(folder)?;
    }
    Ok(())
}

/// Makes the names in a folder durable.
pub(super) fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}
