//! `material.json`: every number of a paint that is not a texel, with its unit and range beside it.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::clamp::Clamped;
use super::textures::{Entry, Textures};
use super::{About, ExportError, ExportSettings, inverse_cdf};
use crate::paint::{CarPaint, Lobe, Provenance, RandomTexture, cell_spacing};

/// Version of the document's form.
const VERSION: u32 = 1;

const MODEL: &str = "f(x,i,o) = T(i) T(o) [ chi(theta_h,theta_d) (diffuse/pi + sum of lobes) + flakes(x,theta_h,theta_d) ] + highlight; \
     angles inside the coat; chi and flakes bilinear between their angles, border values outside; f is clamped at 0 once, at \
     the end; 0 at and below the horizon. Lobe: weight D F G / (pi i_z o_z), D = exp(-tan^2 theta_h/alpha^2)/(alpha^2 cos^4 theta_h), \
     F = F0 + (1-F0)(1-h.o)^5, G = min(1, 2 h_z o_z/(h.o), 2 h_z i_z/(h.o)). T = 1 - R, R exact unpolarised Fresnel at the outer cosine. \
     Highlight: D/(pi) G R(h.i) / (4 i_z o_z) with h outside the coat and alpha its roughness; below 0.001 a mirror image of weight R.";

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
    settings: ExportSettings,
    textures: Map<String, Value>,
    shader: &'static str,
    clamped: &'a [Clamped],
    report: &'a Value,
    documentation: Value,
    #[serde(skip_serializing_if = "Option::is_none")]
    shader_source: Option<&'static str>,
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
    let table = &paint.color_table;
    let document = Document {
        format: "carpaint material",
        version: VERSION,
        name: &about.name,
        provenance: &about.provenance,
        content_hash: paint.content_hash().to_hex().to_string(),
        model: MODEL,
        color_space: "linear sRGB, D65; CIELAB of pi f relative to the perfect diffuser, D65, 2 degree observer",
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
        settings: *settings,
        textures: entries,
        shader: "carpaint.glsl",
        clamped: &textures.clamped,
        report: &about.report,
        documentation: documentation(),
        shader_source: matches!(carrier, Carrier::Inline).then_some(super::SHADER),
    };
    Ok(serde_json::to_vec_pretty(&document)?)
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

/// Unit, range and meaning of every number, by its path; `[]` stands for every entry of a list.
fn documentation() -> Value {
    let mut out = Map::new();
    for (path, unit, range, about) in NUMBERS {
        let range = [range.0, range.1].map(|v| if v.is_finite() { json!(v) } else { Value::Null });
        out.insert(
            (*path).into(),
            json!({"unit": unit, "range": range, "about": about}),
        );
    }
    Value::Object(out)
}

const ANY: f64 = f64::INFINITY;

