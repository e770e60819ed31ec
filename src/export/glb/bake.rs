//! Flakes baked into textures, so that ordinary viewers glitter: F0 and normal of every texel of the random tile.
//!
//! The F0 texture varies the fitted lobe as the flakes vary the paint at 25° off the gloss: brighter flakes are brighter
//! facets. The normal texture tilts every cell a little, so that facets light up one after the other as the object turns.
//! Texels' F0 end at 1, where viewers clamp, and they average to the fitted one, bytes included: both to a thousandth or
//! two. The tilts widen the lobe by a few percent, which the loss report states. What a viewer shows is a likeness: the statistics themselves
//! travel beside it.

use std::sync::LazyLock;

use image::ExtendedColorType;

use super::brdf::GltfMaterial;
use crate::color::{LinearRgb, decode_srgb, encode_srgb};
use crate::export::ExportError;
use crate::export::png_file::png;
use crate::paint::{
    Chi, Direction, FlakeSampler, Flakes, RandomTexture, Reflectance, TexelDraw, instrument_pairs,
};

/// Least brightness of a texel, relative to the mean: measured flakes are noise around zero between glints.
const DARKEST: f64 = 0.02;
/// Standard deviation of the facets' slopes, as a share of the lobe's α.
const TILT_SHARE: f64 = 0.3;
/// Largest standard deviation of the slopes.
const TILT_MAX: f64 = 0.1;
/// The geometry whose flakes are baked: 25° off the gloss, where metallics glitter most to the eye.
const BAKED_GEOMETRY: usize = 2;

/// Baked textures of a paint.
pub(super) struct Baked {
    /// PNG of F0, sRGB.
    pub f0: Vec<u8>,
    /// Factor per channel that makes the texture's mean the fitted F0.
    pub f0_factor: LinearRgb,
    /// PNG of tangent-space normals.
    pub normals: Vec<u8>,
    /// What the loss averages over.
    pub texels: Texels,
}

/// The textures as their statistics.
pub(super) struct Texels {
    /// Some of the normals.
    pub normals: Vec<Direction>,
    /// Shares of the area and the mean F0 in them, by strongest channel and its level.
    ///
    /// A lobe without a film is linear in F0 and in its strongest channel, so that these stand for the texels exactly.
    pub shades: Vec<(f64, LinearRgb)>,
}

/// Levels of the strongest channel that are told apart; films are not linear in F0.
const LEVELS: usize = 4;

/// Sums over the facets of each shade.
#[derive(Default)]
struct Shades([(f64, LinearRgb); 3 * LEVELS]);

impl Shades {
    fn add(&mut self, f0: LinearRgb, area: f64, levels: usize) {
        let strongest = usize::from(f0[1] > f0[0]);
        let strongest = if f0[2] > f0[strongest] { 2 } else { strongest };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // F0 is 0..=1
        let level = ((f0[strongest] * levels as f64) as usize).min(levels - 1);
        let (sum, color) = &mut self.0[strongest * LEVELS + level];
        *sum += area;
        for k in 0..3 {
            color[k] += area * f0[k];
        }
    }

    fn shares(&self) -> Vec<(f64, LinearRgb)> {
        let all: f64 = self.0.iter().map(|(area, _)| area).sum();
        let seen = self.0.iter().filter(|(area, _)| *area > 0.0);
        seen.map(|(area, sum)| (area / all, sum.map(|s| s / area)))
            .collect()
    }
}

/// Color and tilt of one cell.
#[derive(Clone, Copy)]
struct Facet {
    /// Relative to the mean.
    f0: [f32; 3],
    normal: [f32; 3],
}

