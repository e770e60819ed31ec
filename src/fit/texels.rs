//! Texels on their way into clusters: Lab for the assignment, the picture's own numbers for what is promised.
//!
//! Lab is computed in `f32`, several texels at once; it decides which cluster a texel goes to. A cluster's mean is summed
//! from the picture's numbers in `f64` ([`linear`]).

use crate::color::{D65_2, KNEE, Lab, LinearRgb, rgb_to_xyz};
use crate::paint::MAX_LAB;

/// A texel: L, a, b, and its number disguised as a small normal float, so that four lanes add at once.
pub(super) type Texel = [f32; 4];

fn disguised(number: u32) -> f32 {
    f32::from_bits(0x3000_0000 + number)
}

fn number(texel: &Texel) -> usize {
    (texel[3].to_bits() - 0x3000_0000) as usize
}

/// Texels that are converted at once.
const LANES: usize = 64;

/// Lab of π f for up to 64 texels, in `f32`; whether all of them are finite and within the bounds.
///
/// Good to 2e-6 of f, a hundredth of what the half floats of a slice resolve. For the assignment of texels to
/// clusters; [`Lab::from_rgb`] is the exact one.
fn lab_of(rgb: [&[f32]; 3], out: &mut [[f32; LANES]; 3]) -> bool {
    const M: [[f32; 3]; 3] = pi_xyz_over_white();
    let bound = MAX_LAB as f32;
    let n = rgb[0].len().min(LANES);
    let (r, g, b) = (&rgb[0][..n], &rgb[1][..n], &rgb[2][..n]);
    let [light, green_red, yellow_blue] = out;
    let mut outside = 0_u32;
    for k in 0..n {
        let f = M.map(|m| compress(m[0] * r[k] + m[1] * g[k] + m[2] * b[k]));
        let lab = [
            116.0 * f[1] - 16.0,
            500.0 * (f[0] - f[1]),
            200.0 * (f[1] - f[2]),
        ];
        let inside = (lab[0].abs() <= bound) & (lab[1].abs() <= bound) & (lab[2].abs() <= bound);
        outside |= u32::from(!inside);
        (light[k], green_red[k], yellow_blue[k]) = (lab[0], lab[1], lab[2]);
    }
    outside == 0
}

/// The matrix from linear sRGB in 1/sr to XYZ of π f over white.
const fn pi_xyz_over_white() -> [[f32; 3]; 3] {
    let white = [D65_2.x, D65_2.y, D65_2.z];
    let columns = [
        rgb_to_xyz([1.0, 0.0, 0.0]),
        rgb_to_xyz([0.0, 1.0, 0.0]),
        rgb_to_xyz([0.0, 0.0, 1.0]),
    ];
    let mut m = [[0.0; 3]; 3];
    let mut k = 0;
    while k < 9 {
        let (row, column) = (k / 3, k % 3);
        m[row][column] = (std::f64::consts::PI * columns[column][row] / white[row]) as f32;
        k += 1;
    }
    m
}

/// The CIELAB compression in `f32`: a cube root by one step of Halley's and one of Newton's from a guess by the exponent.
#[inline(always)]
fn compress(t: f32) -> f32 {
    const KNEE_LIGHT: f32 = (KNEE * KNEE * KNEE) as f32;
    const SLOPE: f32 = (1.0 / (3.0 * KNEE * KNEE)) as f32;
    let x = t.max(KNEE_LIGHT);
    // A third of the exponent, by shifts that vectorise: 1/4 + 1/16 + ... (Warren, Hacker's Delight, 11-2).
    let mut third = (x.to_bits() >> 2) + (x.to_bits() >> 4);
    third += third >> 4;
    third += third >> 8;
    let guess = f32::from_bits(third + 0x2a51_37a0);
    let cube = guess * guess * guess;
    let inverse = 1.0 / (2.0 * cube + x);
    let y = guess * (cube + 2.0 * x) * inverse;
    // Newton's step takes 1/(3y²), which the guess's y/(2 cube + x) is to a tenth: no second division.
    let y = y - (y * y * y - x) * y * inverse;
    if t > KNEE_LIGHT {
        y
    } else {
        t * SLOPE + (4.0 / 29.0) as f32
    }
}

