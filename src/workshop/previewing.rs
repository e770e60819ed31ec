//! Pictures of a paint or of its aspecular angles, and its flakes texel by texel.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::json;
use utoipa::ToSchema;

use super::realising::{Made, check, choose, error_of};
use super::{Laps, Thing, WorkshopError, read};
use crate::accuracy::PictureError;
use crate::blend::RealisationWeights;
use crate::paint::{CarPaint, Limits};
use crate::render::{self, DirectionalLight, Environment, RenderError, Scene, Shape};

/// Most samples of one picture that a service draws: pixels times samples per pixel.
pub const MOST_SAMPLES: u64 = 1 << 28;

/// What a picture shows on the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Show {
    /// The paint.
    #[default]
    Paint,
    /// In place of it the aspecular angle, 0 to 180 degrees: how far the view is from the mirror image of the main light.
    /// The same for every paint.
    Aspecular,
}

impl Show {
    /// Whether it is the paint.
    #[must_use]
    pub const fn is_paint(&self) -> bool {
        matches!(self, Self::Paint)
    }
}

/// What a picture shows.
#[derive(Clone, Debug)]
pub struct PreviewOptions {
    /// The paint, or its aspecular angles.
    pub show: Show,
    /// What the paint is on.
    pub scene: Shape,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples_per_pixel: u32,
    /// Panorama that lights it; the built-in studio unless given.
    pub environment: Option<Environment>,
    /// Lights in place of the usual one of the scene.
    pub lights: Option<Vec<Light>>,
}

/// Light of one direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Towards the light, of any length: x to the right, y up, z towards the viewer.
    #[schema(min_items = 3, max_items = 3)]
    pub towards: [f32; 3],
    /// Irradiance on a surface that faces it, linear sRGB; that of the scene's usual light unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 3, max_items = 3)]
    pub irradiance: Option<[f32; 3]>,
}

/// What a picture is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PictureFormat {
    /// Tone mapped for a screen, 8 bits.
    Png,
    /// Linear light.
    Exr,
}

impl PictureFormat {
    /// Media type of the file.
    #[must_use]
    pub const fn media_type(self) -> &'static str {
        match self {
            Self::Png => "image/png",
            Self::Exr => "image/x-exr",
        }
    }

    /// Ending of the file's name.
    #[must_use]
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Exr => "exr",
        }
    }

    /// The format that a file name's ending means.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for another ending, naming those that are accepted.
    pub fn of_path(path: &Path) -> Result<Self, WorkshopError> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            _ => {
                let problem = format!("{} ends in neither .png nor .exr", path.display());
                Err(WorkshopError::usage("out", problem))
            }
        }
    }
}

/// Reads a panorama.
///
/// # Errors
///
/// [`WorkshopError`] for a file that cannot be read or is no `.hdr` or `.exr` picture.
pub fn read_environment(path: &Path, limits: &Limits) -> Result<Environment, WorkshopError> {
    let bytes = read(path, limits)?;
    Environment::from_bytes(&bytes, limits)
        .map(|file| file.environment)
        .map_err(|e| WorkshopError::input(path.display(), e))
}

