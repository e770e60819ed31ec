//! Environment pictures from `.hdr` (Radiance) and `.exr` files.
//!
//! Files come from strangers: sizes are checked against [`Limits`] before anything is allocated, a damaged file is an
//! error that says what is wrong. Negative light counts as none; light above the range of a half is held there, which
//! only a bare sun reaches; both are counted in [`Environment::held`].

use std::io::Cursor;

use exr::meta::attribute::IntegerBounds;
use exr::meta::header::Header;
use exr::prelude::{Compression, ReadChannels, ReadLayers};
use image::ImageDecoder;

use super::environment::{Environment, Held};
use super::environment_map::Map;
use super::vector::Vec3;
use crate::paint::Limits;

/// Most radiance a pixel may hold.
const MOST_LIGHT: f32 = 65504.0;

/// Most channels of a layer, of which three are read.
const MOST_CHANNELS: usize = 64;

/// Least light that a picture can be exposed for: below it the factor on light would leave the range of numbers.
const LEAST_LEVEL: f32 = 1e-30;

/// A picture that was read from a file.
#[derive(Clone, Debug)]
pub struct EnvironmentFile {
    /// The light.
    pub environment: Environment,
    /// What it was read from.
    pub format: EnvironmentFormat,
    /// Pixels across and down.
    pub size: [u32; 2],
}

/// Formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentFormat {
    /// Radiance.
    Hdr,
    /// `OpenEXR`.
    Exr,
}

impl EnvironmentFormat {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Hdr, Self::Exr];

    /// The format of a file that begins so.
    fn of(bytes: &[u8]) -> Option<Self> {
        let begins = |format: &Self| match format {
            Self::Hdr => bytes.starts_with(b"#?"),
            Self::Exr => bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]),
        };
        Self::ALL.into_iter().find(begins)
    }

    /// Ending of a file's name.
    #[must_use]
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Hdr => "hdr",
            Self::Exr => "exr",
        }
    }

    /// Media type of a file.
    #[must_use]
    pub const fn media_type(self) -> &'static str {
        match self {
            Self::Hdr => "image/vnd.radiance",
            Self::Exr => "image/x-exr",
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Hdr => "Radiance .hdr",
            Self::Exr => "OpenEXR",
        }
    }
}

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
    /// More bytes of pixels than are accepted.
    #[error(
        "{width} x {height} pixels of {channels} channels unpack to {bytes} bytes, more than the {accepted} accepted"
    )]
    Bytes {
        /// Pixels across.
        width: u64,
        /// Pixels down.
        height: u64,
        /// Channels of a pixel.
        channels: usize,
        /// Bytes of all channels.
        bytes: u128,
        /// What would be accepted.
        accepted: u64,
    },
    /// More channels than are accepted.
    #[error("{found} channels are more than the {MOST_CHANNELS} accepted")]
    Channels {
        /// How many there are.
        found: usize,
    },
    /// Not twice as wide as high.
    #[error(
        "{width} x {height} pixels are no latitude-longitude panorama, which is twice as wide as high: {} x {height}",
        2 * height
    )]
    Shape {
        /// Pixels across.
        width: u64,
        /// Pixels down.
        height: u64,
    },
    /// A picture that is only a part of its panorama, or more than it.
    #[error(
        "the data window {data} is not the display window {display}: a panorama has all its pixels and no others"
    )]
    Window {
        /// Where its pixels are.
        data: String,
        /// Where they should be.
        display: String,
    },
    /// Light too dim to expose a picture for.
    #[error(
        "a white card lying in it reflects {level:e}, accepted is 0 or at least {LEAST_LEVEL:e}"
    )]
    Dark {
        /// What a white card reflects.
        level: f32,
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
    /// [`EnvironmentError`] for other formats, other shapes, damaged files, too many pixels or channels, and pixels that
    /// are not finite.
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<EnvironmentFile, EnvironmentError> {
        let format = EnvironmentFormat::of(bytes).ok_or(EnvironmentError::Format)?;
        let (size, mut pixels) = match format {
            EnvironmentFormat::Hdr => read_hdr(bytes, limits)?,
            EnvironmentFormat::Exr => read_exr(bytes, limits)?,
        };
        let [width, height] = size.map(|side| side as usize);
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
        let environment = Self::map(Map::new(width, height, pixels), held);
        let level = environment.level();
        if level > 0.0 && level < LEAST_LEVEL {
            return Err(EnvironmentError::Dark { level });
        }
        Ok(EnvironmentFile {
            environment,
            format,
            size,
        })
    }
}

