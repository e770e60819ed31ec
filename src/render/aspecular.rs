//! The aspecular angle at every pixel: how far the view is from the mirror image of the main light.
//!
//! `γ = ∠(r, o)` with `r = 2 (n·i) n − i`, where `i` points to the light, `o` to the eye, and `n` is the normal. It is
//! the angle between two vectors, whatever plane they lie in: 0 in the highlight, up to 180 degrees. Instruments read in
//! the plane of incidence and give angles beyond the mirror a sign; a map has no such plane, so −15 and 15 are both 15.
//!
//! Object, lights and camera make the map, and nothing of a paint: it says which reading of an instrument a place in
//! a picture is to be held against. The main light is the one whose highlight the picture shows: of the directional
//! lights and the main light of the surroundings that of the largest irradiance.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;
use serde::Serialize;

use super::backdrop::behind;
use super::environment_map::luminance;
use super::film::{FilmError, screen, write_exr_channel, write_png};
use super::ground::Ground;
use super::lens::Lens;
use super::surface::Surface;
use super::tone::neutral;
use super::vector::{Vec3, add, along, cross, dot, mix, scale, smoothstep, unit};
use super::{DirectionalLight, RenderError, Scene};
use crate::color::{decode_srgb, encode_srgb_f32};
use crate::paint::Limits;

/// A band of angles and how it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AspecularBand {
    /// Where it begins, degrees.
    pub from_deg: f32,
    /// Where it ends, degrees.
    pub to_deg: f32,
    /// Its color on the screen, sRGB, 8 bits a channel.
    pub srgb: [u8; 3],
}

/// Between the angles of multi-angle instruments (ASTM E2194, E2539); colors are six steps of Matplotlib's viridis,
/// light at the face and dark at the flop, which stay apart for color-blind eyes and in gray.
const BANDS: [AspecularBand; 6] = [
    band(0.0, 15.0, [0xfd, 0xe7, 0x25]),
    band(15.0, 25.0, [0x7a, 0xd1, 0x51]),
    band(25.0, 45.0, [0x22, 0xa8, 0x84]),
    band(45.0, 75.0, [0x2a, 0x78, 0x8e]),
    band(75.0, 110.0, [0x41, 0x44, 0x87]),
    band(110.0, 180.0, [0x44, 0x01, 0x54]),
];

const fn band(from_deg: f32, to_deg: f32, srgb: [u8; 3]) -> AspecularBand {
    AspecularBand {
        from_deg,
        to_deg,
        srgb,
    }
}

/// What stands in the place of an angle beside the object.
const BESIDE: f32 = -1.0;

/// What is left of a band's light where the main light does not reach the surface.
const UNLIT: f32 = 0.35;

/// Looks at a pixel, across and down; the one in the middle tells its angle.
const LOOKS: usize = 3;

/// Where the main light comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MainLight {
    /// A directional light.
    DirectionalLight,
    /// The surroundings.
    Environment,
}

/// A light that may be the main one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LightCandidate {
    /// Where it comes from.
    pub light: MainLight,
    /// Unit vector towards it.
    pub towards: Vec3,
    /// Irradiance on a surface that faces it, linear sRGB.
    pub irradiance: Vec3,
}

/// What a map tells.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AspecularReport {
    /// Which light is mirrored.
    pub main_light: MainLight,
    /// Unit vector towards it.
    pub towards: Vec3,
    /// All lights of the scene, the surroundings' last: the main one has the largest irradiance.
    pub candidates: Vec<LightCandidate>,
    /// Least and most of the angles at the middles of pixels, degrees; `None` where none meets the object.
    pub range_deg: Option<[f32; 2]>,
    /// The color scale.
    pub bands: [AspecularBand; 6],
}

/// Aspecular angles of a scene.
#[derive(Clone, Debug)]
pub struct AspecularMap {
    width: u32,
    height: u32,
    degrees: Vec<f32>,
    srgb8: Vec<u8>,
    report: AspecularReport,
}

impl AspecularMap {
    /// Angle at the middle of each pixel, degrees, row by row from the top; −1 beside the object.
    #[must_use]
    pub fn degrees(&self) -> &[f32] {
        &self.degrees
    }

