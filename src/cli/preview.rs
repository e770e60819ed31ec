//! `carpaint preview`: a picture of a paint.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Instant;

use clap::Args;
use serde_json::json;

use super::ingest::ReadingArgs;
use super::number::whole;
use super::output;
use super::profile::TargetArgs;
use super::progress::Progress;
use super::weights::WeightArgs;
use crate::workshop::{
    PictureFormat, PreviewOptions, Work, WorkshopError, open, preview, read_environment,
};

/// Draw a paint, a blend at given weights, or a sample.
#[derive(Args, Clone, Debug)]
pub struct Preview {
    /// A .paint, a .blend, a sample or a measurement.
    #[arg(value_name = "PAINT|BLEND|sample")]
    input: String,
    #[command(flatten)]
    weights: WeightArgs,
    /// What the paint is on: sphere, capsule or panel, 40 mm across and near enough to tell its flakes.
    #[arg(
        long,
        value_name = "SHAPE",
        default_value = "sphere",
        allow_hyphen_values = true
    )]
    scene: String,
    /// Width and height in pixels.
    #[arg(
        long,
        value_name = "WxH",
        default_value = "512x512",
        allow_hyphen_values = true
    )]
    size: Size,
    /// Samples per pixel, in place of the profile's.
    #[arg(long, value_name = "N", value_parser = whole(1..=4096_u32), allow_hyphen_values = true,
        conflicts_with_all = ["max_error", "max_seconds"])]
    spp: Option<u32>,
    /// A panorama to light it with, .hdr or .exr, in place of the built-in studio.
    #[arg(long, value_name = "FILE")]
    environment: Option<PathBuf>,
    #[command(flatten)]
    target: TargetArgs,
    /// Picture to write: .png for a screen, .exr for linear light.
    #[arg(long, value_name = "F.png|F.exr")]
    out: PathBuf,
    /// Write the seconds each stage took.
    #[arg(long, value_name = "T.json")]
    timings: Option<PathBuf>,
}

/// `WxH` in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("'{text}' is no size; accepted is WxH, such as 512x512, 1 to 16384 each");
        let (width, height) = text.split_once('x').ok_or_else(wrong)?;
        let side = |s: &str| {
            s.parse()
                .ok()
                .filter(|n| (1..=16384).contains(n))
                .ok_or_else(wrong)
        };
        Ok(Self {
            width: side(width)?,
            height: side(height)?,
        })
    }
}

impl Preview {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        let options = ReadingArgs::default().options(None, &self.target.profile)?;
        let format = PictureFormat::of_path(&self.out)?;
        let start = Instant::now();
        let progress = Progress::reading(&self.input);
        let thing = open(&self.input, &options, &|share| progress.at(share))?;
        drop(progress);
        let weights = self.weights.for_thing(&thing)?;
        let environment = self
            .environment
            .as_deref()
            .map(|path| read_environment(path, &options.limits))
            .transpose()?;
        let mut wanted = PreviewOptions {
            scene: self.scene.clone(),
            size: [self.size.width, self.size.height],
            samples_per_pixel: self.spp.unwrap_or(options.profile.samples_per_pixel),
            environment,
            lights: None,
        };
        let picked = self.target.pick(&Work::Preview {
            thing: &thing,
            weights: weights.as_ref(),
            options: &wanted,
            format,
            limits: &options.limits,
            written: true,
        })?;
        if let Some(picked) = &picked {
            wanted.samples_per_pixel = picked.profile().samples_per_pixel;
        }
        let opened = start.elapsed();
        let progress = Progress::new("drawing");
        let made = preview(
            &thing,
            weights.as_ref(),
            &wanted,
            format,
            &options.limits,
            &|share| progress.at(share),
        )?;
        let drawn = start.elapsed();
        output::replace(&self.out, &made.bytes)?;
        drop(progress);
        if let Some(timings) = &self.timings {
            let written = start.elapsed();
            let seconds = json!({
                "open": opened.as_secs_f64(),
                "draw": drawn.saturating_sub(opened).as_secs_f64(),
                "write": written.saturating_sub(drawn).as_secs_f64(),
                "total": written.as_secs_f64(),
            });
            output::replace(timings, seconds.to_string().as_bytes())?;
        }
        if json {
            return output::print_json(
                &json!({ "out": self.out, "bytes": made.bytes.len(), "report": made.report, "picked": picked }),
            );
        }
        if let Some(picked) = &picked {
            eprintln!("target {}", picked.line());
        }
        for line in &made.notes {
            eprintln!("note: {line}");
        }
        eprintln!(
            "{}: {} x {}",
            self.out.display(),
            self.size.width,
            self.size.height
        );
        Ok(())
    }
}
