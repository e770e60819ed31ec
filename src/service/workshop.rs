//! The workshop behind the service's desk: each piece of work is the use case that the command line calls too.

use std::path::Path;

use serde_json::Value;

use super::works::{
    Fault, Format, IngestOrder, Layout, Light, Picture, PictureFormat, Progress, Scene, ThetaH,
    Thing, View, WorkError, Works,
};
use crate::accuracy::Profile;
use crate::blend::{Blend, RealisationWeights};
use crate::measurement::{self, ReadOptions, ThetaHSpacing};
use crate::paint::{Limits, PaintFile};
use crate::workshop::{self, IngestOptions, PreviewLight, PreviewOptions, WorkshopError};

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

impl From<WorkshopError> for WorkError {
    fn from(error: WorkshopError) -> Self {
        let fault = match error.fault {
            workshop::Fault::Usage => Fault::Request,
            workshop::Fault::Input => Fault::Upload,
            workshop::Fault::Output | workshop::Fault::Internal => Fault::Internal,
        };
        Self {
            fault,
            field: error.field,
            message: error.message,
        }
    }
}

impl Works for Workshop {
    fn ingest(
        &self,
        upload: &Path,
        order: &IngestOrder,
        progress: Progress<'_>,
    ) -> Result<PaintFile, WorkError> {
        let layout = order.layout.map(|layout| match layout {
            Layout::Mpi2005 => measurement::Layout::Mpi2005,
            Layout::Merl => measurement::Layout::Merl,
            Layout::Rgl => measurement::Layout::Rgl,
            Layout::Package => measurement::Layout::Package,
        });
        let theta_h = order.theta_h.map(|spacing| match spacing {
            ThetaH::Linear => ThetaHSpacing::Linear,
            ThetaH::Sqrt => ThetaHSpacing::SquareRoot,
        });
        let options = IngestOptions {
            name: order.name.clone(),
            read: ReadOptions {
                layout,
                theta_h,
                header_bytes: order.header_bytes,
            },
            coat_ior: order.coat_ior,
            clusters: order.clusters.map(|n| n as usize),
            profile: order.profile,
            limits: self.limits,
        };
        Ok(workshop::ingest_upload(upload, &options, progress)?)
    }

    fn blend(
        &self,
        paints: &[&PaintFile],
        profile: &Profile,
        progress: Progress<'_>,
    ) -> Result<Blend, WorkError> {
        Ok(workshop::blend_paints(paints, profile, progress)?.blend)
    }

    fn realise(
        &self,
        thing: &Thing,
        weights: Option<&RealisationWeights>,
        format: Format,
        profile: &Profile,
    ) -> Result<Vec<u8>, WorkError> {
        let format = match format {
            Format::Zip => workshop::Format::Zip,
            Format::Glb => workshop::Format::Glb,
            Format::Json => workshop::Format::Json,
            Format::Paint => workshop::Format::Paint,
        };
        Ok(workshop::realise(thing, weights, format, profile)?.bytes)
    }

    fn preview(
        &self,
        thing: &Thing,
        weights: Option<&RealisationWeights>,
        view: &View,
        format: PictureFormat,
        progress: Progress<'_>,
    ) -> Result<Picture, WorkError> {
        let scene = match view.scene {
            Scene::Sphere => "sphere",
            Scene::Capsule => "capsule",
            Scene::Panel => "panel",
        };
        let options = PreviewOptions {
            scene: scene.to_owned(),
            size: view.size,
            samples_per_pixel: view.samples_per_pixel,
            environment: None,
            lights: view.lights.as_ref().map(|lights| {
                let light = |light: &Light| PreviewLight {
                    towards: light.towards,
                    irradiance: light.irradiance,
                };
                lights.iter().map(light).collect()
            }),
        };
        let format = match format {
            PictureFormat::Png => workshop::PictureFormat::Png,
            PictureFormat::Exr => workshop::PictureFormat::Exr,
        };
        let made = workshop::preview(thing, weights, &options, format, &self.limits, progress)?;
        let number = |path: &str| made.report.pointer(path).and_then(Value::as_f64);
        let mut accuracy = Vec::new();
        for (name, path) in [
            ("sampling-mean-de2000", "/rendering/sampling/mean_delta_e"),
            ("sampling-p95-de2000", "/rendering/sampling/p95_delta_e"),
            ("flakes-lab", "/error/lab"),
        ] {
            accuracy.extend(number(path).map(|value| format!("{name}={value:.4}")));
        }
        Ok(Picture {
            bytes: made.bytes,
            accuracy: accuracy.join(", "),
            report: made.report,
        })
    }

    fn describe(&self, thing: &Thing) -> Value {
        match thing {
            Thing::Paint(paint) => workshop::describe_paint(paint),
            Thing::Blend(blend) => workshop::describe_blend(blend),
        }
    }
}
