//! `carpaint evaluate`: the BRDF at pairs of directions.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::ingest::ReadingArgs;
use super::made;
use super::output;
use super::profile::ProfileArgs;
use super::progress::Progress;
use super::weights::WeightArgs;
use crate::paint::Chi;
use crate::workshop::{
    Pairs, Source, WorkshopError, evaluate, evaluate_raw, find, open, open_measurement, read,
};

/// Evaluate the BRDF at pairs of directions: 1/sr, linear sRGB, flakes at their mean, no cosine.
///
/// Reads {"pairs": [[[ix,iy,iz],[ox,oy,oz]], …]} (unit vectors, z = normal, i towards the light, o towards the viewer)
/// and writes {"f": [[r,g,b], …]}. A coat's perfect mirror image is left out of f; its weight stands beside it.
#[derive(Args, Clone, Debug)]
pub struct Evaluate {
    /// A .paint, a .blend, a sample or a measurement.
    #[arg(value_name = "PAINT|BLEND|measurement")]
    input: String,
    #[command(flatten)]
    weights: WeightArgs,
    /// Evaluate the measurement itself instead of its fit.
    #[arg(long)]
    raw: bool,
    /// Replace the color table by one color: what the lobes alone say.
    #[arg(long, conflicts_with = "raw")]
    no_color_table: bool,
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    profile: ProfileArgs,
    /// The pairs.
    #[arg(long, value_name = "D.json")]
    directions: PathBuf,
    /// File to write.
    #[arg(long, value_name = "V.json")]
    out: PathBuf,
}

impl Evaluate {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        let options = self.reading.options(None, &self.profile)?;
        let pairs = read(&self.directions, &options.limits)?;
        let pairs = Pairs::from_json(
            &self.directions.display().to_string(),
            &pairs,
            &options.limits,
        )?;
        let mut clamps = Vec::new();
        let values = if self.raw {
            self.weights.refuse(
                "--raw evaluates a measurement, which takes no weights: leave either out",
            )?;
            let Source::Path(path) = find(&self.input)? else {
                return Err(WorkshopError::input(
                    &self.input,
                    "a sample has no measurement to evaluate raw",
                ));
            };
            evaluate_raw(&open_measurement(Path::new(&path), &options)?, &pairs)?
        } else {
            let chi = if self.no_color_table {
                Chi::Overall
            } else {
                Chi::Table
            };
            let progress = Progress::reading(&self.input);
            let thing = open(&self.input, &options, &|share| progress.at(share))?;
            drop(progress);
            let weights = self.weights.for_thing(&thing)?;
            let realised = thing.realise(weights.as_ref())?;
            clamps = realised.clamps;
            evaluate(&realised.paint, &pairs, chi)
        };
        let mut bytes = serde_json::to_vec(&values).map_err(WorkshopError::internal)?;
        bytes.push(b'\n');
        output::replace(&self.out, &bytes)?;
        if json {
            return output::print_json(
                &json!({ "out": self.out.display().to_string(), "pairs": pairs.pairs.len(), "clamps": clamps }),
            );
        }
        made::clamped(&clamps);
        eprintln!("{}: {} pairs", self.out.display(), pairs.pairs.len());
        Ok(())
    }
}
