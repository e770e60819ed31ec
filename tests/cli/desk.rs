//! A desk to call the binary at.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

/// A folder of its own for each test, gone afterwards.
pub struct Desk {
    pub folder: tempfile::TempDir,
}

impl Desk {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a temporary folder"),
        }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn run(&self, words: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_carpaint"))
            .current_dir(self.folder.path())
            .args(words)
            .output()
            .expect("the binary starts")
    }

    pub fn ok(&self, words: &[&str]) -> Output {
        let output = self.run(words);
        assert!(
            output.status.success(),
            "{words:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        output
    }

    /// Runs a command that must fail with this exit code, and gives what it says.
    pub fn refused(&self, code: i32, words: &[&str]) -> String {
        let output = self.run(words);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{words:?}: {said}");
        assert!(
            !said.trim().is_empty() && !said.contains("panicked"),
            "{words:?}: {said}"
        );
        said
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).expect("the file is there")
    }

    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.folder.path())
            .expect("readable")
            .flatten()
            .map(|e| e.file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// A blend of a metallic and a solid sample, with few clusters so that it is quick.
    pub fn with_blend() -> Self {
        let desk = Self::new();
        desk.ok(&[
            "blend",
            "sample:bmw339",
            "sample:blue",
            "--profile",
            "draft",
            "--out",
            "b.blend",
        ]);
        desk
    }
}

pub fn json(bytes: &[u8]) -> serde_json::Value {
    serde_json::from_slice(bytes).expect("one JSON object")
}
