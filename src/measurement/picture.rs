//! EXR pictures as labs write them: single-part RGB, half or float.
//!
//! The header is read here and held against the size the manifest promises before a pixel is decoded, so that a damaged
//! picture cannot ask for memory. Scanline pictures that are uncompressed or packed by ZIP or ZIPS, which is what
//! cameras' software writes for measurements, are decoded here as well, several times faster than by the general
//! decoder; tiles and the other compressions go to the `exr` crate. Deep and multi-part files are refused.
//!
//! Layout: OpenEXR file layout, version 2 (openexr.com, "OpenEXR File Layout").

use std::ops::Range;

use header::{Front, Header, PixelType};

use super::archive::can_hold;
use crate::paint::Limits;

mod header;

/// Pixels of a picture, a plane per channel, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Red, green and blue, `width * height` values each; not finite where the sensor was dead.
    pub planes: [Vec<f32>; 3],
}

/// Why bytes are no picture that can be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// Not an EXR file at all.
    #[error("it does not begin as an EXR picture")]
    Magic,
    /// Parts of the format that no measurement uses.
    #[error(
        "it is {found}, accepted is a single-part picture with channels R, G, B of type half or float, not packed by DWA"
    )]
    Kind {
        /// What it is.
        found: String,
    },
    /// The header ends early or contradicts itself.
    #[error("its header is damaged: {0}")]
    Header(&'static str),
    /// Another size than promised.
    #[error("it has {width} x {height} pixels, wanted are {} x {}", wanted[0], wanted[1])]
    Size {
        /// Pixels across, as the header says.
        width: i64,
        /// Pixels down, as the header says.
        height: i64,
        /// What the caller knows it must be.
        wanted: [u32; 2],
    },
    /// More pixels than are accepted.
    #[error("it has {width} x {height} pixels, accepted are at most {accepted} in all")]
    TooLarge {
        /// Pixels across.
        width: i64,
        /// Pixels down.
        height: i64,
        /// The limit.
        accepted: u64,
    },
    /// A block of rows is missing or damaged.
    #[error("its block of rows {block} is damaged: {reason}")]
    Block {
        /// Position in the offset table.
        block: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// What the general decoder says.
    #[error("it cannot be decoded: {0}")]
    Decoder(String),
}

/// Room that is kept from picture to picture.
pub struct PictureScratch {
    inflater: libdeflater::Decompressor,
    packed: Vec<u8>,
    halves: Vec<half::f16>,
}

impl Default for PictureScratch {
    fn default() -> Self {
        Self {
            inflater: libdeflater::Decompressor::new(),
            packed: Vec::new(),
            halves: Vec::new(),
        }
    }
}

impl std::fmt::Debug for PictureScratch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PictureScratch").finish_non_exhaustive()
    }
}

impl Picture {
    /// Decodes an EXR picture, of the size that is wanted where one is.
    ///
    /// # Errors
    ///
    /// [`PictureError`] when the bytes are another kind of file, of another size, too large, cut or damaged.
    pub fn read_exr(
        bytes: &[u8],
        wanted: Option<[u32; 2]>,
        limits: &Limits,
        scratch: &mut PictureScratch,
    ) -> Result<Self, PictureError> {
        let mut picture = Self::default();
        picture.decode_exr(bytes, wanted, limits, scratch)?;
        Ok(picture)
    }

