//! Writing answers: a file appears whole or not at all, and stdout carries at most one JSON object.

use std::io::Write as _;
use std::path::Path;

use serde::Serialize;

use crate::workshop::WorkshopError;

/// Replaces a file atomically: a temporary file beside it, synced, then renamed over it.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), WorkshopError> {
    let fail = |e: std::io::Error| {
        WorkshopError::output(path.display(), format!("cannot be written: {e}"))
    };
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or_else(|| Path::new("."));
    let mut file = tempfile::Builder::new()
        .prefix(".carpaint-")
        .tempfile_in(folder)
        .map_err(fail)?;
    file.write_all(bytes).map_err(fail)?;
    file.as_file().sync_all().map_err(fail)?;
    open_to_others(file.path()).map_err(fail)?;
    file.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

/// Temporary files are private; a result is as readable as any new file.
#[cfg(unix)]
fn open_to_others(path: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn open_to_others(_: &Path) -> std::io::Result<()> {
    Ok(())
}

/// Prints the one JSON object of `--json`.
pub fn print_json(value: &impl Serialize) -> Result<(), WorkshopError> {
    let mut line = serde_json::to_vec(value).map_err(WorkshopError::internal)?;
    line.push(b'\n');
    let fail = |e: std::io::Error| WorkshopError::output("standard output", e);
    let mut out = std::io::stdout().lock();
    out.write_all(&line)
        .and_then(|()| out.flush())
        .map_err(fail)
}
