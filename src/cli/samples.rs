//! `carpaint samples`: the built-in paints.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use serde_json::json;

use super::output;
use super::profile::ProfileArgs;
use super::progress::Progress;
use crate::workshop::{SAMPLES, WorkshopError, sample_by_name};

/// List the built-in samples, or write one as a .paint.
#[derive(Args, Clone, Debug)]
pub struct Samples {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand, Clone, Debug)]
enum Action {
    /// List them.
    List,
    /// Write one as a .paint.
    Export {
        /// Name of the sample.
        #[arg(value_name = "NAME")]
        name: String,
        #[command(flatten)]
        profile: ProfileArgs,
        /// File to write.
        #[arg(long, value_name = "P.paint")]
        out: PathBuf,
    },
}

impl Samples {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        match &self.action {
            Action::List => list(json),
            Action::Export { name, profile, out } => {
                output::check_ending(out, "paint")?;
                let bare = name.strip_prefix("sample:").unwrap_or(name);
                let sample = sample_by_name(bare).ok_or_else(|| {
                    let known: Vec<&str> = SAMPLES.iter().map(|s| s.name).collect();
                    WorkshopError::input(
                        name,
                        format!("there is no such sample; there are {}", known.join(", ")),
                    )
                })?;
                let progress = Progress::new("simulating flakes");
                let bytes = sample
                    .build(&profile.profile()?, &|share| progress.at(share))?
                    .to_bytes()
                    .map_err(WorkshopError::from)?;
                output::replace(out, &bytes)?;
                drop(progress);
                if json {
                    return output::print_json(
                        &json!({ "out": out.display().to_string(), "bytes": bytes.len() }),
                    );
                }
                eprintln!("{}: {}", out.display(), sample.about);
                Ok(())
            }
        }
    }
}

fn list(json: bool) -> Result<(), WorkshopError> {
    if json {
        let samples: Vec<_> = SAMPLES
            .iter()
            .map(|s| json!({ "name": s.name, "about": s.about, "simulated_flakes": s.is_metallic() }))
            .collect();
        return output::print_json(
            &json!({ "samples": samples, "source": "Günther et al., VMV 2005" }),
        );
    }
    let lines = SAMPLES
        .iter()
        .map(|sample| format!("sample:{:<16} {}\n", sample.name, sample.about));
    let text: String = lines.collect();
    output::print(&format!(
        "{text}Bases: fits of Günther et al., VMV 2005; the flakes are simulated.\n"
    ))
}