    /// The same into a picture whose room is used again; returns how many pixels are dead, a channel of theirs not
    /// finite. Its contents are undefined after an error.
    ///
    /// # Errors
    ///
    /// As [`Picture::read_exr`].
    pub fn decode_exr(
        &mut self,
        bytes: &[u8],
        wanted: Option<[u32; 2]>,
        limits: &Limits,
        scratch: &mut PictureScratch,
    ) -> Result<usize, PictureError> {
        let header = Header::read(bytes, wanted, limits)?;
        (self.width, self.height) = (header.width, header.height);
        let pixels = header.width * header.height;
        if !can_hold(
            bytes.len() as u64,
            header.row_bytes() as u64 * header.height as u64,
        ) {
            return Err(PictureError::Header(
                "it promises more pixels than its bytes can hold",
            ));
        }
        let Some(rows) = header.rows_per_block() else {
            self.decode_general(bytes, &header)?;
            return Ok(self.dead(0..pixels));
        };
        for plane in &mut self.planes {
            // Every row is written: there are as many blocks as offsets, and no two of the same rows.
            plane.resize(pixels, 0.0);
        }
        let blocks = header.height.div_ceil(rows);
        let table = blocks
            .checked_mul(8)
            .and_then(|n| bytes.get(header.end..header.end.checked_add(n)?));
        let table = table.ok_or(PictureError::Header("its offset table is cut short"))?;
        let (mut seen, mut dead) = (vec![false; blocks], 0);
        for (block, offset) in table.chunks_exact(8).enumerate() {
            let damaged = |reason: &str| PictureError::Block {
                block,
                reason: reason.into(),
            };
            let offset = offset.first_chunk().map_or(0, |o| u64::from_le_bytes(*o));
            let position =
                usize::try_from(offset).map_err(|_| damaged("it lies outside the file"))?;
            let mut chunk = Front { bytes, position };
            let row = i64::from(
                chunk
                    .i32()
                    .ok_or_else(|| damaged("it lies outside the file"))?,
            ) - header.rows_from;
            let size = chunk.i32().and_then(|n| usize::try_from(n).ok());
            let data = size
                .and_then(|n| chunk.take(n))
                .ok_or_else(|| damaged("it is cut short"))?;
            let row = usize::try_from(row)
                .ok()
                .filter(|r| *r < header.height && r % rows == 0);
            let row = row.ok_or_else(|| damaged("it begins at a row that no block begins at"))?;
            if std::mem::replace(&mut seen[row / rows], true) {
                return Err(damaged("another block has the same rows"));
            }
            let rows = rows.min(header.height - row);
            let size = header.row_bytes() * rows;
            if data.len() == size {
                self.place_plain(data, row, &header);
            } else if header.compression == 0 {
                return Err(damaged("it has another length than its rows"));
            } else if !can_hold(data.len() as u64, size as u64) {
                return Err(damaged("it promises more pixels than its bytes can hold"));
            } else {
                scratch.packed.resize(size, 0);
                match scratch
                    .inflater
                    .zlib_decompress(data, &mut scratch.packed[..size])
                {
                    Ok(length) if length == size => {}
                    Ok(_) => return Err(damaged("it inflates to another length than its rows")),
                    Err(error) => return Err(damaged(&format!("it does not inflate: {error}"))),
                }
                undo_differences(&mut scratch.packed);
                self.place_split(&scratch.packed, row, &header, &mut scratch.halves);
            }
            dead += self.dead(row * header.width..(row + rows) * header.width);
        }
        Ok(dead)
    }

    /// Puts rows of plain little-endian values where they belong.
    fn place_plain(&mut self, data: &[u8], row: usize, header: &Header) {
        let mut rest = data;
        for y in row.. {
            for (kind, plane) in &header.channels {
                let Some((values, tail)) = rest.split_at_checked(kind.bytes() * header.width)
                else {
                    return;
                };
                rest = tail;
                let Some(plane) = plane else { continue };
                let target = &mut self.planes[*plane][y * header.width..][..header.width];
                if *kind == PixelType::Half {
                    for (pixel, value) in target.iter_mut().zip(values.chunks_exact(2)) {
                        *pixel = half::f16::from_le_bytes([value[0], value[1]]).to_f32();
                    }
                } else {
                    for (pixel, value) in target.iter_mut().zip(values.chunks_exact(4)) {
                        *pixel = f32::from_le_bytes([value[0], value[1], value[2], value[3]]);
                    }
                }
            }
            if rest.is_empty() {
                return;
            }
        }
    }

