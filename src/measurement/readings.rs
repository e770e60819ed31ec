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
/// Characters of a note.
const NOTE_CHARACTERS: usize = 200;

/// Readings of one paint, and what came with them.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadingsFile {
    /// Name of the paint, where the file says it.
    pub name: Option<String>,
    /// Whether the paint was asked for by what tells it from others of its name, which is no name to call it by.
    pub asked_by_id: bool,
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
    /// Reads a file of readings. Of a document with several paints it takes the one that is called `wanted`, by its Id
    /// or its name; of one with a single paint it takes that, unless `wanted` is another object of the document.
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
        let mut file = match layout {
            Layout::Csv => read_csv(text, limits)?,
            Layout::Cxf => read_cxf(text, wanted, limits)?,
            found => return Err(ReadingsError::Layout { found }),
        };
        // What has no color at all is refused where its colors are wanted.
        let colors = file.readings.colors().ok();
        file.warnings
            .extend(colors.and_then(|colors| colors.warning));
        Ok(file)
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
    let mut lines = begin
        .split(|b| matches!(b, b'\n' | b'\r'))
        .map(<[u8]>::trim_ascii);
    let first = lines.find(|line| !line.is_empty() && !comma_separated::is_remark(line))?;
    let name = first.strip_prefix(b"\"").unwrap_or(first);
    let column = super::multi_angle::ASPECULAR_COLUMN.as_bytes();
    let is_named = name
        .get(..column.len())
        .is_some_and(|name| name.eq_ignore_ascii_case(column));
    // A table without names is told that it lacks them.
    (is_named || comma_separated::is_of_numbers(first)).then_some(Layout::Csv)
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

/// The word for one of something, or for any other number of it.
fn counted<'a>(count: usize, one: &'a str, many: &'a str) -> &'a str {
    if count == 1 { one } else { many }
}

/// A name as a paint may have it, if the text is one.
fn as_name(text: &str) -> Option<String> {
    let printable = !text.chars().any(char::is_control);
    let fits = (1..=crate::paint::NAME_CHARACTERS).contains(&text.chars().count());
    (fits && printable).then(|| text.to_owned())
}

#[cfg(test)]
mod tests;
