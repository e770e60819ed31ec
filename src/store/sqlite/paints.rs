//! Paints in SQLite.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::{SqliteCatalogue, hash};
use crate::store::blobs::{Hash, Task};
use crate::store::{NotedPaint, PaintPage, PaintRecord, Paints, StoreError, Visibility};

fn record(row: &SqliteRow) -> Result<PaintRecord, StoreError> {
    let measurement: Option<String> = row.try_get("measurement")?;
    let visibility: String = row.try_get("visibility")?;
    Ok(PaintRecord {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        source: row.try_get("source")?,
        measurement: measurement.map(|text| hash(&text, "paint")).transpose()?,
        paint: hash(row.try_get("paint")?, "paint")?,
        content: hash(row.try_get("content")?, "paint")?,
        visibility: Visibility::of_word(&visibility).ok_or_else(|| StoreError::Corrupt {
            what: "paint",
            detail: format!("its visibility is {visibility:?}"),
        })?,
    })
}

fn noted(row: &SqliteRow) -> Result<NotedPaint, StoreError> {
    let numbers: Option<String> = row.try_get("numbers")?;
    let read = |text: String| {
        serde_json::from_str(&text).map_err(|error| StoreError::Corrupt {
            what: "note",
            detail: error.to_string(),
        })
    };
    Ok(NotedPaint {
        id: row.try_get("id")?,
        paint: hash(row.try_get("paint")?, "paint")?,
        numbers: numbers.map(read).transpose()?,
    })
}

impl Paints for SqliteCatalogue {
    fn add_paint<'a>(&'a self, paint: &'a PaintRecord) -> Task<'a, bool> {
        Box::pin(async move {
            let added = sqlx::query(
                "INSERT INTO paints (id, name, source, words, measurement, paint, content, visibility)
                 VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO NOTHING",
            )
            .bind(&paint.id)
            .bind(&paint.name)
            .bind(&paint.source)
            .bind(format!("{}\n{}", paint.name, paint.source).to_lowercase())
            .bind(paint.measurement.map(|hash| hash.to_string()))
            .bind(paint.paint.to_string())
            .bind(paint.content.to_string())
            .bind(paint.visibility.word())
            .execute(&self.write)
            .await?;
            Ok(added.rows_affected() == 1)
        })
    }

    fn paint<'a>(&'a self, id: &'a str) -> Task<'a, Option<PaintRecord>> {
        Box::pin(async move {
            let row = sqlx::query("SELECT * FROM paints WHERE id = ?")
                .bind(id)
                .fetch_optional(&self.read)
                .await?;
            row.as_ref().map(record).transpose()
        })
    }

    fn paints<'a>(
        &'a self,
        q: Option<&'a str>,
        visibility: Visibility,
        cursor: Option<i64>,
        limit: u32,
    ) -> Task<'a, PaintPage> {
        Box::pin(async move {
            // One more than asked for tells whether there is a next page.
            let rows = sqlx::query(
                "SELECT * FROM paints WHERE seq > ? AND visibility = ? AND (? = '' OR instr(words, ?) > 0) ORDER BY seq LIMIT ?",
            )
            .bind(cursor.unwrap_or(0))
            .bind(visibility.word())
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
            Ok(PaintPage {
                paints: page.iter().map(record).collect::<Result<_, _>>()?,
                next,
            })
        })
    }

    fn show_paint<'a>(&'a self, id: &'a str, visibility: Visibility) -> Task<'a, bool> {
        Box::pin(async move {
            let changed = sqlx::query("UPDATE paints SET visibility = ? WHERE id = ?")
                .bind(visibility.word())
                .bind(id)
                .execute(&self.write)
                .await?;
            Ok(changed.rows_affected() == 1)
        })
    }

    fn note<'a>(&'a self, paint: Hash, kind: &'a str, numbers: &'a [f64]) -> Task<'a, ()> {
        Box::pin(async move {
            sqlx::query(
                "INSERT OR REPLACE INTO notes (paint, kind, numbers)
                 SELECT ?1, ?2, ?3 WHERE EXISTS (SELECT 1 FROM paints WHERE paint = ?1)",
            )
            .bind(paint.to_string())
            .bind(kind)
            .bind(serde_json::json!(numbers).to_string())
            .execute(&self.write)
            .await?;
            Ok(())
        })
    }

    fn noted<'a>(
        &'a self,
        q: Option<&'a str>,
        visibility: Visibility,
        kind: &'a str,
    ) -> Task<'a, Vec<NotedPaint>> {
        Box::pin(async move {
            let rows = sqlx::query(
                "SELECT id, paints.paint, numbers
                 FROM paints LEFT JOIN notes ON notes.paint = paints.paint AND notes.kind = ?1
                 WHERE visibility = ?2 AND (?3 = '' OR instr(words, ?3) > 0) ORDER BY seq",
            )
            .bind(kind)
            .bind(visibility.word())
            .bind(q.unwrap_or("").to_lowercase())
            .fetch_all(&self.read)
            .await?;
            rows.iter().map(noted).collect()
        })
    }

    fn remove_paint<'a>(&'a self, id: &'a str) -> Task<'a, Option<PaintRecord>> {
        Box::pin(async move {
            let mut transaction = self.write.begin().await?;
            let row = sqlx::query("DELETE FROM paints WHERE id = ? RETURNING *")
                .bind(id)
                .fetch_optional(&mut *transaction)
                .await?;
            let removed = row.as_ref().map(record).transpose()?;
            if let Some(removed) = &removed {
                sqlx::query(
                    "DELETE FROM notes WHERE paint = ?1 AND NOT EXISTS (SELECT 1 FROM paints WHERE paint = ?1)",
                )
                .bind(removed.paint.to_string())
                .execute(&mut *transaction)
                .await?;
            }
            transaction.commit().await?;
            Ok(removed)
        })
    }
}
