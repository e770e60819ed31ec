//! The reflectance of a glTF material, as the Khronos specification writes it.
//!
//! ```text
//! specular(α) = V D                   D of Trowbridge-Reitz, V height-correlated Smith over 4 NL NV
//! dielectric  = (1 − max fr) base_color/π + fr specular(roughness²)
//! fr          = specular mix(min(f0(ior) specular_color, 1), 1, (1 − V·H)⁵), bent by iridescence
//! metal       = mix(base_color, 1, (1 − V·H)⁵) specular(roughness²), bent by iridescence
//! material    = mix(mix(dielectric, metal, metallic), specular(clearcoat_roughness²), clearcoat F(N·V))
//! ```
//!
//! Sources: glTF 2.0 specification, appendix B; `KHR_materials_ior`, `_specular`, `_clearcoat` and `_iridescence`. The
//! iridescence Fresnel term is the extension's approximation of Belcour and Barla (2017), at the viewing angle against
//! the normal, as renderers have it. A lobe of α below 0.001 is a mirror image and is left out, as in
//! [`crate::paint::Coat`]. Do not use it to judge a particular viewer: many leave parts of this out.

use std::f64::consts::PI;

use crate::color::LinearRgb;
use crate::paint::Direction;

/// Factors of a glTF material, textures averaged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GltfMaterial {
    /// `baseColorFactor`, linear sRGB, `0..=1`.
    pub base_color: LinearRgb,
    /// `metallicFactor`, `0..=1`.
    pub metallic: f64,
    /// `roughnessFactor`, `0..=1`; α is its square.
    pub roughness: f64,
    /// `ior` of `KHR_materials_ior`, 0 or at least 1.
    pub ior: f64,
    /// `specularFactor` of `KHR_materials_specular`, `0..=1`.
    pub specular: f64,
    /// `specularColorFactor`, `>= 0`.
    pub specular_color: LinearRgb,
    /// `clearcoatFactor`, `0..=1`.
    pub clearcoat: f64,
    /// `clearcoatRoughnessFactor`, `0..=1`.
    pub clearcoat_roughness: f64,
    /// `iridescenceFactor`, `0..=1`.
    pub iridescence: f64,
    /// `iridescenceIor`, at least 1.
    pub iridescence_ior: f64,
    /// `iridescenceThicknessMaximum`, nanometres.
    pub iridescence_thickness_nm: f64,
}

impl Default for GltfMaterial {
    /// The specification's defaults, but not metallic.
    fn default() -> Self {
        Self {
            base_color: [1.0; 3],
            metallic: 0.0,
            roughness: 1.0,
            ior: 1.5,
            specular: 1.0,
            specular_color: [1.0; 3],
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            iridescence: 0.0,
            iridescence_ior: 1.3,
            iridescence_thickness_nm: 400.0,
        }
    }
}

/// Cosines of a pair of directions, which do not depend on the material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cosines {
    n_l: f64,
    n_v: f64,
    v_h: f64,
    /// Squared sine of the half angle: 1 − (N·H)², without cancellation.
    sine2_h: f64,
}

impl Cosines {
    /// Cosines of directions to the light and to the viewer, `None` at or below the horizon.
    pub fn of(wi: Direction, wo: Direction) -> Option<Self> {
        if !(wi[2] > 0.0 && wo[2] > 0.0) {
            return None;
        }
        let half = crate::paint::half_angles(wi, wo);
        Some(Self {
            n_l: wi[2],
            n_v: wo[2],
            v_h: half.h_o,
            sine2_h: half.tan2_h * half.h_z * half.h_z,
        })
    }
}

impl GltfMaterial {
    /// BRDF in 1/sr, linear sRGB, for unit directions; 0 where either is at or below the horizon.
    #[must_use]
    pub fn evaluate(&self, wi: Direction, wo: Direction) -> LinearRgb {
        Cosines::of(wi, wo).map_or([0.0; 3], |cosines| self.at(&cosines))
    }

    /// BRDF at known cosines.
    pub(super) fn at(&self, c: &Cosines) -> LinearRgb {
        self.at_texel(c, dielectric_f0(self.ior, self.specular_color))
    }

    /// BRDF at known cosines where a texel's F0 is `f0`, at most 1.
    pub(super) fn at_texel(&self, c: &Cosines, f0: LinearRgb) -> LinearRgb {
        self.under_film(c, f0, self.film(c, f0))
    }

    /// What its film reflects over a dielectric base; `None` without one.
    pub(super) fn film(&self, c: &Cosines, f0: LinearRgb) -> Option<LinearRgb> {
        let (ior, thickness) = (self.iridescence_ior, self.iridescence_thickness_nm);
        let is_there = self.iridescence > 0.0 && thickness > 0.0;
        is_there.then(|| thin_film(ior, thickness, c.n_v, f0.map(|f| self.specular * f)))
    }

