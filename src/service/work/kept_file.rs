//! Files as the cache of results keeps them: with what is told about them, so that both are answered alike for ever.

use bytes::Bytes;
use serde_json::Value;

use crate::service::http::Problem;
use crate::store::CachedResult;

/// A file out of the cache.
#[derive(Clone, Debug)]
pub struct KeptFile {
    /// How accurate it is, as the value of a header.
    pub accuracy: String,
    /// The report on it, JSON, where it was kept.
    pub report: Bytes,
    /// The file.
    pub file: CachedResult,
}

impl KeptFile {
    /// What is kept of a file: a line of accuracy, a line of the report where that is to be answered too, the file.
    #[must_use]
    pub fn form(accuracy: &str, report: Option<&Value>, file: &[u8]) -> Bytes {
        let report = report.map_or(String::new(), Value::to_string);
        let head = format!("{accuracy}\n{report}\n");
        [head.as_bytes(), file].concat().into()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Hash;

    fn kept(bytes: &[u8]) -> CachedResult {
        CachedResult {
            hash: Hash::of(bytes),
            bytes: Bytes::copy_from_slice(bytes),
        }
    }

    #[test]
    fn what_was_kept_comes_back_whatever_bytes_are_in_it() {
        let report = serde_json::json!({ "notes": ["two\nlines"] });
        for file in [&b""[..], b"\n\n", b"a\nb\n"] {
            for report in [None, Some(&report)] {
                let form = KeptFile::form("flakes-lab=0.3", report, file);
                let found = KeptFile::of(&kept(&form)).expect("two lines");
                assert_eq!(found.accuracy, "flakes-lab=0.3");
                assert_eq!(found.file.bytes, file);
                let told = report.map_or(String::new(), Value::to_string);
                assert_eq!(found.report, told.as_bytes());
            }
        }
    }

    #[test]
    fn what_has_no_two_lines_before_it_is_no_kept_file() {
        for bytes in [&b""[..], b"PK", b"one line\nand a file"] {
            assert!(KeptFile::of(&kept(bytes)).is_err());
        }
    }
}
