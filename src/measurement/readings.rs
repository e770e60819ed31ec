//! Readings of a multi-angle instrument that come as a file of their own: a CSV, or `CxF3`.
//!
//! Both are text. What a file does not say is assumed and told in a warning, and so is what was not read; nothing is
//! guessed in silence.

mod comma_separated;
mod cxf;

use std::collections::BTreeMap;

pub use self::comma_separated::CsvError;
use self::comma_separated::read_csv;
pub use self::cxf::CxfError;
use self::cxf::read_cxf;
use super::{Layout, MultiAngle};
use crate::paint::Limits;

/// Largest file of readings that is read: a thousand times what an instrument writes.
const MOST_BYTES: u64 = 64 << 20;
/// Characters of a value that an error repeats.
const TOLD: usize = 60;

/// Readings of one paint, and what came with them.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadingsFile {
    /// Name of the paint, where the file says it.
    pub name: Option<String>,
    /// What else the file says about itself: instrument, date, who made it.
    pub notes: BTreeMap<String, String>,
    /// The readings.
    pub readings: MultiAngle,
    /// What the user should know: what was assumed, and what was not read.
    pub warnings: Vec<String>,
}

/// Why a file holds no readings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadingsError {
    /// More bytes than are accepted.
    #[error("the readings have {bytes} bytes, accepted are {accepted}")]
    Size {
        /// Length of the input.
        bytes: usize,
        /// The limit.
        accepted: u64,
    },
    /// Text of another encoding.
    #[error("the text is {found}, accepted is UTF-8")]
    Encoding {
        /// What it is.
        found: String,
    },
    /// A damaged table, or one of something else.
    #[error("CSV: {0}")]
    Csv(#[from] CsvError),
    /// A damaged document, or one of something else.
    #[error("CxF: {0}")]
    Cxf(#[from] CxfError),
    /// A layout that is none of readings.
    #[error("layout is {}, accepted of readings are csv and cxf", found.name())]
    Layout {
        /// The layout.
        found: Layout,
    },
}

impl ReadingsFile {
    /// Reads a file of readings. Of a document with several paints it takes the one that is called `wanted`, by its name
    /// or its id.
    ///
    /// # Errors
    ///
    /// [`ReadingsError`] naming line and column, or object, and what would be accepted.
    pub fn read(
        bytes: &[u8],
        layout: Layout,
        wanted: Option<&str>,
        limits: &Limits,
    ) -> Result<Self, ReadingsError> {
        let accepted = MOST_BYTES.min(limits.bytes);
        if bytes.len() as u64 > accepted {
            return Err(ReadingsError::Size {
                bytes: bytes.len(),
                accepted,
            });
        }
        let text = text_of(bytes)?;
        match layout {
            Layout::Csv => Ok(read_csv(text, limits)?),
            Layout::Cxf => Ok(read_cxf(text, wanted, limits)?),
            found => Err(ReadingsError::Layout { found }),
        }
    }
}

/// Which layout of readings bytes begin as, if any.
pub(super) fn begins_as(bytes: &[u8]) -> Option<Layout> {
    let bytes = bytes.strip_prefix(MARK).unwrap_or(bytes);
    let begin = &bytes[..bytes.len().min(4096)];
    let holds = |word: &[u8]| begin.windows(word.len()).any(|w| w == word);
    if begin.trim_ascii_start().starts_with(b"<") {
        return holds(b"CxF").then_some(Layout::Cxf);
    }
    let mut lines = begin.split(|b| *b == b'\n').map(<[u8]>::trim_ascii);
    let header = lines.find(|line| !line.is_empty() && !comma_separated::is_remark(line))?;
    let header = header.trim_ascii_start();
    let header = header.strip_prefix(b"\"").unwrap_or(header);
    header
        .starts_with(super::multi_angle::ASPECULAR_COLUMN.as_bytes())
        .then_some(Layout::Csv)
}

/// Byte order mark of UTF-8.
const MARK: &[u8] = "\u{feff}".as_bytes();

/// Whether text is in UTF-16, as its first bytes say.
pub(super) fn is_utf16(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff")
}

fn text_of(bytes: &[u8]) -> Result<&str, ReadingsError> {
    if is_utf16(bytes) {
        let found = "UTF-16".to_owned();
        return Err(ReadingsError::Encoding { found });
    }
    let bytes = bytes.strip_prefix(MARK).unwrap_or(bytes);
    std::str::from_utf8(bytes).map_err(|error| ReadingsError::Encoding {
        found: format!("no UTF-8 at byte {}", error.valid_up_to()),
    })
}

/// A value as an error repeats it: not at any length.
fn told(value: &str) -> String {
    if value.chars().count() > TOLD {
        value.chars().take(TOLD - 3).chain("...".chars()).collect()
    } else {
        value.to_owned()
    }
}

/// A name as a paint may have it, if the text is one.
fn as_name(text: &str) -> Option<String> {
    let printable = !text.chars().any(char::is_control);
    let fits = (1..=crate::paint::NAME_CHARACTERS).contains(&text.chars().count());
    (fits && printable).then(|| text.to_owned())
}

#[cfg(test)]
mod tests;
