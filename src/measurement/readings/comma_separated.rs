//! Readings as a table of text: a line of column names, then a line for each angle.
//!
//! ```text
//! # illuminant: D50
//! # observer: 10
//! aspecular_deg,L,a,b
//! 15,61.2,-0.4,-2.9
//! ```
//!
//! Columns are those of a package's `multi_angle`: `aspecular_deg` first, then L, a, b or `nm400` … `nm700`, in any order.
//! They are separated by commas, semicolons or tabs, whichever the line of names has; where it is not commas, decimals may
//! have them. Lines that begin with `#` say what a table cannot.

use std::collections::BTreeMap;

use super::{ReadingsFile, as_name, told};
use crate::color::{Illuminant, Observer};
use crate::measurement::MultiAngle;
use crate::measurement::multi_angle::{ASPECULAR_COLUMN, TEXTURE_COLUMNS};
use crate::paint::Limits;

/// Columns of a table, and of those columns that are not read how many are told.
const MOST_COLUMNS: usize = 1000;
const UNKNOWN_TOLD: usize = 8;
/// Characters of a note.
const NOTE_CHARACTERS: usize = 200;
/// What a remark may say beside light, observer, angle and name.
const NOTES: [&str; 5] = [
    "license",
    "instrument",
    "maker",
    "color_code",
    "measured_on",
];
const ACCEPTED_COLUMNS: &str =
    "aspecular_deg first, then L, a, b or spectral columns nm400 to nm700, each once";

/// Why a table holds no readings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CsvError {
    /// A line of column names that are not those of readings, or none.
    #[error("line {line} names the columns {found}, accepted are {ACCEPTED_COLUMNS}")]
    Columns {
        /// Number of the line.
        line: u64,
        /// What it says.
        found: String,
    },
    /// A line that has not one value for each column.
    #[error(
        "line {line} has {found} values, accepted are {columns}, one for each column; where decimals have commas, \
         semicolons or tabs stand between columns"
    )]
    Values {
        /// Number of the line.
        line: u64,
        /// How many values it has.
        found: usize,
        /// How many columns there are.
        columns: usize,
    },
    /// A value that no column of that name has.
    #[error("line {line}, column {column}: the value is {value:?}, accepted is {accepted}")]
    Value {
        /// Number of the line.
        line: u64,
        /// Name of the column.
        column: String,
        /// What stands there.
        value: String,
        /// What may stand there.
        accepted: &'static str,
    },
    /// A remark that says what cannot be.
    #[error("line {line}: {key} is {value:?}, accepted is {accepted}")]
    Remark {
        /// Number of the line.
        line: u64,
        /// What it is about.
        key: String,
        /// What it says.
        value: String,
        /// What it may say.
        accepted: &'static str,
    },
    /// Too many lines, or none.
    #[error("{found} readings, accepted are 1 to {accepted}")]
    Rows {
        /// How many there are, at least.
        found: usize,
        /// The limit.
        accepted: usize,
    },
    /// What the table's reader refuses.
    #[error("{0}")]
    Table(String),
}

/// Whether a line says what a table cannot, in place of being one of the table's.
pub(super) fn is_remark(line: &[u8]) -> bool {
    line.trim_ascii_start()
        .strip_prefix(b"\"")
        .unwrap_or(line)
        .trim_ascii_start()
        .starts_with(b"#")
}

/// What the remarks of a table say.
#[derive(Default)]
struct Remarks {
    name: Option<String>,
    notes: BTreeMap<String, String>,
    illumination_deg: Option<f64>,
    illuminant: Option<Illuminant>,
    observer: Option<Observer>,
    warnings: Vec<String>,
}

