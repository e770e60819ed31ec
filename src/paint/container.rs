//! The container of `.paint` and `.blend` files: versioned, self-contained, checked as a whole.
//!
//! ```text
//! "carpaint" · kind, 8 bytes · version u32 · header length u64 · header (JSON) · body length u64 · body · BLAKE3 of all before
//! ```
//!
//! Little-endian. The body is arrays, each `count u64` and its elements, read in the order they were written. A cut or
//! scrambled file is refused before anything of it is believed.

use bytemuck::{Pod, Zeroable};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::finite::{self, NotFinite};

const MAGIC: &[u8; 8] = b"carpaint";
const CHECKSUM: usize = 32;

/// Why bytes are no such file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ContainerError {
    /// Another kind of file, or none of ours.
    #[error("not a .{0} file: it does not begin as one")]
    Kind(&'static str),
    /// Written by a later carpaint.
    #[error(
        "this .{kind} file is version {found}, this carpaint reads up to version {known}: update carpaint"
    )]
    Newer {
        /// `paint` or `blend`.
        kind: &'static str,
        /// Version of the file.
        found: u32,
        /// Latest version that is read.
        known: u32,
    },
    /// Cut or changed.
    #[error("the .{0} file is damaged: its checksum does not match its contents")]
    Damaged(&'static str),
    /// The JSON header does not hold what it should.
    #[error("the header of the .{kind} file: {source}")]
    Header {
        /// `paint` or `blend`.
        kind: &'static str,
        /// What the JSON reader says.
        source: serde_json::Error,
    },
    /// More bytes than the arrays have.
    #[error("the .{kind} file has {bytes} bytes after its last array")]
    Trailing {
        /// `paint` or `blend`.
        kind: &'static str,
        /// How many.
        bytes: usize,
    },
    /// An array is shorter than its count.
    #[error("array {index} of the .{kind} file is cut short")]
    Array {
        /// `paint` or `blend`.
        kind: &'static str,
        /// Position among the arrays.
        index: usize,
    },
}

/// A checked container.
#[derive(Debug)]
pub struct Container<'a> {
    kind: &'static str,
    header: &'a [u8],
    body: &'a [u8],
}

/// Collects the arrays of a body.
#[derive(Debug, Default)]
pub struct Writer {
    body: Vec<u8>,
}

/// Hands the arrays of a body out again.
#[derive(Debug)]
pub struct Reader<'a> {
    kind: &'static str,
    rest: &'a [u8],
    index: usize,
}

/// Where the arrays of a body go: into a file, or into the hash of what a file would hold.
pub(super) trait Arrays {
    /// Takes bytes in.
    fn take(&mut self, bytes: &[u8]);

    /// Takes an array in.
    fn array<T: Pod>(&mut self, values: &[T]) {
        self.take(&(values.len() as u64).to_le_bytes());
        self.take(bytemuck::cast_slice(values));
    }
}

impl Arrays for Writer {
    fn take(&mut self, bytes: &[u8]) {
        self.body.extend_from_slice(bytes);
    }
}

impl Arrays for blake3::Hasher {
    fn take(&mut self, bytes: &[u8]) {
        self.update(bytes);
    }
}

impl Writer {
    /// Appends an array.
    pub fn array<T: Pod>(&mut self, values: &[T]) {
        Arrays::array(self, values);
    }

    /// The whole file.
    ///
    /// # Errors
    ///
    /// [`NotFinite`] when a number in the header is none.
    ///
    /// # Panics
    ///
    /// When the header does not serialise, which a plain struct always does.
    pub fn finish(
        self,
        kind: &'static str,
        version: u32,
        header: &impl Serialize,
    ) -> Result<Vec<u8>, NotFinite> {
        finite::check(header)?;
        let header = serde_json::to_vec(header).expect("plain data serialises");
        let mut file = Vec::with_capacity(self.body.len() + header.len() + 128);
        file.extend_from_slice(MAGIC);
        file.extend_from_slice(&padded(kind));
        file.extend_from_slice(&version.to_le_bytes());
        file.extend_from_slice(&(header.len() as u64).to_le_bytes());
        file.extend_from_slice(&header);
        file.extend_from_slice(&(self.body.len() as u64).to_le_bytes());
        file.extend_from_slice(&self.body);
        let checksum = blake3::hash(&file);
        file.extend_from_slice(checksum.as_bytes());
        Ok(file)
    }
}

fn padded(kind: &str) -> [u8; 8] {
    let mut out = [0; 8];
    out[..kind.len()].copy_from_slice(kind.as_bytes());
    out
}

impl<'a> Container<'a> {
    /// Whether bytes begin like a container of this kind.
    #[must_use]
    pub fn is(bytes: &[u8], kind: &str) -> bool {
        bytes.starts_with(MAGIC) && bytes.get(8..16) == Some(&padded(kind))
    }

