//! The finished picture: linear light, and the files it is written to.
//!
//! PNG: exposed, tone mapped (Khronos PBR Neutral), sRGB, 8 bits, with half a step of ordered noise so that gradients do
//! not band. EXR: linear light as it left the object, half floats, ZIP. The same picture gives the same bytes: no time
//! stamps, no threads.

use std::io::Cursor;

use exr::prelude::{Encoding, Image, SpecificChannels, WritableImage};
use half::f16;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::tone::{encode_srgb, neutral};
use super::vector::Vec3;

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
    /// Pictures of a sheet differ in size, or there are none.
    #[error("a sheet needs pictures of one size: {0}")]
    Sheet(String),
}

impl Film {
    pub(super) fn new(width: u32, height: u32, exposure: f32, pixels: Vec<Vec3>) -> Self {
        Self { width, height, exposure, pixels }
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

    /// Linear light, row by row from the top.
    #[must_use]
    pub fn pixels(&self) -> &[Vec3] {
        &self.pixels
    }

    /// Screen values, 8 bits a channel, row by row.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to 0..=255
    pub fn to_srgb8(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.pixels.len() * 3);
        for (y, row) in (0_u32..).zip(self.pixels.chunks(self.width as usize)) {
            for (x, pixel) in (0_u32..).zip(row) {
                let shown = neutral(pixel.map(|v| v * self.exposure)).map(encode_srgb);
                let step = dither(x, y);
                bytes.extend(shown.map(|v| (v * 255.0 + step).clamp(0.0, 255.0) as u8));
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
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
            .write_image(&self.to_srgb8(), self.width, self.height, ExtendedColorType::Rgb8)
            .map_err(|e| FilmError::Png(e.to_string()))?;
        Ok(bytes)
    }

    /// The picture as EXR bytes, channels R, G, B, half floats, not exposed.
    ///
    /// # Errors
    ///
    /// [`FilmError::Exr`] from the encoder.
    pub fn to_exr(&self) -> Result<Vec<u8>, FilmError> {
        let at = |k: usize| self.pixels[k].map(|v| f16::from_f32(v.clamp(-65504.0, 65504.0)));
        write_exr(self.width, self.height, |k| at(k).into())
    }

    /// Several pictures side by side in rows of `columns`, without gaps.
    ///
    /// # Errors
    ///
    /// [`FilmError::Sheet`] for no pictures, or sizes that differ.
    pub fn contact_sheet(films: &[Self], columns: usize) -> Result<Self, FilmError> {
        let first = films.first().ok_or_else(|| FilmError::Sheet("there are none".into()))?;
        let (w, h) = (first.width, first.height);
        if let Some(other) = films.iter().find(|f| (f.width, f.height) != (w, h)) {
            return Err(FilmError::Sheet(format!("{w} x {h} and {} x {}", other.width, other.height)));
        }
        let columns = columns.clamp(1, films.len());
        let mut pixels = Vec::new();
        for row in films.chunks(columns) {
            for y in 0..h as usize {
                for k in 0..columns {
                    let range = y * w as usize..(y + 1) * w as usize;
                    match row.get(k) {
                        // Exposed here: the sheet has one exposure, its pictures may differ.
                        Some(film) => pixels.extend(film.pixels[range].iter().map(|p| p.map(|v| v * film.exposure))),
                        None => pixels.extend(range.map(|_| [0.0; 3])),
                    }
                }
            }
        }
        let size = |n: u32, k: usize| {
            let count = u32::try_from(k).ok().and_then(|k| n.checked_mul(k));
            count.ok_or_else(|| FilmError::Sheet("the sheet is too large".into()))
        };
        Ok(Self { width: size(w, columns)?, height: size(h, films.len().div_ceil(columns))?, exposure: 1.0, pixels })
    }
}

/// A step in `0..1` that spreads rounding evenly over neighbours (J. Jimenez's interleaved gradient noise, 2014).
#[allow(clippy::cast_precision_loss)]
fn dither(x: u32, y: u32) -> f32 {
    let wave = 0.067_110_56 * x as f32 + 0.005_837_15 * y as f32;
    (52.982_918 * wave.fract()).fract()
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
    use exr::prelude::{Blocks, Compression, LineOrder};
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let columns = width as usize;
    let channels = SpecificChannels::rgb(move |at: exr::prelude::Vec2<usize>| pixel(at.y() * columns + at.x()));
    let mut bytes = Vec::new();
    Image::from_encoded_channels((columns, height as usize), encoding, channels)
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|e| FilmError::Exr(e.to_string()))?;
    Ok(bytes)
}
