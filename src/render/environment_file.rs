//! Environment pictures from `.hdr` (Radiance) and `.exr` files.
//!
//! Files come from strangers: sizes are checked against [`Limits`] before anything is allocated, a damaged file is an
//! error that says what is wrong. Negative light counts as none; light above the range of a half is held there, which
//! only a bare sun reaches; both are counted in [`Environment::held`].

use std::io::Cursor;

use exr::prelude::{Compression, ReadChannels, ReadLayers};
use image::ImageDecoder;

use super::environment::{Environment, Held, Map};
use super::vector::Vec3;
use crate::paint::Limits;

/// Most radiance a pixel may hold.
const MOST_LIGHT: f32 = 65504.0;

/// Why bytes are no environment.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// Neither of the formats that are read.
    #[error("neither a Radiance .hdr nor an OpenEXR .exr picture")]
    Format,
    /// A file of one of the formats, damaged or of a kind that is not read.
    #[error("{format}: {reason}")]
    Damaged {
        /// Format by its magic number.
        format: &'static str,
        /// What its reader says.
        reason: String,
    },
    /// More pixels than are accepted.
    #[error("{width} x {height} pixels are more than the {accepted} accepted")]
    Size {
        /// Pixels across.
        width: u64,
        /// Pixels down.
        height: u64,
        /// What would be accepted.
        accepted: u64,
    },
    /// A pixel that is no light.
    #[error("pixel ({x}, {y}) holds {value}, accepted is a finite number")]
    NotFinite {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The channel that is not finite.
        value: f32,
    },
}

impl Environment {
    /// A latitude-longitude picture from the bytes of an `.hdr` or `.exr` file.
    ///
    /// # Errors
    ///
    /// [`EnvironmentError`] for other formats, damaged files, too many pixels, and pixels that are not finite.
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<Self, EnvironmentError> {
        let (width, height, mut pixels) = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            read_exr(bytes, limits)?
        } else if bytes.starts_with(b"#?") {
            read_hdr(bytes, limits)?
        } else {
            return Err(EnvironmentError::Format);
        };
        let mut held = Held::NONE;
        for (k, pixel) in pixels.iter_mut().enumerate() {
            if let Some(&value) = pixel.iter().find(|v| !v.is_finite()) {
                return Err(EnvironmentError::NotFinite {
                    x: k % width,
                    y: k / width,
                    value,
                });
            }
            *pixel = pixel.map(|v| held.hold(v, MOST_LIGHT));
        }
        let map = Map {
            width,
            height,
            pixels,
        };
        let mut environment = Self::map(map);
        environment.held = held;
        Ok(environment)
    }
}

type Pixels = (usize, usize, Vec<Vec3>);

fn check(
    width: u64,
    height: u64,
    limits: &Limits,
    format: &'static str,
) -> Result<(usize, usize), EnvironmentError> {
    if width == 0 || height == 0 {
        return Err(EnvironmentError::Damaged {
            format,
            reason: format!("{width} x {height} pixels"),
        });
    }
    let too_large = || EnvironmentError::Size {
        width,
        height,
        accepted: limits.pixels,
    };
    if width
        .checked_mul(height)
        .is_none_or(|pixels| pixels > limits.pixels)
    {
        return Err(too_large());
    }
    let side = |v: u64| usize::try_from(v).map_err(|_| too_large());
    Ok((side(width)?, side(height)?))
}

fn read_hdr(bytes: &[u8], limits: &Limits) -> Result<Pixels, EnvironmentError> {
    const FORMAT: &str = "Radiance .hdr";
    let damaged = |e: image::ImageError| EnvironmentError::Damaged {
        format: FORMAT,
        reason: e.to_string(),
    };
    let decoder =
        image::codecs::hdr::HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(damaged)?;
    let (w, h) = decoder.dimensions();
    let (width, height) = check(w.into(), h.into(), limits, FORMAT)?;
    let mut pixels: Vec<Vec3> = vec![[0.0; 3]; width * height];
    decoder
        .read_image(bytemuck::cast_slice_mut(&mut pixels))
        .map_err(damaged)?;
    Ok((width, height, pixels))
}

