//! Slices of another generator, in Python, made when they are needed and read as it wrote them.

use super::clouds::Clouds;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The 900 slices of `peers/ot/gen.py` in the folder `CARPAINT_DATA`, or `None` where that folder or a Python with `NumPy`
/// (`CARPAINT_PYTHON`, `python3`) is missing, which is said aloud; with `CI=true` nothing is skipped.
pub fn slices() -> Option<Vec<Clouds>> {
    let data =
        std::env::var_os("CARPAINT_DATA").map_or_else(|| PathBuf::from("../shared"), PathBuf::from);
    let script = data.join("peers/ot/gen.py");
    let python = std::env::var_os("CARPAINT_PYTHON").unwrap_or_else(|| "python3".into());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = Command::new(&python)
        .arg(&script)
        .arg(folder.path())
        .output();
    if run.as_ref().is_ok_and(|done| done.status.success()) {
        return Some(read(folder.path()));
    }
    let why = match run {
        Ok(done) => String::from_utf8_lossy(&done.stderr)
            .trim()
            .lines()
            .last()
            .unwrap_or_default()
            .to_owned(),
        Err(error) => error.to_string(),
    };
    let needed = std::env::var("CI").is_ok_and(|ci| ci == "true");
    assert!(!needed, "no slices from {}: {why}", script.display());
    say(&format!(
        "SKIPPED: no slices from {}: {why}",
        script.display()
    ));
    None
}

/// Prints a line. Not by macro: the harness keeps to itself what passing tests print so.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

fn read(folder: &Path) -> Vec<Clouds> {
    let text = std::fs::read_to_string(folder.join("slices.json")).expect("a list of slices");
    let list: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let bytes = std::fs::read(folder.join("slices.bin")).expect("slices");
    let number = |list: &serde_json::Value, k: usize| {
        usize::try_from(list[k].as_u64().expect("a whole number")).expect("in range")
    };
    (0..usize::try_from(list["n"].as_u64().expect("a count")).expect("in range"))
        .map(|k| {
            let (ns, nt) = (number(&list["ns"], k), number(&list["nt"], k));
            let mut values = bytes[number(&list["offset"], k)..]
                .as_chunks::<8>()
                .0
                .iter()
                .map(|b| f64::from_le_bytes(*b));
            let mut masses = |n: usize| values.by_ref().take(n).collect::<Vec<f64>>();
            let (source_masses, target_masses) = (masses(ns), masses(nt));
            let points = |flat: Vec<f64>| flat.as_chunks::<3>().0.to_vec();
            let (source, target) = (points(masses(3 * ns)), points(masses(3 * nt)));
            Clouds {
                kind: "generated",
                source,
                source_masses,
                target,
                target_masses,
            }
        })
        .collect()
}
