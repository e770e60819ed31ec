//! PNG files of 8-bit data, quickly: the fast deflate, and no row filter, so that a reader needs only inflate.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::ExportError;

/// The bytes of a picture of `width x height` pixels.
pub(super) fn png(
    width: usize,
    height: usize,
    pixels: &[u8],
    color: ExtendedColorType,
) -> Result<Vec<u8>, ExportError> {
    let mut out = Vec::with_capacity(pixels.len() + 1024);
    let encoder =
        PngEncoder::new_with_quality(&mut out, CompressionType::Fast, FilterType::NoFilter);
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    encoder.write_image(pixels, size(width), size(height), color)?;
    Ok(out)
}
