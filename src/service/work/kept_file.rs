//! Files as the cache of results keeps them: with what is told about them, so that both are answered alike for ever.

use bytes::Bytes;

use super::works::MadeFile;
use crate::service::http::Problem;
use crate::store::CachedResult;

/// A file out of the cache.
#[derive(Clone, Debug)]
pub struct KeptFile {
    /// How accurate it is, as the value of a header.
    pub accuracy: String,
    /// The report on it, JSON.
    pub report: Bytes,
    /// The file.
    pub file: CachedResult,
}

impl KeptFile {
    /// What is kept: a line of accuracy, a line of the report, the file.
    #[must_use]
    pub fn form(made: &MadeFile) -> Bytes {
        let head = format!("{}\n{}\n", made.accuracy, made.report);
        [head.as_bytes(), &made.bytes].concat().into()
    }

    /// What was kept.
    ///
    /// # Errors
    ///
    /// [`Problem`] for what has no two lines before it.
    pub fn of(kept: &CachedResult) -> Result<Self, Problem> {
        let line_end = |from: usize| {
            let end = kept.bytes[from..].iter().position(|&byte| byte == b'\n');
            end.map(|end| from + end)
                .ok_or_else(|| Problem::internal("a kept file without its report"))
        };
        let first = line_end(0)?;
        let second = line_end(first + 1)?;
        Ok(Self {
            accuracy: String::from_utf8_lossy(&kept.bytes[..first]).into_owned(),
            report: kept.bytes.slice(first + 1..second),
            file: CachedResult {
                // The hash of all three tells files apart as surely as that of one.
                hash: kept.hash,
                bytes: kept.bytes.slice(second + 1..),
            },
        })
    }
}
