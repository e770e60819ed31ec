//! `carpaint bundle`: all paints of a blend become one archive, from which a web page takes every realisation itself.

use std::path::PathBuf;

use clap::Args;

use super::ingest::ReadingArgs;
use super::made;
use super::output;
use super::profile::TargetArgs;
use crate::workshop::{Laps, Work, WorkshopError, bundle_blend, open};

/// Write the texture bundle of a whole blend: its shader mixes the paints, so that sliders need no further request.
///
/// For one realisation at fixed weights see `carpaint realise`.
#[derive(Args, Clone, Debug)]
pub struct Bundle {
    /// A .blend.
    #[arg(value_name = "BLEND")]
    input: String,
    #[command(flatten)]
    target: TargetArgs,
    /// File to write.
    #[arg(long, value_name = "F.zip")]
    out: PathBuf,
    /// Write the seconds each stage took.
    #[arg(long, value_name = "T.json")]
    timings: Option<PathBuf>,
}

impl Bundle {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        if self.out.extension().is_none_or(|ending| ending != "zip") {
            let problem = format!(
                "{} does not end in .zip, which a bundle is",
                self.out.display()
            );
            return Err(WorkshopError::usage("--out", problem));
        }
        let mut stages = Laps::begin();
        let mut options = ReadingArgs::default().options(None, &self.target.profile)?;
        let blend = open(&self.input, &options, &|_| ())?;
        stages.end("open");
        let picked = self.target.pick(&Work::Bundle {
            thing: &blend,
            written: true,
        })?;
        if let Some(picked) = &picked {
            options.profile = *picked.profile();
        }
        if picked.is_some() {
            stages.end("search");
        }
        let made = bundle_blend(&blend, &options.profile)?;
        stages.end_with(&made.stages);
        output::replace(&self.out, &made.bytes)?;
        stages.end("write");
        made::write_seconds(self.timings.as_deref(), stages)?;
        let size = made::size_and_error(&made);
        made::tell(json, &self.out, &made, picked.as_ref(), &size)
    }
}
