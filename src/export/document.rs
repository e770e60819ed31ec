//! `material.json`: every number of a paint that is not a texel, with its unit and range beside it.

use serde::Serialize;
use serde_json::{Map, Value};

use super::clamp::Clamped;
use super::numbers::{self, Number};
use super::textures::{Entry, Textures};
use super::{About, ExportError, ExportSettings, inverse_cdf};
use crate::paint::{CarPaint, Lobe, Provenance, RandomTexture, cell_spacing};

/// Version of the document's form.
const VERSION: u32 = 1;

pub(super) const MODEL: &str = "f(x,i,o) = T(i) T(o) [ chi(theta_h,theta_d) (diffuse/pi + sum of lobes) + flakes(x,theta_h,theta_d) ] + highlight; \
     angles inside the coat; chi and flakes bilinear between their angles, border values outside; f is clamped at 0 once, at \
     the end; 0 at and below the horizon. Lobe: weight D F G / (pi i_z o_z), D = exp(-tan^2 theta_h/alpha^2)/(alpha^2 cos^4 theta_h), \
     F = F0 + (1-F0)(1-h.o)^5, G = min(1, 2 h_z o_z/(h.o), 2 h_z i_z/(h.o)). T = 1 - R, R exact unpolarised Fresnel at the outer cosine. \
     Highlight: D/(pi) G R(h.i) / (4 i_z o_z) with h outside the coat and alpha its roughness; below 0.001 a mirror image of weight R.";

pub(super) const COLOR_SPACE: &str =
    "linear sRGB, D65; CIELAB of pi f relative to the perfect diffuser, D65, 2 degree observer";

#[derive(Serialize)]
pub(super) struct Document<'a> {
    format: &'static str,
    version: u32,
    name: &'a str,
    provenance: &'a Provenance,
    content_hash: String,
    model: &'static str,
    color_space: &'static str,
    coat: Option<CoatEntry>,
    diffuse: [f64; 3],
    lobes: &'a [Lobe],
    color_table: ColorTableEntry<'a>,
    flakes: Option<FlakesEntry<'a>>,
    #[serde(flatten)]
    written: Written<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    shader_source: Option<&'static str>,
}

/// What every document says of how it was written.
#[derive(Serialize)]
pub(super) struct Written<'a> {
    settings: ExportSettings,
    textures: Map<String, Value>,
    shader: &'static str,
    clamped: &'a [Clamped],
    report: &'a Value,
    documentation: Value,
}

impl<'a> Written<'a> {
    /// The textures as they are carried, and the meaning of every number, by the lists of `numbers`.
    pub fn of(
        about: &'a About,
        settings: &ExportSettings,
        textures: &'a Textures,
        carrier: &Carrier,
        numbers: &[&[Number]],
    ) -> Result<Self, ExportError> {
        Ok(Self {
            settings: *settings,
            textures: texture_entries(textures, carrier)?,
            shader: "carpaint.glsl",
            clamped: &textures.clamped,
            report: &about.report,
            documentation: numbers::documentation(numbers),
        })
    }
}

#[derive(Serialize)]
struct CoatEntry {
    ior: f64,
    roughness: f64,
    mirror: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    thickness_um: Option<f64>,
}

#[derive(Serialize)]
struct ColorTableEntry<'a> {
    theta_h_deg: &'a [f64],
    theta_d_deg: &'a [f64],
    overall: [f64; 3],
}

#[derive(Serialize)]
struct FlakesEntry<'a> {
    theta_h_deg: &'a [f64],
    theta_d_deg: &'a [f64],
    clusters: usize,
    widest_slice: usize,
    texel_um: f64,
    grain_um: f64,
    lifetime_deg: [f64; 2],
    persistence_deg: [f64; 2],
    cell_spacing_texels: f64,
    tile_texels: u32,
    corner_rounding_lab: f32,
    #[serde(skip_serializing_if = "Option::is_none")]
    inverse_cdf: Option<InverseCdfEntry>,
}