    /// The same where it is known what the [film](Self::film) reflects.
    pub(super) fn under_film(
        &self,
        c: &Cosines,
        f0: LinearRgb,
        film: Option<LinearRgb>,
    ) -> LinearRgb {
        let lobe = specular(self.roughness * self.roughness, c);
        let grazing = (1.0 - c.v_h).max(0.0).powi(5);
        let mut fr = f0.map(|f| self.specular * (f + (1.0 - f) * grazing));
        let mut conductor = self.base_color.map(|f| f + (1.0 - f) * grazing);
        if let Some(film) = film {
            fr = mix(fr, film, self.iridescence);
            if self.metallic > 0.0 {
                let (ior, thickness) = (self.iridescence_ior, self.iridescence_thickness_nm);
                let film = thin_film(ior, thickness, c.n_v, self.base_color);
                conductor = mix(conductor, film, self.iridescence);
            }
        }
        let below = 1.0 - fr[0].max(fr[1]).max(fr[2]);
        let coat_fresnel = 0.04 + 0.96 * (1.0 - c.n_v).max(0.0).powi(5);
        let coat_weight = self.clearcoat * coat_fresnel;
        let coat = if coat_weight > 0.0 {
            specular(self.clearcoat_roughness * self.clearcoat_roughness, c)
        } else {
            0.0
        };
        std::array::from_fn(|k| {
            let dielectric = below * self.base_color[k] / PI + fr[k] * lobe;
            let base = dielectric + (conductor[k] * lobe - dielectric) * self.metallic;
            base + (coat - base) * coat_weight
        })
    }
}

/// Reflectance at normal incidence of `KHR_materials_ior` and `KHR_materials_specular`, without `specularFactor`.
pub(super) fn dielectric_f0(ior: f64, color: LinearRgb) -> LinearRgb {
    let f0 = ((1.0 - ior) / (1.0 + ior)).powi(2);
    color.map(|c| (f0 * c).min(1.0))
}

fn mix(a: LinearRgb, b: LinearRgb, share: f64) -> LinearRgb {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * share)
}

/// The microfacet lobe in 1/sr without its Fresnel term, 0 for a mirror.
pub(super) fn specular(alpha: f64, c: &Cosines) -> f64 {
    if alpha < crate::paint::Coat::MIRROR_ROUGHNESS {
        return 0.0;
    }
    let alpha2 = alpha * alpha;
    // (N·H)² (α² − 1) + 1, from the squared sine.
    let slope = alpha2 + (1.0 - alpha2) * c.sine2_h;
    let d = alpha2 / (PI * slope * slope);
    let smith = |a: f64, b: f64| a * (alpha2 + (1.0 - alpha2) * b * b).sqrt();
    d * 0.5 / (smith(c.n_v, c.n_l) + smith(c.n_l, c.n_v))
}

/// Fresnel term of a thin film over a base of reflectance `f0`, in air, at the outer cosine.
pub(super) fn thin_film(ior: f64, thickness_nm: f64, cosine: f64, f0: LinearRgb) -> LinearRgb {
    let inner2 = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
    if inner2 < 0.0 {
        return [1.0; 3];
    }
    let inner = inner2.sqrt();
    let schlick = |f0: f64, cosine: f64| f0 + (1.0 - f0) * (1.0 - cosine).powi(5);
    let first = schlick(((ior - 1.0) / (ior + 1.0)).powi(2), cosine);
    let through = 1.0 - first;
    let path = 2.0 * ior * thickness_nm * inner;
    // Entering a denser film, light keeps its phase; leaving it upwards it turns by π.
    let turned = if ior < 1.0 { 0.0 } else { PI };
    let mut phase = [0.0; 3];
    let (mut single, mut amplitude) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        let root = f0[k].clamp(0.0, 0.9999).sqrt();
        let base_ior = (1.0 + root) / (1.0 - root);
        let second = schlick(((base_ior - ior) / (base_ior + ior)).powi(2), inner);
        phase[k] = turned + if base_ior < ior { PI } else { 0.0 };
        let both = (first * second).clamp(1e-5, 0.9999);
        amplitude[k] = both.sqrt();
        single[k] = through * through * second / (1.0 - both);
    }
    let mut sum = single.map(|s| first + s);
    let mut cm = single.map(|s| s - through);
    for color in sensitivities(path, phase) {
        for k in 0..3 {
            cm[k] *= amplitude[k];
            sum[k] += cm[k] * 2.0 * color[k];
        }
    }
    sum.map(|v| v.max(0.0))
}

