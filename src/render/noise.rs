//! What a picture's samples leave to chance: its Monte Carlo standard error, measured.
//!
//! Sample points are a randomised low-discrepancy set, whose error cannot be told from the spread of its samples. A
//! lattice of pixels is therefore drawn again with other points: the difference of two independent drawings has √2 times
//! the standard error of one. It is told as CIEDE2000 of the tone-mapped colors. What is no chance is not in it: below the
//! number of flakes under a pixel, samples draw fewer flakes with less contrast.

use rayon::prelude::*;
use serde::Serialize;

use super::film::Film;
use super::scene::Scene;
use super::shade::Shader;
use super::tone::neutral;
use super::vector::Vec3;
use crate::color::{Lab, ciede2000};

/// Most pixels drawn again.
const PROBED: u32 = 1024;

/// At most one of so many pixels is drawn again.
const LEAST_STRIDE: u32 = 4;

/// What is added to the seed for the second drawing.
const OTHER: u32 = 0x9e37_79b9;

/// Standard error of a pixel's color by chance, CIEDE2000.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SamplingError {
    /// Pixels that were drawn twice.
    pub pixels: usize,
    /// Mean over them, object and background.
    pub mean_delta_e: f64,
    /// 95th percentile over them.
    pub p95_delta_e: f64,
}

/// Draws some pixels again; where there is no picture yet, twice.
pub(super) fn sampling_error(
    shader: &Shader<'_>,
    scene: &Scene,
    film: Option<&Film>,
) -> SamplingError {
    let [width, height] = scene.size;
    let mut stride = LEAST_STRIDE;
    while width.div_ceil(stride) * height.div_ceil(stride) > PROBED {
        stride += 1;
    }
    // A side shorter than half a stride has its last pixel.
    let along = |length: u32| ((stride / 2).min(length - 1)..length).step_by(stride as usize);
    let lattice: Vec<(u32, u32)> = along(height)
        .flat_map(|y| along(width).map(move |x| (x, y)))
        .collect();
    let mut errors: Vec<f64> = lattice
        .par_iter()
        .map(|&(x, y)| {
            let again = shader.pixel(x, y, scene.seed.wrapping_add(OTHER));
            let first = film.map_or_else(
                || shader.pixel(x, y, scene.seed),
                |film| film.pixels()[(y * width + x) as usize],
            );
            ciede2000(shown(first, scene.exposure), shown(again, scene.exposure))
                / std::f64::consts::SQRT_2
        })
        .collect();
    if errors.is_empty() {
        return SamplingError::default();
    }
    errors.sort_unstable_by(f64::total_cmp);
    #[allow(clippy::cast_precision_loss)] // at most a thousand
    let mean_delta_e = errors.iter().sum::<f64>() / errors.len() as f64;
    SamplingError {
        pixels: errors.len(),
        mean_delta_e,
        p95_delta_e: errors[errors.len() * 95 / 100],
    }
}

/// Color of a pixel as a screen shows it.
pub(super) fn shown(pixel: Vec3, exposure: f32) -> Lab {
    Lab::from_rgb(neutral(pixel.map(|v| v * exposure)).map(f64::from))
}
