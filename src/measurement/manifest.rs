//! `paint.json`, the manifest of a measured-paint package: what it says, checked field by field.
//!
//! A refusal names the field as a path, the value and what is accepted. A key that stands twice is refused. One that the
//! format does not know is not, since labs keep notes of their own, but it is told, since it may be a misspelt one.

mod base;
mod field;
mod readings;
mod slices;
mod unique;

pub use self::base::TableLayout;
use self::base::base;
pub(super) use self::base::{BaseEntry, TableEntry};
use self::field::Field;
use self::readings::multi_angle;
pub(super) use self::slices::FlakesEntry;
use self::slices::flakes;
use self::unique::Unique;
use super::multi_angle::MultiAngle;
use super::package::PackageError;
use crate::paint::{Coat, Limits};

/// Name of the manifest in every package.
pub const MANIFEST: &str = "paint.json";
/// Latest version of the format that is read.
const VERSION: u64 = 1;

/// What a manifest says.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Manifest {
    pub name: String,
    pub notes: std::collections::BTreeMap<String, String>,
    pub coat: Option<Coat>,
    pub base: Option<BaseEntry>,
    pub flakes: Option<FlakesEntry>,
    pub multi_angle: Option<MultiAngle>,
    pub warnings: Vec<String>,
}

impl Manifest {
    /// Reads a manifest.
    pub(super) fn parse(bytes: &[u8], limits: &Limits) -> Result<Self, PackageError> {
        // Some editors put a byte order mark before the text.
        let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
        let Unique(value) = serde_json::from_slice(bytes).map_err(|error| {
            let reason = if error.is_data() {
                error.to_string()
            } else {
                format!("no JSON: {error}")
            };
            PackageError::Damaged {
                file: MANIFEST.into(),
                reason,
            }
        })?;
        let root = Field {
            path: String::new(),
            value: &value,
        };
        let mut warnings = Vec::new();
        let notes = [
            "license",
            "instrument",
            "maker",
            "color_code",
            "measured_on",
        ];
        let keys = [
            "format",
            "version",
            "name",
            "color_space",
            "clear_coat",
            "base",
            "flakes",
            "multi_angle",
        ];
        let format = root.want("format", "\"measured-paint\"")?;
        if format.text()? != "measured-paint" {
            return format.refuse("\"measured-paint\"");
        }
        let version = root.want("version", "1")?;
        match version.value.as_u64() {
            Some(VERSION) => {}
            Some(found) if found > VERSION => {
                return Err(PackageError::Newer {
                    found,
                    known: VERSION,
                });
            }
            _ => return version.refuse("1"),
        }
        root.object(&[&keys[..], &notes[..]].concat(), &mut warnings)?;
        let name = root.want("name", "a string of 1 to 200 printable characters")?;
        let printable = !name.text()?.chars().any(char::is_control);
        if !(1..=200).contains(&name.text()?.chars().count()) || !printable {
            return name.refuse("a string of 1 to 200 printable characters");
        }
        let space = root.want("color_space", "\"linear-srgb-d65\"")?;
        if space.text()? != "linear-srgb-d65" {
            return space.refuse("\"linear-srgb-d65\"");
        }
        let mut kept = std::collections::BTreeMap::new();
        for key in notes {
            if let Some(note) = root.get(key) {
                kept.insert(key.to_owned(), note.text()?.to_owned());
            }
        }
        let coat = root
            .get("clear_coat")
            .map(|f| coat(&f, &mut warnings))
            .transpose()?;
        let base = root
            .get("base")
            .map(|f| base(&f, limits, &mut warnings))
            .transpose()?;
        let flakes = root
            .get("flakes")
            .map(|f| flakes(&f, limits, &mut warnings))
            .transpose()?;
        let multi_angle = root
            .get("multi_angle")
            .map(|f| multi_angle(&f, limits, &mut warnings))
            .transpose()?;
        if base.is_none() && multi_angle.is_none() {
            root.want(
                "base",
                "an object with model or brdf_table, where there is no multi_angle",
            )?;
        }
        Ok(Self {
            name: name.text()?.to_owned(),
            notes: kept,
            coat,
            base,
            flakes,
            multi_angle,
            warnings,
        })
    }
}

fn coat(field: &Field, warnings: &mut Vec<String>) -> Result<Coat, PackageError> {
    field.object(&["ior", "thickness_um"], warnings)?;
    let ior = field.want("ior", "1 to 4")?.number(1.0, 4.0, "1 to 4")?;
    let thickness = field
        .get("thickness_um")
        .map(|f| f.number(0.0, 1e6, "0 to 1000000"))
        .transpose()?;
    Ok(Coat {
        thickness_um: thickness,
        ..Coat::smooth(ior)
    })
}
