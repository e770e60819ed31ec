//! The finished picture: linear light, and the files it is written to.
//!
//! PNG: exposed, tone mapped (Khronos PBR Neutral), sRGB, 8 bits, with half a step of ordered noise so that gradients do
//! not band. EXR: linear light as it left the object, half floats, ZIP. The same picture gives the same bytes: no time
//! stamps, no threads.

use std::io::Cursor;

use exr::error::UnitResult;
use exr::prelude::{
    Blocks, Compression, Encoding, Image, LineOrder, SpecificChannels, Vec2, WritableImage,
};
use half::f16;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::tone::neutral;
use super::vector::Vec3;
use crate::color::encode_srgb_f32;

/// A picture in linear sRGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    exposure: f32,
    pixels: Vec<Vec3>,
}

/// Why a picture could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilmError {
    /// The PNG encoder refused.
    #[error("PNG: {0}")]
    Png(String),
    /// The EXR encoder refused.
    #[error("EXR: {0}")]
    Exr(String),
    /// A pixel that no file may hold.
    #[error("pixel {x}, {y} is not a number")]
    NotANumber {
        /// Column, from the left.
        x: usize,
        /// Row, from the top.
        y: usize,
    },
}

impl Film {
    pub(super) fn new(width: u32, height: u32, exposure: f32, pixels: Vec<Vec3>) -> Self {
        Self {
            width,
            height,
            exposure,
            pixels,
        }
    }

    /// Pixels across.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Pixels down.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// Factor on light before tone mapping.
    #[must_use]
    pub const fn exposure(&self) -> f32 {
        self.exposure
    }

    /// Linear light, row by row from the top.
    #[must_use]
    pub fn pixels(&self) -> &[Vec3] {
        &self.pixels
    }

    /// Screen values, 8 bits a channel, row by row.
    #[must_use]
    pub fn to_srgb8(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.pixels.len() * 3);
        for (y, row) in (0_u32..).zip(self.pixels.chunks(self.width as usize)) {
            for (x, pixel) in (0_u32..).zip(row) {
                bytes.extend(screen(*pixel, self.exposure, x, y));
            }
        }
        bytes
    }

    /// The picture as PNG bytes.
    ///
    /// # Errors
    ///
    /// [`FilmError::Png`] from the encoder.
    pub fn to_png(&self) -> Result<Vec<u8>, FilmError> {
        write_png(self.width, self.height, &self.to_srgb8())
    }

    /// The picture as EXR bytes, channels R, G, B, half floats, not exposed. What a half cannot hold is held at its
    /// largest, and below its smallest normal number a pixel is black.
    ///
    /// # Errors
    ///
    /// [`FilmError::NotANumber`] for such a pixel, [`FilmError::Exr`] from the encoder.
    pub fn to_exr(&self) -> Result<Vec<u8>, FilmError> {
        let wrong = |pixel: &Vec3| pixel.iter().any(|v| v.is_nan());
        if let Some(k) = self.pixels.iter().position(wrong) {
            let width = self.width as usize;
            return Err(FilmError::NotANumber {
                x: k % width,
                y: k / width,
            });
        }
        let half = |v: f32| {
            let half = f16::from_f32(v.clamp(-65504.0, 65504.0));
            if half.is_normal() { half } else { f16::ZERO }
        };
        let at = |k: usize| self.pixels[k].map(half);
        write_exr(self.width, self.height, |k| at(k).into())
    }
}

/// Screen values of a pixel of linear light, 8 bits a channel.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to 0..=255
pub(super) fn screen(light: Vec3, exposure: f32, x: u32, y: u32) -> [u8; 3] {
    let shown = neutral(light.map(|v| v * exposure)).map(encode_srgb_f32);
    let step = dither(x, y);
    shown.map(|v| (v * 255.0 + step).clamp(0.0, 255.0) as u8)
}

/// A step in `0..1` that spreads rounding evenly over neighbours (J. Jimenez's interleaved gradient noise, 2014).
#[allow(clippy::cast_precision_loss)]
fn dither(x: u32, y: u32) -> f32 {
    let wave = 0.067_110_56 * x as f32 + 0.005_837_15 * y as f32;
    (52.982_918 * wave.fract()).fract()
}

pub(super) fn write_png(width: u32, height: u32, srgb8: &[u8]) -> Result<Vec<u8>, FilmError> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
        .write_image(srgb8, width, height, ExtendedColorType::Rgb8)
        .map_err(|e| FilmError::Png(e.to_string()))?;
    Ok(bytes)
}

/// One layer of R, G, B.
pub(super) fn write_exr<S>(
    width: u32,
    height: u32,
    pixel: impl Fn(usize) -> (S, S, S) + Sync,
) -> Result<Vec<u8>, FilmError>
where
    S: exr::prelude::IntoSample,
{
    let size = (width as usize, height as usize);
    let at = move |at: Vec2<usize>| pixel(at.y() * size.0 + at.x());
    let image = Image::from_encoded_channels(size, ENCODING, SpecificChannels::rgb(at));
    written(|to| image.write().non_parallel().to_buffered(to))
}

