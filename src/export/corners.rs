//! The textures of the boxes' corners: floats, halves, or bytes over the range that all corners have.

use image::ExtendedColorType;

use super::clamp::finite;
use super::png_file::png;
use super::textures::{Entry, Textures};
use super::{ExportError, Precision};

impl Textures {
    /// Boxes in rows of `width`.
    pub(super) fn corners(
        &mut self,
        lower: &[[f32; 3]],
        upper: &[[f32; 3]],
        width: usize,
        precision: Precision,
    ) -> Result<(), ExportError> {
        let about_lower =
            "corner of smallest L, a, b (R, G, B) of every cluster's box, CIELAB of pi f";
        let about_upper =
            "corner of largest L, a, b (R, G, B) of every cluster's box, CIELAB of pi f";
        let texels = lower.len().div_ceil(width) * width;
        let height = texels / width;
        let range = (precision == Precision::Eight).then(|| Range8::of(lower.iter().chain(upper)));
        let both = [
            ("corners_lower", lower, about_lower),
            ("corners_upper", upper, about_upper),
        ];
        for (name, corners, about) in both {
            let entry = |kind| Entry::plain([width, height], "RGB", kind, about);
            if let Some(range) = &range {
                finite(name, corners.as_flattened())?;
                let (pixels, rounding) = range.quantise(corners, texels);
                self.corner_rounding_lab = self.corner_rounding_lab.max(rounding);
                let bytes = png(width, height, &pixels, ExtendedColorType::Rgb8)?;
                let (scale, offset) = (Some(range.scale), Some(range.offset));
                self.push(
                    name,
                    "png",
                    bytes,
                    Entry {
                        scale,
                        offset,
                        ..entry("unorm8")
                    },
                );
                continue;
            }
            let planes = std::array::from_fn(|k| {
                let mut plane = Vec::with_capacity(texels);
                plane.extend(corners.iter().map(|c| c[k]));
                plane.resize(texels, 0.0);
                plane
            });
            let written = self.three_planes(name, width, planes, precision)?;
            self.corner_rounding_lab = self.corner_rounding_lab.max(written.rounding);
            let (bytes, kind) = written.file;
            self.push(name, "exr", bytes, entry(kind));
        }
        Ok(())
    }
}

/// The range of all corners, in 255 steps an axis.
pub(super) struct Range8 {
    pub(super) scale: [f32; 3],
    pub(super) offset: [f32; 3],
}

impl Range8 {
    pub(super) fn of<'a>(corners: impl Iterator<Item = &'a [f32; 3]>) -> Self {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for corner in corners {
            for k in 0..3 {
                low[k] = low[k].min(corner[k]);
                high[k] = high[k].max(corner[k]);
            }
        }
        Self {
            scale: std::array::from_fn(|k| high[k] - low[k]),
            offset: low,
        }
    }

    fn quantise(&self, corners: &[[f32; 3]], texels: usize) -> (Vec<u8>, f32) {
        let mut worst = 0.0_f32;
        let mut pixels = Vec::with_capacity(texels * 3);
        for corner in corners {
            for k in 0..3 {
                let share = if self.scale[k] > 0.0 {
                    (corner[k] - self.offset[k]) / self.scale[k]
                } else {
                    0.0
                };
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0..=255
                let byte = (share * 255.0).round().clamp(0.0, 255.0) as u8;
                worst = worst.max(
                    (self.offset[k] + self.scale[k] * f32::from(byte) / 255.0 - corner[k]).abs(),
                );
                pixels.push(byte);
            }
        }
        pixels.resize(texels * 3, 0);
        (pixels, worst)
    }
}
