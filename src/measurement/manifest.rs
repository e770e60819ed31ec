//! `paint.json`, the manifest of a measured-paint package: what it says, checked field by field.
//!
//! A refusal names the field as a path, the value and what is accepted. A key that the format does not know is not
//! refused, since labs keep notes of their own, but it is told, since it may be a misspelt one.

use serde_json::Value;

use super::package::PackageError;
use crate::color::{Illuminant, LinearRgb, Observer};
use crate::paint::{AngleGrid, Coat, Limits, Lobe, MAX_ALPHA, MAX_WEIGHT};

/// Name of the manifest in every package.
pub(super) const MANIFEST: &str = "paint.json";
/// Latest version of the format that is read.
const VERSION: u64 = 1;

/// Unknown keys of one object that are told one by one.
const UNKNOWN_TOLD: usize = 8;

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

/// The base as the manifest describes it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum BaseEntry {
    Model {
        diffuse: LinearRgb,
        lobes: Vec<Lobe>,
        color_table: Option<TableEntry>,
    },
    Table {
        file: String,
        layout: TableLayout,
        header_bytes: u64,
    },
}

/// The color table's picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TableEntry {
    pub file: String,
    pub theta_h: AngleGrid,
    pub theta_d: AngleGrid,
}

/// The slices' pictures.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FlakesEntry {
    pub pattern: SlicePattern,
    pub theta_h: AngleGrid,
    pub theta_d: AngleGrid,
    pub texel_um: f64,
    pub size: [u32; 2],
}

/// Layout of a package's BRDF table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableLayout {
    /// 180 x 90 x 90 x RGB, little-endian `f32`.
    Mpi2005,
    /// Three dimensions and three planes of little-endian `f64`.
    Merl,
}

/// Readings of a portable multi-angle instrument, as they came.
#[derive(Clone, Debug, PartialEq)]
pub struct MultiAngle {
    /// Angle of the light from the normal, in air, degrees.
    pub illumination_deg: f64,
    /// Light that L, a, b hold for.
    pub illuminant: Illuminant,
    /// Observer that L, a, b hold for.
    pub observer: Observer,
    /// Names of the columns; the first is `aspecular_deg`.
    pub columns: Vec<String>,
    /// One number per column.
    pub rows: Vec<Vec<f64>>,
}

/// Names of the slices: a path with the indices of θh and θd in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SlicePattern(Vec<Piece>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum Piece {
    Text(String),
    ThetaH(usize),
    ThetaD(usize),
}

impl SlicePattern {
    fn parse(pattern: &str) -> Option<Self> {
        let mut pieces = Vec::new();
        let mut rest = pattern;
        while let Some((text, tail)) = rest.split_once('{') {
            let (field, tail) = tail.split_once('}')?;
            pieces.push(Piece::Text(text.to_owned()));
            let (axis, width) = field.split_once(':').unwrap_or((field, "0"));
            let width = width.parse().ok().filter(|w| *w <= 9)?;
            pieces.push(match axis {
                "h" => Piece::ThetaH(width),
                "i" => Piece::ThetaD(width),
                _ => return None,
            });
            rest = tail;
        }
        pieces.push(Piece::Text(rest.to_owned()));
        let has = |wanted: fn(&Piece) -> bool| pieces.iter().any(wanted);
        (has(|p| matches!(p, Piece::ThetaH(_))) && has(|p| matches!(p, Piece::ThetaD(_))))
            .then_some(Self(pieces))
    }

    /// Name of one slice.
    pub(super) fn name(&self, theta_h: usize, theta_d: usize) -> String {
        use std::fmt::Write as _;
        let mut name = String::new();
        for piece in &self.0 {
            match piece {
                Piece::Text(text) => name.push_str(text),
                Piece::ThetaH(width) => _ = write!(name, "{theta_h:0width$}"),
                Piece::ThetaD(width) => _ = write!(name, "{theta_d:0width$}"),
            }
        }
        name
    }
}

