//! Writing answers: a file appears whole or not at all, and stdout carries at most one JSON object.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::workshop::WorkshopError;

/// Replaces a file atomically: a temporary file beside it, synced, then renamed over it.
///
/// What is no regular file, a pipe or a device, is written to and stays what it is. A link stays a link, and the file
/// it leads to is replaced. A replaced file keeps its mode, a new one has what the umask leaves.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), WorkshopError> {
    write(path, bytes).map_err(|error| {
        let folder = folder_of(path);
        let problem = if folder.is_dir() {
            format!("cannot be written: {error}")
        } else {
            format!("cannot be written: there is no folder {}", folder.display())
        };
        WorkshopError::output(path.display(), problem)
    })
}

/// Endings of what this program writes.
const ENDINGS: [&str; 7] = ["paint", "blend", "zip", "glb", "json", "png", "exr"];

/// Refuses a name that promises another format than the one that will be written.
pub fn check_ending(path: &Path, own: &str) -> Result<(), WorkshopError> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending {
        Some(ending) if ending != own && ENDINGS.contains(&&*ending) => {
            let problem = format!("{} ends in .{ending}, accepted is .{own}", path.display());
            Err(WorkshopError::usage("--out", problem))
        }
        _ => Ok(()),
    }
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let (place, old) = match fs::metadata(path) {
        Ok(old) if !old.is_file() => {
            return OpenOptions::new().write(true).open(path)?.write_all(bytes);
        }
        Ok(old) => (fs::canonicalize(path)?, Some(old)),
        // A link that leads nowhere yet: the file appears where it leads.
        Err(error) if error.kind() == ErrorKind::NotFound && path.is_symlink() => {
            let target = fs::read_link(path)?;
            (folder_of(path).join(target), None)
        }
        Err(error) if error.kind() == ErrorKind::NotFound => (path.to_owned(), None),
        Err(error) => return Err(error),
    };
    let folder = folder_of(&place);
    let mut file = temporary(&folder)?;
    file.write_all(bytes)?;
    if let Some(old) = old {
        file.as_file().set_permissions(old.permissions())?;
    }
    file.as_file().sync_all()?;
    file.persist(&place).map_err(|error| error.error)?;
    sync_folder(&folder)
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .map_or_else(|| PathBuf::from("."), Path::to_owned)
}

/// A temporary file that is as readable as any new file.
fn temporary(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".carpaint-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // The system takes away what the umask says.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// Makes the new name durable, where folders can be synced.
fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) {
        match File::open(folder)?.sync_all() {
            // Not every file system has something to sync.
            Err(error) if error.kind() == ErrorKind::InvalidInput => {}
            synced => return synced,
        }
    }
    Ok(())
}

/// Prints the one JSON object of `--json`.
pub fn print_json(value: &impl Serialize) -> Result<(), WorkshopError> {
    let mut line = serde_json::to_string(value).map_err(WorkshopError::internal)?;
    line.push('\n');
    print(&line)
}

/// Prints to stdout. A reader who has heard enough is no error.
pub fn print(text: &str) -> Result<(), WorkshopError> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(WorkshopError::output("standard output", error))
        }
        _ => Ok(()),
    }
}
