//! The house rules: which room may use which.
//!
//! Reads the `crate::` paths of every source file and fails on an arrow that the table below does not have. When the
//! table is wrong, change it together with the code and say why in the commit.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Room, and the rooms it may use.
const MAY_USE: &[(&str, &[&str])] = &[
    ("color", &[]),
    ("transport", &[]),
    ("paint", &["color"]),
    ("measurement", &["color", "paint"]),
    ("fit", &["measurement", "paint", "color"]),
    ("blend", &["paint", "transport", "color"]),
    ("render", &["paint", "color"]),
    ("export", &["paint", "blend", "color"]),
    // Profiles are the rooms' settings together, so accuracy sees every room below it.
    (
        "accuracy",
        &[
            "color",
            "transport",
            "paint",
            "measurement",
            "fit",
            "blend",
            "render",
            "export",
        ],
    ),
    ("store", &[]),
    (
        "workshop",
        &[
            "color",
            "transport",
            "paint",
            "measurement",
            "fit",
            "blend",
            "render",
            "export",
            "accuracy",
            "store",
        ],
    ),
    // Both doors hand the types of the use cases through: settings, limits, weights, progress.
    ("studio", &[]),
    (
        "service",
        &[
            "studio",
            "workshop",
            "store",
            "accuracy",
            "blend",
            "paint",
            "measurement",
        ],
    ),
    (
        "cli",
        &[
            "workshop",
            "service",
            "accuracy",
            "blend",
            "paint",
            "measurement",
        ],
    ),
];

/// Rooms that compute and nothing else, and what would make them impure.
const PURE: &[&str] = &[
    "color",
    "transport",
    "paint",
    "measurement",
    "fit",
    "blend",
    "render",
    "export",
    "accuracy",
];
const IMPURE: &[&str] = &[
    "tokio::",
    "axum::",
    "std::time::",
    "std::env::",
    "rand::rng",
    "thread_rng",
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a readable folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

fn room_files(room: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    sources(&root.join(room), &mut found);
    found
}

/// The file without its tests: a test may use what it likes.
fn code_of(path: &Path) -> String {
    let text = fs::read_to_string(path).expect("a readable source");
    let code = text
        .split("#[cfg(test)]\nmod ")
        .next()
        .unwrap_or_default()
        .to_owned();
    let is_comment = |line: &&str| !line.trim_start().starts_with("//");
    code.lines()
        .filter(is_comment)
        .collect::<Vec<_>>()
        .join("\n")
}

fn rooms_used(code: &str) -> BTreeSet<String> {
    let name = |rest: &str| {
        rest.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect::<String>()
    };
    let mut used: BTreeSet<String> = code.split("crate::").skip(1).map(name).collect();
    // `use crate::{a::…, b::…}`
    for list in code.split("crate::{").skip(1) {
        let mut depth = 0;
        let mut word = String::new();
        for c in list.chars() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    used.insert(name(word.trim()));
                    word.clear();
                }
                c => word.push(c),
            }
        }
        used.insert(name(word.trim()));
    }
    used
}

#[test]
fn every_arrow_between_rooms_is_in_the_table() {
    let known: BTreeSet<&str> = MAY_USE.iter().map(|(room, _)| *room).collect();
    let mut wrong = Vec::new();
    for (room, may) in MAY_USE {
        for path in room_files(room) {
            if path.file_name().is_some_and(|n| n == "tests.rs") {
                continue;
            }
            for used in rooms_used(&code_of(&path)) {
                if used != *room && known.contains(used.as_str()) && !may.contains(&used.as_str()) {
                    wrong.push(format!("{} uses {used}", path.display()));
                }
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "arrows the house does not have:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn every_room_is_in_the_table() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for entry in fs::read_dir(root).expect("src is readable").flatten() {
        if entry.path().is_dir() {
            let name = entry.file_name().into_string().expect("a plain name");
            assert!(
                MAY_USE.iter().any(|(room, _)| *room == name),
                "room {name} is not in the table"
            );
        }
    }
}

#[test]
fn pure_rooms_know_no_clock_network_or_environment() {
    for room in PURE {
        for path in room_files(room) {
            let code = code_of(&path);
            for word in IMPURE {
                assert!(!code.contains(word), "{} uses {word}", path.display());
            }
        }
    }
}
