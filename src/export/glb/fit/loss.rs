//! How far a glTF material stays away from its paint.

use serde::Serialize;

use crate::color::{Lab, LinearRgb, ciede2000};
use crate::export::glb::bake::Texels;
use crate::export::glb::brdf::{Cosines, GltfMaterial};
use crate::paint::{ASPECULAR_DEG, Chi, Direction, Reflectance, instrument_pairs};

/// How far a GLB's material is from its paint, as the mean of what a viewer shows of its texels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LossReport {
    /// Aspecular angles of the geometries, degrees; light at 45°.
    pub aspecular_deg: [f64; 6],
    /// CIEDE2000 between material and paint at each.
    pub delta_e2000: [f64; 6],
    /// The same, averaged over the normals of its texture too, as a close view averages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delta_e2000_over_normals: Option<[f64; 6]>,
    /// Median of `delta_e2000`.
    pub median: f64,
    /// Largest of `delta_e2000`.
    pub worst: f64,
    /// CIELAB of the paint, D65, 2° observer.
    pub paint_lab: [[f64; 3]; 6],
    /// CIELAB of the material.
    pub material_lab: [[f64; 3]; 6],
}

/// CIEDE2000 of a material against a paint; `texels` are those of its textures, to average over.
pub(in crate::export::glb) fn loss(
    material: &GltfMaterial,
    reflectance: &Reflectance<'_>,
    texels: Option<&Texels>,
) -> LossReport {
    let shown = |(wi, wo): (Direction, Direction)| {
        let shades = texels.map(|texels| &texels.shades[..]);
        shades.map_or_else(
            || material.evaluate(wi, wo),
            |shades| over_shades(material, wi, wo, shades),
        )
    };
    let labs = |pair: (Direction, Direction)| {
        let paint = reflected(reflectance.evaluate(pair.0, pair.1, Chi::Table));
        (paint, reflected(shown(pair)))
    };
    let pairs = instrument_pairs();
    let both = pairs.map(labs);
    let delta_e2000 = both.map(|(paint, material)| ciede2000(paint, material));
    let delta_e2000_over_normals = texels.map(|texels| {
        std::array::from_fn(|k| {
            ciede2000(
                both[k].0,
                reflected(over_normals(material, pairs[k], texels)),
            )
        })
    });
    let mut sorted = delta_e2000;
    sorted.sort_by(f64::total_cmp);
    LossReport {
        aspecular_deg: ASPECULAR_DEG,
        delta_e2000,
        delta_e2000_over_normals,
        median: f64::midpoint(sorted[2], sorted[3]),
        worst: sorted[5],
        paint_lab: both.map(|(paint, _)| paint.to_array()),
        material_lab: both.map(|(_, material)| material.to_array()),
    }
}

/// Mean of a material over the shades of its F0.
fn over_shades(
    material: &GltfMaterial,
    wi: Direction,
    wo: Direction,
    shades: &[(f64, LinearRgb)],
) -> LinearRgb {
    let mut sum = [0.0; 3];
    if let Some(cosines) = Cosines::of(wi, wo) {
        for (share, f0) in shades {
            let f = material.at_texel(&cosines, *f0);
            for k in 0..3 {
                sum[k] += share * f[k];
            }
        }
    }
    sum
}

/// Mean of a material over tilted normals and shades of F0, seen as one surface.
fn over_normals(
    material: &GltfMaterial,
    (wi, wo): (Direction, Direction),
    Texels { normals, shades }: &Texels,
) -> LinearRgb {
    let mut sum = [0.0; 3];
    for normal in normals {
        let [li, lo] = [wi, wo].map(|w| in_frame(*normal, w));
        let f = over_shades(material, li, lo, shades);
        // A viewer multiplies by the cosine against the tilted normal, the instrument divides by the flat one.
        for k in 0..3 {
            sum[k] += f[k] * li[2].max(0.0) / wi[2];
        }
    }
    #[allow(clippy::cast_precision_loss)] // a handful
    sum.map(|v| v / normals.len().max(1) as f64)
}

/// A direction in the frame of a normal near the pole: the shortest rotation that takes the normal to (0, 0, 1).
fn in_frame(n: Direction, w: Direction) -> Direction {
    let dot = n[0] * w[0] + n[1] * w[1] + n[2] * w[2];
    let across = (w[2] + dot) / (1.0 + n[2]);
    [w[0] - across * n[0], w[1] - across * n[1], dot]
}

/// CIELAB of a BRDF value under the instrument's light.
pub(super) fn reflected(f: LinearRgb) -> Lab {
    Lab::from_rgb(f.map(|v| std::f64::consts::PI * v))
}
