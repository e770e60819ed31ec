//! What surrounds the object: the built-in studio, one radiance everywhere, or a picture of the sky.
//!
//! A picture is a latitude-longitude map, linear sRGB, y up: `u = atan2(x, −z)/2π`, `v = acos(y)/π`, row 0 at +y,
//! bilinear, wrapped in u. Files are read by [`Environment::from_bytes`].

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use serde::Serialize;

use super::studio::{KEY, Studio};
use super::vector::{Vec3, along, dot, mix, unit};

/// The surroundings, as radiance by direction.
#[derive(Clone, Debug)]
pub struct Environment {
    source: Source,
    pub(super) held: Held,
}

/// Channels of a picture that were held in the range of light that is drawn, 0 to 65504.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Held {
    /// Channels above it, which a bare sun reaches.
    pub too_bright: u64,
    /// The brightest of them, or 0.
    pub brightest: f32,
    /// Channels below 0, which resampling leaves beside bright lights.
    pub negative: u64,
    /// The lowest of them, or 0.
    pub lowest: f32,
}

#[derive(Clone, Debug)]
pub(super) enum Source {
    Studio(Studio),
    Uniform(Vec3),
    Map(Arc<Map>),
}

/// A latitude-longitude picture.
#[derive(Clone, Debug)]
pub(super) struct Map {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<Vec3>,
}

impl Held {
    pub(super) const NONE: Self = Self {
        too_bright: 0,
        brightest: 0.0,
        negative: 0,
        lowest: 0.0,
    };

    /// The channel within the range, counted where it was outside.
    pub(super) fn hold(&mut self, channel: f32, most: f32) -> f32 {
        if channel > most {
            self.too_bright += 1;
            self.brightest = self.brightest.max(channel);
        } else if channel < 0.0 {
            self.negative += 1;
            self.lowest = self.lowest.min(channel);
        }
        channel.clamp(0.0, most)
    }

    /// In words, where there is anything to say.
    #[must_use]
    pub fn line(&self) -> Option<String> {
        let mut parts = Vec::new();
        if self.too_bright > 0 {
            parts.push(format!(
                "{} channels above 65504, up to {}, are drawn as 65504",
                self.too_bright, self.brightest
            ));
        }
        if self.negative > 0 {
            parts.push(format!(
                "{} channels below 0, down to {}, are drawn as 0",
                self.negative, self.lowest
            ));
        }
        (!parts.is_empty()).then(|| format!("environment: {}", parts.join("; ")))
    }
}

impl Default for Environment {
    fn default() -> Self {
        Self::studio()
    }
}

impl Environment {
    /// The built-in studio.
    #[must_use]
    pub fn studio() -> Self {
        Self::of(Source::Studio(Studio::new()))
    }

    /// The same radiance from everywhere, a white furnace for 1.
    #[must_use]
    pub const fn uniform(radiance: Vec3) -> Self {
        Self::of(Source::Uniform(radiance))
    }

    pub(super) fn map(map: Map) -> Self {
        Self::of(Source::Map(Arc::new(map)))
    }

    const fn of(source: Source) -> Self {
        Self {
            source,
            held: Held::NONE,
        }
    }

    /// Pixels across and down, of a picture.
    #[must_use]
    pub fn size(&self) -> Option<[usize; 2]> {
        match &self.source {
            Source::Map(map) => Some([map.width, map.height]),
            Source::Studio(_) | Source::Uniform(_) => None,
        }
    }

    /// What of the picture is not drawn as bright as it was.
    #[must_use]
    pub const fn held(&self) -> &Held {
        &self.held
    }

    pub(super) const fn source(&self) -> &Source {
        &self.source
    }

    /// Radiance from a unit direction that points towards the surroundings.
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match &self.source {
            Source::Studio(studio) => studio.radiance(direction),
            Source::Uniform(radiance) => *radiance,
            Source::Map(map) => map.radiance(direction),
        }
    }

    /// Unit direction towards the main light: the studio's key, a picture's brightest light. Light that is the
    /// same from everywhere has none, and gives the y axis.
    #[must_use]
    pub fn main_direction(&self) -> Vec3 {
        match &self.source {
            Source::Studio(_) => unit(KEY),
            Source::Uniform(_) => [0.0, 1.0, 0.0],
            Source::Map(map) => map.brightest(),
        }
    }

    /// What a white diffuser turned upwards reflects: the brightness of these surroundings.
    #[must_use]
    pub fn level(&self) -> f32 {
        let (rings, spokes) = (48_u16, 96_u16);
        let mut sum = 0.0;
        for ring in 0..rings {
            // Even in cos², the share of light a ring adds.
            let sine2 = (f32::from(ring) + 0.5) / f32::from(rings);
            for spoke in 0..spokes {
                let turn = TAU * (f32::from(spoke) + 0.5) / f32::from(spokes);
                let direction = [
                    sine2.sqrt() * turn.cos(),
                    (1.0 - sine2).sqrt(),
                    sine2.sqrt() * turn.sin(),
                ];
                sum += luminance(self.radiance(direction));
            }
        }
        sum / f32::from(rings) / f32::from(spokes)
    }
}

pub(super) fn luminance(rgb: Vec3) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

impl Map {
    fn radiance(&self, d: Vec3) -> Vec3 {
        self.at(
            (d[0].atan2(-d[2]) / TAU).rem_euclid(1.0),
            d[1].clamp(-1.0, 1.0).acos() / PI,
        )
    }

