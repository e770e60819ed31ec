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
//! have them. Lines that begin with `#` say what a table cannot, wherever they stand. Cells of texture may be empty.

mod error;
mod remarks;

pub use self::error::CsvError;
use self::remarks::Remarks;
use super::{ReadingsFile, counted, told};
use crate::color::{Illuminant, Observer};
use crate::measurement::MultiAngle;
use crate::measurement::multi_angle::{ASPECULAR_COLUMN, TEXTURE_COLUMNS, most_readings};
use crate::paint::Limits;

/// Columns of a table, and of those columns that are not read how many are told.
const MOST_COLUMNS: usize = 1000;
const UNKNOWN_TOLD: usize = 8;
/// Bytes of one line.
const LINE_BYTES: usize = 64 << 10;

/// Whether a line says what a table cannot, in place of being one of the table's.
pub(super) fn is_remark(line: &[u8]) -> bool {
    line.trim_ascii_start()
        .strip_prefix(b"\"")
        .unwrap_or(line)
        .trim_ascii_start()
        .starts_with(b"#")
}

/// Whether a line is one of numbers, as a table without names begins.
pub(super) fn is_of_numbers(line: &[u8]) -> bool {
    let separators = line.iter().filter(|b| matches!(b, b',' | b';' | b'\t'));
    let of_numbers = |b: &u8| b.is_ascii_digit() || b" \",;\t.+-eE".contains(b);
    separators.count() >= 3
        && line.iter().any(u8::is_ascii_digit)
        && line.len() < 4000
        && line.iter().all(of_numbers)
}

pub(super) fn read_csv(text: &str, limits: &Limits) -> Result<ReadingsFile, CsvError> {
    let mut remarks = Remarks::default();
    let (columns, rows) = table(text, limits, &mut remarks)?;
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
    let readings = MultiAngle {
        illumination_deg: remarks.illumination_deg.unwrap_or(45.0),
        illuminant: remarks.illuminant.unwrap_or(Illuminant::D65),
        observer: remarks.observer.unwrap_or(Observer::Two),
        columns,
        rows,
    };
    let of_spectra = readings.takes_spectra();
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
    if remarks.untold > 0 {
        remarks.warnings.push(format!(
            "{} more {} nothing that a table of readings says, and {} not read",
            remarks.untold,
            counted(remarks.untold, "remark is", "remarks are"),
            counted(remarks.untold, "was", "were"),
        ));
    }
    Ok(ReadingsFile {
        name: remarks.name,
        asked_by_id: false,
        notes: remarks.notes,
        readings,
        warnings: remarks.warnings,
    })
}

/// Lines with their numbers, whichever way they end.
fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    let mut rest = Some(text);
    let lines = std::iter::from_fn(move || {
        let text = rest.filter(|text| !text.is_empty())?;
        let Some((line, after)) = text.split_once(['\n', '\r']) else {
            return rest.take();
        };
        let is_pair = text.as_bytes()[line.len()] == b'\r' && after.starts_with('\n');
        rest = Some(&after[usize::from(is_pair)..]);
        Some(line)
    });
    (1..).zip(lines)
}

/// The columns of a table that are read.
struct Head {
    separator: char,
    /// How many columns the table has.
    width: usize,
    /// Place and name of those that are read.
    columns: Vec<(usize, String)>,
}

/// Names of the columns that are read, and a row for each line.
fn table(
    text: &str,
    limits: &Limits,
    remarks: &mut Remarks,
) -> Result<(Vec<String>, Vec<Vec<f64>>), CsvError> {
    let accepted = most_readings(limits);
    let (mut head, mut rows): (Option<Head>, Vec<Vec<f64>>) = (None, Vec::new());
    for (line, text) in lines(text) {
        let is_remark = is_remark(text.as_bytes());
        // A spreadsheet leaves lines of separators below a table.
        let is_empty = text
            .chars()
            .all(|c| c.is_whitespace() || matches!(c, ',' | ';' | '"'));
        if is_empty && !is_remark {
            continue;
        }
        if text.len() > LINE_BYTES {
            return Err(CsvError::Line {
                line,
                bytes: text.len(),
                accepted: LINE_BYTES,
            });
        }
        if is_remark {
            remarks.read(text, line)?;
        } else if let Some(head) = &head {
            if rows.len() == accepted {
                let found = accepted + 1;
                return Err(CsvError::Rows { found, accepted });
            }
            rows.push(row(text, line, head)?);
        } else {
            head = Some(head_of(text, line, &mut remarks.warnings)?);
        }
    }
    let Some(head) = head else {
        let found = "\"\"".to_owned();
        return Err(CsvError::Columns { line: 1, found });
    };
    if rows.is_empty() {
        return Err(CsvError::Rows { found: 0, accepted });
    }
    let names = head.columns.into_iter().map(|column| column.1).collect();
    Ok((names, rows))
}

