//! What must outlive the process: uploads, paints, blends, jobs, and results worth keeping.
//!
//! Keys and bytes, no paint: nothing here knows what a lobe is. The contract, which one suite (`conformance`) holds every
//! backend to:
//!
//! - **Blobs** are named by the BLAKE3 of their bytes. A blob appears whole or not at all: bytes are written beside it,
//!   synced, renamed, and the folder synced, before its name is given out. Writing the same bytes twice is one blob.
//! - **The catalogue** acknowledges nothing that a power cut could take back. A subject (a paint or blend to be) has at
//!   most one unfinished job. Records are never changed behind a name, only added and removed.
//! - **Results** are a cache: addressed by what made them, checked when read back, dropped when space is short, and
//!   computed once however many ask at the same time.
//!
//! Left to others: what the bytes mean (`paint`, `blend`), when work runs (`service`).

mod blobs;
mod catalogue;
#[cfg(test)]
mod conformance;
mod error;
mod folder;
mod results;
mod sqlite;
mod whole_file;

pub use blobs::{BlobBytes, BlobWriter, Blobs, Hash, LocalBlob, Stored, Task};
pub use catalogue::{
    BlendRecord, Blends, Catalogue, EnvironmentPage, EnvironmentRecord, Environments, JobBook,
    JobEnd, JobKind, JobRecord, JobState, NewJob, NotedPaint, PaintPage, PaintRecord, Paints,
    Submitted, Visibility,
};
pub use error::StoreError;
pub use folder::FolderBlobs;
pub use results::{CachedResult, ResultCache};
pub use sqlite::SqliteCatalogue;
