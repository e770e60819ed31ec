//! Lines of a table that say what its columns cannot: `# illuminant: D50`.

use std::collections::BTreeMap;

use super::{CsvError, UNKNOWN_TOLD};
use crate::color::{Illuminant, Observer};
use crate::measurement::readings::{NOTE_CHARACTERS, as_name, told};

/// What a remark may say of the readings.
const KEYS: [&str; 4] = ["name", "illuminant", "observer", "illumination_deg"];
/// What else it may say.
const NOTES: [&str; 5] = [
    "license",
    "instrument",
    "maker",
    "color_code",
    "measured_on",
];

/// What the remarks of a table say.
#[derive(Default)]
pub(super) struct Remarks {
    pub name: Option<String>,
    pub notes: BTreeMap<String, String>,
    pub illumination_deg: Option<f64>,
    pub illuminant: Option<Illuminant>,
    pub observer: Option<Observer>,
    pub warnings: Vec<String>,
    /// Remarks that were not read and are not among the warnings.
    pub untold: usize,
    /// Line and value of what was said, by what it is about.
    said: BTreeMap<String, (u64, String)>,
}

impl Remarks {
    pub fn read(&mut self, text: &str, line: u64) -> Result<(), CsvError> {
        // A spreadsheet fills such a line up with separators, and may quote it.
        let text = text
            .trim()
            .trim_end_matches([',', ';', '\t'])
            .trim_matches('"');
        let Some((key, value)) = text.trim_start_matches(['#', ' ']).split_once(':') else {
            return Ok(());
        };
        let (said_key, value) = (key.trim(), value.trim());
        let key = &*said_key.to_ascii_lowercase();
        let refuse = |accepted: &'static str| CsvError::Remark {
            line,
            key: told(key),
            value: told(value),
            accepted,
        };
        let is_known = KEYS.contains(&key) || NOTES.contains(&key);
        if let Some((before_line, before)) = self.said.get(key) {
            if says_another(before, value) {
                return Err(CsvError::Contradiction {
                    line,
                    key: told(key),
                    value: told(value),
                    before_line: *before_line,
                    before: told(before),
                });
            }
            return Ok(());
        } else if is_known {
            self.said.insert(key.to_owned(), (line, value.to_owned()));
        }
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
                told(said_key)
            )),
            _ => self.untold += 1,
        }
        Ok(())
    }
}

/// Whether two values differ as what they say.
fn says_another(before: &str, now: &str) -> bool {
    let number = |text: &str| text.trim_end_matches('°').parse::<f64>().ok();
    match (number(before), number(now)) {
        (Some(before), Some(now)) => before != now,
        _ => before != now,
    }
}