/// A value of the manifest and the path to it.
struct Field<'a> {
    path: String,
    value: &'a Value,
}

impl<'a> Field<'a> {
    fn refuse<T>(&self, accepted: impl Into<String>) -> Result<T, PackageError> {
        let mut value = self.value.to_string();
        if value.len() > 60 {
            value = value.chars().take(57).chain("...".chars()).collect();
        }
        Err(PackageError::Field {
            field: self.path.clone(),
            value,
            accepted: accepted.into(),
        })
    }

    fn get(&self, key: &str) -> Option<Field<'a>> {
        let value = self.value.get(key).filter(|v| !v.is_null())?;
        let path = if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        };
        Some(Field { path, value })
    }

    fn want(&self, key: &str, accepted: &str) -> Result<Field<'a>, PackageError> {
        let field = if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        };
        let missing = || PackageError::Field {
            field,
            value: "missing".into(),
            accepted: accepted.into(),
        };
        self.get(key).ok_or_else(missing)
    }

    fn object(&self, keys: &[&str], warnings: &mut Vec<String>) -> Result<(), PackageError> {
        let Value::Object(map) = self.value else {
            return self.refuse(format!("an object with {}", keys.join(", ")));
        };
        let place = if self.path.is_empty() {
            String::new()
        } else {
            format!(" in {}", self.path)
        };
        let mut unknown = map.keys().filter(|key| !keys.contains(&key.as_str()));
        for key in unknown.by_ref().take(UNKNOWN_TOLD) {
            let key: String = key.chars().take(80).collect();
            warnings.push(format!(
                "{MANIFEST}: {key:?}{place} is no key of the format and was not read"
            ));
        }
        let more = unknown.count();
        if more > 0 {
            warnings.push(format!(
                "{MANIFEST}: {more} more keys{place} are none of the format and were not read"
            ));
        }
        Ok(())
    }

    fn list(&self, most: usize, what: &str) -> Result<Vec<Field<'a>>, PackageError> {
        let Value::Array(items) = self.value else {
            return self.refuse(format!("a list of {what}"));
        };
        if items.len() > most {
            let value = format!("{} entries", items.len());
            return Err(PackageError::Field {
                field: self.path.clone(),
                value,
                accepted: format!("at most {most}"),
            });
        }
        let item = |(k, value)| Field {
            path: format!("{}[{k}]", self.path),
            value,
        };
        Ok(items.iter().enumerate().map(item).collect())
    }

    fn text(&self) -> Result<&'a str, PackageError> {
        self.value
            .as_str()
            .map_or_else(|| self.refuse("a string"), Ok)
    }

    fn number(&self, low: f64, high: f64, accepted: &str) -> Result<f64, PackageError> {
        match self.value.as_f64() {
            Some(value) if (low..=high).contains(&value) => Ok(value),
            _ => self.refuse(accepted),
        }
    }

    fn whole(&self, low: u64, high: u64) -> Result<u64, PackageError> {
        match self.value.as_u64() {
            Some(value) if (low..=high).contains(&value) => Ok(value),
            _ => self.refuse(format!("a whole number from {low} to {high}")),
        }
    }

    /// A number for all channels, or three.
    fn channels(&self) -> Result<LinearRgb, PackageError> {
        let accepted = "a number from 0 to 1000, or three of them";
        match self.value {
            Value::Array(items) if items.len() == 3 => {
                let items = self.list(3, "numbers")?;
                let mut rgb = [0.0; 3];
                for (channel, item) in rgb.iter_mut().zip(items) {
                    *channel = item.number(0.0, MAX_WEIGHT, accepted)?;
                }
                Ok(rgb)
            }
            _ => Ok([self.number(0.0, MAX_WEIGHT, accepted)?; 3]),
        }
    }

    fn angles(&self, limits: &Limits) -> Result<AngleGrid, PackageError> {
        let mut degrees = Vec::new();
        for item in self.list(limits.angles, "angles in degrees")? {
            degrees.push(item.number(0.0, 90.0, "an angle from 0 to 90 degrees")?);
        }
        AngleGrid::new(degrees).map_err(|error| PackageError::Field {
            field: self.path.clone(),
            value: error.to_string(),
            accepted: "strictly ascending angles from 0 to 90 degrees, at least one".into(),
        })
    }

    /// Name of a file of the package.
    fn file(&self) -> Result<String, PackageError> {
        let name = self.text()?;
        if name.is_empty() || name.len() > 1000 {
            return self.refuse("the name of a file in the package");
        }
        Ok(name.to_owned())
    }
}

