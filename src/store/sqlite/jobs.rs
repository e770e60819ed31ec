//! Jobs in SQLite.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::SqliteCatalogue;
use crate::store::blobs::Task;
use crate::store::{JobBook, JobEnd, JobKind, JobRecord, JobState, NewJob, StoreError, Submitted};

fn record(row: &SqliteRow) -> Result<JobRecord, StoreError> {
    let (kind, state): (String, String) = (row.try_get("kind")?, row.try_get("state")?);
    let corrupt = |detail: String| StoreError::Corrupt {
        what: "job",
        detail,
    };
    Ok(JobRecord {
        id: row.try_get("id")?,
        kind: JobKind::of_word(&kind).ok_or_else(|| corrupt(format!("its kind is {kind:?}")))?,
        subject: row.try_get("subject")?,
        request: row.try_get("request")?,
        state: JobState::of_word(&state)
            .ok_or_else(|| corrupt(format!("its state is {state:?}")))?,
        attempts: row.try_get("attempts")?,
        problem: row.try_get("problem")?,
        stages: row.try_get("stages")?,
    })
}

impl JobBook for SqliteCatalogue {
    fn submit_job<'a>(&'a self, job: &'a NewJob) -> Task<'a, Submitted> {
        Box::pin(async move {
            let mut transaction = self.write.begin().await?;
            let inserted = sqlx::query(
                "INSERT INTO jobs (id, kind, subject, request) VALUES (?, ?, ?, ?)
                 ON CONFLICT (subject) WHERE state IN ('queued', 'running') DO NOTHING",
            )
            .bind(&job.id)
            .bind(job.kind.word())
            .bind(&job.subject)
            .bind(&job.request)
            .execute(&mut *transaction)
            .await?;
            let row = sqlx::query(
                "SELECT * FROM jobs WHERE subject = ? AND state IN ('queued', 'running')",
            )
            .bind(&job.subject)
            .fetch_one(&mut *transaction)
            .await?;
            transaction.commit().await?;
            Ok(Submitted {
                job: record(&row)?,
                new: inserted.rows_affected() == 1,
            })
        })
    }

    fn job<'a>(&'a self, id: &'a str) -> Task<'a, Option<JobRecord>> {
        Box::pin(async move {
            let row = sqlx::query("SELECT * FROM jobs WHERE id = ?")
                .bind(id)
                .fetch_optional(&self.read)
                .await?;
            row.as_ref().map(record).transpose()
        })
    }

    fn unfinished_jobs(&self) -> Task<'_, Vec<JobRecord>> {
        Box::pin(async move {
            let rows =
                sqlx::query("SELECT * FROM jobs WHERE state IN ('queued', 'running') ORDER BY seq")
                    .fetch_all(&self.read)
                    .await?;
            rows.iter().map(record).collect()
        })
    }

    fn begin_job<'a>(&'a self, id: &'a str) -> Task<'a, ()> {
        Box::pin(async move {
            sqlx::query(
                "UPDATE jobs SET state = 'running', attempts = attempts + 1
                 WHERE id = ? AND state IN ('queued', 'running')",
            )
            .bind(id)
            .execute(&self.write)
            .await?;
            Ok(())
        })
    }

    fn return_job<'a>(&'a self, id: &'a str) -> Task<'a, ()> {
        Box::pin(async move {
            sqlx::query("UPDATE jobs SET state = 'queued', attempts = attempts - 1 WHERE id = ? AND state = 'running'")
                .bind(id)
                .execute(&self.write)
                .await?;
            Ok(())
        })
    }

    fn forget_ended_jobs(&self, keep: u32) -> Task<'_, ()> {
        Box::pin(async move {
            sqlx::query(
                "DELETE FROM jobs WHERE state IN ('done', 'failed', 'cancelled') AND seq <= (
                     SELECT seq FROM jobs WHERE state IN ('done', 'failed', 'cancelled')
                     ORDER BY seq DESC LIMIT 1 OFFSET ?)",
            )
            .bind(i64::from(keep))
            .execute(&self.write)
            .await?;
            Ok(())
        })
    }

    fn end_job<'a>(&'a self, id: &'a str, end: JobEnd<'a>) -> Task<'a, bool> {
        Box::pin(async move {
            let ended = sqlx::query(
                "UPDATE jobs SET state = ?, problem = ?, stages = ? WHERE id = ? AND state IN ('queued', 'running')",
            )
            .bind(end.state.word())
            .bind(end.problem)
            .bind(end.stages)
            .bind(id)
            .execute(&self.write)
            .await?;
            Ok(ended.rows_affected() == 1)
        })
    }
}