    /// Checks a file as a whole.
    ///
    /// # Errors
    ///
    /// [`ContainerError`] for another kind of file, a newer version, or a damaged one.
    pub fn open(bytes: &'a [u8], kind: &'static str, known: u32) -> Result<Self, ContainerError> {
        if !Self::is(bytes, kind) {
            return Err(ContainerError::Kind(kind));
        }
        let damaged = || ContainerError::Damaged(kind);
        let (version, rest) = bytes[16..].split_first_chunk::<4>().ok_or_else(damaged)?;
        let found = u32::from_le_bytes(*version);
        if found > known {
            return Err(ContainerError::Newer { kind, found, known });
        }
        let content = bytes.len().checked_sub(CHECKSUM).ok_or_else(damaged)?;
        if blake3::hash(&bytes[..content]).as_bytes()[..] != bytes[content..] {
            return Err(damaged());
        }
        let (header, rest) = sized(rest).ok_or_else(damaged)?;
        let (body, rest) = sized(rest).ok_or_else(damaged)?;
        if rest.len() != CHECKSUM {
            return Err(damaged());
        }
        Ok(Self { kind, header, body })
    }

    /// The JSON header.
    ///
    /// # Errors
    ///
    /// [`ContainerError::Header`] when it does not hold a `T`.
    pub fn header<T: DeserializeOwned>(&self) -> Result<T, ContainerError> {
        serde_json::from_slice(self.header).map_err(|source| ContainerError::Header {
            kind: self.kind,
            source,
        })
    }

    /// The arrays.
    #[must_use]
    pub const fn reader(&self) -> Reader<'a> {
        Reader {
            kind: self.kind,
            rest: self.body,
            index: 0,
        }
    }
}

/// Splits off a run of bytes that is preceded by its length.
fn sized(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<8>()?;
    rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)
}

impl Reader<'_> {
    /// The next array.
    ///
    /// # Errors
    ///
    /// [`ContainerError::Array`] when the body ends before it.
    pub fn array<T: Pod + Zeroable>(&mut self) -> Result<Vec<T>, ContainerError> {
        let cut = ContainerError::Array {
            kind: self.kind,
            index: self.index,
        };
        let Some((count, rest)) = self.rest.split_first_chunk::<8>() else {
            return Err(cut);
        };
        let bytes = usize::try_from(u64::from_le_bytes(*count))
            .ok()
            .and_then(|n| n.checked_mul(size_of::<T>()));
        let Some((values, rest)) = bytes.and_then(|n| rest.split_at_checked(n)) else {
            return Err(cut);
        };
        self.rest = rest;
        self.index += 1;
        Ok(bytemuck::pod_collect_to_vec(values))
    }

    /// Checks that all was read.
    ///
    /// # Errors
    ///
    /// [`ContainerError::Trailing`] for bytes after the last array.
    pub fn end(self) -> Result<(), ContainerError> {
        if self.rest.is_empty() {
            return Ok(());
        }
        Err(ContainerError::Trailing {
            kind: self.kind,
            bytes: self.rest.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> Vec<u8> {
        let mut writer = Writer::default();
        writer.array(&[1.5_f64, -2.0]);
        writer.array(&[[1_u32, 2]]);
        let header = serde_json::json!({"name": "silver"});
        writer.finish("paint", 3, &header).expect("finite")
    }

    #[test]
    fn what_was_written_is_read_again() {
        let bytes = file();
        let container = Container::open(&bytes, "paint", 3).expect("whole");
        assert_eq!(
            container.header::<serde_json::Value>().expect("JSON")["name"],
            "silver"
        );
        let mut reader = container.reader();
        assert_eq!(reader.array::<f64>().expect("first"), [1.5, -2.0]);
        assert_eq!(reader.array::<[u32; 2]>().expect("second"), [[1, 2]]);
        assert!(reader.array::<f64>().is_err());
    }

    #[test]
    fn a_newer_version_is_refused_by_number() {
        let error = Container::open(&file(), "paint", 2)
            .expect_err("newer")
            .to_string();
        assert!(
            error.contains("version 3") && error.contains("version 2"),
            "{error}"
        );
        assert!(matches!(
            Container::open(&file(), "blend", 3),
            Err(ContainerError::Kind("blend"))
        ));
    }

    #[test]
    fn every_cut_and_every_changed_byte_is_noticed() {
        let bytes = file();
        for length in 0..bytes.len() {
            assert!(
                Container::open(&bytes[..length], "paint", 3).is_err(),
                "cut at {length}"
            );
        }
        for k in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[k] ^= 0x40;
            assert!(Container::open(&changed, "paint", 3).is_err(), "byte {k}");
        }
    }
}
