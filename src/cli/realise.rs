//! `carpaint realise`: a blend at given weights becomes a file that others use.

use std::path::PathBuf;

use clap::Args;

use super::ingest::ReadingArgs;
use super::made;
use super::output;
use super::profile::TargetArgs;
use super::progress::Progress;
use super::weights::WeightArgs;
use crate::workshop::{Format, Laps, Work, WorkshopError, open, realise};

/// Take a realisation of a blend: a texture bundle, a GLB, a material.json, or a .paint.
///
/// A paint or a sample is exported as it is.
#[derive(Args, Clone, Debug)]
pub struct Realise {
    /// A .blend; or a .paint, a sample or a measurement, which need no weights.
    #[arg(value_name = "BLEND")]
    input: String,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    target: TargetArgs,
    /// File to write; its ending says what: .zip, .glb, .json or .paint.
    #[arg(long, value_name = "F.zip|F.glb|F.json|F.paint")]
    out: PathBuf,
    /// Write the seconds each stage took.
    #[arg(long, value_name = "T.json")]
    timings: Option<PathBuf>,
}

impl Realise {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        let mut stages = Laps::begin();
        let mut options = ReadingArgs::default().options(None, &self.target.profile)?;
        let format = Format::of_path(&self.out)?;
        let progress = Progress::reading(&self.input);
        let thing = open(&self.input, &options, &|share| progress.at(share))?;
        drop(progress);
        let weights = self.weights.for_thing(&thing)?;
        stages.end("open");
        let picked = self.target.pick(&Work::Realise {
            thing: &thing,
            weights: weights.as_ref(),
            format,
            written: true,
        })?;
        if let Some(picked) = &picked {
            options.profile = *picked.profile();
        }
        if picked.is_some() {
            stages.end("search");
        }
        let made = realise(&thing, weights.as_ref(), format, &options.profile)?;
        stages.end_with(&made.stages);
        output::replace(&self.out, &made.bytes)?;
        stages.end("write");
        made::write_seconds(self.timings.as_deref(), stages)?;
        let size = made::size_and_error(&made);
        made::tell(json, &self.out, &made, picked.as_ref(), &size)
    }
}
