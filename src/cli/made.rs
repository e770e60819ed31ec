//! What a command tells about the file it made, and how long the stages took.

use std::path::Path;
use std::time::Duration;

use serde_json::{Map, json};

use super::output;
use crate::accuracy::ResultError;
use crate::paint::Clamp;
use crate::workshop::{Laps, Made, Picked, WorkshopError};

/// Writes the seconds of each stage and of all, where there is a file for them.
pub fn write_seconds(timings: Option<&Path>, laps: Laps) -> Result<(), WorkshopError> {
    let Some(timings) = timings else {
        return Ok(());
    };
    let stages = laps.into_stages();
    let total: Duration = stages.iter().map(|(_, time)| *time).sum();
    let mut seconds = Map::new();
    for (stage, time) in stages.into_iter().chain([("total", total)]) {
        seconds.insert(stage.to_owned(), json!(time.as_secs_f64()));
    }
    output::replace(timings, json!(seconds).to_string().as_bytes())
}

/// How large a file is, and how far off where that is known.
pub fn size_and_error(made: &Made) -> String {
    let lab = made.report.pointer("/accuracy/error/lab");
    let lab = lab.and_then(serde_json::Value::as_f64);
    let error = lab.map_or(String::new(), |lab| format!(", error {lab:.3} Lab"));
    format!("{} bytes{error}", made.bytes.len())
}

/// How far off a result's flakes are, and where that is not known, why; nothing of a solid color.
pub fn error(of: &ResultError) -> String {
    match (of.lab, of.unknown()) {
        _ if of.terms.is_empty() => String::new(),
        (Some(lab), _) => format!(", error {lab:.3} Lab"),
        (None, why) => format!(
            ", error not known{}",
            why.map_or(String::new(), |why| format!(": {why}"))
        ),
    }
}

/// Tells what was made: one JSON object, or notes and a last line for people.
pub fn tell(
    json: bool,
    out: &Path,
    made: &Made,
    picked: Option<&Picked>,
    size: &str,
) -> Result<(), WorkshopError> {
    if json {
        return output::print_json(
            &json!({ "out": out.display().to_string(), "bytes": made.bytes.len(), "report": made.report, "picked": picked }),
        );
    }
    notes(picked, &made.notes);
    eprintln!("{}: {size}", out.display());
    Ok(())
}

/// What was clamped in a realisation.
pub fn clamped(clamps: &[Clamp]) {
    for clamp in clamps {
        eprintln!("note: {clamp}");
    }
}

/// What was picked for a target, and what the user should know.
pub fn notes(picked: Option<&Picked>, notes: &[String]) {
    if let Some(picked) = picked {
        eprintln!("target {}", picked.told());
    }
    for note in notes {
        eprintln!("note: {note}");
    }
}
