//! The catalogue in SQLite: one file, write-ahead log, every commit synced.
//!
//! One connection writes, a few read: writers queue here instead of failing with "database is locked".

mod blends;
mod environments;
mod jobs;
mod paints;

use std::path::Path;
use std::time::Duration;

use sqlx::SqlitePool;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};

use super::blobs::{Hash, Task};
use super::{Catalogue, StoreError};

/// Connections that read.
const READERS: u32 = 4;

/// A catalogue in a SQLite file.
#[derive(Clone, Debug)]
pub struct SqliteCatalogue {
    write: SqlitePool,
    read: SqlitePool,
}

impl SqliteCatalogue {
    /// Opens the catalogue in `file`, made and brought up to date where needed.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the file is no catalogue, or a newer one.
    pub async fn open(file: &Path) -> Result<Self, StoreError> {
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(Duration::from_secs(10));
        let write = SqlitePoolOptions::new()
            .max_connections(1)
            .connect_with(options.clone())
            .await?;
        sqlx::migrate!("src/store/migrations").run(&write).await?;
        let read = SqlitePoolOptions::new()
            .max_connections(READERS)
            .connect_with(options.read_only(true))
            .await?;
        Ok(Self { write, read })
    }

    /// Finishes what is under way and closes the file.
    pub async fn close(&self) {
        self.read.close().await;
        self.write.close().await;
    }
}

impl Catalogue for SqliteCatalogue {
    fn ping(&self) -> Task<'_, ()> {
        Box::pin(async move {
            sqlx::query("SELECT 1").execute(&self.read).await?;
            Ok(())
        })
    }

    fn tie_key<'a>(&'a self, key: &'a str, subject: &'a str, keep: u32) -> Task<'a, String> {
        Box::pin(async move {
            let mut transaction = self.write.begin().await?;
            let tied = sqlx::query("INSERT INTO request_keys (key, subject) VALUES (?, ?) ON CONFLICT (key) DO NOTHING")
                .bind(key)
                .bind(subject)
                .execute(&mut *transaction)
                .await?;
            if tied.rows_affected() == 1 {
                sqlx::query(
                    "DELETE FROM request_keys WHERE seq <= (SELECT max(seq) FROM request_keys) - ?",
                )
                .bind(i64::from(keep))
                .execute(&mut *transaction)
                .await?;
            }
            let (subject,): (String,) =
                sqlx::query_as("SELECT subject FROM request_keys WHERE key = ?")
                    .bind(key)
                    .fetch_one(&mut *transaction)
                    .await?;
            transaction.commit().await?;
            Ok(subject)
        })
    }

    fn names_blob(&self, blob: Hash) -> Task<'_, bool> {
        Box::pin(async move {
            let (named,): (bool,) = sqlx::query_as(
                "SELECT EXISTS (SELECT 1 FROM paints WHERE measurement = ?1 OR paint = ?1)
                     OR EXISTS (SELECT 1 FROM blends WHERE blend = ?1)
                     OR EXISTS (SELECT 1 FROM environments WHERE file = ?1)
                     OR EXISTS (SELECT 1 FROM jobs WHERE state IN ('queued', 'running') AND instr(request, ?1) > 0)",
            )
            .bind(blob.to_string())
            .fetch_one(&self.write)
            .await?;
            Ok(named)
        })
    }
}

fn hash(text: &str, what: &'static str) -> Result<Hash, StoreError> {
    text.parse().map_err(|error| StoreError::Corrupt {
        what,
        detail: format!("{text:?} is no hash: {error}"),
    })
}