type Pixels = ([u32; 2], Vec<Vec3>);

/// The size, where a panorama may have it.
fn check(
    width: u64,
    height: u64,
    limits: &Limits,
    format: EnvironmentFormat,
) -> Result<[u32; 2], EnvironmentError> {
    if width == 0 || height == 0 {
        return Err(EnvironmentError::Damaged {
            format: format.name(),
            reason: format!("{width} x {height} pixels"),
        });
    }
    let too_large = || EnvironmentError::Size {
        width,
        height,
        accepted: limits.pixels,
    };
    let area = width.checked_mul(height);
    if area.is_none_or(|pixels| pixels > limits.pixels) {
        return Err(too_large());
    }
    if width.abs_diff(height.saturating_mul(2)) > 1 {
        return Err(EnvironmentError::Shape { width, height });
    }
    let side = |v: u64| u32::try_from(v).map_err(|_| too_large());
    Ok([side(width)?, side(height)?])
}

fn read_hdr(bytes: &[u8], limits: &Limits) -> Result<Pixels, EnvironmentError> {
    const FORMAT: EnvironmentFormat = EnvironmentFormat::Hdr;
    let damaged = |e: image::ImageError| EnvironmentError::Damaged {
        format: FORMAT.name(),
        reason: e.to_string(),
    };
    let decoder =
        image::codecs::hdr::HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(damaged)?;
    let (w, h) = decoder.dimensions();
    let size = check(w.into(), h.into(), limits, FORMAT)?;
    let mut pixels: Vec<Vec3> = vec![[0.0; 3]; w as usize * h as usize];
    decoder
        .read_image(bytemuck::cast_slice_mut(&mut pixels))
        .map_err(damaged)?;
    Ok((size, pixels))
}

/// Holds a layer against what is accepted: the reader allocates what a header claims.
fn check_layer(header: &Header, limits: &Limits) -> Result<(), EnvironmentError> {
    const FORMAT: EnvironmentFormat = EnvironmentFormat::Exr;
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    let (width, height) = (width as u64, height as u64);
    check(width, height, limits, FORMAT)?;
    let channels = header.channels.list.len();
    if channels > MOST_CHANNELS {
        return Err(EnvironmentError::Channels { found: channels });
    }
    let area = u128::from(width) * u128::from(height);
    let bytes = area * header.channels.bytes_per_pixel as u128;
    if bytes > u128::from(limits.table_bytes) {
        return Err(EnvironmentError::Bytes {
            width,
            height,
            channels,
            bytes,
            accepted: limits.table_bytes,
        });
    }
    // exr 1.74 allocates whatever a damaged DWA block claims, terabytes included, before it looks at the data.
    if matches!(
        header.compression,
        Compression::DWAA(_) | Compression::DWAB(_)
    ) {
        let reason = "DWA compression is not read; store the picture with ZIP or PIZ".into();
        return Err(EnvironmentError::Damaged {
            format: FORMAT.name(),
            reason,
        });
    }
    let (data, display) = (
        header.data_window(),
        header.shared_attributes.display_window,
    );
    if data != display {
        let told = |of: IntegerBounds| {
            let (at, size) = (of.position, of.size);
            format!("{} x {} at {}, {}", size.0, size.1, at.0, at.1)
        };
        return Err(EnvironmentError::Window {
            data: told(data),
            display: told(display),
        });
    }
    Ok(())
}

fn read_exr(bytes: &[u8], limits: &Limits) -> Result<Pixels, EnvironmentError> {
    const FORMAT: &str = EnvironmentFormat::Exr.name();
    let damaged = |e: exr::error::Error| EnvironmentError::Damaged {
        format: FORMAT,
        reason: e.to_string(),
    };
    let meta =
        exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    for header in &meta.headers {
        check_layer(header, limits)?;
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
    let size = check(width as u64, height as u64, limits, EnvironmentFormat::Exr)?;
    Ok((size, pixels))
}

#[cfg(test)]
mod tests;