/// Bakes the flakes of a paint into the lobe of its fitted material, whose F0 is `f0`.
pub(super) fn bake(
    reflectance: &Reflectance<'_>,
    flakes: &Flakes,
    material: &GltfMaterial,
    f0: LinearRgb,
) -> Result<Baked, ExportError> {
    let tile = RandomTexture::of(&flakes.texture);
    let cells = tile.cells();
    let width = tile.width() as usize;
    let baked = BakedSlice::of(reflectance, flakes);
    let facet = facets(reflectance, &baked, material);
    // Cells are wider than texels: most texels show the facet beside or above, and only its bytes are theirs.
    let mut shown: Vec<u32> = Vec::with_capacity(cells.len());
    let (mut all, mut areas): (Vec<Facet>, Vec<f64>) = (Vec::new(), Vec::new());
    for (k, &cell) in cells.iter().enumerate() {
        let beside = (k % width > 0).then(|| k - 1);
        let known = [beside, k.checked_sub(width)]
            .into_iter()
            .flatten()
            .find(|&at| cells[at] == cell);
        let own = known.map_or(all.len(), |at| shown[at] as usize);
        if own == all.len() {
            all.push(facet(cell));
            areas.push(0.0);
        }
        areas[own] += 1.0;
        #[allow(clippy::cast_possible_truncation)] // no more facets than texels of a tile
        shown.push(own as u32);
    }
    let gain: [f32; 3] = std::array::from_fn(|k| clamped_gain(&all, &areas, k, f0[k]));
    for facet in &mut all {
        for k in 0..3 {
            facet.f0[k] = (facet.f0[k] * gain[k]).min(1.0);
        }
    }
    let peak = all.iter().flat_map(|f| f.f0).fold(1e-6_f32, f32::max);
    let curve = &*CURVE;
    let mut sum = [0.0; 3];
    let colors: Vec<[u8; 3]> = all
        .iter()
        .zip(&areas)
        .map(|(f, area)| {
            let bytes = f.f0.map(|light| curve.byte(light / peak));
            for k in 0..3 {
                sum[k] += area * f64::from(curve.light[usize::from(bytes[k])]);
            }
            bytes
        })
        .collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0..=255
    let normals: Vec<[u8; 3]> = all
        .iter()
        .map(|f| f.normal.map(|v| (127.5 + 127.5 * v).round() as u8))
        .collect();
    #[allow(clippy::cast_precision_loss)] // a tile's texels
    let mean = sum.map(|s| s / shown.len() as f64);
    let f0_factor: LinearRgb =
        std::array::from_fn(|k| if mean[k] > 1e-9 { f0[k] / mean[k] } else { 0.0 });
    let levels = if material.iridescence > 0.0 {
        LEVELS
    } else {
        1
    };
    let mut shades = Shades::default();
    for (bytes, area) in colors.iter().zip(&areas) {
        let light = bytes.map(|b| f64::from(curve.light[usize::from(b)]));
        shades.add(
            std::array::from_fn(|k| (light[k] * f0_factor[k]).min(1.0)),
            *area,
            levels,
        );
    }
    let normal_sample = shown
        .iter()
        .step_by(shown.len().div_ceil(64).max(1))
        .map(|&own| all[own as usize].normal.map(f64::from))
        .collect();
    let height = tile.height() as usize;
    let picture = |of_facet: &[[u8; 3]]| {
        let texels: Vec<[u8; 3]> = shown.iter().map(|&own| of_facet[own as usize]).collect();
        png(
            width,
            height,
            texels.as_flattened(),
            ExtendedColorType::Rgb8,
        )
    };
    Ok(Baked {
        f0: picture(&colors)?,
        f0_factor,
        normals: picture(&normals)?,
        texels: Texels {
            normals: normal_sample,
            shades: shades.shares(),
        },
    })
}

/// Bins of [`clamped_gain`], 64 to the octave, and the first of them: above 2⁻⁶ as the leading bits of a float.
const BINS: usize = 1024;
const FIRST_BIN: u32 = 0x3c80_0000 >> 17;

/// The gain at which facets, none above 1, have the mean `f0` in a channel, within a thousandth.
///
/// The mean is concave and piecewise linear in the gain, so Newton's steps from below end on it.
#[allow(clippy::cast_possible_truncation)] // texel precision
fn clamped_gain(facets: &[Facet], areas: &[f64], channel: usize, f0: f64) -> f32 {
    // Area, and relative F0 times it: steps over bins, not over all facets.
    let mut bins = vec![(0.0, 0.0); BINS];
    for (facet, area) in facets.iter().zip(areas) {
        let relative = facet.f0[channel];
        let bin = (relative.to_bits() >> 17).saturating_sub(FIRST_BIN) as usize;
        let (sum, light) = &mut bins[bin.min(BINS - 1)];
        *sum += area;
        *light += area * f64::from(relative);
    }
    let area: f64 = bins.iter().map(|(area, _)| area).sum();
    let mut gain = 0.0;
    for _ in 0..24 {
        let (mut below, mut above) = (0.0, 0.0);
        for (area, light) in &bins {
            if gain * light < *area {
                below += light;
            } else {
                above += area;
            }
        }
        let next = (f0 * area - above) / below;
        if !(next.is_finite() && next > gain * (1.0 + 1e-6)) {
            break;
        }
        gain = next;
    }
    gain as f32
}

