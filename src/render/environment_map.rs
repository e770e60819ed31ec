//! A latitude-longitude picture of the surroundings, and what is known of its light once it is decoded.
//!
//! Linear sRGB, y up: `u = atan2(x, −z)/2π`, `v = acos(y)/π`, row 0 at +y, bilinear, wrapped in u.

use std::f32::consts::{PI, TAU};
use std::ops::Range;

use super::scene::DirectionalLight;
use super::vector::{Vec3, add, along, dot, mix, scale, unit};

/// Reach of the main light around its middle, degrees: a sun with its glow, or the bright part of a window.
const REACH_DEG: f32 = 6.0;

/// A latitude-longitude picture.
#[derive(Clone, Debug)]
pub(super) struct Map {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<Vec3>,
    level: f32,
    main_light: DirectionalLight,
}

pub(super) fn luminance(rgb: Vec3) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

impl Map {
    /// A picture of so many pixels, row by row; there is at least one.
    pub(super) fn new(width: usize, height: usize, pixels: Vec<Vec3>) -> Self {
        let mut map = Self {
            width,
            height,
            pixels,
            level: 0.0,
            main_light: DirectionalLight {
                towards: [0.0, 1.0, 0.0],
                irradiance: [0.0; 3],
            },
        };
        map.level = map.measured_level();
        map.main_light = map.brightest();
        map
    }

    /// What a white diffuser turned upwards reflects.
    pub(super) const fn level(&self) -> f32 {
        self.level
    }

    /// The brightest light, which is taken to reach six degrees around its middle.
    pub(super) const fn main_light(&self) -> DirectionalLight {
        self.main_light
    }

    pub(super) fn radiance(&self, d: Vec3) -> Vec3 {
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
    /// Every pixel once, by the exact `∫ cos θ dω / π` of its place: chance points would miss a sun of one pixel.
    #[allow(clippy::cast_possible_truncation)] // light is f32
    fn measured_level(&self) -> f32 {
        let half = std::f64::consts::FRAC_PI_2;
        // Share of a white card's light that comes from above this row, of all the upper half.
        let above = |row: usize| {
            let theta = row as f64 / self.height as f64 * 2.0 * half;
            theta.min(half).sin().powi(2)
        };
        let rows = self.pixels.chunks(self.width).enumerate();
        let light = rows.take(self.height.div_ceil(2)).map(|(y, row)| {
            let sum: f64 = row.iter().map(|pixel| f64::from(luminance(*pixel))).sum();
            sum / self.width as f64 * (above(y + 1) - above(y))
        });
        light.sum::<f64>() as f32
    }

    /// Middle of the brightest light: of the brightest of 64 x 32 cells, then of all light within six degrees of its
    /// middle, so that a light across a border of cells is not cut.
    fn brightest(&self) -> DirectionalLight {
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
        let reach = REACH_DEG.to_radians().cos();
        let towards = self.middle(self.rows_near(middle), |_, d| dot(d, middle) > reach);
        DirectionalLight {
            towards,
            irradiance: self.irradiance(towards, reach),
        }
    }

    /// Rows within reach of a direction.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // held to the rows there are
    fn rows_near(&self, middle: Vec3) -> Range<usize> {
        let near = (REACH_DEG / 180.0 * self.height as f32).ceil();
        let at = middle[1].clamp(-1.0, 1.0).acos() / PI * self.height as f32;
        (at - near).max(0.0) as usize..((at + near) as usize + 1).min(self.height)
    }

    /// Pixels of some rows: direction, radiance, and solid angle.
    fn pixels_of(&self, rows: Range<usize>) -> impl Iterator<Item = (usize, Vec3, Vec3, f32)> {
        rows.flat_map(move |y| {
            let v = (y as f32 + 0.5) / self.height as f32;
            let solid = (v * PI).sin() * PI / self.height as f32 * TAU / self.width as f32;
            (0..self.width).map(move |x| {
                let direction = Self::direction((x as f32 + 0.5) / self.width as f32, v);
                (x, direction, self.pixels[y * self.width + x], solid)
            })
        })
    }

    /// Direction of the mean light of some pixels of some rows.
    fn middle(&self, rows: Range<usize>, counts: impl Fn(usize, Vec3) -> bool) -> Vec3 {
        let near = self.pixels_of(rows).filter(|(x, d, ..)| counts(*x, *d));
        unit(near.fold([0.0; 3], |sum, (_, d, light, solid)| {
            along(sum, d, luminance(light) * solid)
        }))
    }

    /// Irradiance on a surface that faces a direction, by the light closer to it than some cosine.
    fn irradiance(&self, towards: Vec3, reach: f32) -> Vec3 {
        let rows = self.rows_near(towards);
        let near = self
            .pixels_of(rows)
            .filter(|(_, d, ..)| dot(*d, towards) > reach);
        near.fold([0.0; 3], |sum, (_, d, light, solid)| {
            add(sum, scale(light, dot(d, towards) * solid))
        })
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
            let found = Map::new(width, height, pixels.collect())
                .main_light()
                .towards;
            let away = dot(found, towards).clamp(-1.0, 1.0).acos().to_degrees();
            assert!(away < 1.0, "{sun:?}: {away} degrees");
        }
        let dark = Map::new(1, 1, vec![[0.0; 3]]);
        assert_eq!(dark.main_light().towards, [0.0, 1.0, 0.0]);
        assert_eq!(dark.main_light().irradiance, [0.0; 3]);
    }

