//! Environments in SQLite.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::{SqliteCatalogue, hash};
use crate::store::blobs::Task;
use crate::store::{EnvironmentPage, EnvironmentRecord, Environments, StoreError};

fn record(row: &SqliteRow) -> Result<EnvironmentRecord, StoreError> {
    Ok(EnvironmentRecord {
        id: row.try_get("id")?,
        format: row.try_get("format")?,
        width: row.try_get("width")?,
        height: row.try_get("height")?,
        file: hash(row.try_get("file")?, "environment")?,
        held: row.try_get("held")?,
    })
}

impl Environments for SqliteCatalogue {
    fn add_environment<'a>(&'a self, environment: &'a EnvironmentRecord) -> Task<'a, bool> {
        Box::pin(async move {
            let added = sqlx::query(
                "INSERT INTO environments (id, format, width, height, file, held) VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO NOTHING",
            )
            .bind(&environment.id)
            .bind(&environment.format)
            .bind(environment.width)
            .bind(environment.height)
            .bind(environment.file.to_string())
            .bind(&environment.held)
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

    fn environments(&self, cursor: Option<i64>, limit: u32) -> Task<'_, EnvironmentPage> {
        Box::pin(async move {
            // One more than asked for tells whether there is a next page.
            let rows = sqlx::query("SELECT * FROM environments WHERE seq > ? ORDER BY seq LIMIT ?")
                .bind(cursor.unwrap_or(0))
                .bind(i64::from(limit) + 1)
                .fetch_all(&self.read)
                .await?;
            let page = &rows[..rows.len().min(limit as usize)];
            let next = match page.last() {
                Some(last) if rows.len() > page.len() => Some(last.try_get("seq")?),
                _ => None,
            };
            Ok(EnvironmentPage {
                environments: page.iter().map(record).collect::<Result<_, _>>()?,
                next,
            })
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