pub(super) fn read_csv(text: &str, limits: &Limits) -> Result<ReadingsFile, CsvError> {
    let mut remarks = Remarks::default();
    let (mut before, mut body) = (0_u64, text);
    while let Some((line, rest)) = body
        .split_once('\n')
        .or((!body.is_empty()).then_some((body, "")))
    {
        if is_remark(line.as_bytes()) {
            remarks.read(line, before + 1)?;
        } else if !line.trim().is_empty() {
            break;
        }
        (before, body) = (before + 1, rest);
    }
    let (columns, rows) = table(body, before, limits, &mut remarks.warnings)?;
    let unsaid = [
        (
            "illumination_deg",
            "45",
            remarks.illumination_deg.is_none(),
            true,
        ),
        ("illuminant", "D65", remarks.illuminant.is_none(), false),
        ("observer", "2", remarks.observer.is_none(), false),
    ];
    let of_spectra = columns.iter().any(|name| name.starts_with("nm"));
    let unsaid: Vec<_> = unsaid
        .iter()
        .filter(|said| said.2 && (said.3 || !of_spectra))
        .collect();
    if !unsaid.is_empty() {
        let assumed: Vec<String> = unsaid
            .iter()
            .map(|said| format!("{} {}", said.0, said.1))
            .collect();
        let lines: Vec<String> = unsaid
            .iter()
            .map(|said| format!("'# {}: {}'", said.0, said.1))
            .collect();
        remarks.warnings.push(format!(
            "the table does not say and it was assumed: {}; lines above the columns such as {} say it",
            assumed.join(", "),
            lines.join(", ")
        ));
    }
    Ok(ReadingsFile {
        name: remarks.name,
        notes: remarks.notes,
        readings: MultiAngle {
            illumination_deg: remarks.illumination_deg.unwrap_or(45.0),
            illuminant: remarks.illuminant.unwrap_or(Illuminant::D65),
            observer: remarks.observer.unwrap_or(Observer::Two),
            columns,
            rows,
        },
        warnings: remarks.warnings,
    })
}

impl Remarks {
    fn read(&mut self, text: &str, line: u64) -> Result<(), CsvError> {
        // A spreadsheet fills such a line up with separators, and may quote it.
        let text = text
            .trim()
            .trim_end_matches([',', ';', '\t'])
            .trim_matches('"');
        let Some((key, value)) = text.trim_start_matches(['#', ' ']).split_once(':') else {
            return Ok(());
        };
        let (key, value) = (key.trim(), value.trim());
        let refuse = |accepted: &'static str| CsvError::Remark {
            line,
            key: told(key),
            value: told(value),
            accepted,
        };
        match key {
            "name" => {
                let name = as_name(value);
                self.name = Some(name.ok_or_else(|| refuse("1 to 200 printable characters"))?);
            }
            "illuminant" => {
                self.illuminant = Some(match value {
                    "D65" => Illuminant::D65,
                    "D50" => Illuminant::D50,
                    _ => return Err(refuse("D65 or D50")),
                });
            }
            "observer" => {
                self.observer = Some(match value.trim_end_matches('°') {
                    "2" => Observer::Two,
                    "10" => Observer::Ten,
                    _ => return Err(refuse("2 or 10")),
                });
            }
            "illumination_deg" => {
                let angle = value.parse().ok().filter(|v| (0.0..90.0).contains(v));
                self.illumination_deg =
                    Some(angle.ok_or_else(|| {
                        refuse("degrees from 0 to below 90, with a decimal point")
                    })?);
            }
            key if NOTES.contains(&key) => {
                if value.chars().count() > NOTE_CHARACTERS || value.chars().any(char::is_control) {
                    return Err(refuse("up to 200 printable characters"));
                }
                self.notes.insert(key.to_owned(), value.to_owned());
            }
            _ if self.warnings.len() < UNKNOWN_TOLD => self.warnings.push(format!(
                "line {line}: {:?} is nothing that a table of readings says, and was not read",
                told(key)
            )),
            _ => {}
        }
        Ok(())
    }
}

