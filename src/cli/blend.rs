//! `carpaint blend`: paints become a `.blend`.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::ingest::ReadingArgs;
use super::made;
use super::output;
use super::profile::TargetArgs;
use super::progress::Progress;
use crate::accuracy::blend_error;
use crate::blend::PAINTS;
use crate::workshop::{Laps, Work, WorkshopError, blend_paints, describe_blend, open_paints};

/// Find how the flakes of 2 to 5 paints become one another, and keep it as a .blend.
///
/// Each INPUT is a measurement, a .paint or a sample (sample:NAME). Weights of a realisation follow their order.
#[derive(Args, Clone, Debug)]
pub struct Blend {
    /// The paints.
    #[arg(value_name = "INPUT", required = true, num_args = 1..)]
    inputs: Vec<String>,
    #[command(flatten)]
    target: TargetArgs,
    /// File to write.
    #[arg(long, value_name = "B.blend")]
    out: PathBuf,
    /// Write the seconds each stage took.
    #[arg(long, value_name = "T.json")]
    timings: Option<PathBuf>,
}

impl Blend {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        output::check_ending(&self.out, "blend")?;
        let mut options = ReadingArgs::default().options(None, &self.target.profile)?;
        if !PAINTS.contains(&self.inputs.len()) {
            let problem = format!(
                "{} paints given, a blend takes {} to {}",
                self.inputs.len(),
                PAINTS.start(),
                PAINTS.end()
            );
            return Err(WorkshopError::usage("INPUT", problem));
        }
        let mut stages = Laps::begin();
        let picked = self.target.pick(&Work::BlendNames {
            names: &self.inputs,
            options: &options,
        })?;
        if let Some(picked) = &picked {
            options.profile = *picked.profile();
            stages.end("search");
        }
        let progress = Progress::reading(&self.inputs.join(", "));
        let paints = open_paints(&self.inputs, &options, &|share| progress.at(share))?;
        drop(progress);
        stages.end("ingest");
        let progress = Progress::new("blending");
        let made = blend_paints(
            &paints.iter().collect::<Vec<_>>(),
            &options.profile,
            &|share| progress.at(share),
        )?;
        stages.end("blend");
        output::replace(&self.out, &made.blend.to_bytes()?)?;
        drop(progress);
        stages.end("write");
        made::write_seconds(self.timings.as_deref(), stages)?;
        let names: Vec<&str> = made.blend.ingredients().map(|(name, _)| name).collect();
        if json {
            let correspondence = &describe_blend(&made.blend)["correspondence"];
            return output::print_json(
                &json!({ "out": self.out.display().to_string(), "paints": names, "profile": options.profile.name(),
                    "correspondence": correspondence, "error": blend_error(&made.blend), "picked": picked,
                    "notes": made.notes }),
            );
        }
        made::notes(picked.as_ref(), &made.notes);
        let report = made.blend.report();
        eprintln!(
            "{}: {} · {} slices, {} clusters, mean transport {:.2}{}",
            self.out.display(),
            names.join(" + "),
            report.slices,
            report.clusters,
            report.mean_cost,
            made::error(&blend_error(&made.blend)),
        );
        Ok(())
    }
}
