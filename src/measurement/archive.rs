//! The files of a package, by name: a zip archive or a folder.
//!
//! Any number of threads may read at once. Nothing but the archive's directory is kept; a file is read when it is asked
//! for, and never more of it than the caller accepts, whatever the archive says about its size. Names come from the
//! package itself and are not trusted: neither they nor links leave the folder.

mod directory;

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use zip::read::{ZipArchiveMetadata, ZipReadOptions};
use zip::{CompressionMethod, ZipArchive};

use directory::Directory;

use super::package::PackageError;
use crate::paint::Limits;

/// What every workbook of a spreadsheet program holds, which is an archive too.
pub(super) const WORKBOOK: &str = "[Content_Types].xml";

/// Where the bytes of an archive are.
#[derive(Clone, Debug)]
pub(super) enum Source {
    File(Arc<File>),
    Memory(Bytes),
}

/// The files of a package.
#[derive(Clone, Debug)]
pub(super) enum Archive {
    Zip {
        source: Source,
        directory: Arc<ZipArchiveMetadata>,
        index: Arc<std::collections::HashMap<String, usize>>,
    },
    Folder(PathBuf),
}

/// Room to unpack files in, kept from one to the next.
pub(super) struct Unpacking {
    inflater: libdeflater::Decompressor,
    packed: Vec<u8>,
}

impl Default for Unpacking {
    fn default() -> Self {
        Self {
            inflater: libdeflater::Decompressor::new(),
            packed: Vec::new(),
        }
    }
}

/// Bytes that an archive's directory and the search for it may take, beside those for each file.
const DIRECTORY: u64 = 1 << 20;
/// Bytes of its directory that a file may take: 46, its name and what else is told of it.
const DIRECTORY_ENTRY: u64 = 512;

/// A reading position of its own in a shared source.
struct Cursor {
    source: Source,
    position: u64,
    length: u64,
    /// Bytes that may still be read.
    left: u64,
}

impl Cursor {
    fn new(source: Source) -> io::Result<Self> {
        let length = match &source {
            Source::File(file) => file.metadata()?.len(),
            Source::Memory(bytes) => bytes.len() as u64,
        };
        Ok(Self {
            source,
            position: 0,
            length,
            left: u64::MAX,
        })
    }
}

impl Source {
    /// Replaces `into` by so many bytes from here on; they are there.
    fn copy(&self, start: u64, count: usize, into: &mut Vec<u8>) -> io::Result<()> {
        into.resize(count, 0);
        let mut cursor = Cursor {
            source: self.clone(),
            position: start,
            length: start + count as u64,
            left: u64::MAX,
        };
        cursor.read_exact(into)
    }
}

#[cfg(unix)]
fn read_at(file: &File, into: &mut [u8], offset: u64) -> io::Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, into, offset)
}

#[cfg(windows)]
fn read_at(file: &File, into: &mut [u8], offset: u64) -> io::Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, into, offset)
}

impl Read for Cursor {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            return Err(io::Error::other("its directory is longer than is accepted"));
        }
        let most = usize::try_from(self.left).unwrap_or(usize::MAX);
        let room = into.len().min(most);
        let into = &mut into[..room];
        let count = match &self.source {
            Source::File(file) => read_at(file, into, self.position)?,
            Source::Memory(bytes) => {
                let start = usize::try_from(self.position)
                    .unwrap_or(usize::MAX)
                    .min(bytes.len());
                (&bytes[start..]).read(into)?
            }
        };
        self.position += count as u64;
        self.left -= count as u64;
        Ok(count)
    }
}

impl Seek for Cursor {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = match to {
            SeekFrom::Start(offset) => Some(offset),
            SeekFrom::End(offset) => self.length.checked_add_signed(offset),
            SeekFrom::Current(offset) => self.position.checked_add_signed(offset),
        };
        self.position = position.ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
        Ok(self.position)
    }
}

impl Archive {
    /// A zip archive in memory.
    pub(super) fn in_memory(bytes: Bytes, limits: &Limits) -> Result<Self, PackageError> {
        Self::zip(Source::Memory(bytes), limits)
    }