/// Names of the columns that are read, and a row for each line.
fn table(
    body: &str,
    before: u64,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<(Vec<String>, Vec<Vec<f64>>), CsvError> {
    let head = body.lines().next().unwrap_or_default();
    let separator = [b';', b'\t']
        .into_iter()
        .find(|s| head.as_bytes().contains(s))
        .unwrap_or(b',');
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(body.as_bytes());
    let mut records = reader.records();
    let broken = |error: csv::Error| CsvError::Table(error.to_string());
    let line_of =
        |record: &csv::StringRecord| before + record.position().map_or(1, csv::Position::line);
    let names = records
        .next()
        .transpose()
        .map_err(broken)?
        .unwrap_or_default();
    let line = line_of(&names);
    let mut columns: Vec<(usize, String)> = Vec::new();
    let mut unknown = Vec::new();
    for (at, name) in names.iter().enumerate().take(MOST_COLUMNS) {
        let known = [ASPECULAR_COLUMN, "L", "a", "b"].contains(&name)
            || TEXTURE_COLUMNS.contains(&name)
            || name.starts_with("nm");
        if known {
            columns.push((at, name.to_owned()));
        } else {
            unknown.push(format!("{:?}", told(name)));
        }
    }
    let kept: Vec<String> = columns.iter().map(|column| column.1.clone()).collect();
    let mut sorted = kept.clone();
    sorted.sort();
    let twice = sorted.windows(2).any(|pair| pair[0] == pair[1]);
    if names.len() > MOST_COLUMNS || twice || !MultiAngle::are_readings(&kept) || columns[0].0 != 0
    {
        let found: Vec<&str> = names.iter().take(UNKNOWN_TOLD).collect();
        let found = format!("{:?}", told(&found.join(", ")));
        return Err(CsvError::Columns { line, found });
    }
    if !unknown.is_empty() {
        warnings.push(format!(
            "line {line}: {} of the columns are none of readings and were not read: {}",
            unknown.len(),
            unknown
                .iter()
                .take(UNKNOWN_TOLD)
                .cloned()
                .collect::<Vec<_>>()
                .join(", ")
        ));
    }
    let mut rows = Vec::new();
    for record in records {
        let record = record.map_err(broken)?;
        let line = line_of(&record);
        // A spreadsheet leaves lines of separators below a table.
        if record.iter().all(str::is_empty) {
            continue;
        }
        if record.len() != names.len() {
            return Err(CsvError::Values {
                line,
                found: record.len(),
                columns: names.len(),
            });
        }
        if rows.len() == limits.angles {
            return Err(CsvError::Rows {
                found: rows.len() + 1,
                accepted: limits.angles,
            });
        }
        let cell = |(at, column): &(usize, String)| {
            number(
                record.get(*at).unwrap_or_default(),
                separator != b',',
                column,
            )
            .map_err(|accepted| CsvError::Value {
                line,
                column: column.clone(),
                value: told(record.get(*at).unwrap_or_default()),
                accepted,
            })
        };
        rows.push(columns.iter().map(cell).collect::<Result<Vec<f64>, _>>()?);
    }
    if rows.is_empty() {
        return Err(CsvError::Rows {
            found: 0,
            accepted: limits.angles,
        });
    }
    Ok((kept, rows))
}

/// The number that a cell of a column holds, or what it should.
fn number(cell: &str, decimal_comma: bool, column: &str) -> Result<f64, &'static str> {
    let with_point = (decimal_comma && !cell.contains('.')).then(|| cell.replacen(',', ".", 1));
    let (low, high, accepted) = if column == ASPECULAR_COLUMN {
        (-90.0, 180.0, "an aspecular angle from -90 to 180 degrees")
    } else {
        (
            -1e6,
            1e6,
            "a number from -1000000 to 1000000, with a decimal point where commas stand between columns",
        )
    };
    let value: Result<f64, _> = with_point.as_deref().unwrap_or(cell).parse();
    value
        .ok()
        .filter(|v| (low..=high).contains(v))
        .ok_or(accepted)
}