/// The flakes nearest to the geometry that is baked.
struct BakedSlice {
    flakes: Flakes,
    theta_h_deg: f32,
    theta_d_deg: f32,
}

impl BakedSlice {
    /// On the nearest slice itself a draw is one draw, not a mixture of four.
    fn of(reflectance: &Reflectance<'_>, flakes: &Flakes) -> Self {
        let (wi, wo) = instrument_pairs()[BAKED_GEOMETRY];
        let half = reflectance.terms(wi, wo, Chi::Table).map(|t| t.half);
        let nearest = |grid: &crate::paint::AngleGrid, angle: Option<f64>| {
            let bracket = grid.bracket(angle.unwrap_or(0.0).to_degrees());
            let index = if bracket.fraction < 0.5 {
                bracket.low
            } else {
                bracket.high
            };
            #[allow(clippy::cast_possible_truncation)] // angles at texel precision
            let angle = grid.degrees()[index] as f32;
            (index, angle)
        };
        let (row, theta_h_deg) = nearest(&flakes.theta_h, half.map(|h| h.theta_h));
        let (column, theta_d_deg) = nearest(&flakes.theta_d, half.map(|h| h.theta_d));
        Self {
            flakes: flakes.only(&[row], &[column]),
            theta_h_deg,
            theta_d_deg,
        }
    }
}

/// What a cell becomes.
fn facets<'a>(
    reflectance: &Reflectance<'_>,
    baked: &'a BakedSlice,
    material: &GltfMaterial,
) -> impl Fn(u32) -> Facet + 'a {
    let (wi, wo) = instrument_pairs()[BAKED_GEOMETRY];
    let transmission = reflectance
        .terms(wi, wo, Chi::Table)
        .map_or(1.0, |t| t.transmission);
    let mean = baked.flakes.slice_at(0).mean();
    // The lobe alone, without diffuse and coat.
    let lobe = GltfMaterial {
        base_color: [0.0; 3],
        clearcoat: 0.0,
        ..*material
    }
    .evaluate(wi, wo);
    let gain: [f64; 3] = lobe.map(|s| transmission / s.max(1e-5));
    let sampler = FlakeSampler::new(&baked.flakes);
    let slope = (TILT_SHARE * material.roughness.powi(2)).min(TILT_MAX);
    move |cell| {
        let color = sampler.color(cell, baked.theta_h_deg, baked.theta_d_deg);
        #[allow(clippy::cast_possible_truncation)] // texel precision
        let f0 = std::array::from_fn(|k| {
            (1.0 + gain[k] * (f64::from(color[k]) - mean[k])).max(DARKEST) as f32
        });
        Facet {
            f0,
            normal: tilted(cell, slope),
        }
    }
}

/// Normal of a cell: Gaussian slopes by Box and Muller from the cell's own random numbers.
fn tilted(cell: u32, slope: f64) -> [f32; 3] {
    let draw = TexelDraw::of(!cell, 0.0, 0.0, [1e4; 2]);
    // Not the pick: it follows from the cell's number, and the brightest flakes would be the most tilted.
    let radius = slope * (-2.0 * f64::from(draw.place[1]).ln()).sqrt();
    let turn = std::f64::consts::TAU * f64::from(draw.place[0]);
    let (x, y) = (radius * turn.cos(), radius * turn.sin());
    let length = (1.0 + x * x + y * y).sqrt();
    #[allow(clippy::cast_possible_truncation)] // becomes a byte
    [x, y, 1.0].map(|v| (v / length) as f32)
}

static CURVE: LazyLock<SrgbCurve> = LazyLock::new(SrgbCurve::new);

/// The sRGB transfer curve by table, both ways (IEC 61966-2-1).
struct SrgbCurve {
    /// Byte of the square of `index/4095`.
    bytes: Vec<u8>,
    /// Light of every byte.
    light: [f32; 256],
}

