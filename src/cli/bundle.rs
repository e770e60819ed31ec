//! `carpaint bundle`: all paints of a blend become one archive, from which a web page takes every realisation itself.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::ingest::ReadingArgs;
use super::output;
use super::profile::ProfileArgs;
use crate::workshop::{WorkshopError, bundle_blend, open};

/// Write the texture bundle of a whole blend: its shader mixes the paints, so that sliders need no further request.
///
/// For one realisation at fixed weights see `carpaint realise`.
#[derive(Args, Clone, Debug)]
pub struct Bundle {
    /// A .blend.
    #[arg(value_name = "BLEND")]
    input: String,
    #[command(flatten)]
    profile: ProfileArgs,
    /// File to write.
    #[arg(long, value_name = "F.zip")]
    out: PathBuf,
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
        let options = ReadingArgs::default().options(None, &self.profile)?;
        let blend = open(&self.input, &options, &|_| ())?;
        let made = bundle_blend(&blend, &options.profile)?;
        output::replace(&self.out, &made.bytes)?;
        if json {
            return output::print_json(
                &json!({ "out": self.out.display().to_string(), "bytes": made.bytes.len(), "report": made.report }),
            );
        }
        eprintln!("{}: {} bytes", self.out.display(), made.bytes.len());
        Ok(())
    }
}