impl Manifest {
    /// Reads a manifest.
    pub(super) fn parse(bytes: &[u8], limits: &Limits) -> Result<Self, PackageError> {
        let value: Value =
            serde_json::from_slice(bytes).map_err(|error| PackageError::Damaged {
                file: MANIFEST.into(),
                reason: format!("no JSON: {error}"),
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

fn base(
    field: &Field,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<BaseEntry, PackageError> {
    field.object(&["model", "brdf_table"], warnings)?;
    match (field.get("model"), field.get("brdf_table")) {
        (Some(model), None) => model_base(&model, limits, warnings),
        (None, Some(table)) => {
            table.object(&["file", "layout", "header_bytes"], warnings)?;
            let layout = table.want("layout", "\"mpi-2005\" or \"merl\"")?;
            let layout = match layout.text()? {
                "mpi-2005" => TableLayout::Mpi2005,
                "merl" => TableLayout::Merl,
                _ => return layout.refuse("\"mpi-2005\" or \"merl\""),
            };
            let header_bytes = table
                .get("header_bytes")
                .map_or(Ok(0), |f| f.whole(0, 1 << 20))?;
            Ok(BaseEntry::Table {
                file: table.want("file", "the name of a file")?.file()?,
                layout,
                header_bytes,
            })
        }
        _ => field.refuse("exactly one of model and brdf_table"),
    }
}

fn model_base(
    model: &Field,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<BaseEntry, PackageError> {
    model.object(&["diffuse", "lobes", "color_table"], warnings)?;
    let diffuse = model
        .want("diffuse", "a number from 0 to 1000, or three of them")?
        .channels()?;
    let list = model.want("lobes", "1 to 8 lobes")?;
    let mut lobes = Vec::new();
    for lobe in list.list(limits.lobes, "lobes")? {
        lobe.object(&["weight", "alpha", "f0"], warnings)?;
        let accepted = "above 0, to 10";
        lobes.push(Lobe {
            weight: lobe
                .want("weight", "a number from 0 to 1000, or three of them")?
                .channels()?,
            alpha: lobe
                .want("alpha", accepted)?
                .number(f64::MIN_POSITIVE, MAX_ALPHA, accepted)?,
            f0: lobe.want("f0", "0 to 1")?.number(0.0, 1.0, "0 to 1")?,
        });
    }
    if lobes.is_empty() {
        return list.refuse(format!("1 to {} lobes", limits.lobes));
    }
    let table = |field: Field| {
        field.object(&["file", "theta_h_deg", "theta_i_deg"], warnings)?;
        Ok(TableEntry {
            file: field.want("file", "the name of a file")?.file()?,
            theta_h: field
                .want("theta_h_deg", "a list of angles")?
                .angles(limits)?,
            theta_d: field
                .want("theta_i_deg", "a list of angles")?
                .angles(limits)?,
        })
    };
    let color_table = model.get("color_table").map(table).transpose()?;
    Ok(BaseEntry::Model {
        diffuse,
        lobes,
        color_table,
    })
}

fn flakes(
    field: &Field,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<FlakesEntry, PackageError> {
    field.object(
        &[
            "slices",
            "theta_h_deg",
            "theta_i_deg",
            "texel_um",
            "size_px",
        ],
        warnings,
    )?;
    let accepted = "a path with {h:02} and {i:02} in it";
    let slices = field.want("slices", accepted)?;
    let Some(pattern) = SlicePattern::parse(&slices.file()?) else {
        return slices.refuse(accepted);
    };
    let size = field.want("size_px", "[width, height]")?;
    let sides = size.list(2, "two numbers")?;
    let [width, height] = &sides[..] else {
        return size.refuse("[width, height]");
    };
    let side = |f: &Field| {
        Ok(u32::try_from(f.whole(1, limits.slice_pixels.min(1 << 24))?).unwrap_or(u32::MAX))
    };
    let (width, height) = (side(width)?, side(height)?);
    if u64::from(width) * u64::from(height) > limits.slice_pixels {
        return size.refuse(format!("at most {} pixels", limits.slice_pixels));
    }
    let theta_h = field
        .want("theta_h_deg", "a list of angles")?
        .angles(limits)?;
    let theta_d = field
        .want("theta_i_deg", "a list of angles")?
        .angles(limits)?;
    let places = (0..theta_h.len()).flat_map(|h| (0..theta_d.len()).map(move |d| (h, d)));
    let mut names = std::collections::HashSet::new();
    for name in places.map(|(h, d)| pattern.name(h, d)) {
        if let Some(twice) = names.replace(name) {
            return slices.refuse(format!(
                "a path that names every slice otherwise, which {accepted} does; two would be {twice:?}"
            ));
        }
    }
    Ok(FlakesEntry {
        pattern,
        theta_h,
        theta_d,
        texel_um: field.want("texel_um", "above 0, to 100000")?.number(
            f64::MIN_POSITIVE,
            1e5,
            "above 0, to 100000",
        )?,
        size: [width, height],
    })
}

fn multi_angle(
    field: &Field,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<MultiAngle, PackageError> {
    field.object(
        &[
            "illumination_deg",
            "illuminant",
            "observer",
            "columns",
            "rows",
        ],
        warnings,
    )?;
    let illuminant = field.want("illuminant", "\"D65\" or \"D50\"")?;
    let observer = field.want("observer", "\"2\" or \"10\"")?;
    let list = field.want("columns", "a list of names, the first aspecular_deg")?;
    let mut columns = Vec::new();
    for column in list.list(1000, "names")? {
        columns.push(column.text()?.to_owned());
    }
    let has = |name: &str| columns.iter().any(|c| c == name);
    let colors = has("L") && has("a") && has("b") || columns.iter().any(|c| c.starts_with("nm"));
    if columns.first().map(String::as_str) != Some("aspecular_deg") || !colors {
        return list.refuse("aspecular_deg first, then L, a, b or spectral columns nm400 to nm700");
    }
    let mut rows = Vec::new();
    for row in field
        .want("rows", "a list of rows")?
        .list(limits.angles, "rows")?
    {
        let cells = row.list(columns.len(), "numbers")?;
        if cells.len() != columns.len() {
            return row.refuse(format!("{} numbers, one per column", columns.len()));
        }
        let number = |f: &Field| f.number(-1e6, 1e6, "a number from -1000000 to 1000000");
        let angle = cells[0].number(-90.0, 180.0, "an aspecular angle from -90 to 180 degrees")?;
        let rest = cells[1..].iter().map(number);
        rows.push(
            std::iter::once(Ok(angle))
                .chain(rest)
                .collect::<Result<Vec<f64>, _>>()?,
        );
    }
    Ok(MultiAngle {
        illumination_deg: field
            .want("illumination_deg", "0 to 90")?
            .number(0.0, 90.0, "0 to 90")?,
        illuminant: match illuminant.text()? {
            "D65" => Illuminant::D65,
            "D50" => Illuminant::D50,
            _ => return illuminant.refuse("\"D65\" or \"D50\""),
        },
        observer: match observer.text()? {
            "2" => Observer::Two,
            "10" => Observer::Ten,
            _ => return observer.refuse("\"2\" or \"10\""),
        },
        columns,
        rows,
    })
}
