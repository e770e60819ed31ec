//! Flakes laid flat: the texels at one angle pair, as the random texture draws them.

use super::RenderError;
use super::film::write_exr;
use crate::paint::{CarPaint, FlakeSampler, Limits, RandomTexture, cell_spacing};

/// Flake reflectance of a patch of `width x height` texels at one angle pair, as EXR bytes.
///
/// Values are 1/sr in linear sRGB, 32-bit floats, channels R, G, B, not clamped: slices carry sensor noise and their
/// mean is right only with it. Angles are those inside the coat, degrees.
///
/// # Errors
///
/// [`RenderError::NoFlakes`] for a solid color, [`RenderError::Scene`] for sizes or angles out of range.
pub fn texels(
    paint: &CarPaint,
    theta_h_deg: f64,
    theta_d_deg: f64,
    size: [u32; 2],
    seed: u32,
    limits: &Limits,
) -> Result<Vec<u8>, RenderError> {
    let [width, height] = size;
    let flakes = paint.flakes.as_ref().ok_or(RenderError::NoFlakes)?;
    if width == 0 || height == 0 || u64::from(width) * u64::from(height) > limits.pixels {
        let reason = format!(
            "{width} x {height}, accepted are 1 to {} pixels",
            limits.pixels
        );
        return Err(RenderError::Scene {
            field: "size",
            reason,
        });
    }
    for (field, angle) in [("theta_h_deg", theta_h_deg), ("theta_d_deg", theta_d_deg)] {
        if !(0.0..=90.0).contains(&angle) {
            return Err(RenderError::Scene {
                field,
                reason: format!("{angle}, accepted is 0 to 90"),
            });
        }
    }
    let sampler = FlakeSampler::new(flakes);
    let spacing = cell_spacing(flakes.texture.grain_um / flakes.texture.texel_um);
    let tile = RandomTexture::new(width, height, spacing, seed);
    #[allow(clippy::cast_possible_truncation)] // texel precision
    let (h, d) = (theta_h_deg as f32, theta_d_deg as f32);
    Ok(write_exr(width, height, |k| {
        sampler.color(tile.cells()[k], h, d).into()
    })?)
}
