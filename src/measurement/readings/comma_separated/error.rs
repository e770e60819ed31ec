//! Why a table of readings is refused.

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
    /// A table whose first line is one of numbers.
    #[error(
        "line {line} is {found}, accepted is a first line that names the columns: {ACCEPTED_COLUMNS}"
    )]
    Unnamed {
        /// Number of the line.
        line: u64,
        /// What it says.
        found: String,
    },
    /// A line of more than any table's.
    #[error("line {line} has {bytes} bytes, accepted are {accepted}")]
    Line {
        /// Number of the line.
        line: u64,
        /// Its length.
        bytes: usize,
        /// The limit.
        accepted: usize,
    },
    /// A quote that its line does not end.
    #[error(
        "line {line} begins a quote that does not end, accepted are cells whose quotes end on their line"
    )]
    Quotes {
        /// Number of the line.
        line: u64,
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
    /// Remarks that contradict each other.
    #[error(
        "line {line}: {key} is {value:?}, line {before_line} says {before:?}, accepted is one value"
    )]
    Contradiction {
        /// Number of the line.
        line: u64,
        /// What it is about.
        key: String,
        /// What it says.
        value: String,
        /// Number of the line that said it before.
        before_line: u64,
        /// What that line says.
        before: String,
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
