//! Pictures of painted objects: scene, surroundings, shading, film.
//!
//! [`render`] draws a ball, a capsule or a panel of physical size under directional lights and an environment, with
//! every texel's flakes of its own, and gives back linear light ([`Film`]) and what was simulated ([`RenderReport`]).
//! The same paint and scene give the same bytes on any number of threads: rows are shaded independently and collected in
//! order, sample points depend on pixel and seed alone. [`aspecular`] maps the aspecular angle in place of a paint.
//!
//! Left to others: which profile asks for how many samples (`accuracy`), meshes, and what a paint is (`paint`).

mod aspecular;
mod backdrop;
mod difference;
mod effects;
mod environment;
mod environment_file;
mod environment_map;
mod film;
mod ground;
mod kernel;
mod lanes;
mod lens;
mod light_grid;
mod light_table;
mod noise;
mod optics;
mod points;
mod scene;
mod shade;
mod studio;
mod surface;
mod texels;
mod tone;
mod vector;

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;
use serde::Serialize;

pub use aspecular::{
    AspecularBand, AspecularMap, AspecularReport, LightCandidate, MainLight, aspecular,
};
pub use difference::{PictureDifference, difference};
pub use effects::{Effect, EffectPlan, PlannedEffect};
pub use environment::{Environment, Held};
pub use environment_file::{EnvironmentError, EnvironmentFile, EnvironmentFormat};
pub use film::{Film, FilmError};
pub use noise::SamplingError;
pub use scene::{Background, Camera, DirectionalLight, Scene};
pub use surface::Shape;
pub use texels::texels;
pub use tone::neutral;

use crate::paint::{CarPaint, Limits};

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A field of the scene is out of range.
    #[error("{field}: {reason}")]
    Scene {
        /// Which field.
        field: &'static str,
        /// What it is and what would be accepted.
        reason: String,
    },
    /// Texels of a paint without flakes were asked for.
    #[error("the paint is a solid color, it has no flakes to draw")]
    NoFlakes,
    /// The picture could not be written.
    #[error(transparent)]
    Film(#[from] FilmError),
}

/// What was simulated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RenderReport {
    /// The effect plan.
    #[serde(flatten)]
    pub plan: EffectPlan,
    /// Samples per pixel.
    pub samples_per_pixel: u32,
    /// What the samples leave to chance.
    pub sampling: SamplingError,
    /// Paint seen by a pixel in the middle of the picture, millimetres.
    pub pixel_mm: f64,
}

/// A picture and what was simulated for it.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Linear light.
    pub film: Film,
    /// What was simulated.
    pub report: RenderReport,
}

/// Draws a paint in a scene, on the threads of the current rayon pool. `progress` is told shares of the work, 0 to 1.
///
/// # Errors
///
/// [`RenderError::Scene`] for a scene that is out of range or beyond the limits.
pub fn render(
    paint: &CarPaint,
    scene: &Scene,
    limits: &Limits,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Rendering, RenderError> {
    scene.validate(limits)?;
    let (shader, plan) = shade::Shader::new(paint, scene);
    let [width, height] = scene.size;
    let done = AtomicU32::new(0);
    let mut pixels = vec![[0.0; 3]; width as usize * height as usize];
    (0..height)
        .into_par_iter()
        .zip(pixels.par_chunks_exact_mut(width as usize))
        .for_each(|(y, row)| {
            for (x, pixel) in (0..width).zip(row) {
                *pixel = shader.pixel(x, y, scene.seed);
            }
            let rows = done.fetch_add(1, Ordering::Relaxed) + 1;
            #[allow(clippy::cast_precision_loss)]
            progress(rows as f32 / height as f32);
        });
    let film = Film::new(width, height, scene.exposure, pixels);
    let report = RenderReport {
        sampling: noise::sampling_error(&shader, scene, Some(&film), progress),
        plan,
        samples_per_pixel: scene.samples_per_pixel,
        pixel_mm: pixel_mm(scene),
    };
    Ok(Rendering { film, report })
}

/// What the samples of a picture will leave to chance, without drawing it: only the pixels that tell are drawn.
///
/// # Errors
///
/// [`RenderError::Scene`] for a scene that is out of range or beyond the limits.
pub fn sampling(
    paint: &CarPaint,
    scene: &Scene,
    limits: &Limits,
) -> Result<SamplingError, RenderError> {
    scene.validate(limits)?;
    let (shader, _) = shade::Shader::new(paint, scene);
    Ok(noise::sampling_error(&shader, scene, None, &|_| ()))
}

fn pixel_mm(scene: &Scene) -> f64 {
    let away = vector::sub(scene.camera.origin, scene.camera.target);
    let distance = f64::from(vector::dot(away, away).sqrt()) - 1.0;
    let tangent = f64::from(scene.camera.field_of_view_deg).to_radians() / 2.0;
    let across = 2.0 * tangent.tan() * distance.max(0.0) * scene.object_mm / 2.0;
    across / f64::from(scene.size[0].min(scene.size[1]))
}

#[cfg(test)]
mod tests;