/// Fills `texels` with the finite pixels and `light` with what the picture says of all; returns how many are not finite,
/// and how many lie beyond the bounds.
pub(super) fn take_in(
    planes: [&[f32]; 3],
    texels: &mut Vec<Texel>,
    light: &mut Vec<[f32; 4]>,
) -> (usize, usize) {
    let [red, green, blue] = planes;
    texels.clear();
    texels.reserve(red.len());
    light.clear();
    light.reserve(red.len());
    let mut lab = [[0.0_f32; LANES]; 3];
    let mut within = true;
    let mut first = 0_u32;
    for ((r, g), b) in red
        .chunks(LANES)
        .zip(green.chunks(LANES))
        .zip(blue.chunks(LANES))
    {
        within &= lab_of([r, g, b], &mut lab);
        let [l, green_red, yellow_blue] = &lab;
        let colors = l.iter().zip(green_red).zip(yellow_blue).take(r.len());
        texels.extend(
            (first..)
                .zip(colors)
                .map(|(number, ((l, a), b))| [*l, *a, *b, disguised(number)]),
        );
        light.extend(r.iter().zip(g).zip(b).map(|((r, g), b)| [*r, *g, *b, 0.0]));
        first += LANES as u32;
    }
    if within {
        return (0, 0);
    }
    let bound = MAX_LAB as f32;
    texels.retain(|texel| light[number(texel)].iter().all(|v| v.is_finite()));
    let mut beyond = 0;
    for texel in texels.iter_mut() {
        // A finite color whose own arithmetic overflowed is as light as can be.
        let overflown = [bound, 0.0, 0.0];
        let held = [0, 1, 2].map(|k| {
            if texel[k].is_nan() {
                overflown[k]
            } else {
                texel[k].clamp(-bound, bound)
            }
        });
        if held != texel[..3] {
            beyond += 1;
            texel[..3].copy_from_slice(&held);
            let rgb = Lab::from(held.map(f64::from))
                .to_rgb()
                .map(|v| (v / std::f64::consts::PI) as f32);
            light[number(texel)][..3].copy_from_slice(&rgb);
        }
    }
    (red.len() - texels.len(), beyond)
}

/// Linear reflectance factor of a texel.
#[inline]
pub(super) fn linear(texel: &Texel, light: &[[f32; 4]]) -> LinearRgb {
    let [r, g, b, _] = light[number(texel)];
    [r, g, b].map(|v| f64::from(v) * std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn texels(pixels: &[[f32; 3]]) -> (Vec<Texel>, Vec<[f32; 4]>, (usize, usize)) {
        let plane = |k: usize| -> Vec<f32> { pixels.iter().map(|p| p[k]).collect() };
        let (red, green, blue) = (plane(0), plane(1), plane(2));
        let (mut texels, mut light) = (Vec::new(), Vec::new());
        let counts = take_in([&red, &green, &blue], &mut texels, &mut light);
        (texels, light, counts)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn the_quick_lab_is_the_exact_one_to_single_precision(
            rgb in prop::array::uniform3(prop_oneof![-0.01..0.01_f32, 0.0..1.0_f32, 0.0..500.0_f32]),
        ) {
            let (texels, ..) = texels(&[rgb]);
            let exact = Lab::from_rgb(rgb.map(|v| f64::from(v) * std::f64::consts::PI)).to_array();
            // The cube root is good to 1.5e-6; f carries a few ulp more of itself and of its argument's terms, the latter divided by three times the
            // square of f; a and b multiply the difference by 500 and 200.
            let size = f64::from(rgb.iter().fold(0.0_f32, |m, v| m.max(v.abs()))) * std::f64::consts::PI;
            let f = size.cbrt().max(0.2);
            let ulp = f64::from(f32::EPSILON);
            let tolerance = (1.5e-6 + 4.0 * ulp) * f + 4.0 * ulp * size / (3.0 * KNEE * KNEE);
            for (k, scale) in [116.0, 1000.0, 400.0].into_iter().enumerate() {
                prop_assert!((f64::from(texels[0][k]) - exact[k]).abs() <= scale * tolerance, "{texels:?} {exact:?}");
            }
        }
    }

    #[test]
    fn pixels_that_are_no_numbers_are_left_out_and_counted() {
        let nan = f32::NAN;
        let (kept, _, counts) = texels(&[
            [0.1; 3],
            [nan, 0.1, 0.1],
            [0.2; 3],
            [0.1, f32::INFINITY, 0.1],
            [0.1, 0.1, nan],
        ]);
        assert_eq!(counts, (3, 0));
        assert_eq!(kept.iter().map(number).collect::<Vec<_>>(), [0, 2]);
    }

    #[test]
    fn colors_beyond_the_bounds_are_held_there_and_counted() {
        let (kept, light, counts) = texels(&[
            [0.1; 3],
            [1e5; 3],
            [f32::MAX, f32::MAX, 0.0],
            [-1e30, 0.0, 1e30],
        ]);
        assert_eq!(counts, (0, 3));
        let bound = MAX_LAB as f32;
        assert!(
            kept.iter().all(|t| t[..3].iter().all(|v| v.abs() <= bound)),
            "{kept:?}"
        );
        assert_eq!(kept[1][0], bound);
        assert!(
            linear(&kept[1], &light)
                .iter()
                .all(|v| v.is_finite() && *v > 1000.0)
        );
    }
}
