//! `carpaint ingest`: a measurement becomes a `.paint`.

use std::cell::RefCell;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::made;
use super::number::{real, whole};
use super::profile::{ProfileArgs, TargetArgs};
use super::progress::Progress;
use super::{output, show};
use crate::accuracy::paint_error;
use crate::measurement::{Layout, ReadOptions, ThetaHSpacing};
use crate::workshop::{
    IngestOptions, Laps, Source, Work, WorkshopError, describe_paint, find, ingest_in_stages,
    is_paint_file,
};

const A_CSV: &str = "\
A CSV of readings:

    # name: my silver
    # illuminant: D65
    # observer: 10
    # illumination_deg: 45
    aspecular_deg,L,a,b
    15,95.2,-0.6,0.9
    45,48.7,-0.9,-1.2
    110,24.1,-0.3,-1.8";

/// Fit a measurement and keep it as a .paint.
///
/// INPUT is a measured-paint package (a .zip or a folder), an RGL .bsdf, an MPI 2005 table, a MERL binary, or readings of a
/// hand-held multi-angle instrument as CSV or CxF3. What it is is recognised from its contents; --layout overrides that.
///
/// A CSV of readings has a line for each angle: aspecular_deg first, degrees from the mirror direction towards the light,
/// then L, a, b or a spectrum nm400 to nm700 (1 is white). Lines above the columns say what a table cannot.
///
/// Of a CxF3 document with several paints, --name says which. From readings alone a base is fitted that reads the same;
/// they show neither flakes nor the clear coat: of CSV and CxF3 one of index 1.5 is assumed unless --coat-ior says otherwise.
// A terminal shows backticks as they are.
#[allow(clippy::doc_markdown)]
#[derive(Args, Clone, Debug)]
#[command(verbatim_doc_comment, after_long_help = A_CSV)]
pub struct Ingest {
    /// The measurement.
    #[arg(value_name = "INPUT")]
    input: String,
    /// Name of the paint, in place of the measurement's own; which of a CxF3 document's paints, by its name or Id.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    name: Option<String>,
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    target: TargetArgs,
    /// File to write.
    #[arg(long, value_name = "P.paint")]
    out: PathBuf,
    /// Write the seconds each stage took.
    #[arg(long, value_name = "T.json")]
    timings: Option<PathBuf>,
}

/// How a measurement is read.
#[allow(clippy::doc_markdown)]
#[derive(Args, Clone, Debug, Default)]
pub struct ReadingArgs {
    /// What the file is, where it should not be recognised from its contents.
    #[arg(long, value_enum, value_name = "LAYOUT", allow_hyphen_values = true)]
    layout: Option<LayoutName>,
    /// Spacing of the half angle in an MPI 2005 table.
    #[arg(long, value_enum, value_name = "SPACING", allow_hyphen_values = true)]
    theta_h: Option<SpacingName>,
    /// Bytes before the values of an MPI 2005 table, 84 unless given.
    #[arg(long, value_name = "N", value_parser = whole(0..=1_u64 << 20),
        allow_hyphen_values = true)]
    header_bytes: Option<u64>,
    /// Give the paint a clear coat of this index of refraction, 1 to 4; otherwise the fit decides, and of readings as CSV or
    /// CxF3, which 1 leaves uncoated, it is 1.5.
    #[arg(long, value_name = "N", value_parser = real(1.0..=4.0), allow_hyphen_values = true)]
    coat_ior: Option<f64>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum LayoutName {
    #[value(name = "mpi-2005")]
    Mpi2005,
    Merl,
    Rgl,
    Package,
    Csv,
    Cxf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum SpacingName {
    Linear,
    Sqrt,
}

impl ReadingArgs {
    /// The options these arguments mean, for a profile.
    pub fn options(
        &self,
        name: Option<String>,
        profile: &ProfileArgs,
    ) -> Result<IngestOptions, WorkshopError> {
        let layout = self.layout.map(|layout| match layout {
            LayoutName::Mpi2005 => Layout::Mpi2005,
            LayoutName::Merl => Layout::Merl,
            LayoutName::Rgl => Layout::Rgl,
            LayoutName::Package => Layout::Package,
            LayoutName::Csv => Layout::Csv,
            LayoutName::Cxf => Layout::Cxf,
        });
        let theta_h = self.theta_h.map(|spacing| match spacing {
            SpacingName::Linear => ThetaHSpacing::Linear,
            SpacingName::Sqrt => ThetaHSpacing::SquareRoot,
        });
        Ok(IngestOptions {
            name,
            read: ReadOptions {
                layout,
                theta_h,
                header_bytes: self.header_bytes,
            },
            coat_ior: self.coat_ior,
            asked: profile.knobs()?,
            profile: profile.profile()?,
            ..IngestOptions::default()
        })
    }
}

/// Where a measurement is; what is none already is refused.
pub fn measurement(name: &str) -> Result<PathBuf, WorkshopError> {
    match find(name)? {
        Source::Path(path) if is_paint_file(&path)? => {
            let hint = "this is a .paint: nothing of it is left to ingest";
            Err(WorkshopError::input(name, hint))
        }
        Source::Path(path) => Ok(path),
        Source::Sample(sample) => {
            let hint = format!(
                "a sample is no measurement; 'carpaint samples export {}' writes its .paint",
                sample.name
            );
            Err(WorkshopError::input(name, hint))
        }
    }
}

impl Ingest {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        output::check_ending(&self.out, "paint")?;
        let mut options = self
            .reading
            .options(self.name.clone(), &self.target.profile)?;
        let path = measurement(&self.input)?;
        let work = Work::Ingest {
            path: &path,
            options: &options,
        };
        let stages = RefCell::new(Laps::begin());
        let ended = |stage| stages.borrow_mut().end(stage);
        let picked = self.target.pick(&work)?;
        if let Some(picked) = &picked {
            options.profile = *picked.profile();
            ended("search");
        }
        let progress = Progress::new("ingesting");
        let paint = ingest_in_stages(&path, &options, &|share| progress.at(share), &ended)?;
        output::replace(&self.out, &paint.to_bytes()?)?;
        ended("write");
        drop(progress);
        made::write_seconds(self.timings.as_deref(), stages.into_inner())?;
        if json {
            return output::print_json(
                &json!({ "out": self.out.display().to_string(), "profile": options.profile.name(), "picked": picked, "paint": describe_paint(&paint) }),
            );
        }
        made::notes(picked.as_ref(), &[]);
        for warning in &paint.warnings {
            eprintln!("warning: {warning}");
        }
        eprintln!(
            "{}: {}{}",
            self.out.display(),
            show::one_line(&paint),
            made::error(&paint_error(&paint)),
        );
        Ok(())
    }
}
