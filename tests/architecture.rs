//! The house rules: which room may use which.
//!
//! Reads the `crate::` paths of every source file and fails on an arrow that the table below does not have. When the
//! table is wrong, change it together with the code and say why in the commit.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Rooms that compute a paint's way through the house, from measurement to picture.
const COMPUTING: &[&str] = &[
    "color",
    "descent",
    "transport",
    "paint",
    "measurement",
    "fit",
    "blend",
    "render",
    "export",
];

/// Room, and the rooms it may use.
const MAY_USE: &[(&str, &[&[&str]])] = &[
    ("color", &[]),
    ("transport", &[]),
    // What two searches of different rooms share, as numbers only.
    ("descent", &[]),
    ("paint", &[&["color"]]),
    ("measurement", &[&["color", "paint"]]),
    ("fit", &[&["measurement", "paint", "color", "descent"]]),
    ("blend", &[&["paint", "transport", "color"]]),
    ("render", &[&["paint", "color"]]),
    ("export", &[&["paint", "blend", "color", "descent"]]),
    // Profiles are the rooms' settings together, so accuracy sees every room below it.
    ("accuracy", &[COMPUTING]),
    ("store", &[]),
    ("workshop", &[COMPUTING, &["accuracy", "store"]]),
    // Both doors hand the types of the use cases through: settings, limits, weights, progress.
    ("studio", &[]),
    ("service", &[DOORS, &["studio", "store"]]),
    ("cli", &[DOORS, &["service"]]),
];
const DOORS: &[&str] = &["workshop", "accuracy", "blend", "paint", "measurement"];

/// What computes knows none of these: what it needs of them comes as an argument.
const IMPURE: &[&str] = &[
    "tokio",
    "axum",
    "sqlx",
    "moka",
    "clap",
    "tracing",
    "rand",
    "getrandom",
    "tempfile",
    "std::fs",
    "std::net",
    "std::thread",
    "std::env",
    "std::time",
    "std::process",
    "std::io::stdin",
    "std::io::stdout",
    "std::io::stderr",
    "std::hash::RandomState",
    "std::collections::HashMap",
    "std::collections::HashSet",
    // A group would hide the names above from this test.
    "std::{",
    "println!",
    "print!",
    "eprintln!",
    "eprint!",
    "dbg!",
    "thread_local!",
    // The pool is the caller's.
    "ThreadPoolBuilder",
    "rayon::spawn",
];

/// Where one of them stands after all, and why.
const PURE_ENOUGH: &[(&str, &str, &str)] = &[
    (
        "measurement/archive.rs",
        "std::fs",
        "reads, at places, the file whose path it is given: packages of gigabytes are not held in memory",
    ),
    (
        "measurement/archive.rs",
        "std::collections::HashMap",
        "names are looked up in it, it is never walked",
    ),
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
    let mut parts = text.split("#[cfg(test)]\nmod ");
    let mut code = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (first, after) = part.split_once('\n').unwrap_or((part, ""));
        if first.ends_with(';') {
            code.push_str(after);
            continue;
        }
        // Code that follows tests would be looked at by nobody.
        let after = after.split_once("\n}\n").map_or("", |(_, after)| after);
        assert!(
            after.trim().is_empty(),
            "{}: code follows the tests",
            path.display()
        );
    }
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
                if used != *room
                    && known.contains(used.as_str())
                    && !may.iter().any(|rooms| rooms.contains(&used.as_str()))
                {
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

/// Whether code names this, as a whole path or macro and not as a part of another word.
fn names(code: &str, word: &str) -> bool {
    let is_letter = |c: char| c.is_alphanumeric() || c == '_';
    let is_macro_or_group = word.ends_with(['!', '{']);
    let is_path = |rest: &str| {
        // A crate's name alone may be anything's name.
        rest.starts_with("::") || word.contains("::") || word == "ThreadPoolBuilder"
    };
    code.match_indices(word).any(|(at, _)| {
        let (before, after) = (&code[..at], &code[at + word.len()..]);
        let begins = !before.ends_with(|c| is_letter(c) || c == '"');
        let ends = !after.starts_with(is_letter) && is_path(after);
        begins && (is_macro_or_group || ends)
    })
}

#[test]
fn rooms_that_compute_know_no_clock_disk_network_thread_or_environment() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    let mut excused = BTreeSet::new();
    for room in COMPUTING.iter().chain(&["accuracy"]) {
        for path in room_files(room) {
            if path.file_name().is_some_and(|n| n == "tests.rs") {
                continue;
            }
            let code = code_of(&path);
            let place = path
                .strip_prefix(&root)
                .unwrap_or(&path)
                .to_string_lossy()
                .replace('\\', "/");
            for word in IMPURE.iter().filter(|word| names(&code, word)) {
                match PURE_ENOUGH
                    .iter()
                    .position(|(file, what, _)| *file == place && what == word)
                {
                    Some(excuse) => {
                        excused.insert(excuse);
                    }
                    None => wrong.push(format!("{place} uses {word}")),
                }
            }
        }
    }
    assert!(wrong.is_empty(), "impure:\n{}", wrong.join("\n"));
    assert_eq!(
        excused.len(),
        PURE_ENOUGH.len(),
        "an excuse that nothing needs"
    );
}

#[test]
fn a_word_is_found_as_a_path_and_not_in_others() {
    for code in [
        "use std::fs::File;",
        "std::fs::read(p)",
        "let t = std::time::Instant::now();",
        "use std::fs;",
    ] {
        assert!(IMPURE.iter().any(|word| names(code, word)), "{code}");
    }
    for code in [
        "tokio::spawn(x)",
        "println!(\"x\")",
        "use std::{fs, io};",
        "rayon::ThreadPoolBuilder::new()",
    ] {
        assert!(IMPURE.iter().any(|word| names(code, word)), "{code}");
    }
    for code in [
        "let rand = 3;",
        "self.random::<f64>()",
        "std::f64::consts::PI",
        "crate::clap_less::x",
        "fn clap() {}",
    ] {
        assert!(!IMPURE.iter().any(|word| names(code, word)), "{code}");
    }
}

/// What the image is built of holds every file that the program has in it.
#[test]
fn the_dockerfile_copies_what_the_program_includes() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let dockerfile = fs::read_to_string(root.join("docker/Dockerfile")).expect("a Dockerfile");
    let copied: Vec<&str> = dockerfile
        .lines()
        .filter_map(|line| line.strip_prefix("COPY "))
        .filter(|line| !line.starts_with("--from"))
        .flat_map(|line| line.split_whitespace().rev().skip(1))
        .collect();
    let mut looked_at = 0;
    for path in room_files("") {
        let text = code_of(&path);
        let folder = path.parent().expect("a folder");
        let text = text.replace("include_bytes!(", "include_str!(");
        for included in text.split("include_str!(").skip(1) {
            let name = included.trim_start().strip_prefix('"');
            let name = name.and_then(|rest| rest.split_once('"'));
            let (name, _) = name.expect("an included file by its name");
            let file = fs::canonicalize(folder.join(name)).expect("an included file");
            let file = file
                .strip_prefix(fs::canonicalize(root).expect("the root"))
                .expect("within the project");
            looked_at += 1;
            assert!(
                copied.iter().any(|from| file.starts_with(from)),
                "{} includes {}, which docker/Dockerfile does not copy",
                path.display(),
                file.display()
            );
        }
    }
    assert!(looked_at > 3, "{looked_at} files");
}
