//! `material.json` of a blend: each paint's numbers as they are to be summed, and what they have in common.

use serde::Serialize;

use super::document::{COLOR_SPACE, Carrier, MODEL, Written};
use super::numbers::{self, ANY, Number};
use super::textures::Textures;
use super::{About, ExportError, ExportSettings};
use crate::blend::Part;
use crate::paint::{CarPaint, Coat, FlakeTexture, Lobe, Provenance, RandomTexture, cell_spacing};

/// Version of the document's form.
const VERSION: u32 = 1;

const BLENDING: &str = "Weights w are one number a paint, in the order of `paints`: one list for the base (coat, diffuse, lobes, \
     color_table), one for the flakes' lightness, one for their color; inside or beyond 0 to 1. Linear: X = sum of w X_m for ior and \
     roughness of the coat (an index of 1 is no coat), diffuse, weight and f0 of each lobe, CIELAB of each color table node \
     (then to linear sRGB, then between angles), by lightness for the L of both corners of each box, by color and \
     times the saturation for a and b of both corners. Geometric: X = product of X_m^(w/S), S the sum of w, for the alpha of a lobe, and by lightness for texel_um, \
     grain_um, lifetime_deg and persistence_deg; where |S| < 0.1 the exponents of n paints are 1/n + (w - S/n) S/0.01 instead. \
     Corners that change places are put in order. Probabilities never change. Bounds: ior 1 to 4, roughness 0 to 1, diffuse and weights 0 to 1000, alpha 0.0001 to 10, f0 0 to 1, Lab -2000 to 2000 an \
     axis, texel_um 0.001 to 1e5, grain_um 0.001 to 1e6, degrees 0.01 to 1e4. The mean of a slice depends on the weights: sum of \
     probability times the mean linear sRGB over each box, in 1/sr (over pi), colors uniform in the box; carpaint.js has it in \
     closed form and writes it to the texture slice_means, which is not in this archive. The random tile is that of equal weights \
     (`flakes.tile`): seen with texels of max(grain_um, texel_um/2) / max(tile.grain_um/tile.texel_um, 1/2) it has the grain \
     of other weights too. ";

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    version: u32,
    name: &'a str,
    provenance: &'a Provenance,
    model: &'static str,
    blending: &'static str,
    color_space: &'static str,
    paints: Vec<PaintEntry<'a>>,
    color_table: AnglesEntry<'a>,
    flakes: Option<FlakesEntry<'a>>,
    #[serde(flatten)]
    written: Written<'a>,
}

#[derive(Serialize)]
struct PaintEntry<'a> {
    name: &'a str,
    content_hash: &'a str,
    coat: Option<Coat>,
    diffuse: [f64; 3],
    lobes: &'a [Lobe],
    color_table: OverallEntry,
    flakes: Option<FlakeTexture>,
}

#[derive(Serialize)]
struct OverallEntry {
    overall_lab: [f64; 3],
}

#[derive(Serialize)]
struct AnglesEntry<'a> {
    theta_h_deg: &'a [f64],
    theta_d_deg: &'a [f64],
}

#[derive(Serialize)]
struct FlakesEntry<'a> {
    #[serde(flatten)]
    angles: AnglesEntry<'a>,
    clusters: usize,
    widest_slice: usize,
    tile_texels: u32,
    tile: TileEntry,
    corner_rounding_lab: f32,
}

#[derive(Serialize)]
struct TileEntry {
    texel_um: f64,
    grain_um: f64,
    cell_spacing_texels: f64,
}