    /// A zip archive or a folder on disk.
    pub(super) fn at(path: &Path, limits: &Limits) -> Result<Self, PackageError> {
        let open = |source| PackageError::Open {
            path: path.to_owned(),
            source,
        };
        if path.metadata().map_err(open)?.is_dir() {
            return Ok(Self::Folder(path.to_owned()));
        }
        Self::zip(
            Source::File(Arc::new(File::open(path).map_err(open)?)),
            limits,
        )
    }

    fn zip(source: Source, limits: &Limits) -> Result<Self, PackageError> {
        let archive = |error: &dyn std::fmt::Display| PackageError::Archive {
            reason: error.to_string(),
        };
        let mut cursor = Cursor::new(source.clone()).map_err(|e| archive(&e))?;
        let length = cursor.length;
        let headless = |error: &dyn std::fmt::Display| PackageError::Archive {
            reason: format!(
                "{error}; an archive's directory is its end, and {length} bytes are here, perhaps not all of them"
            ),
        };
        if cursor.length > limits.bytes {
            return Err(PackageError::Size {
                file: "the package".into(),
                bytes: cursor.length,
                accepted: limits.bytes,
            });
        }
        // A directory of millions would be held in memory before it could be counted. Where it stands is what the archive
        // says, in more than one place: wherever it is found, no more of it is read than the files that are accepted need.
        let announced = Directory::announced(&mut cursor, length).map_err(|e| headless(&e))?;
        if announced.entries > limits.entries as u64 {
            return Err(PackageError::Entries {
                count: usize::try_from(announced.entries).unwrap_or(usize::MAX),
                accepted: limits.entries,
            });
        }
        cursor.left = DIRECTORY + DIRECTORY_ENTRY * limits.entries as u64;
        let directory = ZipArchive::new(cursor)
            .map_err(|e| headless(&e))?
            .metadata();
        if directory.len() > limits.entries {
            return Err(PackageError::Entries {
                count: directory.len(),
                accepted: limits.entries,
            });
        }
        if directory.has_duplicate_names() {
            let mut cursor = Cursor::new(source).map_err(|e| archive(&e))?;
            let name = announced.repeated(&mut cursor).map_err(|e| archive(&e))?;
            return Err(PackageError::Archive {
                reason: format!(
                    "it holds two files of one name, {}",
                    name.as_deref().unwrap_or("which its directory hides")
                ),
            });
        }
        let mut index = std::collections::HashMap::with_capacity(directory.len());
        for k in 0..directory.len() {
            let entry = directory.entry(k).map_err(|e| archive(&e))?;
            index.insert(String::from_utf8_lossy(entry.name_raw()).into_owned(), k);
        }
        Ok(Self::Zip {
            source,
            directory,
            index: Arc::new(index),
        })
    }

    /// Whether there is a file of this name.
    pub(super) fn holds(&self, name: &str) -> bool {
        match self {
            Self::Zip { index, .. } => index.contains_key(name),
            Self::Folder(folder) => within(folder, name).is_some_and(|path| path.is_file()),
        }
    }

    /// The first file of this name that stands inside a folder of the archive.
    fn instead_of(&self, name: &str) -> Option<String> {
        let Self::Zip { index, .. } = self else {
            return None;
        };
        let within = |path: &&String| path.strip_suffix(name).is_some_and(|p| p.ends_with('/'));
        let in_other_case = |path: &&String| path.eq_ignore_ascii_case(name);
        let found = index.keys().filter(within).min();
        let found = found.or_else(|| index.keys().filter(in_other_case).min());
        let found = found.or_else(|| index.get_key_value(WORKBOOK).map(|(path, _)| path));
        found.cloned()
    }

