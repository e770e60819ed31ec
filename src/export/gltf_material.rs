//! A fitted material as glTF's JSON, and what of the paint travels in its extras.

use serde_json::{Map, Value, json};

use super::About;
use super::gltf_brdf::GltfMaterial;
use super::gltf_fit::LossReport;
use super::gltf_mesh::REPEATS;
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
    radius: f64,
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
            "tiles_around_the_ball": REPEATS,
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
        "ball_radius_m": radius,
        "loss": loss,
        "report": about.report,
        "documentation": DOCUMENTATION.iter().map(|&(k, v)| (k.to_string(), v.into())).collect::<Map<_, _>>(),
    })
}

/// What the extras mean; the model's formula is in a texture bundle's `material.json`.
const DOCUMENTATION: [(&str, &str); 13] = [
    (
        "coat",
        "ior 1 to 4; Beckmann roughness 0 to 1, below 0.001 a mirror; thickness in micrometres, not used",
    ),
    (
        "diffuse",
        "Lambertian albedo before the color table, linear sRGB, 0 to 1000",
    ),
    (
        "lobes",
        "weight s per channel (0 to 1000), Beckmann alpha (0 to 10), Schlick f0 (0 to 1)",
    ),
    (
        "color_table",
        "color of diffuse and lobes; nodes: accessor, linear sRGB, theta_d fastest; angles in degrees inside the coat",
    ),
    (
        "flakes.offsets",
        "accessor: first cluster of every slice, theta_d fastest, and one past the last",
    ),
    (
        "flakes.probability",
        "accessor: probability of every cluster, sums to 1 in a slice within 32-bit rounding",
    ),
    (
        "flakes.lower, flakes.upper",
        "accessors: corners of every cluster's box, CIELAB of pi f (D65, 2 degree observer), colors uniform inside",
    ),
    (
        "flakes.texel_um, grain_um",
        "side of a texel; distance over which the texels' autocorrelation falls to one half; micrometres",
    ),
    (
        "flakes.lifetime_deg, persistence_deg",
        "angle over which a slice's correlation falls to one half; angle over which a texel keeps its random number; degrees along theta_h and theta_d",
    ),
    (
        "flakes.tile_um",
        "side of the baked textures on the paint, micrometres: repeat uv so on a mesh of your own",
    ),
    (
        "loss.delta_e2000",
        "CIEDE2000 between this material, textures averaged, by the BRDF of the glTF specification, and the paint, light at 45 degrees, per aspecular angle",
    ),
    (
        "loss.delta_e2000_over_normals",
        "the same, averaged over the tilts of the normal texture instead of along the mean normal",
    ),
    (
        "report",
        "what was clamped, blended and warned of on the way",
    ),
];