/// Path, unit, range and meaning.
#[rustfmt::skip]
const NUMBERS: &[(&str, &str, (f64, f64), &str)] = &[
    ("version", "1", (1.0, ANY), "version of this document's form; later versions may add, never change"),
    ("coat.ior", "1", (1.0, 4.0), "index of refraction of the clear coat; below 1.0001 it is optically absent"),
    ("coat.roughness", "1", (0.0, 1.0), "Beckmann roughness of the coat's highlight; below 0.001 a mirror"),
    ("coat.thickness_um", "micrometre", (0.0, 1e6), "thickness as the lab stated it; not used"),
    ("diffuse[]", "1", (0.0, 1000.0), "Lambertian albedo of the base before the color table, linear sRGB"),
    ("lobes[].weight[]", "1", (0.0, 1000.0), "weight s of the lobe, linear sRGB"),
    ("lobes[].alpha", "1", (0.0, 10.0), "Beckmann roughness, evaluated as at least 0.0001"),
    ("lobes[].f0", "1", (0.0, 1.0), "Schlick reflectance at normal incidence"),
    ("color_table.theta_h_deg[]", "degree", (0.0, 90.0), "half angle of each row, inside the coat"),
    ("color_table.theta_d_deg[]", "degree", (0.0, 90.0), "difference angle of each column, inside the coat"),
    ("color_table.overall[]", "1", (-ANY, ANY), "the one color that stands for the table, linear sRGB"),
    ("flakes.theta_h_deg[]", "degree", (0.0, 90.0), "half angle of each row of slices, inside the coat"),
    ("flakes.theta_d_deg[]", "degree", (0.0, 90.0), "difference angle of each column of slices, inside the coat"),
    ("flakes.clusters", "1", (1.0, 16_777_216.0), "clusters of all slices"),
    ("flakes.widest_slice", "1", (1.0, 16_777_216.0), "most clusters of a slice"),
    ("flakes.texel_um", "micrometre", (0.0, 1e5), "side of a texel on the paint"),
    ("flakes.grain_um", "micrometre", (0.0, 1e6), "distance over which the texels' autocorrelation falls to one half"),
    ("flakes.lifetime_deg[]", "degree", (0.0, 1e4), "angle over which a slice's correlation falls to one half, along theta_h and theta_d"),
    ("flakes.persistence_deg[]", "degree", (0.0, 1e4), "angle over which a texel keeps its random number, along theta_h and theta_d"),
    ("flakes.cell_spacing_texels", "texel", (0.0, ANY), "distance of the cells that share a random number"),
    ("flakes.tile_texels", "texel", (1.0, ANY), "side of the random texture"),
    ("flakes.corner_rounding_lab", "CIELAB", (0.0, ANY), "largest rounding of a box corner in the corner textures"),
    ("flakes.inverse_cdf.steps", "1", (500.0, 500.0), "steps of the inverse cumulative distribution"),
    ("flakes.inverse_cdf.blocks", "1", (1.0, ANY), "slices that stand side by side in a row of its texture"),
    ("flakes.inverse_cdf.probability_loss[]", "1", (0.0, 1.0), "per slice (theta_d fastest): share of draws that show another cluster than they should (total variation)"),
    ("flakes.inverse_cdf.mean_luminance_change[]", "1", (-1.0, ANY), "per slice: change of the mean luminance by the steps, relative; 0 where the mean is below 1e-6 1/sr"),
    ("textures.*.width", "texel", (1.0, 4096.0), "columns"),
    ("textures.*.height", "texel", (1.0, 4096.0), "rows; row 0 is the first line of the file"),
    ("textures.*.scale[]", "as the texture", (0.0, ANY), "value = offset + scale * texel, texel 0 to 1; absent: value = texel"),
    ("textures.*.offset[]", "as the texture", (-ANY, ANY), "see scale"),
    ("clamped[].count", "1", (1.0, ANY), "numbers of this texture outside the range of its type"),
    ("clamped[].farthest", "as the texture", (-ANY, ANY), "the farthest of them"),
    ("clamped[].limit", "as the texture", (65504.0, 65504.0), "the magnitude they were held to"),
];

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Paths of all numbers in a value, lists as `[]`, textures as `*`.
    fn paths(value: &Value, path: &str, out: &mut std::collections::BTreeSet<String>) {
        match value {
            Value::Number(_) => {
                out.insert(path.to_string());
            }
            Value::Array(list) => list
                .iter()
                .for_each(|entry| paths(entry, &format!("{path}[]"), out)),
            Value::Object(map) => {
                for (key, entry) in map {
                    let key = if path == "textures" { "*" } else { key };
                    paths(
                        entry,
                        &if path.is_empty() {
                            key.to_string()
                        } else {
                            format!("{path}.{key}")
                        },
                        out,
                    );
                }
            }
            _ => {}
        }
    }

    /// Fails when a number of the document is not explained, or lies outside the range that is told.
    pub fn assert_documented(document: &Value) {
        let mut found = std::collections::BTreeSet::new();
        for (key, value) in document.as_object().expect("an object") {
            if !["report", "documentation", "provenance"].contains(&key.as_str()) {
                paths(value, key, &mut found);
            }
        }
        for path in found {
            assert!(
                document["documentation"].get(&path).is_some(),
                "{path} is not documented"
            );
        }
    }
}
