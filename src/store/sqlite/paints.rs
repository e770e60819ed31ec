//! Paints in SQLite.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::{SqliteCatalogue, hash};
use crate::store::blobs::{Hash, Task};
use crate::store::{PaintPage, PaintRecord, Paints, StoreError};

fn record(row: &SqliteRow) -> Result<PaintRecord, StoreError> {
    let measurement: Option<String> = row.try_get("measurement")?;
    Ok(PaintRecord {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        source: row.try_get("source")?,
        measurement: measurement.map(|text| hash(&text, "paint")).transpose()?,
        paint: hash(row.try_get("paint")?, "paint")?,
        content: hash(row.try_get("content")?, "paint")?,
    })
}

impl Paints for SqliteCatalogue {
    fn add_paint<'a>(&'a self, paint: &'a PaintRecord) -> Task<'a, bool> {
        Box::pin(async move {
            let added = sqlx::query(
                "INSERT INTO paints (id, name, source, words, measurement, paint, content)
                 VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO NOTHING",
            )
            .bind(&paint.id)
            .bind(&paint.name)
            .bind(&paint.source)
            .bind(format!("{}\n{}", paint.name, paint.source).to_lowercase())
            .bind(paint.measurement.map(|hash| hash.to_string()))
            .bind(paint.paint.to_string())
            .bind(paint.content.to_string())
            .execute(&self.write)
            .await?;
            Ok(added.rows_affected() == 1)
        })
    }

    fn paint<'a>(&'a self, id: &'a str) -> Task<'a, Option<PaintRecord>> {
        Box::pin(async move {
            let row = sqlx::query("SELECT * FROM paints WHERE id = ?").bind(id).fetch_optional(&self.read).await?;
            row.as_ref().map(record).transpose()
        })
    }

    fn paints<'a>(&'a self, q: Option<&'a str>, cursor: Option<i64>, limit: u32) -> Task<'a, PaintPage> {
        Box::pin(async move {
            // One more than asked for tells whether there is a next page.
            let rows = sqlx::query(
                "SELECT * FROM paints WHERE seq > ? AND (? = '' OR instr(words, ?) > 0) ORDER BY seq LIMIT ?",
            )
            .bind(cursor.unwrap_or(0))
            .bind(q.unwrap_or("").to_lowercase())
            .bind(q.unwrap_or("").to_lowercase())
            .bind(i64::from(limit) + 1)
            .fetch_all(&self.read)
            .await?;
            let page = &rows[..rows.len().min(limit as usize)];
            let next = match page.last() {
                Some(last) if rows.len() > page.len() => Some(last.try_get("seq")?),
                _ => None,
            };
            Ok(PaintPage { paints: page.iter().map(record).collect::<Result<_, _>>()?, next })
        })
    }

    fn remove_paint<'a>(&'a self, id: &'a str) -> Task<'a, Option<Vec<Hash>>> {
        Box::pin(async move {
            let mut transaction = self.write.begin().await?;
            let row = sqlx::query("DELETE FROM paints WHERE id = ? RETURNING *")
                .bind(id)
                .fetch_optional(&mut *transaction)
                .await?;
            let Some(gone) = row.as_ref().map(record).transpose()? else { return Ok(None) };
            let mut orphans = Vec::new();
            for blob in gone.measurement.into_iter().chain([gone.paint]) {
                // A job that is not done may still want the measurement.
                let (named,): (i64,) = sqlx::query_as(
                    "SELECT EXISTS (SELECT 1 FROM paints WHERE measurement = ?1 OR paint = ?1)
                         OR EXISTS (SELECT 1 FROM blends WHERE blend = ?1)
                         OR EXISTS (SELECT 1 FROM jobs
                                    WHERE state IN ('queued', 'running') AND instr(request, ?1) > 0)",
                )
                .bind(blob.to_string())
                .fetch_one(&mut *transaction)
                .await?;
                if named == 0 {
                    orphans.push(blob);
                }
            }
            transaction.commit().await?;
            Ok(Some(orphans))
        })
    }
}