    /// What was mapped, and by which scale.
    #[must_use]
    pub const fn report(&self) -> &AspecularReport {
        &self.report
    }

    /// The map as PNG bytes: bands of color, darker where the main light does not reach, lines at their borders, and the
    /// scene's background beside the object.
    ///
    /// # Errors
    ///
    /// [`FilmError::Png`] from the encoder.
    pub fn to_png(&self) -> Result<Vec<u8>, FilmError> {
        write_png(self.width, self.height, &self.srgb8)
    }

    /// The angles as EXR bytes: one channel of 32-bit floats, `aspecular_deg`, −1 beside the object.
    ///
    /// # Errors
    ///
    /// [`FilmError::Exr`] from the encoder.
    pub fn to_exr(&self) -> Result<Vec<u8>, FilmError> {
        write_exr_channel(self.width, self.height, "aspecular_deg", |k| {
            self.degrees[k]
        })
    }
}

/// Maps the aspecular angles of a scene. `progress` is told shares of the work, 0 to 1.
///
/// Nine looks at a pixel whatever the scene's samples: nothing in it is left to chance.
///
/// # Errors
///
/// [`RenderError::Scene`] for a scene that is out of range or beyond the limits.
pub fn aspecular(
    scene: &Scene,
    limits: &Limits,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<AspecularMap, RenderError> {
    scene.validate(limits)?;
    let candidates = candidates(scene);
    let (main_light, towards) = brightest(&candidates);
    let surface = Surface::new(scene.shape);
    let mapper = Mapper {
        scene,
        ground: Ground::new(&surface),
        surface,
        lens: Lens::new(scene),
        towards,
        colors: BANDS.map(|band| band.srgb.map(linear)),
    };
    let [width, height] = scene.size;
    let done = AtomicU32::new(0);
    let rows: Vec<Vec<(f32, [u8; 3])>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let row = (0..width).map(|x| mapper.pixel(x, y)).collect();
            let rows = done.fetch_add(1, Ordering::Relaxed) + 1;
            #[allow(clippy::cast_precision_loss)] // picture sizes
            progress(rows as f32 / height as f32);
            row
        })
        .collect();
    let (degrees, srgb8): (Vec<f32>, Vec<[u8; 3]>) = rows.into_iter().flatten().unzip();
    let on_object = || degrees.iter().copied().filter(|&angle| angle >= 0.0);
    let range_deg = on_object().next().map(|first| {
        [
            on_object().fold(first, f32::min),
            on_object().fold(first, f32::max),
        ]
    });
    Ok(AspecularMap {
        width,
        height,
        report: AspecularReport {
            main_light,
            towards,
            candidates,
            range_deg,
            bands: BANDS,
        },
        degrees,
        srgb8: srgb8.concat(),
    })
}

/// All lights of a scene, the surroundings' last.
fn candidates(scene: &Scene) -> Vec<LightCandidate> {
    let of = |light: MainLight, by: &DirectionalLight| LightCandidate {
        light,
        towards: unit(by.towards),
        irradiance: by.irradiance,
    };
    let directional = scene.lights.iter();
    let around = of(MainLight::Environment, &scene.environment.main_light());
    directional
        .map(|by| of(MainLight::DirectionalLight, by))
        .chain([around])
        .collect()
}

/// The strongest candidate, the first of equals; without any light the y axis.
fn brightest(candidates: &[LightCandidate]) -> (MainLight, Vec3) {
    let (mut main, mut most) = ((MainLight::Environment, [0.0, 1.0, 0.0]), 0.0);
    for of in candidates {
        if luminance(of.irradiance) > most {
            most = luminance(of.irradiance);
            main = (of.light, of.towards);
        }
    }
    main
}

#[allow(clippy::cast_possible_truncation)] // pixels are f32
fn linear(code: u8) -> f32 {
    decode_srgb(f64::from(code) / 255.0) as f32
}

/// Angle between the mirror image of the light and the view, degrees; vectors of length 1.
///
/// By the tangent: the cosine alone loses small angles to rounding.
fn aspecular_deg(normal: Vec3, light: Vec3, eye: Vec3) -> f32 {
    let mirrored = along(scale(light, -1.0), normal, 2.0 * dot(normal, light));
    let across = cross(mirrored, eye);
    dot(across, across)
        .sqrt()
        .atan2(dot(mirrored, eye))
        .to_degrees()
}

