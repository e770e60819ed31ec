//! Blobs: immutable bytes named by their BLAKE3.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use bytes::Bytes;
use futures::future::BoxFuture;
use futures::stream::BoxStream;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::StoreError;

/// What a store's method returns.
pub type Task<'a, T> = BoxFuture<'a, Result<T, StoreError>>;

/// BLAKE3 of some bytes, 64 hexadecimal digits in text.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Hash([u8; 32]);

/// A blob that was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stored {
    /// Name.
    pub hash: Hash,
    /// Bytes.
    pub length: u64,
}

/// A blob being read, a piece at a time.
pub struct BlobBytes {
    /// Bytes in all.
    pub length: u64,
    /// The pieces in order.
    pub pieces: BoxStream<'static, Result<Bytes, StoreError>>,
}

/// A blob as a file on this machine, for parsers that seek. It exists as long as this value does.
#[derive(Debug)]
pub struct LocalBlob {
    path: PathBuf,
}

/// A place for blobs.
pub trait Blobs: Send + Sync {
    /// Begins a blob. Nothing of it can be seen before [`BlobWriter::finish`]; dropping the writer forgets it.
    fn begin(&self) -> Task<'_, Box<dyn BlobWriter>>;

    /// The whole blob, for the small ones. `None` when there is none of this name.
    fn read(&self, hash: Hash) -> Task<'_, Option<Bytes>>;

    /// The blob in pieces, however large.
    fn stream(&self, hash: Hash) -> Task<'_, Option<BlobBytes>>;

    /// The blob as a local file.
    fn local(&self, hash: Hash) -> Task<'_, Option<LocalBlob>>;

    /// Forgets a blob. Forgetting what is not there is no error.
    fn remove(&self, hash: Hash) -> Task<'_, ()>;

    /// Names of all blobs, in no order.
    fn all(&self) -> Task<'_, Vec<Hash>>;

    /// Writes a small blob at once.
    fn put(&self, bytes: Bytes) -> Task<'_, Stored> {
        Box::pin(async move {
            let mut writer = self.begin().await?;
            writer.append(bytes).await?;
            writer.finish().await
        })
    }
}

/// A blob being written.
pub trait BlobWriter: Send {
    /// Adds bytes at the end.
    fn append(&mut self, bytes: Bytes) -> Task<'_, ()>;

    /// Makes the blob appear, durably, under the hash of its bytes.
    fn finish(self: Box<Self>) -> Task<'static, Stored>;
}

impl Hash {
    /// The hash of these bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// The 32 bytes.
    #[must_use]
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl From<blake3::Hash> for Hash {
    fn from(hash: blake3::Hash) -> Self {
        Self(*hash.as_bytes())
    }
}

impl From<[u8; 32]> for Hash {
    fn from(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }
}

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&blake3::Hash::from_bytes(self.0).to_hex())
    }
}

impl fmt::Debug for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Hash({self})")
    }
}

impl Serialize for Hash {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Hash {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(D::Error::custom)
    }
}

impl FromStr for Hash {
    type Err = blake3::HexError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        blake3::Hash::from_hex(text).map(Self::from)
    }
}

impl fmt::Debug for BlobBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BlobBytes")
            .field("length", &self.length)
            .finish_non_exhaustive()
    }
}

impl LocalBlob {
    pub(super) const fn new(path: PathBuf) -> Self {
        Self { path }
    }

    /// Where the file is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}