fn read_exr(bytes: &[u8], limits: &Limits) -> Result<Pixels, EnvironmentError> {
    const FORMAT: &str = "OpenEXR";
    let damaged = |e: exr::error::Error| EnvironmentError::Damaged {
        format: FORMAT,
        reason: e.to_string(),
    };
    // The header alone first: the reader allocates what the header claims.
    let meta =
        exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    for header in &meta.headers {
        let size = header.layer_size;
        check(size.width() as u64, size.height() as u64, limits, FORMAT)?;
        // exr 1.74 allocates whatever a damaged DWA block claims, terabytes included, before it looks at the data.
        if matches!(
            header.compression,
            Compression::DWAA(_) | Compression::DWAB(_)
        ) {
            let reason = "DWA compression is not read; store the picture with ZIP or PIZ".into();
            return Err(EnvironmentError::Damaged {
                format: FORMAT,
                reason,
            });
        }
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| {
                (
                    size.width(),
                    vec![[0.0_f32; 3]; size.width() * size.height()],
                )
            },
            |(width, pixels): &mut (usize, Vec<Vec3>), at, (r, g, b): (f32, f32, f32)| {
                if let Some(pixel) = pixels.get_mut(at.y() * *width + at.x()) {
                    *pixel = [r, g, b];
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let (width, pixels) = image.layer_data.channel_data.pixels;
    let height = image.layer_data.size.height();
    if pixels.len() != width * height || pixels.is_empty() {
        return Err(EnvironmentError::Damaged {
            format: FORMAT,
            reason: "pixels are missing".into(),
        });
    }
    Ok((width, height, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::film::write_exr;

    fn hdr() -> Vec<u8> {
        let mut bytes = Vec::new();
        let pixels: Vec<image::Rgb<f32>> = (0..32_u8)
            .map(|k| image::Rgb([f32::from(k), 0.5, 2.0]))
            .collect();
        image::codecs::hdr::HdrEncoder::new(&mut bytes)
            .encode(&pixels, 8, 4)
            .expect("encodes");
        bytes
    }

    fn sky(bad: f32) -> Vec<u8> {
        write_exr(8, 4, |k| {
            if k == 11 {
                (bad, 1.0, 1.0)
            } else {
                (0.5_f32, 1.0, 2.0)
            }
        })
        .expect("encodes")
    }

    #[test]
    fn both_formats_are_read() {
        let limits = Limits::default();
        let up = Environment::from_bytes(&sky(0.5), &limits)
            .expect("exr")
            .radiance([0.0, 1.0, 0.0]);
        assert!((up[0] - 0.5).abs() < 1e-6 && (up[2] - 2.0).abs() < 1e-6);
        let somewhere = Environment::from_bytes(&hdr(), &limits)
            .expect("hdr")
            .radiance([0.0, 0.2, 0.9]);
        assert!((somewhere[2] - 2.0).abs() < 0.02);
    }

    #[test]
    fn pixels_that_are_no_light_are_refused_or_held_and_counted() {
        let limits = Limits::default();
        for light in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let error = Environment::from_bytes(&sky(light), &limits).expect_err("no light");
            assert!(
                matches!(error, EnvironmentError::NotFinite { x: 3, y: 1, .. }),
                "{error}"
            );
        }
        for (light, told) in [
            (0.5, None),
            (65504.0, None),
            (-1.0, Some("1 channels below 0, down to -1, are drawn as 0")),
            (
                1e6,
                Some("1 channels above 65504, up to 1000000, are drawn as 65504"),
            ),
        ] {
            let sky = Environment::from_bytes(&sky(light), &limits).expect("held");
            let told = told.map(|what| format!("environment: {what}"));
            assert_eq!(sky.held().line(), told);
            assert!(sky.level().is_finite() && sky.level() >= 0.0);
        }
    }

    #[test]
    fn sizes_are_checked_before_anything_is_allocated() {
        let limits = Limits {
            pixels: 31,
            ..Limits::default()
        };
        for bytes in [hdr(), sky(0.5)] {
            assert!(matches!(
                Environment::from_bytes(&bytes, &limits),
                Err(EnvironmentError::Size { .. })
            ));
        }
    }

    #[test]
    fn cut_and_damaged_files_are_errors_or_pictures_never_panics() {
        let limits = Limits {
            pixels: 1 << 20,
            ..Limits::default()
        };
        for whole in [hdr(), sky(0.5)] {
            for cut in 0..whole.len() {
                assert!(
                    Environment::from_bytes(&whole[..cut], &limits).is_err(),
                    "cut to {cut} of {}",
                    whole.len()
                );
            }
            for k in 0..whole.len() {
                for bit in 0..8 {
                    let mut damaged = whole.clone();
                    damaged[k] ^= 1 << bit;
                    let _ = Environment::from_bytes(&damaged, &limits);
                }
            }
        }
    }
}
