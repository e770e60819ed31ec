//! OpenEXR files of one uncompressed scan-line part, written directly: a texture is mostly a memory copy.
//!
//! Layout: "OpenEXR File Layout", Academy Software Foundation: magic, version 2, header attributes, one offset a line,
//! then per line its number, its size, and the channels one after the other in alphabetical order. Little-endian.
//! Rows from top to bottom, so row 0 of a table is the first line. Do not use it for pictures that people download:
//! nothing is compressed.

use half::f16;

/// The numbers of one channel, row by row.
#[derive(Clone, Copy, Debug)]
pub(super) enum Plane<'a> {
    /// 16-bit floats.
    Half(&'a [f16]),
    /// 32-bit floats.
    Float(&'a [f32]),
}

impl Plane<'_> {
    fn row(&self, y: usize, width: usize) -> &[u8] {
        match self {
            Self::Half(values) => bytemuck::cast_slice(&values[y * width..(y + 1) * width]),
            Self::Float(values) => bytemuck::cast_slice(&values[y * width..(y + 1) * width]),
        }
    }

    /// How many numbers.
    pub const fn len(&self) -> usize {
        match self {
            Self::Half(values) => values.len(),
            Self::Float(values) => values.len(),
        }
    }

    const fn pixel_type(&self) -> u32 {
        match self {
            Self::Half(_) => 1,
            Self::Float(_) => 2,
        }
    }

    const fn size(&self) -> usize {
        match self {
            Self::Half(_) => 2,
            Self::Float(_) => 4,
        }
    }
}

/// The bytes of a file with these channels, `name` ascending, each `width * height` numbers.
pub(super) fn exr(width: usize, height: usize, channels: &[(&str, Plane<'_>)]) -> Vec<u8> {
    debug_assert!(
        channels.is_sorted_by_key(|(name, _)| *name),
        "channels stand in alphabetical order"
    );
    let line: usize = channels.iter().map(|(_, plane)| plane.size() * width).sum();
    let mut out = Vec::with_capacity(512 + height * (16 + line));
    out.extend_from_slice(&20_000_630_u32.to_le_bytes());
    out.extend_from_slice(&2_u32.to_le_bytes());
    header(&mut out, width, height, channels);
    let first = out.len() + 8 * height;
    for y in 0..height {
        out.extend_from_slice(&((first + y * (8 + line)) as u64).to_le_bytes());
    }
    for y in 0..height {
        out.extend_from_slice(&word(y));
        out.extend_from_slice(&word(line));
        for (_, plane) in channels {
            out.extend_from_slice(plane.row(y, width));
        }
    }
    out
}

/// A size as the format's 32-bit integer; textures are far below its limit.
fn word(value: usize) -> [u8; 4] {
    i32::try_from(value).unwrap_or(i32::MAX).to_le_bytes()
}

fn header(out: &mut Vec<u8>, width: usize, height: usize, channels: &[(&str, Plane<'_>)]) {
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        for text in [name, kind] {
            out.extend_from_slice(text.as_bytes());
            out.push(0);
        }
        out.extend_from_slice(&word(value.len()));
        out.extend_from_slice(value);
    };
    let mut list = Vec::new();
    for (name, plane) in channels {
        list.extend_from_slice(name.as_bytes());
        list.push(0);
        list.extend_from_slice(&plane.pixel_type().to_le_bytes());
        list.extend_from_slice(&[0; 4]);
        list.extend_from_slice(&1_u32.to_le_bytes());
        list.extend_from_slice(&1_u32.to_le_bytes());
    }
    list.push(0);
    attribute("channels", "chlist", &list);
    attribute("compression", "compression", &[0]);
    let window = [[0; 4], [0; 4], word(width - 1), word(height - 1)].concat();
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1.0_f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1.0_f32.to_le_bytes());
    out.push(0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::*;

    /// Another reader of the format finds the same numbers at the same places.
    #[test]
    fn the_exr_crate_reads_what_was_written() {
        let (width, height) = (5, 3);
        let half: Vec<f16> = (0..15_u8)
            .map(|k| f16::from_f32(f32::from(k) - 7.5))
            .collect();
        let float: Vec<f32> = (0..15_u8).map(|k| f32::from(k) / 3.0).collect();
        let bytes = super::exr(
            width,
            height,
            &[("B", Plane::Half(&half)), ("R", Plane::Float(&float))],
        );
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(std::io::Cursor::new(bytes))
            .expect("an EXR file");
        let layer = image.layer_data;
        assert_eq!((layer.size.x(), layer.size.y()), (width, height));
        let list = &layer.channel_data.list;
        assert_eq!(list[0].name.to_string(), "B");
        assert_eq!(
            list[0].sample_data.values_as_f32().collect::<Vec<_>>(),
            half.iter().map(|h| h.to_f32()).collect::<Vec<_>>()
        );
        assert_eq!(list[1].name.to_string(), "R");
        assert_eq!(
            list[1].sample_data.values_as_f32().collect::<Vec<_>>(),
            float
        );
    }
}