    /// The same for rows whose even bytes stand before their odd ones.
    fn place_split(
        &mut self,
        data: &[u8],
        row: usize,
        header: &Header,
        halves: &mut Vec<half::f16>,
    ) {
        let (even, odd) = data.split_at(data.len().div_ceil(2));
        let (width, mut at, mut y) = (header.width, 0, row);
        while at < odd.len() {
            for (kind, plane) in &header.channels {
                let count = kind.bytes() / 2 * width;
                let (low, high) = (&even[at..at + count], &odd[at..at + count]);
                at += count;
                let Some(plane) = plane else { continue };
                let target = &mut self.planes[*plane][y * width..][..width];
                if *kind == PixelType::Half {
                    halves.clear();
                    halves.extend(
                        low.iter()
                            .zip(high)
                            .map(|(&l, &h)| half::f16::from_bits(u16::from_le_bytes([l, h]))),
                    );
                    half::slice::HalfFloatSliceExt::convert_to_f32_slice(&halves[..], target);
                } else {
                    let pairs = low.chunks_exact(2).zip(high.chunks_exact(2));
                    for (pixel, (l, h)) in target.iter_mut().zip(pairs) {
                        *pixel = f32::from_le_bytes([l[0], h[0], l[1], h[1]]);
                    }
                }
            }
            y += 1;
        }
    }

    /// Tiles and the rarer compressions.
    fn decode_general(&mut self, bytes: &[u8], header: &Header) -> Result<(), PictureError> {
        use exr::prelude::*;
        // What the general decoder reserves is bounded by the header's size, which was checked.
        let [red, green, blue] = &mut self.planes;
        for plane in [&mut *red, &mut *green, &mut *blue] {
            plane.clear();
        }
        let (width, height) = (header.width, header.height);
        let decoded = read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                move |size, _| {
                    (
                        size,
                        vec![
                            [0.0_f32; 3];
                            if size == Vec2(width, height) {
                                width * height
                            } else {
                                0
                            }
                        ],
                    )
                },
                |(size, pixels), at, (r, g, b): (f32, f32, f32)| {
                    if let Some(pixel) = pixels.get_mut(at.y() * size.width() + at.x()) {
                        *pixel = [r, g, b];
                    }
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(std::io::Cursor::new(bytes))
            .map_err(|error| PictureError::Decoder(error.to_string()))?;
        let (size, pixels) = decoded.layer_data.channel_data.pixels;
        if size != Vec2(width, height) {
            return Err(PictureError::Header("it contradicts itself about its size"));
        }
        red.extend(pixels.iter().map(|p| p[0]));
        green.extend(pixels.iter().map(|p| p[1]));
        blue.extend(pixels.iter().map(|p| p[2]));
        Ok(())
    }

    /// How many of these pixels have a channel that is not finite.
    fn dead(&self, of: Range<usize>) -> usize {
        let [red, green, blue] = self.planes.each_ref().map(|plane| &plane[of.clone()]);
        // x · 0 is 0 for every finite x and NaN for every other: a sum that needs no branch.
        let dead =
            |((r, g), b): ((&f32, &f32), &f32)| usize::from((r * 0.0 + g * 0.0 + b * 0.0) != 0.0);
        red.iter().zip(green).zip(blue).map(dead).sum()
    }

    /// Pixels in all.
    #[must_use]
    pub const fn pixels(&self) -> usize {
        self.width * self.height
    }
}

/// Each byte but the first was stored as the difference from the one before, plus 128.
fn undo_differences(bytes: &mut [u8]) {
    let mut words = bytes.chunks_exact_mut(8);
    // With every byte 128 less, the differences are a plain running sum; it starts 128 higher for the first byte.
    let mut before = 128_u8;
    for word in &mut words {
        let mut eight = [0; 8];
        eight.copy_from_slice(word);
        let mut sum = u64::from_le_bytes(eight) ^ 0x8080_8080_8080_8080;
        for shift in [8, 16, 32] {
            sum = add_bytes(sum, sum << shift);
        }
        sum = add_bytes(sum, u64::from(before) * 0x0101_0101_0101_0101);
        word.copy_from_slice(&sum.to_le_bytes());
        before = sum.to_le_bytes()[7];
    }
    for byte in words.into_remainder() {
        *byte = byte.wrapping_sub(128).wrapping_add(before);
        before = *byte;
    }
}

/// Sum of eight bytes each, without carries between them.
const fn add_bytes(a: u64, b: u64) -> u64 {
    const LOW: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    ((a & LOW) + (b & LOW)) ^ ((a ^ b) & !LOW)
}

#[cfg(test)]
pub(super) mod tests;
