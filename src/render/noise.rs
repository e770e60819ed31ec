//! What a picture's samples leave to chance: its Monte Carlo standard error, measured.
//!
//! Sample points are a randomised low-discrepancy set, whose error cannot be told from the spread of its samples. A
//! lattice of pixels is therefore drawn again with other points: the difference of two independent drawings has √2 times
//! the standard error of one. It is told as CIEDE2000 of the tone-mapped colors. What is no chance is not in it: below the
//! number of flakes under a pixel, samples draw fewer flakes with less contrast.
//!
//! FLIP looks at a pixel's neighbourhood, so that whole tiles are drawn again for it. It is no spread that could be halved:
//! told is the FLIP between the two drawings. They differ by √2 times as much as one from the picture without chance, so
//! that it is usually above that picture's FLIP.

use rayon::prelude::*;
use serde::Serialize;

use super::difference::flip;
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

/// Side of a tile that is drawn again, pixels: FLIP's widest filter has 21.
const TILE: u32 = 32;

/// Most tiles along a side of the picture.
const MOST_TILES: u32 = 3;

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
    /// Mean FLIP, 0 to 1, between two drawings of tiles spread over the picture; usually above that of one drawing.
    /// `None` of a picture that is not drawn.
    pub flip_between_drawings: Option<f64>,
}

/// Draws some pixels again; where there is no picture yet, twice.
pub(super) fn sampling_error(
    shader: &Shader<'_>,
    scene: &Scene,
    film: Option<&Film>,
    progress: &(dyn Fn(f32) + Sync),
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
    let drawn_twice = |x: u32, y: u32| {
        let again = shader.pixel(x, y, scene.seed.wrapping_add(OTHER));
        let first = film.map_or_else(
            || shader.pixel(x, y, scene.seed),
            |film| film.pixels()[(y * width + x) as usize],
        );
        [first, again]
    };
    let mut errors: Vec<f64> = lattice
        .par_iter()
        .map(|&(x, y)| {
            // Whoever hears it may call the work off.
            progress(1.0);
            let [first, again] = drawn_twice(x, y);
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
        flip_between_drawings: film.map(|_| flip_of_tiles(scene, &drawn_twice, progress)),
    }
}

/// Mean FLIP between two drawings, over tiles of the picture.
fn flip_of_tiles(
    scene: &Scene,
    drawn_twice: &(impl Fn(u32, u32) -> [Vec3; 2] + Sync),
    progress: &(dyn Fn(f32) + Sync),
) -> f64 {
    let [width, height] = scene.size;
    let side = TILE.min(width).min(height);
    // At least one, however small the picture; a sixteenth of it at most from 256 pixels on.
    let along = |length: u32| (length / (TILE * LEAST_STRIDE)).clamp(1, MOST_TILES);
    let middles = |length: u32| {
        let count = along(length);
        (0..count).map(move |k| ((2 * k + 1) * length / (2 * count)).saturating_sub(side / 2))
    };
    let corners: Vec<(u32, u32)> = middles(height)
        .flat_map(|y| middles(width).map(move |x| (x.min(width - side), y.min(height - side))))
        .collect();
    let flips: Vec<f64> = corners
        .par_iter()
        .map(|&(left, top)| {
            let (first, again): (Vec<Vec3>, Vec<Vec3>) = (0..side * side)
                .map(|k| <(Vec3, Vec3)>::from(drawn_twice(left + k % side, top + k / side)))
                .collect();
            progress(1.0);
            let tile = |pixels| Film::new(side, side, scene.exposure, pixels);
            flip(&tile(first), &tile(again))
        })
        .collect();
    #[allow(clippy::cast_precision_loss)] // at most 16
    let mean = flips.iter().sum::<f64>() / flips.len() as f64;
    mean
}

/// Color of a pixel as a screen shows it.
pub(super) fn shown(pixel: Vec3, exposure: f32) -> Lab {
    Lab::from_rgb(neutral(pixel.map(|v| v * exposure)).map(f64::from))
}
