//! Results on disk: `results/ab/abcdef…` named by key; in the file the hash of the bytes, then the bytes.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::SystemTime;

use bytes::Bytes;
use tempfile::NamedTempFile;
use tokio::task::spawn_blocking;

use super::CachedResult;
use crate::store::StoreError;
use crate::store::blobs::Hash;
use crate::store::whole_file::{Durability, appear};

const HASH_BYTES: usize = 32;

/// Where results are written before they appear.
pub(super) const INCOMING: &str = "incoming";

#[derive(Debug)]
pub(super) struct ResultFolder {
    folder: PathBuf,
    limit: u64,
    held: AtomicU64,
    sweeping: tokio::sync::RwLock<()>,
}

struct Entry {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
}

impl ResultFolder {
    pub(super) fn open(folder: &Path, limit: u64) -> Result<Self, StoreError> {
        let open = || -> io::Result<u64> {
            let incoming = folder.join(INCOMING);
            if incoming.is_dir() {
                fs::remove_dir_all(&incoming)?;
            }
            fs::create_dir_all(incoming)?;
            Ok(entries(folder)?.iter().map(|entry| entry.bytes).sum())
        };
        let held = open().map_err(StoreError::io(format!(
            "opening the results in {}",
            folder.display()
        )))?;
        Ok(Self {
            folder: folder.to_owned(),
            limit,
            held: AtomicU64::new(held),
            sweeping: tokio::sync::RwLock::default(),
        })
    }

    fn place(&self, key: Hash) -> PathBuf {
        let name = key.to_string();
        self.folder.join(&name[..2]).join(name)
    }

    /// Whether there is a file of this name, whole or not.
    pub(super) async fn holds(&self, key: Hash) -> bool {
        let found = tokio::fs::try_exists(self.place(key)).await;
        found.unwrap_or_else(|error| {
            tracing::warn!(%error, %key, "a stored result does not read");
            false
        })
    }

    /// The result, if it is there and whole.
    pub(super) async fn read(&self, key: Hash) -> Option<CachedResult> {
        let place = self.place(key);
        let read = spawn_blocking(move || -> io::Result<Option<CachedResult>> {
            let mut file = File::open(&place)?;
            let mut hash = [0; HASH_BYTES];
            file.read_exact(&mut hash)?;
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes)?;
            if Hash::of(&bytes).as_bytes() != &hash {
                missing_is_gone(fs::remove_file(&place))?;
                return Ok(None);
            }
            // What was used last goes last; not every file system minds.
            let _ = file.set_modified(SystemTime::now());
            Ok(Some(CachedResult {
                bytes: Bytes::from(bytes),
                hash: hash.into(),
            }))
        });
        match read.await.ok()? {
            Ok(result) => result,
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => {
                tracing::warn!(%error, %key, "a stored result does not read");
                None
            }
        }
    }

    /// Keeps a result. What cannot be kept is computed again some day.
    pub(super) async fn write(&self, key: Hash, result: CachedResult) {
        let length = (result.bytes.len() + HASH_BYTES) as u64;
        if length > self.limit / 4 {
            return;
        }
        let (folder, place) = (self.folder.join(INCOMING), self.place(key));
        let writing = self.sweeping.read().await;
        let written = spawn_blocking(move || -> io::Result<()> {
            let mut file = NamedTempFile::new_in(folder)?;
            file.write_all(result.hash.as_bytes())?;
            file.write_all(&result.bytes)?;
            appear(file, &place, Durability::Cached)
        });
        match written.await {
            Ok(Ok(())) => {
                let held = self.held.fetch_add(length, Ordering::Relaxed) + length;
                drop(writing);
                if held > self.limit {
                    self.sweep().await;
                }
            }
            Ok(Err(error)) => tracing::warn!(%error, %key, "a result was not kept"),
            Err(_) => {}
        }
    }

    /// Drops what was not used for longest, until a tenth of the space is free.
    async fn sweep(&self) {
        // Alone: what is written while the folder is read would be neither found nor counted.
        let _alone = self.sweeping.write().await;
        if self.held.load(Ordering::Relaxed) <= self.limit {
            return;
        }
        let (folder, goal) = (self.folder.clone(), self.limit / 10 * 9);
        let swept = spawn_blocking(move || -> io::Result<u64> {
            let mut entries = entries(&folder)?;
            entries.sort_by_key(|entry| entry.used);
            let mut held: u64 = entries.iter().map(|entry| entry.bytes).sum();
            for entry in entries {
                if held <= goal {
                    break;
                }
                missing_is_gone(fs::remove_file(entry.path))?;
                held -= entry.bytes;
            }
            Ok(held)
        });
        match swept.await {
            Ok(Ok(held)) => self.held.store(held, Ordering::Relaxed),
            Ok(Err(error)) => tracing::warn!(%error, "results were not swept"),
            Err(_) => {}
        }
    }
}

/// A file that somebody else removed is gone as well.
fn missing_is_gone(removed: io::Result<()>) -> io::Result<()> {
    match removed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// All results in the folder, none of those being written.
fn entries(folder: &Path) -> io::Result<Vec<Entry>> {
    let mut all = Vec::new();
    for item in fs::read_dir(folder)? {
        let item = item?;
        if item.file_name() == INCOMING {
            continue;
        }
        if item.file_type()?.is_dir() {
            all.extend(entries(&item.path())?);
        } else if let Ok(metadata) = item.metadata() {
            let used = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
            all.push(Entry {
                path: item.path(),
                bytes: metadata.len(),
                used,
            });
        }
    }
    Ok(all)
}
