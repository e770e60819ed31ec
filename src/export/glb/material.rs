//! A fitted material as glTF's JSON, and what of the paint travels in its extras.

use serde_json::{Map, Value, json};

use super::brdf::GltfMaterial;
use super::fit::LossReport;
use super::mesh::Mesh;
use crate::export::About;
use crate::export::numbers::{
    ANGLES, ANY, GRAIN, Number, PAINT, PROVENANCE, REPORT, documentation,
};
use crate::paint::{CarPaint, RandomTexture, cell_spacing};

/// The material and the extensions it uses; `textures` are those of F0 and of the normals.
pub(super) fn material_json(
    name: &str,
    material: &GltfMaterial,
    textures: Option<[usize; 2]>,
) -> (Value, Vec<&'static str>) {
    let mut extensions = Map::new();
    extensions.insert("KHR_materials_ior".into(), json!({ "ior": material.ior }));
    let mut specular = json!({ "specularFactor": material.specular, "specularColorFactor": material.specular_color });
    if let Some([f0, _]) = textures {
        specular["specularColorTexture"] = json!({ "index": f0 });
    }
    extensions.insert("KHR_materials_specular".into(), specular);
    if material.clearcoat > 0.0 {
        let coat = json!({
            "clearcoatFactor": material.clearcoat,
            "clearcoatRoughnessFactor": material.clearcoat_roughness,
        });
        extensions.insert("KHR_materials_clearcoat".into(), coat);
    }
    if material.iridescence > 0.0 {
        let film = json!({
            "iridescenceFactor": material.iridescence,
            "iridescenceIor": material.iridescence_ior,
            "iridescenceThicknessMaximum": material.iridescence_thickness_nm,
        });
        extensions.insert("KHR_materials_iridescence".into(), film);
    }
    let used = [
        "KHR_materials_clearcoat",
        "KHR_materials_ior",
        "KHR_materials_iridescence",
        "KHR_materials_specular",
    ]
    .into_iter()
    .filter(|name| extensions.contains_key(*name))
    .collect();
    let [r, g, b] = material.base_color;
    let mut json = json!({
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [r, g, b, 1.0],
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        },
        "extensions": extensions,
    });
    if let Some([_, normals]) = textures {
        json["normalTexture"] = json!({ "index": normals });
    }
    (json, used)
}

/// Everything of the paint, its lists as accessors, and how far the material is from it.
pub(super) fn extras(
    paint: &CarPaint,
    about: &About,
    loss: &LossReport,
    lists: &Map<String, Value>,
    mesh: &Mesh,
) -> Value {
    let table = &paint.color_table;
    let list = |name: &str| lists.get(name).cloned().unwrap_or_default();
    let flakes = paint.flakes.as_ref().map(|flakes| {
        let texture = &flakes.texture;
        let tile_um = texture.texel_um * f64::from(RandomTexture::TILE);
        json!({
            "theta_h_deg": flakes.theta_h.degrees(),
            "theta_d_deg": flakes.theta_d.degrees(),
            "offsets": list("offsets"),
            "probability": list("probability"),
            "lower": list("lower"),
            "upper": list("upper"),
            "texel_um": texture.texel_um,
            "grain_um": texture.grain_um,
            "lifetime_deg": texture.lifetime_deg,
            "persistence_deg": texture.persistence_deg,
            "cell_spacing_texels": cell_spacing(texture.grain_um / texture.texel_um),
            "tile_um": tile_um,
            "tiles_around_the_ball": mesh.repeats,
        })
    });
    json!({
        "version": 1,
        "name": about.name,
        "provenance": about.provenance,
        "content_hash": paint.content_hash().to_hex().to_string(),
        "coat": paint.coat,
        "diffuse": paint.diffuse,
        "lobes": paint.lobes,
        "color_table": {
            "theta_h_deg": table.theta_h().degrees(),
            "theta_d_deg": table.theta_d().degrees(),
            "nodes": list("color_table"),
            "overall": table.overall().to_rgb(),
        },
        "flakes": flakes,
        "ball_radius_m": mesh.radius,
        "loss": loss,
        "report": about.report,
        "documentation": documentation(&[PAINT, ANGLES, GRAIN, EXTRAS, REPORT, PROVENANCE]),
    })
}

/// Lists and losses of the extras; the model's formula is in a texture bundle's `material.json`.
#[rustfmt::skip]
const EXTRAS: &[Number] = &[
    ("color_table.nodes", "accessor", (0.0, ANY), "index of the accessor with the colors of diffuse and lobes, linear sRGB, theta_d fastest"),
    ("flakes.offsets", "accessor", (0.0, ANY), "index of the accessor with the first cluster of every slice, theta_d fastest, and one past the last"),
    ("flakes.probability", "accessor", (0.0, ANY), "index of the accessor with the probability of every cluster, which sums to 1 in a slice within 32-bit rounding"),
    ("flakes.lower", "accessor", (0.0, ANY), "index of the accessor with the corner of least L, a, b of every cluster's box, CIELAB of pi f (D65, 2 degree observer), colors uniform inside"),
    ("flakes.upper", "accessor", (0.0, ANY), "index of the accessor with the corner of largest L, a, b of every cluster's box"),
    ("flakes.tile_um", "micrometre", (0.0, ANY), "side of the baked textures on the paint: repeat uv so on a mesh of your own"),
    ("flakes.tiles_around_the_ball", "1", (1.0, ANY), "repetitions of the baked textures around this file's ball"),
    ("ball_radius_m", "metre", (0.0, ANY), "radius of this file's ball, on which texels have their true size"),
    ("loss.aspecular_deg[]", "degree", (-90.0, 180.0), "aspecular angle of each geometry, light at 45 degrees"),
    ("loss.delta_e2000[]", "CIEDE2000", (0.0, ANY), "at each geometry between the paint and this material, the BRDF of the glTF specification averaged over the texels of F0"),
    ("loss.delta_e2000_over_normals[]", "CIEDE2000", (0.0, ANY), "the same, averaged over the tilts of the normal texture too instead of along the mean normal"),
    ("loss.median", "CIEDE2000", (0.0, ANY), "median of loss.delta_e2000"),
    ("loss.worst", "CIEDE2000", (0.0, ANY), "largest of loss.delta_e2000"),
    ("loss.paint_lab[][]", "CIELAB", (-ANY, ANY), "L, a, b of the paint at each geometry, D65, 2 degree observer; above 100 where it outshines the perfect diffuser"),
    ("loss.material_lab[][]", "CIELAB", (-ANY, ANY), "L, a, b of the material likewise"),
];
