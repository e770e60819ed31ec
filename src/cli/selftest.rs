//! `carpaint selftest`: the hard cases, quickly, on this machine and on a paint.

use std::fmt::Write as _;

use clap::Args;
use serde::Serialize;

use super::ingest::ReadingArgs;
use super::output;
use super::profile::ProfileArgs;
use super::progress::Progress;
use crate::workshop::{Check, WorkshopError, open_paint, selftest};

/// Check that this machine computes what it should, on a paint of yours or on a sample.
#[derive(Args, Clone, Debug)]
pub struct Selftest {
    /// A .paint, a sample or a measurement.
    #[arg(value_name = "PAINT|sample", default_value = "sample:polaris_silber")]
    input: String,
    #[command(flatten)]
    profile: ProfileArgs,
}

#[derive(Serialize)]
struct Report<'a> {
    paint: &'a str,
    passed: bool,
    checks: &'a [Check],
}

impl Selftest {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        let options = ReadingArgs::default().options(None, &self.profile)?;
        let progress = Progress::new("checking");
        let paint = open_paint(&self.input, &options, &|_| ())?;
        let checks = selftest(&paint, &options.profile, &|share| progress.at(share))?;
        drop(progress);
        let failed = checks.iter().filter(|check| !check.passed).count();
        if json {
            output::print_json(&Report {
                paint: &paint.name,
                passed: failed == 0,
                checks: &checks,
            })?;
        } else {
            print_table(&checks)?;
        }
        if failed == 0 {
            return Ok(());
        }
        let count = checks.len();
        Err(WorkshopError::internal(format!(
            "{failed} of {count} checks failed on {}",
            paint.name
        )))
    }
}

fn print_table(checks: &[Check]) -> Result<(), WorkshopError> {
    let widest = checks.iter().map(|c| c.case.len()).max().unwrap_or(0);
    let mut table = format!(
        "{:widest$}  {:>9}  {:>7}  {:20}  verdict\n",
        "case", "found", "limit", "unit"
    );
    for check in checks {
        let verdict = if check.passed { "ok" } else { "FAILED" };
        let _ = writeln!(
            table,
            "{:widest$}  {:>9}  {:>7}  {:20}  {verdict}",
            check.case,
            short(check.found),
            short(check.limit),
            check.unit
        );
    }
    output::print(&table)
}

/// Two digits, or a whole number.
fn short(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e6 {
        format!("{value}")
    } else if (0.01..1000.0).contains(&value.abs()) {
        format!("{value:.2}")
    } else {
        format!("{value:.1e}")
    }
}