/// The columns that a line names.
fn head_of(text: &str, line: u64, warnings: &mut Vec<String>) -> Result<Head, CsvError> {
    if is_of_numbers(text.as_bytes()) {
        let found = format!("{:?}", told(text.trim()));
        return Err(CsvError::Unnamed { line, found });
    }
    let separator = [';', '\t'].into_iter().find(|s| text.contains(*s));
    let separator = separator.unwrap_or(',');
    let refuse = |names: &str| CsvError::Columns {
        line,
        found: format!("{:?}", told(names)),
    };
    if text.matches(separator).count() >= MOST_COLUMNS {
        return Err(refuse(text));
    }
    let names = cells(text, line, separator)?;
    let mut columns: Vec<(usize, String)> = Vec::new();
    let mut unknown = Vec::new();
    for (at, name) in names.iter().enumerate() {
        match known(name, &names) {
            Some(name) => columns.push((at, name)),
            None => unknown.push(format!("{:?}", told(name))),
        }
    }
    let kept: Vec<String> = columns.iter().map(|column| column.1.clone()).collect();
    let mut sorted = kept.clone();
    sorted.sort();
    let twice = sorted.windows(2).any(|pair| pair[0] == pair[1]);
    let first = columns.first().map(|column| column.0);
    if twice || !MultiAngle::are_readings(&kept) || first != Some(0) {
        let found: Vec<&str> = names.iter().take(UNKNOWN_TOLD).collect();
        return Err(refuse(&found.join(", ")));
    }
    if !unknown.is_empty() {
        let count = unknown.len();
        unknown.truncate(UNKNOWN_TOLD);
        warnings.push(format!(
            "line {line}: {count} of the columns {} not read: {}",
            counted(
                count,
                "is none of readings and was",
                "are none of readings and were"
            ),
            unknown.join(", ")
        ));
    }
    Ok(Head {
        separator,
        width: names.len(),
        columns,
    })
}

/// The column of readings that a name is, in whichever case its letters are where no other column has them right.
fn known(name: &str, all: &csv::StringRecord) -> Option<String> {
    let exact = [ASPECULAR_COLUMN, "L", "a", "b"];
    if name.starts_with("nm") {
        return Some(name.to_owned());
    }
    let is_of_nm = |rest: &str| rest.starts_with(|c: char| c.is_ascii_digit());
    if let Some(rest) = ["NM", "Nm", "nM"]
        .iter()
        .find_map(|nm| name.strip_prefix(nm))
        && is_of_nm(rest)
    {
        return Some(format!("nm{rest}"));
    }
    let mut columns = exact.into_iter().chain(TEXTURE_COLUMNS);
    let column = columns.find(|column| column.eq_ignore_ascii_case(name))?;
    (column == name || !all.iter().any(|other| other == column)).then(|| column.to_owned())
}

/// The cells of a line.
fn cells(text: &str, line: u64, separator: char) -> Result<csv::StringRecord, CsvError> {
    if text.matches('"').count() % 2 == 1 {
        return Err(CsvError::Quotes { line });
    }
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(if separator == ';' {
            b';'
        } else if separator == '\t' {
            b'\t'
        } else {
            b','
        })
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let record = reader.records().next().transpose();
    Ok(record
        .map_err(|error| CsvError::Table(error.to_string()))?
        .unwrap_or_default())
}

/// The numbers of a line.
fn row(text: &str, line: u64, head: &Head) -> Result<Vec<f64>, CsvError> {
    let columns = head.width;
    let refuse = |found| CsvError::Values {
        line,
        found,
        columns,
    };
    let separators = text.matches(head.separator).count();
    if separators >= MOST_COLUMNS {
        return Err(refuse(separators + 1));
    }
    let cells = cells(text, line, head.separator)?;
    if cells.len() != columns {
        return Err(refuse(cells.len()));
    }
    let cell = |(at, column): &(usize, String)| {
        let cell = cells.get(*at).unwrap_or_default();
        if cell.is_empty() && TEXTURE_COLUMNS.contains(&column.as_str()) {
            return Ok(f64::NAN);
        }
        number(cell, head.separator != ',', column).map_err(|accepted| CsvError::Value {
            line,
            column: column.clone(),
            value: told(cell),
            accepted,
        })
    };
    head.columns.iter().map(cell).collect()
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
