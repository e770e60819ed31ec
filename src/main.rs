//! The `carpaint` binary: see [`carpaint::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    carpaint::cli::run()
}