    /// Replaces `into` by the file of this name, at most `most` bytes of it.
    pub(super) fn read(
        &self,
        name: &str,
        most: u64,
        into: &mut Vec<u8>,
        room: &mut Unpacking,
    ) -> Result<(), PackageError> {
        into.clear();
        let damaged = |reason: String| PackageError::Damaged {
            file: name.to_owned(),
            reason,
        };
        let too_large = |bytes| PackageError::Size {
            file: name.to_owned(),
            bytes,
            accepted: most,
        };
        let missing = || PackageError::Missing {
            file: name.to_owned(),
            inside: self.instead_of(name),
        };
        match self {
            Self::Zip {
                source,
                directory,
                index,
            } => {
                let entry = index.get(name).ok_or_else(missing)?;
                let entry = directory
                    .entry(*entry)
                    .map_err(|e| damaged(e.to_string()))?;
                if entry.size() > most {
                    return Err(too_large(entry.size()));
                }
                let method = entry.compression();
                if entry.encrypted()
                    || !matches!(
                        method,
                        CompressionMethod::Stored | CompressionMethod::Deflated
                    )
                {
                    return Err(damaged(format!(
                        "packed by {method:?}, accepted is stored or deflated, unencrypted"
                    )));
                }
                let size = usize::try_from(entry.size()).map_err(|_| too_large(entry.size()))?;
                let (packed, checksum) = (entry.compressed_size(), entry.crc32());
                let mut cursor = Cursor::new(source.clone()).map_err(|e| damaged(e.to_string()))?;
                let length = cursor.length;
                let found = entry.with_reader(&mut cursor, ZipReadOptions::new());
                let found = found.map_err(|e| damaged(e.to_string()))?;
                let start = found.data_start();
                // The directory's sizes are claims: no memory for more than is there or can be packed in it.
                let within = start.filter(|start| {
                    start
                        .checked_add(packed)
                        .is_some_and(|end| end <= length && can_hold(packed, size as u64))
                });
                let (Some(start), Ok(packed)) = (within, usize::try_from(packed)) else {
                    return Err(damaged("it is cut short".into()));
                };
                if method == CompressionMethod::Stored {
                    if packed != size {
                        return Err(damaged(
                            "it is stored in another length than its own".into(),
                        ));
                    }
                    source.copy(start, size, into)
                } else {
                    source.copy(start, packed, &mut room.packed)
                }
                .map_err(|e| damaged(e.to_string()))?;
                if method == CompressionMethod::Deflated {
                    into.resize(size, 0);
                    let inflated = room.inflater.deflate_decompress(&room.packed, into);
                    match inflated {
                        Ok(length) if length == size => {}
                        Ok(_) => {
                            return Err(damaged(
                                "it inflates to another length than its own".into(),
                            ));
                        }
                        Err(error) => return Err(damaged(format!("it does not inflate: {error}"))),
                    }
                }
                if libdeflater::crc32(into) != checksum {
                    return Err(damaged("its checksum is wrong".into()));
                }
            }
            Self::Folder(folder) => {
                let path = within(folder, name).ok_or_else(missing)?;
                let file = open_within(folder, &path).map_err(|e| match e.kind() {
                    io::ErrorKind::NotFound => missing(),
                    _ => damaged(e.to_string()),
                })?;
                file.take(most + 1)
                    .read_to_end(into)
                    .map_err(|e| damaged(e.to_string()))?;
            }
        }
        if into.len() as u64 > most {
            return Err(too_large(into.len() as u64));
        }
        Ok(())
    }
}

/// Whether packed bytes can become so many: nothing packs denser than deflate's 1032:1.
pub(super) const fn can_hold(packed: u64, bytes: u64) -> bool {
    bytes / 1032 <= packed
}

/// Opens a file that is in the folder when its links are followed, and that does not wait for a writer as a pipe does.
fn open_within(folder: &Path, path: &Path) -> io::Result<File> {
    let real = path.canonicalize()?;
    if !real.starts_with(folder.canonicalize()?) {
        return Err(io::Error::other("it is a link that leaves the folder"));
    }
    if !real.metadata()?.is_file() {
        return Err(io::Error::other("it is no regular file"));
    }
    File::open(real)
}

/// Path of a name inside a folder; `None` for a name that would leave it.
fn within(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = Path::new(name);
    let inside = name
        .components()
        .all(|part| matches!(part, Component::Normal(_)));
    (inside && name.components().next().is_some()).then(|| folder.join(name))
}

#[cfg(test)]
mod tests;
