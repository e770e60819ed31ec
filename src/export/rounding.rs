//! What a reader of the textures gets back of a box's corners.

use half::f16;

use super::Precision;
use super::corners::Range8;

/// The rounding of corner textures.
#[derive(Debug)]
pub struct Rounding {
    precision: Precision,
    range: Option<([f32; 3], [f32; 3])>,
}

impl Rounding {
    /// How these corners, all that a texture has, are rounded.
    #[must_use]
    pub fn of<'a>(corners: impl Iterator<Item = &'a [f32; 3]>, precision: Precision) -> Self {
        let range = (precision == Precision::Eight).then(|| {
            let range = Range8::of(corners);
            (range.scale, range.offset)
        });
        Self { precision, range }
    }

    /// A corner as it is read back.
    #[must_use]
    pub fn read_back(&self, corner: [f32; 3]) -> [f32; 3] {
        match (self.precision, self.range) {
            (Precision::Eight, Some((scale, offset))) => std::array::from_fn(|k| {
                if scale[k] <= 0.0 {
                    return offset[k];
                }
                let step = ((corner[k] - offset[k]) / scale[k] * 255.0)
                    .round()
                    .clamp(0.0, 255.0);
                offset[k] + scale[k] * step / 255.0
            }),
            (Precision::F16, _) => corner.map(|v| f16::from_f32(v).to_f32()),
            _ => corner,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::made_up::{about, metallic};
    use crate::export::{ExportSettings, material_json};

    #[test]
    fn what_is_read_back_is_as_far_off_as_the_document_says() {
        let paint = metallic(4, 3, 20);
        let flakes = paint.flakes.as_ref().expect("flakes");
        for precision in [Precision::F32, Precision::F16, Precision::Eight] {
            let corners = flakes.lower.iter().chain(&flakes.upper);
            let rounding = Rounding::of(corners.clone(), precision);
            let worst = corners
                .flat_map(|&c| {
                    let back = rounding.read_back(c);
                    [0, 1, 2].map(|k| (back[k] - c[k]).abs())
                })
                .fold(0.0_f32, f32::max);
            let settings = ExportSettings {
                precision,
                ..ExportSettings::default()
            };
            let json = material_json(&paint, &about(), &settings).expect("written");
            let document: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
            let stated = document["flakes"]["corner_rounding_lab"]
                .as_f64()
                .expect("a number");
            assert!(
                (f64::from(worst) - stated).abs() < 1e-6,
                "{precision:?}: {worst} {stated}"
            );
        }
    }
}
