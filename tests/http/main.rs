//! The service end to end, over real connections on a port of its own.

// A test tells one story from its begin to its end.
#![allow(clippy::too_many_lines)]

mod bundle;
mod caching;
mod client;
mod crowds;
mod environments;
mod fields;
mod house;
mod interface;
mod jobs;
mod kill;
mod lit;
mod nearest;
mod origins;
mod paints;
mod previews;
mod problems;
mod profiles;
mod readings;
mod real;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("temporary folder")
}

/// Files under a folder.
fn walk(folder: &std::path::Path) -> usize {
    let entries = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").path());
    entries
        .map(|path| if path.is_dir() { walk(&path) } else { 1 })
        .sum()
}
