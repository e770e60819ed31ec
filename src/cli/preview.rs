//! `carpaint preview`: a picture of a paint.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::ingest::ReadingArgs;
use super::made;
use super::number::whole;
use super::output;
use super::profile::{ProfileArgs, TargetArgs};
use super::progress::Progress;
use super::weights::WeightArgs;
use crate::workshop::{
    Laps, PictureFormat, PictureWork, PreviewOptions, Shape, Show, Source, Work, WorkshopError,
    find, open, preview, read_environment,
};

/// Draw a paint, a blend at given weights, or a sample.
#[derive(Args, Clone, Debug)]
pub struct Preview {
    /// A .paint, a .blend, a sample or a measurement.
    #[arg(value_name = "PAINT|BLEND|sample")]
    input: String,
    #[command(flatten)]
    weights: WeightArgs,
    #[command(flatten)]
    frame: FrameArgs,
    /// What is shown on it: the paint, or the aspecular angle, 0 to 180 degrees from the mirror image of the main light, as
    /// bands between the instruments' angles. Angles are the same for every paint and have no samples.
    #[arg(
        long,
        value_name = "WHAT",
        default_value = "paint",
        allow_hyphen_values = true
    )]
    show: ShowName,
    /// Samples per pixel, in place of the preset's.
    #[arg(long, value_name = "N", value_parser = whole(1..=4096_u32), allow_hyphen_values = true,
        conflicts_with_all = ["max_error", "max_seconds"])]
    spp: Option<u32>,
    /// A panorama to light it with, .hdr or .exr, in place of the built-in studio.
    #[arg(long, value_name = "FILE")]
    environment: Option<PathBuf>,
    #[command(flatten)]
    target: TargetArgs,
    /// Picture to write: .png for a screen, .exr for linear light, or for angles in degrees.
    #[arg(long, value_name = "F.png|F.exr")]
    out: PathBuf,
    /// Write the seconds each stage took.
    #[arg(long, value_name = "T.json")]
    timings: Option<PathBuf>,
}

/// What a picture shows, and how large it is.
#[derive(Args, Clone, Copy, Debug)]
pub struct FrameArgs {
    /// What the paint is on, 40 mm across and near enough to tell its flakes.
    #[arg(
        long,
        value_name = "SHAPE",
        default_value = "sphere",
        allow_hyphen_values = true
    )]
    pub scene: ShapeName,
    /// Width and height in pixels.
    #[arg(
        long,
        value_name = "WxH",
        default_value = "512x512",
        allow_hyphen_values = true
    )]
    pub size: Size,
}

/// What the paint is on.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ShapeName {
    Sphere,
    Capsule,
    Panel,
}

impl From<ShapeName> for Shape {
    fn from(name: ShapeName) -> Self {
        match name {
            ShapeName::Sphere => Self::Sphere,
            ShapeName::Capsule => Self::Capsule,
            ShapeName::Panel => Self::Panel,
        }
    }
}

/// What is shown on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ShowName {
    Paint,
    Aspecular,
}