impl SrgbCurve {
    fn new() -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0..=255
        let bytes = (0..4096_u32)
            .map(|k| (255.0 * encode_srgb((f64::from(k) / 4095.0).powi(2))).round() as u8)
            .collect();
        #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss)] // 0..=255
        let light = std::array::from_fn(|k| decode_srgb(k as f64 / 255.0) as f32);
        Self { bytes, light }
    }

    fn byte(&self, light: f32) -> u8 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0..=4095
        let index = (light.clamp(0.0, 1.0).sqrt() * 4095.0 + 0.5) as usize;
        self.bytes[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{Lab, ciede2000};
    use crate::export::glb::brdf::dielectric_f0;
    use crate::export::glb::fit::{fit, loss};
    use crate::export::made_up::metallic;

    /// A texel is what a viewer shows of it: its byte times the factor, at most 1.
    #[test]
    fn the_texture_averages_to_the_fitted_f0() {
        let paint = metallic(8, 6, 30);
        let reflectance = Reflectance::new(&paint);
        let (material, _) = fit(&reflectance);
        let fitted = dielectric_f0(material.ior, material.specular_color);
        let flakes = paint.flakes.as_ref().expect("flakes");
        let curve = SrgbCurve::new();
        for (f0, bright) in [(fitted, false), ([0.94, 0.85, 0.6], true)] {
            let baked = bake(&reflectance, flakes, &material, f0).expect("baked");
            let picture = image::load_from_memory(&baked.f0).expect("a PNG").to_rgb8();
            let texels = f64::from(picture.width() * picture.height());
            for k in 0..3 {
                let light = |p: &image::Rgb<u8>| {
                    f64::from(curve.light[usize::from(p.0[k])]) * baked.f0_factor[k]
                };
                let shown: f64 = picture.pixels().map(|p| light(p).min(1.0)).sum();
                // The gain holds to a thousandth; at 1 a byte is a hundredth wide, half of which falls either way.
                let mean = shown / texels;
                assert!((mean / f0[k] - 1.0).abs() < 3e-3, "{k}: {mean} for {f0:?}");
                let most = picture.pixels().map(light).fold(0.0, f64::max);
                assert!(most < 1.005, "{k}: {most}");
            }
            let at_one = |p: &&image::Rgb<u8>| {
                f64::from(curve.light[usize::from(p.0[0])]) * baked.f0_factor[0] > 0.99
            };
            let share = picture.pixels().filter(at_one).count() as f64 / texels;
            assert_eq!(share > 0.05, bright, "{share} of the texels are at 1");
            let bytes: std::collections::BTreeSet<u8> = picture.pixels().map(|p| p.0[1]).collect();
            assert!(bytes.len() > 10, "the texture varies");
        }
    }

    #[test]
    fn the_loss_is_that_of_all_texels_as_viewers_show_them() {
        let paint = metallic(8, 6, 30);
        let reflectance = Reflectance::new(&paint);
        let (material, _) = fit(&reflectance);
        // So near 1 that many texels meet it.
        let f0 = [0.94, 0.85, 0.6];
        let flakes = paint.flakes.as_ref().expect("flakes");
        let curve = SrgbCurve::new();
        let white = dielectric_f0(material.ior, [1.0; 3])[0];
        for (iridescence, tolerance) in [(0.0, 0.02), (0.7, 0.3)] {
            let material = GltfMaterial {
                base_color: [0.2, 0.1, 0.4],
                iridescence,
                ..material
            };
            let baked = bake(&reflectance, flakes, &material, f0).expect("baked");
            let picture = image::load_from_memory(&baked.f0).expect("a PNG").to_rgb8();
            let reported = loss(&material, &reflectance, Some(&baked.texels));
            for (pair, lab) in instrument_pairs().into_iter().zip(reported.material_lab) {
                let mut sum = [0.0; 3];
                for pixel in picture.pixels() {
                    let light = pixel.0.map(|b| f64::from(curve.light[usize::from(b)]));
                    let texel = GltfMaterial {
                        specular_color: std::array::from_fn(|k| {
                            light[k] * baked.f0_factor[k] / white
                        }),
                        ..material
                    };
                    let f = texel.evaluate(pair.0, pair.1);
                    for k in 0..3 {
                        sum[k] += f[k];
                    }
                }
                let texels = f64::from(picture.width() * picture.height());
                let seen = Lab::from_rgb(sum.map(|s| s / texels * std::f64::consts::PI));
                let apart = ciede2000(Lab::from(lab), seen);
                assert!(apart < tolerance, "{iridescence}: {apart}");
            }
        }
    }

    #[test]
    fn every_byte_of_the_curve_survives_both_ways() {
        let curve = SrgbCurve::new();
        for byte in 0..=255_u8 {
            assert_eq!(curve.byte(curve.light[usize::from(byte)]), byte);
        }
    }
}
