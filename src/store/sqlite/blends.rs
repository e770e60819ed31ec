//! Blends in SQLite.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::{SqliteCatalogue, hash};
use crate::store::blobs::Task;
use crate::store::{BlendRecord, Blends, StoreError};

impl Blends for SqliteCatalogue {
    fn add_blend<'a>(&'a self, blend: &'a BlendRecord) -> Task<'a, bool> {
        Box::pin(async move {
            let added = sqlx::query(
                "INSERT INTO blends (id, paints, options, blend) VALUES (?, ?, ?, ?) ON CONFLICT (id) DO NOTHING",
            )
            .bind(&blend.id)
            .bind(blend.paints.join(" "))
            .bind(&blend.options)
            .bind(blend.blend.to_string())
            .execute(&self.write)
            .await?;
            Ok(added.rows_affected() == 1)
        })
    }

    fn blend<'a>(&'a self, id: &'a str) -> Task<'a, Option<BlendRecord>> {
        Box::pin(async move {
            let row = sqlx::query("SELECT * FROM blends WHERE id = ?")
                .bind(id)
                .fetch_optional(&self.read)
                .await?;
            row.as_ref().map(record).transpose()
        })
    }

    fn remove_blend<'a>(&'a self, id: &'a str) -> Task<'a, Option<BlendRecord>> {
        Box::pin(async move {
            let row = sqlx::query("DELETE FROM blends WHERE id = ? RETURNING *")
                .bind(id)
                .fetch_optional(&self.write)
                .await?;
            row.as_ref().map(record).transpose()
        })
    }
}

fn record(row: &SqliteRow) -> Result<BlendRecord, StoreError> {
    let paints: String = row.try_get("paints")?;
    Ok(BlendRecord {
        id: row.try_get("id")?,
        paints: paints.split_whitespace().map(str::to_owned).collect(),
        options: row.try_get("options")?,
        blend: hash(row.try_get("blend")?, "blend")?,
    })
}
