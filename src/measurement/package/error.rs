//! Why a file or a folder is no measured-paint package.

use std::path::PathBuf;

use crate::measurement::archive::WORKBOOK;
use crate::measurement::manifest::MANIFEST;
use crate::measurement::picture::PictureError;
use crate::paint::ColorTableError;

/// Why something is no measured-paint package. Names the file inside and what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackageError {
    /// The path cannot be opened.
    #[error("{} cannot be opened: {source}", path.display())]
    Open {
        /// What was to be opened.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// No zip archive, or a cut one.
    #[error("the package is no readable zip archive: {reason}")]
    Archive {
        /// What the archive reader says.
        reason: String,
    },
    /// Too many files.
    #[error("the package holds {count} files, accepted are {accepted}")]
    Entries {
        /// How many there are.
        count: usize,
        /// The limit.
        accepted: usize,
    },
    /// A file that is not there.
    #[error("{file} is not in the package{}", instead(inside.as_deref()))]
    Missing {
        /// Name in the package.
        file: String,
        /// A file of this name inside a folder of the package, one of this name in other case, or one that tells what the
        /// archive is instead.
        inside: Option<String>,
    },
    /// A file that is too large, packed or unpacked.
    #[error("{file} has {bytes} bytes or more, accepted are {accepted}")]
    Size {
        /// Name in the package.
        file: String,
        /// How many bytes.
        bytes: u64,
        /// The limit.
        accepted: u64,
    },
    /// A file that cannot be read as what it should be.
    #[error("{file} is damaged: {reason}")]
    Damaged {
        /// Name in the package.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// A field of the manifest.
    #[error("{MANIFEST}: {field} is {value}, accepted is {accepted}")]
    Field {
        /// Path of the field.
        field: String,
        /// The offending value.
        value: String,
        /// What would be accepted.
        accepted: String,
    },
    /// A package of a later format.
    #[error(
        "{MANIFEST}: version is {found}, this carpaint reads up to version {known}: update carpaint"
    )]
    Newer {
        /// Version of the package.
        found: u64,
        /// Latest version that is read.
        known: u64,
    },
    /// A picture that cannot be used.
    #[error("{file}: {source}")]
    Picture {
        /// Name in the package.
        file: String,
        /// What is wrong with it.
        source: PictureError,
    },
    /// A slice with too many dead pixels.
    #[error("{file} has {dead} pixels of {pixels} that are not finite, accepted are 5 %")]
    DeadPixels {
        /// Name in the package.
        file: String,
        /// Pixels with a channel that is not finite.
        dead: usize,
        /// Pixels in all.
        pixels: usize,
    },
    /// The color table's colors.
    #[error("{file}: {source}")]
    ColorTable {
        /// Name in the package.
        file: String,
        /// What is wrong with them.
        source: ColorTableError,
    },
}

impl PackageError {
    /// The file in the package that is wrong, where it is one.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::Open { .. } | Self::Archive { .. } | Self::Entries { .. } => None,
            Self::Field { .. } | Self::Newer { .. } => Some(MANIFEST),
            Self::Missing { file, .. }
            | Self::Size { file, .. }
            | Self::Damaged { file, .. }
            | Self::Picture { file, .. }
            | Self::DeadPixels { file, .. }
            | Self::ColorTable { file, .. } => Some(file),
        }
    }

    /// The field of the manifest that is wrong, where it is one, as a JSON pointer (RFC 6901).
    #[must_use]
    pub fn pointer(&self) -> Option<String> {
        match self {
            Self::Field { field, .. } => {
                let tokens = field.split(['.', '[']).filter(|token| !token.is_empty());
                let tokens = tokens.map(|token| format!("/{}", token.trim_end_matches(']')));
                Some(tokens.collect())
            }
            Self::Newer { .. } => Some("/version".to_owned()),
            _ => None,
        }
    }
}

fn instead(inside: Option<&str>) -> String {
    match inside {
        None => String::new(),
        Some(WORKBOOK) => {
            "; it is the workbook of a spreadsheet: save the sheet of readings as CSV in UTF-8"
                .to_owned()
        }
        Some(inside) if inside.contains('/') => {
            format!("; it holds {inside}: pack what is in the folder, not the folder itself")
        }
        Some(inside) => format!("; it holds {inside}: names are told apart by case"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_of_the_manifest_is_pointed_at() {
        let field = |field: &str| PackageError::Field {
            field: field.to_owned(),
            value: "-1".to_owned(),
            accepted: "above 0".to_owned(),
        };
        for (path, pointer) in [
            ("flakes.theta_h_deg[3]", "/flakes/theta_h_deg/3"),
            (
                "base.model.lobes[0].weight[2]",
                "/base/model/lobes/0/weight/2",
            ),
            ("multi_angle.rows[1][4]", "/multi_angle/rows/1/4"),
            ("name", "/name"),
            ("", ""),
        ] {
            assert_eq!(field(path).pointer().as_deref(), Some(pointer));
            assert_eq!(field(path).file(), Some("paint.json"));
        }
    }
}