    /// Radiance at a place on the map, `u`, `v` in `0..=1`.
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss
    )]
    pub(super) fn at(&self, u: f32, v: f32) -> Vec3 {
        let (w, h) = (self.width as f32, self.height as f32);
        let u = u * w - 0.5;
        let v = (v * h - 0.5).clamp(0.0, h - 1.0);
        let (left, top) = (u.floor(), (v as usize).min(self.height - 1));
        let (x0, y1) = (
            left.rem_euclid(w) as usize % self.width,
            (top + 1).min(self.height - 1),
        );
        let x1 = (x0 + 1) % self.width;
        let pixel = |x: usize, y: usize| self.pixels[y * self.width + x];
        let (s, t) = (u - left, v - v.floor());
        mix(
            mix(pixel(x0, top), pixel(x1, top), s),
            mix(pixel(x0, y1), pixel(x1, y1), s),
            t,
        )
    }

    /// Direction of a place on the map, `u`, `v` in `0..1`.
    pub(super) fn direction(u: f32, v: f32) -> Vec3 {
        let (theta, turn) = (v * PI, u * TAU);
        [
            theta.sin() * turn.sin(),
            theta.cos(),
            -theta.sin() * turn.cos(),
        ]
    }
}

#[allow(clippy::cast_precision_loss)] // sizes of a picture
impl Map {
    /// Middle of the brightest light: of the brightest of 64 x 32 cells, then of all light within six degrees of its
    /// middle, so that a light across a border of cells is not cut.
    fn brightest(&self) -> Vec3 {
        const CELLS: [usize; 2] = [64, 32];
        let mut cells = vec![(0.0_f32, 0.0_f32); CELLS[0] * CELLS[1]];
        for (y, row) in self.pixels.chunks(self.width).enumerate() {
            for (x, pixel) in row.iter().enumerate() {
                let cell = y * CELLS[1] / self.height * CELLS[0] + x * CELLS[0] / self.width;
                cells[cell].0 += luminance(*pixel);
                cells[cell].1 += 1.0;
            }
        }
        let (mut brightest, mut most) = (0, 0.0);
        for (cell, (light, count)) in cells.into_iter().enumerate() {
            if count > 0.0 && light / count > most {
                (brightest, most) = (cell, light / count);
            }
        }
        let rows = |row: usize| (row * self.height).div_ceil(CELLS[1]);
        let (row, column) = (brightest / CELLS[0], brightest % CELLS[0]);
        let middle = self.middle(rows(row)..rows(row + 1), |x, _| {
            x * CELLS[0] / self.width == column
        });
        let reach = 6.0_f32.to_radians();
        let near = (reach / PI * self.height as f32).ceil();
        let at = middle[1].clamp(-1.0, 1.0).acos() / PI * self.height as f32;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // held to the rows there are
        let (top, end) = (
            (at - near).max(0.0) as usize,
            ((at + near) as usize + 1).min(self.height),
        );
        self.middle(top..end, |_, d| dot(d, middle) > reach.cos())
    }

    /// Direction of the mean light of some pixels of some rows.
    fn middle(&self, rows: std::ops::Range<usize>, counts: impl Fn(usize, Vec3) -> bool) -> Vec3 {
        let mut sum = [0.0; 3];
        for y in rows {
            let v = (y as f32 + 0.5) / self.height as f32;
            for x in 0..self.width {
                let d = Self::direction((x as f32 + 0.5) / self.width as f32, v);
                if counts(x, d) {
                    let light = luminance(self.pixels[y * self.width + x]);
                    sum = along(sum, d, light * (v * PI).sin());
                }
            }
        }
        unit(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::cast_precision_loss)]
    fn the_main_light_of_a_picture_is_its_sun_wherever_cells_end() {
        let (width, height) = (128_usize, 64_usize);
        for sun in [[0.25, 0.3], [0.5, 0.25], [0.0, 0.4], [0.7, 0.51]] {
            let towards = Map::direction(sun[0], sun[1]);
            let pixels = (0..width * height).map(|k| {
                let (x, y) = ((k % width) as f32 + 0.5, (k / width) as f32 + 0.5);
                let d = Map::direction(x / width as f32, y / height as f32);
                [if dot(d, towards) > 4.0_f32.to_radians().cos() {
                    1000.0
                } else {
                    1.0
                }; 3]
            });
            let map = Map {
                width,
                height,
                pixels: pixels.collect(),
            };
            let found = Environment::map(map).main_direction();
            let away = dot(found, towards).clamp(-1.0, 1.0).acos().to_degrees();
            assert!(away < 1.0, "{sun:?}: {away} degrees");
        }
        let dark = Map {
            width: 1,
            height: 1,
            pixels: vec![[0.0; 3]],
        };
        assert_eq!(Environment::map(dark).main_direction(), [0.0, 1.0, 0.0]);
    }

    #[test]
    #[allow(clippy::cast_precision_loss)]
    fn a_map_is_read_where_it_was_written() {
        let (width, height) = (8, 4);
        let pixels = (0..width * height).map(|k| [k as f32, 0.0, 1.0]).collect();
        let environment = Environment::map(Map {
            width,
            height,
            pixels,
        });
        for y in 0..height {
            for x in 0..width {
                let d = Map::direction((x as f32 + 0.5) / 8.0, (y as f32 + 0.5) / 4.0);
                let got = environment.radiance(d);
                assert!(
                    (got[0] - (y * width + x) as f32).abs() < 1e-3,
                    "{x} {y} {got:?}"
                );
            }
        }
    }

    #[test]
    fn a_uniform_environment_has_its_own_level() {
        assert!((Environment::uniform([0.7; 3]).level() - 0.7).abs() < 1e-4);
    }
}
