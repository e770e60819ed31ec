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
    let error = lab.map_or(String::new(), in_lab);
    format!("{} bytes{error}", made.bytes.len())
}

fn in_lab(error: f64) -> String {
    format!(", error {error:.3} Lab")
}

/// How far off a result's flakes are, and where that is not known, why; nothing of a solid color.
pub fn error(of: &ResultError) -> String {
    match (of.lab, of.unknown()) {
        _ if of.terms.is_empty() => String::new(),
        (Some(lab), _) => in_lab(lab),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::Term;

    #[test]
    fn an_error_is_told_in_lab_or_why_it_is_not_known_and_not_at_all_of_a_solid() {
        let of = |terms: Vec<Option<f64>>| ResultError {
            lab: terms.iter().copied().sum(),
            terms: (terms.iter())
                .map(|&lab| Term {
                    what: "clusters",
                    lab,
                    how: "as it is known",
                })
                .collect(),
            seen: None,
            unseen: None,
        };
        assert_eq!(error(&of(Vec::new())), "");
        assert_eq!(error(&of(vec![Some(0.25), Some(0.5)])), ", error 0.750 Lab");
        let unknown = error(&of(vec![Some(0.25), None]));
        assert_eq!(unknown, ", error not known: as it is known");
    }
}