impl From<ShowName> for Show {
    fn from(name: ShowName) -> Self {
        match name {
            ShowName::Paint => Self::Paint,
            ShowName::Aspecular => Self::Aspecular,
        }
    }
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

/// An option that would be ignored is refused.
pub fn refuse_samples_of_angles(
    show: ShowName,
    spp: Option<u32>,
    target: &TargetArgs,
    input: &str,
) -> Result<(), WorkshopError> {
    if show != ShowName::Aspecular {
        return Ok(());
    }
    let given = [
        ("--spp", spp.is_some()),
        ("--max-error", target.max_error.is_some()),
        ("--max-seconds", target.max_seconds.is_some()),
    ];
    let refused = |option: &str, why: &str| {
        let problem = format!(
            "{option} beside --show aspecular: angles follow from the scene, {why}; leave the option out"
        );
        Err(WorkshopError::usage(option, problem))
    };
    if let Some((option, _)) = given.iter().find(|(_, is)| *is) {
        return refused(option, "without samples");
    }
    let args = &target.profile;
    let turned = args.knobs.iter().find_map(|knobs| knobs.samples_per_pixel);
    if let Some(samples) = turned {
        let option = format!("--knob samples_per_pixel={samples}");
        return refused(&option, "without samples");
    }
    if let Some(samples) = args.knobs()?.samples_per_pixel {
        let option = format!("--profile with samples_per_pixel={samples}");
        return refused(&option, "without samples");
    }
    // A sample is made with a profile, a file is what it is.
    if args.is_given() && !matches!(find(input)?, Source::Sample(_)) {
        return refused("--profile", "whatever the profile of a paint in a file");
    }
    Ok(())
}

/// Samples per pixel that contradict those of the profile beside them are refused.
pub fn refuse_samples_twice(spp: Option<u32>, args: &ProfileArgs) -> Result<(), WorkshopError> {
    match spp.zip(args.knobs()?.samples_per_pixel) {
        Some((spp, own)) if spp != own => {
            let problem = format!(
                "--spp is {spp}, and samples_per_pixel {own} in the profile beside it; accepted is one of the two"
            );
            Err(WorkshopError::usage("--spp", problem))
        }
        _ => Ok(()),
    }
}

impl Preview {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        refuse_samples_of_angles(self.show, self.spp, &self.target, &self.input)?;
        let options = ReadingArgs::default().options(None, &self.target.profile)?;
        refuse_samples_twice(self.spp, &self.target.profile)?;
        let format = PictureFormat::of_path(&self.out)?;
        let mut stages = Laps::begin();
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
            show: self.show.into(),
            scene: self.frame.scene.into(),
            size: [self.frame.size.width, self.frame.size.height],
            samples_per_pixel: self.spp.unwrap_or(options.profile.samples_per_pixel),
            environment,
            lights: None,
        };
        stages.end("open");
        let progress = Progress::new("looking for samples");
        let picked = self.target.pick(&Work::Preview(PictureWork {
            thing: &thing,
            weights: weights.as_ref(),
            options: &wanted,
            format,
            limits: &options.limits,
            written: true,
        }))?;
        drop(progress);
        if let Some(picked) = &picked {
            // Before the wait, not after it.
            eprintln!("target {}", picked.told());
            wanted.samples_per_pixel = picked.profile().samples_per_pixel;
        }
        if picked.is_some() {
            stages.end("search");
        }
        let progress = Progress::new("drawing");
        let made = preview(
            &thing,
            weights.as_ref(),
            &wanted,
            format,
            &options.limits,
            &|share| progress.at(share),
        )?;
        stages.end_with(&made.stages);
        output::replace(&self.out, &made.bytes)?;
        drop(progress);
        stages.end("write");
        made::write_seconds(self.timings.as_deref(), stages)?;
        let size = format!(
            "{} x {}{}",
            self.frame.size.width,
            self.frame.size.height,
            error_told(&made.report)
        );
        made::tell(
            json,
            &self.out,
            &made,
            picked.as_ref().filter(|_| json),
            &size,
        )
    }
}

/// Error of a picture of a paint, for people.
fn error_told(report: &serde_json::Value) -> String {
    let error = &report["picture_error"];
    let number = |name: &str| error[name].as_f64();
    match (number("delta_e_2000"), number("samples"), number("paint")) {
        (Some(all), Some(samples), Some(paint)) => format!(
            ", off by CIEDE2000 {all:.2} in the mean: samples leave {samples:.2} to chance, {paint:.2} is the paint's mean color"
        ),
        (_, Some(samples), _) => format!(
            ", samples leave CIEDE2000 {samples:.2} to chance in the mean; how far off the paint is, is not known: {}",
            error["how"].as_str().unwrap_or_default()
        ),
        _ => String::new(),
    }
}
