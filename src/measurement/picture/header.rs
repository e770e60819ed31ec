//! The head of an EXR file: size, channels and packing, held against what is wanted before a pixel is decoded.

use super::PictureError;
use crate::paint::Limits;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PixelType {
    Uint,
    Half,
    Float,
}

impl PixelType {
    pub(super) const fn bytes(self) -> usize {
        if matches!(self, Self::Half) { 2 } else { 4 }
    }
}

/// What the head of an EXR file says, checked.
#[derive(Debug)]
pub(super) struct Header {
    /// Type of each channel and, where it is one of R, G, B, its plane.
    pub channels: Vec<(PixelType, Option<usize>)>,
    pub compression: u8,
    tiled: bool,
    pub rows_from: i64,
    pub width: usize,
    pub height: usize,
    /// Where the offset table begins.
    pub end: usize,
}

/// Reads bytes from the front, never past the end.
pub(super) struct Front<'a> {
    pub bytes: &'a [u8],
    pub position: usize,
}

impl<'a> Front<'a> {
    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.position.checked_add(count)?;
        let taken = self.bytes.get(self.position..end)?;
        self.position = end;
        Some(taken)
    }

    pub(super) fn chunk<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.first_chunk().copied()
    }

    pub(super) fn i32(&mut self) -> Option<i32> {
        self.chunk().map(i32::from_le_bytes)
    }

    /// A name that ends in a zero byte, at most 255 bytes.
    fn name(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.position..)?;
        let length = rest.iter().take(256).position(|&b| b == 0)?;
        self.position += length + 1;
        Some(&rest[..length])
    }
}

/// Most channels of a picture, of which three are read.
const MOST_CHANNELS: usize = 16;

/// Last of the compressions that are read: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A.
const B44A: u8 = 7;

const CUT: PictureError = PictureError::Header("it is cut short");

impl Header {
    pub(super) fn read(
        bytes: &[u8],
        wanted: Option<[u32; 2]>,
        limits: &Limits,
    ) -> Result<Self, PictureError> {
        let mut front = Front { bytes, position: 0 };
        if front.chunk() != Some([0x76, 0x2f, 0x31, 0x01]) {
            return Err(PictureError::Magic);
        }
        let flags = front.i32().ok_or(CUT)?;
        let kind = |found: String| PictureError::Kind { found };
        if flags & 0xff != 2 {
            return Err(kind(format!("of version {}", flags & 0xff)));
        }
        if flags & 0x1800 != 0 {
            return Err(kind("a deep or multi-part file".into()));
        }
        let (mut channels, mut window, mut compression) = (None, None, None);
        loop {
            let name = front.name().ok_or(CUT)?;
            if name.is_empty() {
                break;
            }
            front.name().ok_or(CUT)?;
            let size = front
                .i32()
                .and_then(|n| usize::try_from(n).ok())
                .ok_or(CUT)?;
            let value = front.take(size).ok_or(CUT)?;
            let mut value = Front {
                bytes: value,
                position: 0,
            };
            match name {
                b"channels" => channels = Some(read_channels(&mut value)?),
                b"compression" => compression = value.chunk::<1>().map(|[c]| c),
                b"dataWindow" => {
                    let mut corner = || value.i32().map(i64::from).ok_or(CUT);
                    window = Some([corner()?, corner()?, corner()?, corner()?]);
                }
                _ => {}
            }
        }
        let channels: Vec<_> = channels.ok_or(PictureError::Header("it names no channels"))?;
        let compression = compression.ok_or(PictureError::Header("it names no compression"))?;
        if compression > B44A {
            // exr 1.74 reserves whatever a damaged DWA block claims before it looks at the data.
            return Err(kind(format!(
                "packed by method {compression} (DWA or unknown)"
            )));
        }
        let [x0, y0, x1, y1] = window.ok_or(PictureError::Header("it has no data window"))?;
        let (width, height) = (x1 - x0 + 1, y1 - y0 + 1);
        if let Some(wanted) = wanted
            && (width, height) != (i64::from(wanted[0]), i64::from(wanted[1]))
        {
            return Err(PictureError::Size {
                width,
                height,
                wanted,
            });
        }
        let side = |s: i64| usize::try_from(s).ok().filter(|s| *s > 0 && *s < 1 << 24);
        let area = width.unsigned_abs().saturating_mul(height.unsigned_abs());
        let (Some(w), Some(h), true) = (side(width), side(height), area <= limits.pixels) else {
            return Err(PictureError::TooLarge {
                width,
                height,
                accepted: limits.pixels,
            });
        };
        Ok(Self {
            channels,
            compression,
            tiled: flags & 0x200 != 0,
            rows_from: y0,
            width: w,
            height: h,
            end: front.position,
        })
    }

    /// Bytes of one row, all channels.
    pub(super) fn row_bytes(&self) -> usize {
        self.channels
            .iter()
            .map(|(kind, _)| kind.bytes() * self.width)
            .sum()
    }

    /// Rows of a block, where this file can be decoded here.
    pub(super) fn rows_per_block(&self) -> Option<usize> {
        match self.compression {
            0 | 2 if !self.tiled => Some(1),
            3 if !self.tiled => Some(16),
            _ => None,
        }
    }
}

fn read_channels(value: &mut Front) -> Result<Vec<(PixelType, Option<usize>)>, PictureError> {
    let mut channels: Vec<(PixelType, Option<usize>)> = Vec::new();
    loop {
        let name = value.name().ok_or(CUT)?;
        if name.is_empty() {
            break;
        }
        let plane = match name {
            b"R" => Some(0),
            b"G" => Some(1),
            b"B" => Some(2),
            _ => None,
        };
        let kind = match value.i32().ok_or(CUT)? {
            0 => PixelType::Uint,
            1 => PixelType::Half,
            2 => PixelType::Float,
            _ => return Err(PictureError::Header("a channel of no known type")),
        };
        value.take(4).ok_or(CUT)?;
        let sampling = (value.i32().ok_or(CUT)?, value.i32().ok_or(CUT)?);
        if sampling != (1, 1)
            || (plane.is_some() && kind == PixelType::Uint)
            || channels.len() >= MOST_CHANNELS
        {
            return Err(PictureError::Kind {
                found: "a picture with subsampled, integer or too many channels".into(),
            });
        }
        if plane.is_some() && channels.iter().any(|(_, p)| *p == plane) {
            return Err(PictureError::Header("a channel is named twice"));
        }
        channels.push((kind, plane));
    }
    if channels.iter().filter(|(_, plane)| plane.is_some()).count() != 3 {
        return Err(PictureError::Kind {
            found: "a picture without one of the channels R, G, B".into(),
        });
    }
    Ok(channels)
}