#[derive(Serialize)]
struct InverseCdfEntry {
    steps: usize,
    blocks: usize,
    probability_loss: Vec<f32>,
    mean_luminance_change: Vec<f32>,
}

/// How a texture of the document is found: by file, or inline.
pub(super) enum Carrier {
    /// Files beside the document.
    Files,
    /// `data:` addresses inside it.
    Inline,
}

/// The document of a paint whose textures are written.
pub(super) fn document(
    paint: &CarPaint,
    about: &About,
    settings: &ExportSettings,
    textures: &Textures,
    carrier: &Carrier,
) -> Result<Vec<u8>, ExportError> {
    let explained = [
        numbers::PAINT,
        numbers::ANGLES,
        numbers::GRAIN,
        numbers::TEXTURES,
        numbers::INVERSE_CDF,
        numbers::REPORT,
        numbers::PROVENANCE,
    ];
    let table = &paint.color_table;
    let document = Document {
        format: "carpaint material",
        version: VERSION,
        name: &about.name,
        provenance: &about.provenance,
        content_hash: paint.content_hash().to_hex().to_string(),
        model: MODEL,
        color_space: COLOR_SPACE,
        coat: paint.coat.map(|coat| CoatEntry {
            ior: coat.ior,
            roughness: coat.roughness,
            mirror: coat.is_mirror(),
            thickness_um: coat.thickness_um,
        }),
        diffuse: paint.diffuse,
        lobes: &paint.lobes,
        color_table: ColorTableEntry {
            theta_h_deg: table.theta_h().degrees(),
            theta_d_deg: table.theta_d().degrees(),
            overall: table.overall().to_rgb(),
        },
        flakes: paint.flakes.as_ref().map(|flakes| FlakesEntry {
            theta_h_deg: flakes.theta_h.degrees(),
            theta_d_deg: flakes.theta_d.degrees(),
            clusters: flakes.clusters(),
            widest_slice: flakes.widest_slice(),
            texel_um: flakes.texture.texel_um,
            grain_um: flakes.texture.grain_um,
            lifetime_deg: flakes.texture.lifetime_deg,
            persistence_deg: flakes.texture.persistence_deg,
            cell_spacing_texels: cell_spacing(flakes.texture.grain_um / flakes.texture.texel_um),
            tile_texels: RandomTexture::TILE,
            corner_rounding_lab: textures.corner_rounding_lab,
            inverse_cdf: settings.inverse_cdf.then(|| InverseCdfEntry {
                steps: inverse_cdf::STEPS,
                blocks: textures.inverse_cdf_blocks,
                probability_loss: textures.slice_losses.iter().map(|loss| loss[0]).collect(),
                mean_luminance_change: textures.slice_losses.iter().map(|loss| loss[1]).collect(),
            }),
        }),
        written: Written::of(about, settings, textures, carrier, &explained)?,
        shader_source: matches!(carrier, Carrier::Inline).then_some(super::SHADER),
    };
    Ok(serde_json::to_vec_pretty(&document)?)
}

/// What is told of each texture, by name.
fn texture_entries(
    textures: &Textures,
    carrier: &Carrier,
) -> Result<Map<String, Value>, ExportError> {
    let mut entries = Map::new();
    for texture in &textures.list {
        let mut entry = serde_json::to_value::<&Entry>(&texture.entry)?;
        let (key, value) = match carrier {
            Carrier::Files => ("file", texture.file.clone()),
            Carrier::Inline => ("data", inline(&texture.file, &texture.bytes)),
        };
        entry[key] = value.into();
        entries.insert(texture.name.into(), entry);
    }
    Ok(entries)
}

fn inline(file: &str, bytes: &[u8]) -> String {
    use base64::Engine;
    let kind = if std::path::Path::new(file)
        .extension()
        .is_some_and(|e| e == "png")
    {
        "png"
    } else {
        "x-exr"
    };
    let mut out = format!("data:image/{kind};base64,");
    base64::engine::general_purpose::STANDARD.encode_string(bytes, &mut out);
    out
}