    #[test]
    #[allow(clippy::cast_precision_loss)]
    fn a_map_is_read_where_it_was_written() {
        let (width, height) = (8, 4);
        let pixels = (0..width * height).map(|k| [k as f32, 0.0, 1.0]).collect();
        let map = Map::new(width, height, pixels);
        for y in 0..height {
            for x in 0..width {
                let d = Map::direction((x as f32 + 0.5) / 8.0, (y as f32 + 0.5) / 4.0);
                let got = map.radiance(d);
                assert!(
                    (got[0] - (y * width + x) as f32).abs() < 1e-3,
                    "{x} {y} {got:?}"
                );
            }
        }
    }

    /// A dim sky with a sun of one pixel.
    fn with_sun(width: usize, height: usize, at: [usize; 2], sun: f32) -> Map {
        let mut pixels = vec![[0.25; 3]; width * height];
        pixels[at[1] * width + at[0]] = [sun; 3];
        Map::new(width, height, pixels)
    }

    #[test]
    #[allow(clippy::cast_precision_loss)]
    fn a_sun_of_one_pixel_gives_the_same_level_at_any_azimuth() {
        let (width, height, sun) = (1024_usize, 512_usize, 60_000.0_f32);
        for row in [3_usize, 100, 255] {
            // The pixel's light on a white card, by the middle of its small place.
            let theta = (row as f32 + 0.5) / height as f32 * PI;
            let solid = theta.sin() * PI / height as f32 * TAU / width as f32;
            let want = 0.25 + (sun - 0.25) * theta.cos() * solid / PI;
            for column in [0, 1, 333, 512, 1023] {
                let level = with_sun(width, height, [column, row], sun).level();
                assert!(
                    (level / want - 1.0).abs() < 1e-4,
                    "{row} {column}: {level}, not {want}"
                );
            }
        }
        // Below the horizon it does not reach the card, whose own row is cut at the horizon where rows are odd.
        assert!((with_sun(64, 33, [5, 17], sun).level() - 0.25).abs() < 1e-6);
        assert!((with_sun(64, 33, [5, 16], 0.25).level() - 0.25).abs() < 1e-6);
    }

    #[test]
    fn the_main_light_has_the_irradiance_of_its_pixels() {
        // The sun in a row near the horizon, where a pixel of this map covers (π/256)².
        let light = with_sun(512, 256, [77, 128], 40_000.0).main_light();
        let sun = 40_000.0 * (PI / 256.0).powi(2);
        // And six degrees of the sky around it.
        let sky = 0.25 * PI * REACH_DEG.to_radians().sin().powi(2);
        for channel in light.irradiance {
            assert!(
                (channel / (sun + sky) - 1.0).abs() < 1e-3,
                "{channel}, not {}",
                sun + sky
            );
        }
    }
}