/// The document of a blend whose textures are written; `even` is the realisation at equal weights.
pub(super) fn blend_document(
    parts: &[Part<'_>],
    even: &CarPaint,
    about: &About,
    settings: &ExportSettings,
    textures: &Textures,
) -> Result<Vec<u8>, ExportError> {
    let paints = parts.iter().map(|part| PaintEntry {
        name: part.name,
        content_hash: part.hash,
        coat: part.coat,
        diffuse: part.diffuse,
        lobes: &part.lobes,
        color_table: OverallEntry {
            overall_lab: part.color_table.overall().to_array(),
        },
        flakes: part.texture,
    });
    let explained = [
        PAINTS,
        numbers::ANGLES,
        numbers::TEXTURES,
        numbers::REPORT,
        numbers::PROVENANCE,
    ];
    let table = &even.color_table;
    let document = Document {
        format: "carpaint blend",
        version: VERSION,
        name: &about.name,
        provenance: &about.provenance,
        model: MODEL,
        blending: BLENDING.trim_end(),
        color_space: COLOR_SPACE,
        paints: paints.collect(),
        color_table: AnglesEntry {
            theta_h_deg: table.theta_h().degrees(),
            theta_d_deg: table.theta_d().degrees(),
        },
        flakes: even.flakes.as_ref().map(|flakes| FlakesEntry {
            angles: AnglesEntry {
                theta_h_deg: flakes.theta_h.degrees(),
                theta_d_deg: flakes.theta_d.degrees(),
            },
            clusters: flakes.clusters(),
            widest_slice: flakes.widest_slice(),
            tile_texels: RandomTexture::TILE,
            tile: TileEntry {
                texel_um: flakes.texture.texel_um,
                grain_um: flakes.texture.grain_um,
                cell_spacing_texels: cell_spacing(
                    flakes.texture.grain_um / flakes.texture.texel_um,
                ),
            },
            corner_rounding_lab: textures.corner_rounding_lab,
        }),
        written: Written::of(about, settings, textures, &Carrier::Files, &explained)?,
    };
    Ok(serde_json::to_vec_pretty(&document)?)
}

/// What a blend has that a paint has not.
#[rustfmt::skip]
const PAINTS: &[Number] = &[
    ("version", "1", (1.0, ANY), "version of this document's form; later versions may add, never change"),
    ("paints[].coat.ior", "1", (1.0, 4.0), "index of refraction of the clear coat; 1 where this paint is uncoated and another is not"),
    ("paints[].coat.roughness", "1", (0.0, 1.0), "Beckmann roughness of the coat's highlight, an uncoated paint's as its partners'; below 0.001 a mirror"),
    ("paints[].coat.thickness_um", "micrometre", (0.0, 1e6), "thickness as the lab stated it; not used"),
    ("paints[].diffuse[]", "1", (0.0, 1000.0), "Lambertian albedo of the base before the color table, linear sRGB"),
    ("paints[].lobes[].weight[]", "1", (0.0, 1000.0), "weight s of the lobe, linear sRGB; lobes correspond from paint to paint by their place, 0 where a paint has none there"),
    ("paints[].lobes[].alpha", "1", (0.0, 10.0), "Beckmann roughness, blended as a weighted geometric mean"),
    ("paints[].lobes[].f0", "1", (0.0, 1.0), "Schlick reflectance at normal incidence"),
    ("paints[].color_table.overall_lab[]", "CIELAB", (-2000.0, 2000.0), "the one color that stands for the paint's color table"),
    ("paints[].flakes.texel_um", "micrometre", (0.0, 1e5), "side of a texel on the paint"),
    ("paints[].flakes.grain_um", "micrometre", (0.0, 1e6), "distance over which the texels' autocorrelation falls to one half"),
    ("paints[].flakes.lifetime_deg[]", "degree", (0.0, 1e4), "angle over which a slice's correlation falls to one half, along theta_h and theta_d"),
    ("paints[].flakes.persistence_deg[]", "degree", (0.0, 1e4), "angle over which a texel keeps its random number, along theta_h and theta_d"),
    ("flakes.tile.texel_um", "micrometre", (0.0, 1e5), "side of a texel at equal weights, for which the random texture is made"),
    ("flakes.tile.grain_um", "micrometre", (0.0, 1e6), "grain at equal weights"),
    ("flakes.tile.cell_spacing_texels", "texel", (0.0, ANY), "distance of the random texture's cells"),
];