/// One layer of one channel of 32-bit floats.
pub(super) fn write_exr_channel(
    width: u32,
    height: u32,
    name: &str,
    pixel: impl Fn(usize) -> f32 + Sync,
) -> Result<Vec<u8>, FilmError> {
    let size = (width as usize, height as usize);
    let channel = SpecificChannels::build().with_channel::<f32>(name);
    let channel = channel.with_pixel_fn(move |at: Vec2<usize>| (pixel(at.y() * size.0 + at.x()),));
    let image = Image::from_encoded_channels(size, ENCODING, channel);
    written(|to| image.write().non_parallel().to_buffered(to))
}

fn written(write: impl FnOnce(Cursor<&mut Vec<u8>>) -> UnitResult) -> Result<Vec<u8>, FilmError> {
    let mut bytes = Vec::new();
    write(Cursor::new(&mut bytes)).map_err(|e| FilmError::Exr(e.to_string()))?;
    Ok(bytes)
}

/// As all pictures are packed.
const ENCODING: Encoding = Encoding {
    compression: Compression::ZIP16,
    blocks: Blocks::ScanLines,
    line_order: LineOrder::Increasing,
};

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn read_exr(bytes: &[u8]) -> (usize, usize, Vec<Vec3>) {
        use exr::prelude::{ReadChannels, ReadLayers, read};
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                |size, _| (size.width(), vec![[0.0; 3]; size.area()]),
                |(width, pixels): &mut (usize, Vec<Vec3>), at, (r, g, b): (f32, f32, f32)| {
                    pixels[at.y() * *width + at.x()] = [r, g, b];
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .expect("reads back");
        let (width, pixels) = image.layer_data.channel_data.pixels;
        (width, pixels.len() / width, pixels)
    }

    fn ramp() -> Film {
        let pixels = (0..12_u16)
            .map(|k| [f32::from(k) * 0.25, 1.0 / (f32::from(k) + 1.0), -0.1])
            .collect();
        Film::new(4, 3, 1.0, pixels)
    }

    #[test]
    fn no_half_in_a_file_is_no_number_or_neither_zero_nor_normal() {
        let nan = Film::new(2, 1, 1.0, vec![[0.0; 3], [1.0, f32::NAN, 0.0]]);
        let refused = nan.to_exr().expect_err("refused");
        assert_eq!(refused.to_string(), "pixel 1, 0 is not a number");
        let hard = [[1e30, -f32::INFINITY, 65519.0], [1e-5, -6e-5, 6.2e-5]];
        let bytes = Film::new(2, 1, 1.0, hard.to_vec()).to_exr();
        let (_, _, pixels) = read_exr(&bytes.expect("encodes"));
        assert_eq!(pixels[0], [65504.0, -65504.0, 65504.0]);
        assert_eq!(pixels[1][..2], [0.0, 0.0]);
        assert!((pixels[1][2] / 6.2e-5 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn an_exr_reads_back_to_half_precision() {
        let (width, height, pixels) = read_exr(&ramp().to_exr().expect("encodes"));
        assert_eq!((width, height), (4, 3));
        for (got, want) in pixels.iter().zip(ramp().pixels()) {
            for k in 0..3 {
                assert!((got[k] - want[k]).abs() <= want[k].abs() / 2048.0);
            }
        }
    }

    #[test]
    fn a_png_reads_back_as_the_screen_values() {
        let bytes = ramp().to_png().expect("encodes");
        let picture = image::load_from_memory(&bytes)
            .expect("reads back")
            .to_rgb8();
        assert_eq!(picture.dimensions(), (4, 3));
        assert_eq!(picture.into_raw(), ramp().to_srgb8());
    }

    #[test]
    fn the_same_picture_gives_the_same_bytes() {
        assert_eq!(
            ramp().to_exr().expect("encodes"),
            ramp().to_exr().expect("encodes")
        );
        assert_eq!(
            ramp().to_png().expect("encodes"),
            ramp().to_png().expect("encodes")
        );
    }

    #[test]
    fn dithering_keeps_the_mean_of_a_flat_field() {
        // sRGB 100.3: three in ten pixels must say 101.
        let linear = ((100.3 / 255.0 + 0.055) / 1.055_f32).powf(2.4) + 0.04;
        let film = Film::new(64, 64, 1.0, vec![[linear; 3]; 64 * 64]);
        let bytes = film.to_srgb8();
        let mean = bytes.iter().map(|&b| f64::from(b)).sum::<f64>() / f64::from(64 * 64 * 3);
        assert!((mean - 100.3).abs() < 0.05, "{mean}");
    }
}
