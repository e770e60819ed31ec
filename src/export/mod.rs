//! What leaves the house: texture bundles, self-contained JSON, and glTF.
//!
//! One file per format, each a function from a paint to bytes: [`bundle`] (a `.zip` of textures, shader and
//! `material.json`), [`material_json`] (the same in one JSON), [`glb`] (a fitted glTF material that carries the
//! statistical flakes beside it); [`readings`], what an instrument would say; and [`blend_bundle`], from a whole blend to
//! one `.zip` whose shader mixes the paints at any weights. The same paint, [`About`] and [`ExportSettings`] give the same
//! bytes on every machine that rounds alike; neither a clock nor the output's own name gets in.
//!
//! Left to others: pictures (`render`), mixing (`blend`).

mod alias;
mod blend_bundle;
mod blend_document;
mod bundle;
mod clamp;
mod corners;
mod cxf;
mod document;
mod draws;
mod exr_file;
mod glb;
mod gloss;
mod inverse_cdf;
#[cfg(test)]
mod made_up;
mod material_json;
mod numbers;
mod png_file;
mod readings;
mod rounding;
mod textures;

pub use alias::{AliasEntry, alias_table};
pub use blend_bundle::blend_bundle;
pub use bundle::{bundle, companions_hash};
pub use clamp::Clamped;
pub use cxf::CXF_MEDIA_TYPE;
pub use glb::{GltfMaterial, LossReport, glb, glb_and_loss};
pub use gloss::{Gloss, gloss};
pub use inverse_cdf::{InverseCdf, inverse_cdf};
pub use material_json::material_json;
#[cfg(test)]
pub(crate) use numbers::tests::assert_documented;
pub use readings::{AngleError, Readings, readings};
pub use rounding::Rounding;

use serde::{Deserialize, Serialize};

use crate::paint::Provenance;

/// The shader library that every bundle carries, GLSL ES 3.00.
pub const SHADER: &str = include_str!("shader/carpaint.glsl");

/// What travels with a paint besides its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct About {
    /// Name of the paint.
    pub name: String,
    /// Where it comes from.
    pub provenance: Provenance,
    /// What happened on the way: weights, clamps, warnings, residuals. Written as it is.
    pub report: serde_json::Value,
}

/// How the corners of flake boxes are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Precision {
    /// 32-bit floats: what the paint holds.
    #[serde(rename = "f32")]
    F32,
    /// 16-bit floats: 11 bits of every number.
    #[default]
    #[serde(rename = "f16")]
    F16,
    /// 8-bit integers over the range of the paint; colors at the ends of the range band.
    #[serde(rename = "8bit")]
    Eight,
}

/// What an export contains and how exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ExportSettings {
    /// Precision of corner textures, color table and slice means.
    pub precision: Precision,
    /// Whether the alias table is written: exact draws in constant time.
    pub alias: bool,
    /// Whether the inverse cumulative distribution of 500 steps is written, with its loss.
    pub inverse_cdf: bool,
}

impl Default for ExportSettings {
    fn default() -> Self {
        Self {
            precision: Precision::F16,
            alias: true,
            inverse_cdf: true,
        }
    }
}

/// Why a paint cannot be exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A number that no file may hold.
    #[error("{what}, number {index}, is not finite")]
    NotFinite {
        /// The texture or list.
        what: &'static str,
        /// Position in it.
        index: usize,
    },
    /// More than textures can address.
    #[error("{count} {what}, which is more than a texture holds; accepted are {accepted}")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many fit.
        accepted: usize,
    },
    /// The archive refused to be written.
    #[error("writing the archive: {0}")]
    Archive(#[from] zip::result::ZipError),
    /// The archive refused bytes.
    #[error("writing the archive: {0}")]
    Write(#[from] std::io::Error),
    /// A picture refused to be encoded.
    #[error("encoding a picture: {0}")]
    Picture(#[from] image::ImageError),
    /// A document refused to be encoded.
    #[error("encoding JSON: {0}")]
    Json(#[from] serde_json::Error),
}
