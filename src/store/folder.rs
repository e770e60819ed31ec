//! Blobs in a folder: `blobs/ab/abcdef…`, written first under `incoming/`.
//!
//! What a crash leaves in `incoming/` was never acknowledged and is swept at the next start.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use bytes::Bytes;
use futures::StreamExt;
use tempfile::{NamedTempFile, TempPath};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::task::spawn_blocking;

use super::StoreError;
use super::blobs::{BlobBytes, BlobWriter, Blobs, Hash, LocalBlob, Stored, Task};
use super::whole_file::{Durability, appear, sync_folder};

/// Bytes gathered before they go to the file, and read at a time.
const PIECE: usize = 512 << 10;

/// A folder of blobs.
#[derive(Debug)]
pub struct FolderBlobs {
    blobs: PathBuf,
    incoming: PathBuf,
}

struct FolderWriter {
    file: tokio::fs::File,
    path: TempPath,
    blobs: PathBuf,
    hasher: blake3::Hasher,
    length: u64,
    gathered: Vec<u8>,
}

impl FolderBlobs {
    /// Opens the blobs under `root`, which is made where it is missing.
    ///
    /// # Errors
    ///
    /// [`StoreError::Io`] when the folders cannot be made or swept.
    pub fn open(root: &Path) -> Result<Self, StoreError> {
        let (blobs, incoming) = (root.join("blobs"), root.join("incoming"));
        let make = || -> io::Result<()> {
            fs::create_dir_all(&blobs)?;
            if incoming.is_dir() {
                fs::remove_dir_all(&incoming)?;
            }
            fs::create_dir_all(&incoming)?;
            // All folders there will ever be, so that no blob waits for the name of its folder to be durable.
            for first in 0..=u8::MAX {
                fs::create_dir_all(blobs.join(format!("{first:02x}")))?;
            }
            sync_folder(&blobs)?;
            sync_folder(root)
        };
        make().map_err(StoreError::io(format!(
            "opening the blobs in {}",
            root.display()
        )))?;
        Ok(Self { blobs, incoming })
    }

    fn place(&self, hash: Hash) -> PathBuf {
        place(&self.blobs, hash)
    }
}

fn place(blobs: &Path, hash: Hash) -> PathBuf {
    let name = hash.to_string();
    blobs.join(&name[..2]).join(name)
}

/// Names in the folders of `blobs`. Files of other names are not ours.
fn names(blobs: &Path) -> io::Result<Vec<Hash>> {
    let mut names = Vec::new();
    for folder in fs::read_dir(blobs)? {
        let folder = folder?;
        if folder.file_type()?.is_dir() {
            for file in fs::read_dir(folder.path())? {
                names.extend(
                    file?
                        .file_name()
                        .to_str()
                        .and_then(|name| name.parse::<Hash>().ok()),
                );
            }
        }
    }
    Ok(names)
}

/// `None` instead of "not found".
fn found<T>(result: io::Result<T>, hash: Hash) -> Result<Option<T>, StoreError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(StoreError::io(format!("reading blob {hash}"))(error)),
    }
}

/// Runs file work off the async threads. A panic there is a panic here.
async fn off_thread<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    match spawn_blocking(work).await {
        Ok(value) => value,
        Err(error) if error.is_panic() => std::panic::resume_unwind(error.into_panic()),
        // The runtime is going down: nobody is left to wait.
        Err(_) => std::future::pending().await,
    }
}

impl Blobs for FolderBlobs {
    fn begin(&self) -> Task<'_, Box<dyn BlobWriter>> {
        let (incoming, blobs) = (self.incoming.clone(), self.blobs.clone());
        Box::pin(async move {
            let file = off_thread(move || NamedTempFile::new_in(incoming))
                .await
                .map_err(StoreError::io("beginning a blob"))?;
            let (file, path) = file.into_parts();
            let (file, hasher) = (tokio::fs::File::from_std(file), blake3::Hasher::new());
            let writer = FolderWriter {
                file,
                path,
                blobs,
                hasher,
                length: 0,
                gathered: Vec::new(),
            };
            Ok(Box::new(writer) as Box<dyn BlobWriter>)
        })
    }

    fn read(&self, hash: Hash) -> Task<'_, Option<Bytes>> {
        let path = self.place(hash);
        Box::pin(async move {
            Ok(found(off_thread(move || fs::read(path)).await, hash)?.map(Bytes::from))
        })
    }

    fn stream(&self, hash: Hash) -> Task<'_, Option<BlobBytes>> {
        let path = self.place(hash);
        Box::pin(async move {
            let Some(file) = found(tokio::fs::File::open(path).await, hash)? else {
                return Ok(None);
            };
            let Some(metadata) = found(file.metadata().await, hash)? else {
                return Ok(None);
            };
            let pieces = futures::stream::try_unfold(file, move |mut file| async move {
                let mut piece = Vec::with_capacity(PIECE);
                (&mut file)
                    .take(PIECE as u64)
                    .read_to_end(&mut piece)
                    .await
                    .map_err(StoreError::io(format!("reading blob {hash}")))?;
                Ok((!piece.is_empty()).then(|| (Bytes::from(piece), file)))
            });
            Ok(Some(BlobBytes {
                length: metadata.len(),
                pieces: pieces.boxed(),
            }))
        })
    }

    fn local(&self, hash: Hash) -> Task<'_, Option<LocalBlob>> {
        let path = self.place(hash);
        Box::pin(async move {
            let here = tokio::fs::metadata(&path)
                .await
                .map(|_| LocalBlob::new(path));
            found(here, hash)
        })
    }

    fn remove(&self, hash: Hash) -> Task<'_, ()> {
        let path = self.place(hash);
        Box::pin(async move { found(tokio::fs::remove_file(path).await, hash).map(|_| ()) })
    }

    fn all(&self) -> Task<'_, Vec<Hash>> {
        let blobs = self.blobs.clone();
        Box::pin(async move {
            off_thread(move || names(&blobs))
                .await
                .map_err(StoreError::io("listing the blobs"))
        })
    }
}

impl FolderWriter {
    async fn spill(&mut self) -> io::Result<()> {
        self.file.write_all(&self.gathered).await?;
        self.gathered.clear();
        Ok(())
    }
}

impl BlobWriter for FolderWriter {
    fn append(&mut self, bytes: Bytes) -> Task<'_, ()> {
        Box::pin(async move {
            self.hasher.update(&bytes);
            self.length += bytes.len() as u64;
            self.gathered.extend_from_slice(&bytes);
            if self.gathered.len() < PIECE {
                return Ok(());
            }
            self.spill().await.map_err(StoreError::io("writing a blob"))
        })
    }

    fn finish(mut self: Box<Self>) -> Task<'static, Stored> {
        Box::pin(async move {
            let stored = Stored {
                hash: self.hasher.finalize().into(),
                length: self.length,
            };
            let place = place(&self.blobs, stored.hash);
            self.spill()
                .await
                .map_err(StoreError::io("writing a blob"))?;
            self.file
                .flush()
                .await
                .map_err(StoreError::io("writing a blob"))?;
            let file = NamedTempFile::from_parts(self.file.into_std().await, self.path);
            off_thread(move || {
                if place.exists() {
                    // Whoever wrote it may not have come to this yet.
                    place.parent().map_or(Ok(()), sync_folder)
                } else {
                    appear(file, &place, Durability::Synced)
                }
            })
            .await
            .map_err(StoreError::io(format!("storing blob {}", stored.hash)))?;
            Ok(stored)
        })
    }
}