/// Fourier transform of the color matching functions, Gaussians each (Belcour and Barla 2017), in linear sRGB, at a path
/// and at twice the path and shift: of an angle and its double one cosine is enough, of a square and its fourfold one
/// exponential.
///
/// The shift is given per channel of the result, as the extension has it, though it enters as XYZ.
fn sensitivities(path_nm: f64, shift: [f64; 3]) -> [LinearRgb; 2] {
    let phase = 2.0 * PI * path_nm * 1e-9;
    let bumps = |height: f64, position: f64, variance: f64, shift: f64| {
        let scale = height * (2.0 * PI * variance).sqrt();
        let cosine = (position * phase + shift).cos();
        let fall = (-phase * phase * variance).exp();
        [
            scale * cosine * fall,
            scale * (2.0 * cosine * cosine - 1.0) * fall.powi(4),
        ]
    };
    let x = bumps(5.4856e-13, 1.6810e6, 4.3278e9, shift[0]);
    let x_blue = bumps(9.7470e-14, 2.2399e6, 4.5282e9, shift[0]);
    let y = bumps(4.4201e-13, 1.7953e6, 9.3046e9, shift[1]);
    let z = bumps(5.2481e-13, 2.2084e6, 6.6121e9, shift[2]);
    [0, 1].map(|order| {
        let xyz = [x[order] + x_blue[order], y[order], z[order]];
        crate::color::xyz_to_rgb(xyz.map(|v| v / 1.0685e-7))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::Value;

    fn vector(value: &Value) -> [f64; 3] {
        std::array::from_fn(|k| value[k].as_f64().expect("a number"))
    }

    /// How the numbers were made stands in the file.
    #[test]
    fn the_khronos_sample_renderer_shades_the_same() {
        let oracle: Value =
            serde_json::from_str(include_str!("../../../tests/oracle/gltf_brdf.json"))
                .expect("an oracle of numbers");
        let cases = oracle["cases"].as_array().expect("cases");
        assert_eq!(cases.len(), 160);
        for case in cases {
            let number = |name: &str| case[name].as_f64().expect("a number");
            let material = GltfMaterial {
                base_color: vector(&case["base_color"]),
                metallic: number("metallic"),
                roughness: number("roughness"),
                ior: number("ior"),
                specular: number("specular"),
                specular_color: vector(&case["specular_color"]),
                clearcoat: number("clearcoat"),
                clearcoat_roughness: number("clearcoat_roughness"),
                iridescence: number("iridescence"),
                iridescence_ior: number("iridescence_ior"),
                iridescence_thickness_nm: number("iridescence_thickness_nm"),
            };
            let got = material.evaluate(vector(&case["wi"]), vector(&case["wo"]));
            let want = vector(&case["f"]);
            let scale = want.iter().fold(1e-3_f64, |m, v| m.max(v.abs()));
            for k in 0..3 {
                // The renderer counts in 32 bits; its 1 − (N·H)² loses up to three digits next to the mirror.
                assert!((got[k] - want[k]).abs() < 1e-3 * scale, "{case}: {got:?}");
            }
        }
    }

    /// `KHR_materials_specular`: one weight for all channels of the base, or its complement would show. Here the Khronos
    /// renderer weighs by channel, so the number is worked from the extension's formula.
    #[test]
    fn a_colored_fresnel_term_takes_its_largest_channel_from_the_base() {
        let material = GltfMaterial {
            base_color: [0.5; 3],
            specular_color: [12.5, 0.0, 0.0],
            ..GltfMaterial::default()
        };
        let f = material.evaluate([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]);
        // α = 1: D = V = 1/π and 1/4; F0 = 0.04 · 12.5 = 0.5 in red.
        let (diffuse, lobe) = (0.5 / PI, 0.25 / PI);
        for (got, want) in f
            .iter()
            .zip([0.5 * diffuse + 0.5 * lobe, 0.5 * diffuse, 0.5 * diffuse])
        {
            assert!((got - want).abs() < 1e-12, "{f:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn it_is_finite_and_not_negative(
            base_color in prop::array::uniform3(0.0..=1.0_f64), specular_color in prop::array::uniform3(0.0..=3.0_f64),
            metallic in 0.0..=1.0_f64, roughness in 0.0..=1.0_f64, iridescence in 0.0..=1.0_f64,
            thickness in 0.0..2000.0_f64, ior in 1.0..=5.0_f64, z in prop::array::uniform2(1e-9..=1.0_f64),
        ) {
            let material = GltfMaterial {
                base_color, specular_color, metallic, roughness, iridescence, ior, clearcoat: 0.5,
                iridescence_thickness_nm: thickness, iridescence_ior: 1.8, ..GltfMaterial::default()
            };
            let [wi, wo] = z.map(|z| [(1.0 - z * z).sqrt(), 0.0, z]);
            for v in material.evaluate(wi, wo) {
                // Iridescence may reflect a little more than falls in; the base under it is then negative by as little.
                prop_assert!(v.is_finite() && v >= -0.2, "{v}");
            }
        }
    }
}