/// A scene prepared for mapping.
struct Mapper<'a> {
    scene: &'a Scene,
    surface: Surface,
    ground: Ground,
    lens: Lens,
    towards: Vec3,
    /// Linear light of the bands on the screen.
    colors: [Vec3; 6],
}

/// What one look through a pixel meets.
#[derive(Clone, Copy)]
enum Look {
    Angle { deg: f32, lit: bool },
    Beside(Vec3),
}

impl Mapper<'_> {
    /// Angle at the middle of a pixel, and its screen values.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // held to 0..=255
    fn pixel(&self, x: u32, y: u32) -> (f32, [u8; 3]) {
        let place = [1.0, 3.0, 5.0].map(|sixths: f32| sixths / 6.0);
        let looks: [Look; LOOKS * LOOKS] =
            std::array::from_fn(|k| self.look(x, y, [place[k % LOOKS], place[k / LOOKS]]));
        let middle = match looks[LOOKS * LOOKS / 2] {
            Look::Angle { deg, .. } => deg,
            Look::Beside(_) => BESIDE,
        };
        let share = 1.0 / looks.len() as f32;
        if looks.iter().all(|look| matches!(look, Look::Beside(_))) {
            let light = looks.iter().fold([0.0; 3], |sum, look| match look {
                Look::Beside(light) => add(sum, *light),
                Look::Angle { .. } => sum,
            });
            // Dithered as in other pictures: the background is a gradient, the bands are not.
            return (
                middle,
                screen(scale(light, share), self.scene.exposure, x, y),
            );
        }
        let slope = slope(&looks);
        let shown = looks.iter().fold([0.0; 3], |sum, look| {
            add(sum, scale(self.shown(look, slope), share))
        });
        let code = |v: f32| (encode_srgb_f32(v.clamp(0.0, 1.0)) * 255.0).round() as u8;
        (middle, shown.map(code))
    }

    fn look(&self, x: u32, y: u32, within: [f32; 2]) -> Look {
        let (direction, place) = self.lens.ray(x, y, within);
        match self.surface.meet(self.scene.camera.origin, direction) {
            Some(hit) => Look::Angle {
                deg: aspecular_deg(hit.normal, self.towards, scale(direction, -1.0)),
                lit: dot(hit.normal, self.towards) > 0.0,
            },
            None => Look::Beside(behind(self.scene, &self.ground, direction, place)),
        }
    }

    /// Light of one look on the screen, 0 to 1.
    fn shown(&self, look: &Look, slope: f32) -> Vec3 {
        let (deg, lit) = match *look {
            Look::Angle { deg, lit } => (deg, lit),
            Look::Beside(light) => return neutral(scale(light, self.scene.exposure)),
        };
        let band = BANDS.iter().position(|band| deg < band.to_deg);
        let mut shown = self.colors[band.unwrap_or(BANDS.len() - 1)];
        if !lit {
            shown = scale(shown, UNLIT);
        }
        for (band, color) in BANDS.iter().zip(&self.colors).take(BANDS.len() - 1) {
            let away = (deg - band.to_deg).abs() / slope.max(f32::MIN_POSITIVE);
            // Dark on light bands, light on dark ones.
            let ink = if color[1] > 0.3 { 0.0 } else { 1.0 };
            shown = mix([ink; 3], shown, smoothstep(0.4, 1.0, away));
        }
        shown
    }
}

/// Change of the angle from a pixel to the next, degrees; 0 where a look goes beside the object.
#[allow(clippy::cast_precision_loss)] // three
fn slope(looks: &[Look; LOOKS * LOOKS]) -> f32 {
    let deg = |k: usize| match looks[k] {
        Look::Angle { deg, .. } => Some(deg),
        Look::Beside(_) => None,
    };
    let middle = LOOKS * LOOKS / 2;
    let per_pixel = LOOKS as f32 / 2.0;
    let along = |from, to| Some((deg(to)? - deg(from)?) * per_pixel);
    match (
        along(middle - 1, middle + 1),
        along(middle - LOOKS, middle + LOOKS),
    ) {
        (Some(across), Some(down)) => across.hypot(down),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests;