/// Draws a paint, or a blend at the given weights, or the aspecular angles in place of either.
///
/// # Errors
///
/// [`WorkshopError`] for a scene that is not offered, a size or a sample count out of range, or refused weights.
pub fn preview(
    thing: &Thing,
    weights: Option<&RealisationWeights>,
    options: &PreviewOptions,
    format: PictureFormat,
    limits: &Limits,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Made, WorkshopError> {
    let scene = scene_of(options);
    if options.show == Show::Aspecular {
        check(thing, weights)?;
        return angles(&scene, format, limits, progress);
    }
    let mut laps = Laps::begin();
    let chosen = choose(thing, weights)?;
    laps.end("realise");
    let rendering = render::render(&chosen.paint, &scene, limits, progress).map_err(refused)?;
    laps.end("draw");
    let bytes = match format {
        PictureFormat::Png => rendering.film.to_png(),
        PictureFormat::Exr => rendering.film.to_exr(),
    }
    .map_err(WorkshopError::internal)?;
    laps.end("encode");
    let error = error_of(thing, weights);
    let report = json!({
        "realisation": chosen.report,
        "rendering": rendering.report,
        "picture_error": PictureError::of(rendering.report.sampling.mean_delta_e, &error),
        "error": error,
    });
    let mut notes = chosen.notes;
    if let Some(lab) = error.lab.filter(|lab| *lab > TELLING) {
        notes.push(format!(
            "the flakes themselves are {lab:.2} Lab off, which no number of samples mends: cluster them more finely, or take more angles"
        ));
    }
    let made = Made {
        bytes,
        report,
        notes,
        stages: laps.into_stages(),
    };
    Ok(with_held(made, &scene))
}

/// Error of flakes, Lab, from which on a picture of them tells it.
const TELLING: f64 = 1.0;

/// The same with what of the surroundings is not drawn as bright as it was.
fn with_held(mut made: Made, scene: &Scene) -> Made {
    let held = scene.environment.held();
    if let Some(line) = held.line() {
        made.report["environment"] = json!(held);
        made.notes.push(line);
    }
    made
}

/// The map of aspecular angles. No paint is looked at: it would be the same for all.
fn angles(
    scene: &Scene,
    format: PictureFormat,
    limits: &Limits,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Made, WorkshopError> {
    let mut laps = Laps::begin();
    let map = render::aspecular(scene, limits, progress).map_err(refused)?;
    laps.end("draw");
    let bytes = match format {
        PictureFormat::Png => map.to_png(),
        PictureFormat::Exr => map.to_exr(),
    }
    .map_err(WorkshopError::internal)?;
    laps.end("encode");
    let made = Made {
        bytes,
        report: json!({ "aspecular": map.report() }),
        notes: Vec::new(),
        stages: laps.into_stages(),
    };
    Ok(with_held(made, scene))
}

/// Error of a picture that is not drawn yet.
pub(super) fn picture_error(
    thing: &Thing,
    weights: Option<&RealisationWeights>,
    options: &PreviewOptions,
    limits: &Limits,
) -> Result<PictureError, WorkshopError> {
    let scene = scene_of(options);
    let chosen = choose(thing, weights)?;
    let sampling = render::sampling(&chosen.paint, &scene, limits).map_err(refused)?;
    let of = error_of(thing, weights);
    Ok(PictureError::of(sampling.mean_delta_e, &of))
}

fn scene_of(options: &PreviewOptions) -> Scene {
    let mut scene = Scene::new(options.scene, options.size);
    scene.samples_per_pixel = options.samples_per_pixel;
    if let Some(environment) = &options.environment {
        scene = scene.in_environment(environment.clone());
    }
    if let Some(lights) = &options.lights {
        let usual = DirectionalLight::key(options.scene).irradiance;
        let light = |light: &Light| DirectionalLight {
            towards: light.towards,
            irradiance: light.irradiance.unwrap_or(usual),
        };
        scene.lights = lights.iter().map(light).collect();
    }
    scene
}

fn refused(error: RenderError) -> WorkshopError {
    let field = match &error {
        RenderError::Scene { field, .. } => field,
        _ => "scene",
    };
    WorkshopError::usage(field, error)
}

/// The flakes at an angle pair in degrees, as the random texture draws them, as an EXR.
///
/// # Errors
///
/// [`WorkshopError`] for a paint without flakes or a picture too large.
pub fn texels(
    paint: &CarPaint,
    theta_deg: [f64; 2],
    size: [u32; 2],
    seed: u32,
    limits: &Limits,
) -> Result<Vec<u8>, WorkshopError> {
    render::texels(paint, theta_deg[0], theta_deg[1], size, seed, limits).map_err(refused)
}
