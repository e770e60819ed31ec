//! How the bytes of a measurement are laid out, as its first bytes, its length or its owner tell.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::mpi::{self, MPI_HEADER_BYTES};
use super::table::ThetaHSpacing;
use super::{MeasurementError, merl, readings, tensor};

/// Names of all layouts.
pub(super) const LAYOUTS: &str = "rgl, mpi-2005, merl, package, csv or cxf";

/// How the bytes of a measurement are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Tensor file of EPFL's material database (`.bsdf`).
    Rgl,
    /// Half-angle table of the MPI car paints of 2005.
    #[serde(rename = "mpi-2005")]
    Mpi2005,
    /// Half-angle table of the MERL database.
    Merl,
    /// Measured-paint package, a zip archive.
    Package,
    /// Readings of a multi-angle instrument as a table of text: `aspecular_deg,L,a,b`.
    Csv,
    /// Readings of a multi-angle instrument in `CxF3` (ISO 17972-1).
    Cxf,
}

impl Layout {
    /// Its name, in requests and in provenances.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rgl => "rgl",
            Self::Mpi2005 => "mpi-2005",
            Self::Merl => "merl",
            Self::Package => "package",
            Self::Csv => "csv",
            Self::Cxf => "cxf",
        }
    }

    /// The layout of this name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        [
            Self::Rgl,
            Self::Mpi2005,
            Self::Merl,
            Self::Package,
            Self::Csv,
            Self::Cxf,
        ]
        .into_iter()
        .find(|layout| layout.name() == name)
    }

    /// Whether it holds readings at a few angles, and not a reflectance.
    #[must_use]
    pub const fn is_of_readings(self) -> bool {
        matches!(self, Self::Csv | Self::Cxf)
    }
}

/// What a caller knows about a file that its bytes do not say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// The layout; `None` finds it out from the bytes.
    pub layout: Option<Layout>,
    /// Spacing of a table's θh; `None` is the layout's own.
    pub theta_h: Option<ThetaHSpacing>,
    /// Bytes before the values of an MPI table; `None` is [`MPI_HEADER_BYTES`].
    pub header_bytes: Option<u64>,
}

/// Finds out the layout from the first bytes or the length.
///
/// # Errors
///
/// [`MeasurementError::Unknown`] when neither tells, [`MeasurementError::Stated`] for a stated layout that is not the file's.
pub fn sniff(bytes: &[u8], options: &ReadOptions) -> Result<Layout, MeasurementError> {
    let begins_as = if bytes.starts_with(tensor::MAGIC) {
        Some(Layout::Rgl)
    } else if bytes.starts_with(b"PK") {
        Some(Layout::Package)
    } else {
        readings::begins_as(bytes)
    };
    match (options.layout, begins_as) {
        (Some(stated), Some(found)) if stated != found => {
            return Err(MeasurementError::Stated { stated, found });
        }
        (Some(layout), _) | (None, Some(layout)) => return Ok(layout),
        (None, None) => {}
    }
    let header = options.header_bytes.unwrap_or(MPI_HEADER_BYTES);
    if bytes.len() as u64 == mpi::VALUE_BYTES.saturating_add(header) {
        Ok(Layout::Mpi2005)
    } else if bytes.len() == merl::FILE_BYTES || merl::begins_like_one(bytes) {
        Ok(Layout::Merl)
    } else {
        Err(MeasurementError::Unknown {
            bytes: bytes.len(),
            what: what_it_is(bytes),
        })
    }
}

/// What a file of no known layout is, for who took it for a measurement.
fn what_it_is(bytes: &[u8]) -> String {
    let known: [(&[u8], &str); 8] = [
        (b"\x89PNG", "is a PNG picture"),
        (b"\xff\xd8\xff", "is a JPEG picture"),
        (b"\x76\x2f\x31\x01", "is an OpenEXR picture"),
        (b"#?RADIANCE", "is a Radiance picture"),
        (b"glTF", "is a glTF model"),
        (b"\x1f\x8b", "is packed by gzip"),
        (b"%PDF", "is a PDF"),
        (
            b"carpaint",
            "is a .paint or a .blend, which was fitted already: show, blend, realise or preview it",
        ),
    ];
    let begin = &bytes[..bytes.len().min(8)];
    match known.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        Some((_, what)) => (*what).to_owned(),
        None if bytes.is_empty() => "is empty".to_owned(),
        None if readings::is_utf16(bytes) => {
            "is text in UTF-16; readings are read in UTF-8, as which a spreadsheet or an editor saves them".to_owned()
        }
        None if bytes.trim_ascii_start().starts_with(b"{") => {
            "is JSON; a package's paint.json comes zipped together with its pictures".to_owned()
        }
        None if let Some(line) = head_of_table(bytes) => format!(
            "begins with the line {line:?}; in a table of readings the first column is aspecular_deg, the angle from the \
             mirror direction"
        ),
        None if begin
            .iter()
            .all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace()) =>
        {
            format!("begins with the text {:?}", String::from_utf8_lossy(begin))
        }
        None => format!("begins with {begin:02x?}"),
    }
}

/// The first line of a text that has columns, up to so many characters; remarks aside.
fn head_of_table(bytes: &[u8]) -> Option<String> {
    const SHOWN: usize = 60;
    let text = bytes.get(..bytes.len().min(4096))?;
    let mut lines = text.split(|b| matches!(b, b'\n' | b'\r'));
    let line = lines.find(|line| !line.trim_ascii().is_empty() && !line.starts_with(b"#"))?;
    let line = std::str::from_utf8(line).ok()?;
    let is_table =
        line.contains([',', ';', '\t']) && !line.chars().any(|c| c.is_control() && c != '\t');
    is_table.then(|| line.chars().take(SHOWN).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stated_layout_wins_where_the_bytes_do_not_tell() {
        let options = ReadOptions {
            layout: Some(Layout::Merl),
            ..ReadOptions::default()
        };
        assert_eq!(sniff(b"12345678", &options), Ok(Layout::Merl));
        let refused = sniff(b"PK\x03\x04", &options).expect_err("a package");
        assert!(
            refused
                .to_string()
                .starts_with("layout is merl, accepted is package"),
            "{refused}"
        );
        assert_eq!(
            sniff(b"tensor_file\0", &ReadOptions::default()),
            Ok(Layout::Rgl)
        );
        assert_eq!(
            sniff(b"PK\x03\x04", &ReadOptions::default()),
            Ok(Layout::Package)
        );
    }

    #[test]
    fn a_file_of_another_kind_is_told_what_it_is() {
        for (bytes, what) in [
            (&b"\x89PNG\r\n\x1a\n"[..], "is a PNG picture"),
            (b"", "is empty"),
            (b"carpaint", "fitted already"),
            (b"\x00\x01", "begins with [00, 01]"),
            (
                b"# by hand\nangle,L,a,b\n15,9,0,0\n",
                "\"angle,L,a,b\"; in a table",
            ),
        ] {
            let error = sniff(bytes, &ReadOptions::default()).expect_err("no measurement");
            assert!(error.to_string().contains(what), "{error}");
        }
    }
}
