//! The hash of what was handed in, file or folder.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::WorkshopError;
use crate::paint::Limits;

/// BLAKE3 of a file's bytes; of a folder, of the names, lengths and bytes of its files, sorted by name.
///
/// # Errors
///
/// [`WorkshopError`] for what cannot be read, or a folder with more files than `limits.entries`.
pub(super) fn content_hash(path: &Path, limits: &Limits) -> Result<blake3::Hash, WorkshopError> {
    let fail = |path: &Path, e: std::io::Error| {
        WorkshopError::input(path.display(), format!("cannot be read: {e}"))
    };
    let mut hasher = blake3::Hasher::new();
    if !path.is_dir() {
        let read = File::open(path).and_then(|file| hasher.update_reader(file).map(|_| ()));
        return read.map(|()| hasher.finalize()).map_err(|e| fail(path, e));
    }
    let (mut folders, mut files) = (vec![PathBuf::new()], Vec::new());
    while let Some(folder) = folders.pop() {
        let full = path.join(&folder);
        for entry in fs::read_dir(&full).map_err(|e| fail(&full, e))? {
            let entry = entry.map_err(|e| fail(&full, e))?;
            let name = folder.join(entry.file_name());
            // Links to folders are not followed: they may go round.
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                folders.push(name);
            } else if path.join(&name).is_file() {
                files.push(name);
            }
        }
        if files.len() + folders.len() > limits.entries {
            let problem = format!("more than {} files, accepted are so many", limits.entries);
            return Err(WorkshopError::input(path.display(), problem));
        }
    }
    files.sort();
    for name in files {
        let (full, text) = (path.join(&name), name.to_string_lossy().replace('\\', "/"));
        let mut of_file = blake3::Hasher::new();
        File::open(&full)
            .and_then(|file| of_file.update_reader(file).map(|_| ()))
            .map_err(|e| fail(&full, e))?;
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
        hasher.update(&of_file.count().to_le_bytes());
        hasher.update(of_file.finalize().as_bytes());
    }
    Ok(hasher.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_its_files_whatever_it_is_called() {
        let limits = Limits::default();
        let write = |files: &[(&str, &str)]| {
            let folder = tempfile::tempdir().expect("a folder");
            for (name, text) in files {
                let path = folder.path().join(name);
                fs::create_dir_all(path.parent().expect("a parent")).expect("made");
                fs::write(path, text).expect("written");
            }
            content_hash(folder.path(), &limits).expect("a hash")
        };
        let one = write(&[("paint.json", "{}"), ("flakes/00.exr", "x")]);
        assert_eq!(one, write(&[("flakes/00.exr", "x"), ("paint.json", "{}")]));
        assert_ne!(one, write(&[("flakes/01.exr", "x"), ("paint.json", "{}")]));
        assert_ne!(one, write(&[("flakes/00.exr", "y"), ("paint.json", "{}")]));
    }

    #[test]
    fn a_file_is_its_bytes() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        fs::write(file.path(), b"package").expect("written");
        let hash = content_hash(file.path(), &Limits::default()).expect("a hash");
        assert_eq!(hash, blake3::hash(b"package"));
    }
}
