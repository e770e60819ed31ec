//! `carpaint study`: what accuracy costs on this machine.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::output;
use super::progress::Progress;
use crate::accuracy::study::{page, plots};
use crate::workshop::{StudyOptions, WorkshopError, study};

/// Measure error against time for every knob, and write study.json, a page and plots.
///
/// Each PAINT is a measurement with pictures of flakes, or a metallic sample; four samples unless given. Takes about a
/// minute on two processors. A service whose data folder holds study.json serves it at /v1/accuracy.
#[derive(Args, Clone, Debug)]
pub struct Study {
    /// Two paints or more; the first two are blended, the first three joined.
    #[arg(value_name = "PAINT")]
    paints: Vec<String>,
    /// Folder to write into; created if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Fewer settings, smaller pictures, one go each: about half a minute.
    #[arg(long)]
    quick: bool,
}

impl Study {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        if self.out.exists() && !self.out.is_dir() {
            let problem = format!("{} is a file, accepted is a folder", self.out.display());
            return Err(WorkshopError::usage("--out", problem));
        }
        std::fs::create_dir_all(&self.out)
            .map_err(|e| WorkshopError::output(self.out.display(), e))?;
        let progress = Progress::new("studying");
        let options = StudyOptions { quick: self.quick };
        let measured = study(&self.paints, &options, &|what, share| {
            progress.says(what);
            progress.at(share);
        })?;
        drop(progress);
        let mut text = serde_json::to_vec_pretty(&measured).map_err(WorkshopError::internal)?;
        text.push(b'\n');
        output::replace(&self.out.join("study.json"), &text)?;
        output::replace(&self.out.join("README.md"), page(&measured).as_bytes())?;
        for (name, svg) in plots(&measured) {
            output::replace(&self.out.join(name), svg.as_bytes())?;
        }
        if json {
            return output::print_json(
                &json!({ "out": self.out.display().to_string(), "seconds": measured.seconds }),
            );
        }
        for front in &measured.fronts {
            eprintln!("{}: the knee is {}", front.work, front.knee);
        }
        for growth in &measured.growth {
            if let Some(exponent) = growth.exponent {
                eprintln!("time grows as {}^{exponent:.2}", growth.with);
            }
        }
        eprintln!("{}: README.md, study.json and plots", self.out.display());
        Ok(())
    }
}
