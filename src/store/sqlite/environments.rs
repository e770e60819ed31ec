//! Panoramas in SQLite.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::{SqliteCatalogue, hash};
use crate::store::blobs::Task;
use crate::store::{EnvironmentRecord, Environments, StoreError};

fn record(row: &SqliteRow) -> Result<EnvironmentRecord, StoreError> {
    Ok(EnvironmentRecord {
        id: row.try_get("id")?,
        format: row.try_get("format")?,
        width: row.try_get("width")?,
        height: row.try_get("height")?,
        file: hash(row.try_get("file")?, "environment")?,
    })
}

impl Environments for SqliteCatalogue {
    fn add_environment<'a>(&'a self, environment: &'a EnvironmentRecord) -> Task<'a, bool> {
        Box::pin(async move {
            let added = sqlx::query(
                "INSERT INTO environments (id, format, width, height, file) VALUES (?, ?, ?, ?, ?) ON CONFLICT (id) DO NOTHING",
            )
            .bind(&environment.id)
            .bind(&environment.format)
            .bind(environment.width)
            .bind(environment.height)
            .bind(environment.file.to_string())
            .execute(&self.write)
            .await?;
            Ok(added.rows_affected() == 1)
        })
    }

    fn environment<'a>(&'a self, id: &'a str) -> Task<'a, Option<EnvironmentRecord>> {
        Box::pin(async move {
            let row = sqlx::query("SELECT * FROM environments WHERE id = ?")
                .bind(id)
                .fetch_optional(&self.read)
                .await?;
            row.as_ref().map(record).transpose()
        })
    }

    fn remove_environment<'a>(&'a self, id: &'a str) -> Task<'a, Option<EnvironmentRecord>> {
        Box::pin(async move {
            let row = sqlx::query("DELETE FROM environments WHERE id = ? RETURNING *")
                .bind(id)
                .fetch_optional(&self.write)
                .await?;
            row.as_ref().map(record).transpose()
        })
    }
}
