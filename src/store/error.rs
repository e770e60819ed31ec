//! What can go wrong between this process and what it keeps.

use std::io;

/// Why the store did not do what was asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The file system refused.
    #[error("{what}: {source}")]
    Io {
        /// What was attempted, with the file's name.
        what: String,
        /// What the system said.
        source: io::Error,
    },
    /// The catalogue's database refused.
    #[error("catalogue: {0}")]
    Database(#[from] sqlx::Error),
    /// The catalogue's tables could not be brought up to date.
    #[error("catalogue: {0}")]
    Migration(#[from] sqlx::migrate::MigrateError),
    /// A stored record does not read back.
    #[error("catalogue: a stored {what} does not read back: {detail}")]
    Corrupt {
        /// Kind of record.
        what: &'static str,
        /// What is wrong with it.
        detail: String,
    },
    /// Another process uses the folder.
    #[error("{0} is in use by another carpaint")]
    InUse(String),
}

impl StoreError {
    /// Wraps an I/O error with what was attempted.
    pub(crate) fn io(what: impl Into<String>) -> impl FnOnce(io::Error) -> Self {
        let what = what.into();
        move |source| Self::Io { what, source }
    }

    /// Whether the disk, or the share of it that may be used, is full.
    #[must_use]
    pub fn is_full(&self) -> bool {
        match self {
            Self::Io { source, .. } => {
                matches!(
                    source.kind(),
                    io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
                )
            }
            // SQLITE_FULL
            Self::Database(sqlx::Error::Database(error)) => {
                error.code().is_some_and(|code| code == "13")
            }
            _ => false,
        }
    }
}
