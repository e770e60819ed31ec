//! `material.json` on its own: textures inline in base64, the shader as text. For callers that want one document.

use super::document::{Carrier, document};
use super::textures::Textures;
use super::{About, ExportError, ExportSettings};
use crate::paint::CarPaint;

/// A paint as one JSON document.
///
/// # Errors
///
/// [`ExportError`] for a number that is not finite, or more clusters than textures address.
pub fn material_json(
    paint: &CarPaint,
    about: &About,
    settings: &ExportSettings,
) -> Result<Vec<u8>, ExportError> {
    let textures = Textures::of(paint, settings)?;
    document(paint, about, settings, &textures, &Carrier::Inline)
}
