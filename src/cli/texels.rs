//! `carpaint texels`: the flakes at one angle pair, as the random texture draws them.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::ingest::ReadingArgs;
use super::made;
use super::number::{real, whole};
use super::output;
use super::preview::Size;
use super::profile::ProfileArgs;
use super::progress::Progress;
use super::weights::WeightArgs;
use crate::workshop::{WorkshopError, open, texels};

/// Write the flakes at one angle pair as an EXR: 1/sr, linear sRGB, one pixel a texel.
#[derive(Args, Clone, Debug)]
pub struct Texels {
    /// A .paint, a .blend, a sample or a measurement.
    #[arg(value_name = "PAINT|BLEND")]
    input: String,
    #[command(flatten)]
    weights: WeightArgs,
    /// Angle of the half vector from the normal, degrees inside the coat, 0 to 90.
    #[arg(long, value_name = "DEG", value_parser = real(0.0..=90.0), allow_hyphen_values = true)]
    theta_h: f64,
    /// Angle between half vector and light, degrees inside the coat, 0 to 90.
    #[arg(long, value_name = "DEG", value_parser = real(0.0..=90.0), allow_hyphen_values = true)]
    theta_d: f64,
    /// Width and height in texels.
    #[arg(
        long,
        value_name = "WxH",
        default_value = "256x256",
        allow_hyphen_values = true
    )]
    size: Size,
    /// Which random texture.
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = whole(0..=u32::MAX),
        allow_hyphen_values = true)]
    seed: u32,
    #[command(flatten)]
    profile: ProfileArgs,
    /// Picture to write.
    #[arg(long, value_name = "F.exr")]
    out: PathBuf,
}

impl Texels {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        output::check_ending(&self.out, "exr")?;
        let options = ReadingArgs::default().options(None, &self.profile)?;
        let progress = Progress::reading(&self.input);
        let thing = open(&self.input, &options, &|share| progress.at(share))?;
        drop(progress);
        let weights = self.weights.for_thing(&thing)?;
        let realised = thing.realise(weights.as_ref())?;
        let (angles, size) = (
            [self.theta_h, self.theta_d],
            [self.size.width, self.size.height],
        );
        let bytes = texels(&realised.paint, angles, size, self.seed, &options.limits)?;
        output::replace(&self.out, &bytes)?;
        if json {
            return output::print_json(
                &json!({ "out": self.out.display().to_string(), "bytes": bytes.len(), "clamps": realised.clamps }),
            );
        }
        made::clamped(&realised.clamps);
        eprintln!(
            "{}: {} x {} texels",
            self.out.display(),
            self.size.width,
            self.size.height
        );
        Ok(())
    }
}
