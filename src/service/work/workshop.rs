//! The workshop behind the service's desk: each piece of work is the use case that the command line calls too.

use std::path::Path;

use serde_json::Value;

use super::works::{
    Asked, Estimate, Format, Gloss, IngestOrder, MadeFile, Picked, PictureFormat, Progress,
    Readings, Target, Thing, View, Works,
};
use crate::accuracy::{Knobs, Profile};
use crate::blend::{Blend, RealisationWeights};
use crate::measurement::ReadOptions;
use crate::paint::{Limits, PaintFile};
use crate::workshop::{
    self, Environment, IngestOptions, Made, PictureWork, PreviewOptions, Work, WorkshopError,
};

/// Does the work, within limits.
#[derive(Clone, Copy, Debug)]
pub struct Workshop {
    limits: Limits,
}

impl Workshop {
    /// A workshop that keeps to these limits.
    #[must_use]
    pub const fn new(limits: Limits) -> Self {
        Self { limits }
    }
}

impl Workshop {
    fn options(&self, order: &IngestOrder) -> IngestOptions {
        IngestOptions {
            name: order.name.clone(),
            read: ReadOptions {
                layout: order.layout,
                theta_h: order.theta_h,
                header_bytes: order.header_bytes,
            },
            coat_ior: order.coat_ior,
            asked: Knobs {
                clusters: order.clusters,
                ..Knobs::default()
            },
            profile: order.profile,
            limits: self.limits,
        }
    }

    /// The work that was asked for, as the workshop estimates it.
    fn with_work<T>(&self, asked: &Asked<'_>, then: impl FnOnce(&Work<'_>) -> T) -> T {
        match *asked {
            Asked::Ingest { upload, order } => then(&Work::Ingest {
                path: upload,
                options: &self.options(order),
            }),
            Asked::Blend { paints } => then(&Work::Blend { paints }),
            Asked::Realise {
                thing,
                weights,
                format,
            } => then(&Work::Realise {
                thing,
                weights,
                format,
                written: false,
            }),
            Asked::Bundle { thing } => then(&Work::Bundle {
                thing,
                written: false,
            }),
            Asked::Preview {
                thing,
                weights,
                view,
                environment,
                format,
            } => then(&Work::Preview(PictureWork {
                thing,
                weights,
                options: &options_of(view, environment),
                format,
                limits: &self.limits,
                written: false,
            })),
        }
    }
}

/// What an instrument can be held against.
fn paint_of(thing: &Thing) -> Result<&PaintFile, WorkshopError> {
    match thing {
        Thing::Paint(paint) => Ok(paint),
        Thing::Blend(_) => Err(WorkshopError::internal("a blend is not read")),
    }
}

fn options_of(view: &View, environment: Option<&Environment>) -> PreviewOptions {
    PreviewOptions {
        show: view.show,
        scene: view.scene,
        size: view.size,
        samples_per_pixel: view.samples_per_pixel,
        environment: environment.cloned(),
        lights: view.lights.clone(),
    }
}

/// Figures of reports that headers tell: their names there, and where they stand.
const FIGURES: [(&str, &str); 7] = [
    ("picture-de2000", "/picture_error/delta_e_2000"),
    ("sampling-mean-de2000", "/rendering/sampling/mean_delta_e"),
    ("sampling-p95-de2000", "/rendering/sampling/p95_delta_e"),
    ("sampling-flip", "/rendering/sampling/flip_between_drawings"),
    ("flakes-lab", "/error/lab"),
    ("flakes-lab", "/accuracy/error/lab"),
    ("gltf-median-de2000", "/accuracy/gltf_loss/median"),
];

/// A file with what of its report headers tell.
fn told(made: Made) -> MadeFile {
    let figures = FIGURES.iter().filter_map(|(name, path)| {
        let value = made.report.pointer(path)?.as_f64()?;
        Some(format!("{name}={value:.4}"))
    });
    MadeFile {
        accuracy: figures.collect::<Vec<_>>().join(", "),
        bytes: made.bytes,
        report: made.report,
        stages: made.stages,
    }
}

impl Works for Workshop {
    fn ingest(
        &self,
        upload: &Path,
        order: &IngestOrder,
        progress: Progress<'_>,
        ended: &dyn Fn(&'static str),
    ) -> Result<PaintFile, WorkshopError> {
        let options = self.options(order);
        workshop::ingest_upload(upload, &options, progress, ended)
    }

    fn blend(
        &self,
        paints: &[&PaintFile],
        profile: &Profile,
        progress: Progress<'_>,
    ) -> Result<Blend, WorkshopError> {
        Ok(workshop::blend_paints(paints, profile, progress)?.blend)
    }

    fn realise(
        &self,
        thing: &Thing,
        weights: Option<&RealisationWeights>,
        format: Format,
        profile: &Profile,
    ) -> Result<MadeFile, WorkshopError> {
        workshop::realise(thing, weights, format, profile).map(told)
    }

    fn bundle(&self, blend: &Thing, profile: &Profile) -> Result<MadeFile, WorkshopError> {
        workshop::bundle_blend(blend, profile).map(told)
    }

    fn preview(
        &self,
        thing: &Thing,
        weights: Option<&RealisationWeights>,
        view: &View,
        environment: Option<&Environment>,
        format: PictureFormat,
        progress: Progress<'_>,
    ) -> Result<MadeFile, WorkshopError> {
        let options = options_of(view, environment);
        workshop::preview(thing, weights, &options, format, &self.limits, progress).map(told)
    }

    fn readings(
        &self,
        paint: &Thing,
        aspecular_deg: Option<&[f64]>,
    ) -> Result<Readings, WorkshopError> {
        workshop::readings(paint_of(paint)?, aspecular_deg)
    }

    fn readings_document(
        &self,
        paint: &Thing,
        aspecular_deg: Option<&[f64]>,
    ) -> Result<String, WorkshopError> {
        workshop::readings_document(paint_of(paint)?, aspecular_deg)
    }

    fn gloss(&self, paint: &Thing) -> Result<Gloss, WorkshopError> {
        Ok(workshop::gloss(paint_of(paint)?))
    }

    fn estimate(&self, asked: &Asked<'_>, profile: &Profile) -> Result<Estimate, WorkshopError> {
        self.with_work(asked, |work| work.estimate(profile))
    }

    fn pick(&self, asked: &Asked<'_>, target: &Target) -> Result<Picked, WorkshopError> {
        self.with_work(asked, |work| target.pick(work))
    }

    fn notes(&self, blend: &Blend, profile: &Profile) -> Vec<String> {
        workshop::blend_notes(blend, profile)
    }

    fn describe(&self, thing: &Thing) -> Value {
        match thing {
            Thing::Paint(paint) => workshop::describe_paint(paint),
            Thing::Blend(blend) => workshop::describe_blend(blend),
        }
    }
}
