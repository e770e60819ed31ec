//! `carpaint estimate`: what a command will take, before it is run.

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, Subcommand, ValueEnum};
use serde_json::json;

use super::ingest::{ReadingArgs, measurement};
use super::number::whole;
use super::output;
use super::preview::{FrameArgs, ShowName, refuse_samples_of_angles, refuse_samples_twice};
use super::profile::TargetArgs;
use super::weights::WeightArgs;
use crate::accuracy::Knobs;
use crate::workshop::{
    Estimate as Estimated, Format, IngestOptions, PictureFormat, PictureWork, PreviewOptions,
    Stage, Work, WorkshopError, open, read_environment, sample_to_estimate,
};

/// Estimate seconds, bytes and error of a command before running it.
///
/// A small part of the work is done, on this machine and now, and the rest is reckoned from it; what is soon done is done
/// whole. With --max-error or --max-seconds it says which profile would be picked.
#[derive(Args, Clone, Debug)]
pub struct Estimate {
    #[command(subcommand)]
    work: What,
}

#[derive(Subcommand, Clone, Debug)]
enum What {
    /// Of `carpaint ingest`.
    Ingest {
        /// The measurement.
        #[arg(value_name = "INPUT")]
        input: String,
        #[command(flatten)]
        reading: ReadingArgs,
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Of `carpaint blend`, opening and ingesting included.
    Blend {
        /// The paints.
        #[arg(value_name = "INPUT", required = true, num_args = 1..)]
        inputs: Vec<String>,
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Of `carpaint realise`.
    Realise {
        /// A .blend, or a .paint or sample, which need no weights.
        #[arg(value_name = "BLEND")]
        input: String,
        #[command(flatten)]
        weights: WeightArgs,
        /// What is to be written.
        #[arg(
            long,
            value_enum,
            value_name = "FORMAT",
            default_value = "zip",
            allow_hyphen_values = true
        )]
        format: FormatName,
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Of `carpaint bundle`.
    Bundle {
        /// A .blend.
        #[arg(value_name = "BLEND")]
        input: String,
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Of `carpaint preview`.
    Preview {
        /// A .paint, a .blend, a sample or a measurement.
        #[arg(value_name = "PAINT|BLEND|sample")]
        input: String,
        #[command(flatten)]
        weights: WeightArgs,
        #[command(flatten)]
        frame: FrameArgs,
        /// What is shown on it: the paint, or the aspecular angles.
        #[arg(
            long,
            value_enum,
            value_name = "WHAT",
            default_value = "paint",
            allow_hyphen_values = true
        )]
        show: ShowName,
        /// What is to be written.
        #[arg(
            long,
            value_enum,
            value_name = "FORMAT",
            default_value = "png",
            allow_hyphen_values = true
        )]
        format: PictureName,
        /// A panorama to light it with, .hdr or .exr, in place of the built-in studio.
        #[arg(long, value_name = "FILE")]
        environment: Option<PathBuf>,
        /// Samples per pixel, in place of the preset's.
        #[arg(long, value_name = "N", value_parser = whole(1..=4096_u32), allow_hyphen_values = true,
            conflicts_with_all = ["max_error", "max_seconds"])]
        spp: Option<u32>,
        #[command(flatten)]
        target: TargetArgs,
    },
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormatName {
    Zip,
    Glb,
    Json,
    Paint,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PictureName {
    Png,
    Exr,
}

impl From<PictureName> for PictureFormat {
    fn from(name: PictureName) -> Self {
        match name {
            PictureName::Png => Self::Png,
            PictureName::Exr => Self::Exr,
        }
    }
}

impl Estimate {
    pub fn run(&self, as_json: bool) -> Result<(), WorkshopError> {
        let begun = Instant::now();
        let target = match &self.work {
            What::Ingest { target, .. }
            | What::Blend { target, .. }
            | What::Realise { target, .. }
            | What::Bundle { target, .. }
            | What::Preview { target, .. } => target,
        };
        let reading = match &self.work {
            What::Ingest { reading, .. } => reading.clone(),
            _ => ReadingArgs::default(),
        };
        let options = reading.options(None, &target.profile)?;
        let estimate = self.estimate(target, &options)?.after(vec![starting()]);
        if as_json {
            let mut told = serde_json::to_value(&estimate).map_err(WorkshopError::internal)?;
            told["estimated_in_seconds"] = json!(begun.elapsed().as_secs_f64());
            return output::print_json(&told);
        }
        let stages: Vec<String> = estimate
            .stages
            .iter()
            .map(|s| format!("{} {:.3}", s.stage, s.seconds))
            .collect();
        let why = estimate.error.unknown;
        output::print(&format!(
            "profile: {}\nseconds: {:.3} ({})\nbytes: {}\nerror: {}{}\n",
            Knobs::told(&estimate.knobs),
            estimate.seconds,
            stages.join(", "),
            estimate.bytes,
            estimate.error,
            why.map_or(String::new(), |why| format!(" ({why})"))
        ))
    }

    fn estimate(
        &self,
        args: &TargetArgs,
        options: &IngestOptions,
    ) -> Result<Estimated, WorkshopError> {
        let of = |work: &Work<'_>| match args.pick(work)? {
            Some(picked) => {
                eprintln!("target {}", picked.told());
                Ok(picked.estimate)
            }
            None => work.estimate(&options.profile),
        };
        match &self.work {
            What::Ingest { input, .. } => of(&Work::Ingest {
                path: &measurement(input)?,
                options,
            }),
            What::Blend { inputs, .. } => of(&Work::BlendNames {
                names: inputs,
                options,
            }),
            What::Realise {
                input,
                weights,
                format,
                ..
            } => {
                let begun = Instant::now();
                let thing = open(input, options, &|_| ())?;
                let opened = opening(begun);
                let weights = weights.for_thing(&thing)?;
                let format = match format {
                    FormatName::Zip => Format::Zip,
                    FormatName::Glb => Format::Glb,
                    FormatName::Json => Format::Json,
                    FormatName::Paint => Format::Paint,
                };
                let estimate = of(&Work::Realise {
                    thing: &thing,
                    weights: weights.as_ref(),
                    format,
                    written: true,
                })?;
                Ok(estimate.after(vec![opened]))
            }
            What::Bundle { input, .. } => {
                let begun = Instant::now();
                let thing = open(input, options, &|_| ())?;
                let opened = opening(begun);
                let estimate = of(&Work::Bundle {
                    thing: &thing,
                    written: true,
                })?;
                Ok(estimate.after(vec![opened]))
            }
            What::Preview {
                input,
                weights,
                frame,
                show,
                format,
                environment,
                spp,
                target,
            } => {
                refuse_samples_of_angles(*show, *spp, target, input)?;
                refuse_samples_twice(*spp, &target.profile)?;
                let (mut opened, thing) = sample_to_estimate(input, options)?;
                let weights = weights.for_thing(&thing)?;
                let begun = Instant::now();
                let read = |path: &PathBuf| read_environment(path, &options.limits);
                let environment = environment.as_ref().map(read).transpose()?;
                if environment.is_some() {
                    let seconds = begun.elapsed().as_secs_f64();
                    let stage = "environment";
                    opened.push(Stage { stage, seconds });
                }
                let mut profile = options.profile;
                profile.samples_per_pixel = spp.unwrap_or(profile.samples_per_pixel);
                let view = PreviewOptions {
                    show: (*show).into(),
                    scene: frame.scene.into(),
                    size: [frame.size.width, frame.size.height],
                    samples_per_pixel: profile.samples_per_pixel,
                    environment,
                    lights: None,
                };
                let work = Work::Preview(PictureWork {
                    thing: &thing,
                    weights: weights.as_ref(),
                    options: &view,
                    format: (*format).into(),
                    limits: &options.limits,
                    written: true,
                });
                let estimate = match args.pick(&work)? {
                    Some(picked) => {
                        eprintln!("target {}", picked.told());
                        picked.estimate
                    }
                    None => work.estimate(&profile)?,
                };
                Ok(estimate.after(opened))
            }
        }
    }
}

/// What it takes to start this program at all.
fn starting() -> Stage {
    let begun = Instant::now();
    let started = std::env::current_exe().and_then(|program| {
        std::process::Command::new(program)
            .arg("--version")
            .output()
    });
    Stage {
        stage: "start",
        seconds: started.map_or(0.0, |_| begun.elapsed().as_secs_f64()),
    }
}

fn opening(begun: Instant) -> Stage {
    Stage {
        stage: "open",
        seconds: begun.elapsed().as_secs_f64(),
    }
}
