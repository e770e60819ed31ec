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
pub(super) const LANES: usize = 64;

/// Up to 64 texels of a picture: what it says of them, in 1/sr, and their Lab.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lot {
    pub rgb: [[f32; LANES]; 3],
    pub lab: [[f32; LANES]; 3],
    /// How many they are.
    pub count: usize,
    /// Those with a finite color, a bit for each.
    pub live: u64,
    /// How many were held at the bounds.
    pub beyond: usize,
}

impl Lot {
    /// A lot to take texels into.
    pub(super) const EMPTY: Self = Self {
        rgb: [[0.0; LANES]; 3],
        lab: [[0.0; LANES]; 3],
        count: 0,
        live: 0,
        beyond: 0,
    };

    /// Takes the first 64 of these texels at most.
    #[inline(always)]
    pub(super) fn take(&mut self, planes: [&[f32]; 3]) {
        self.count = planes[0].len().min(LANES);
        for (own, plane) in self.rgb.iter_mut().zip(planes) {
            own[..self.count].copy_from_slice(&plane[..self.count]);
        }
        self.live = u64::MAX >> (LANES - self.count);
        self.beyond = 0;
        if !self.convert() {
            self.hold_to_bounds();
        }
    }

    /// Lab of π f in `f32`; whether all of them are finite and within the bounds.
    ///
    /// Good to 2e-6 of f, a hundredth of what the half floats of a slice resolve. For the assignment of texels to
    /// clusters; [`Lab::from_rgb`] is the exact one.
    #[inline(always)]
    fn convert(&mut self) -> bool {
        const M: [[f32; 3]; 3] = pi_xyz_over_white();
        let bound = MAX_LAB as f32;
        // Written out, and each in turn: as a map over the rows it was not inlined, and the loop not vectorised.
        let ([r, g, b], [light, green_red, yellow_blue]) = (&self.rgb, &mut self.lab);
        let mut outside = 0_u32;
        // All lanes, whatever a shorter lot leaves in the last of them: its bounds then only cost a second look.
        for k in 0..LANES {
            let f = [
                compress(M[0][0] * r[k] + M[0][1] * g[k] + M[0][2] * b[k]),
                compress(M[1][0] * r[k] + M[1][1] * g[k] + M[1][2] * b[k]),
                compress(M[2][0] * r[k] + M[2][1] * g[k] + M[2][2] * b[k]),
            ];
            let lab = [
                116.0 * f[1] - 16.0,
                500.0 * (f[0] - f[1]),
                200.0 * (f[1] - f[2]),
            ];
            let inside =
                (lab[0].abs() <= bound) & (lab[1].abs() <= bound) & (lab[2].abs() <= bound);
            outside |= u32::from(!inside);
            (light[k], green_red[k], yellow_blue[k]) = (lab[0], lab[1], lab[2]);
        }
        outside == 0
    }

    /// Marks what is not finite as dead and moves what lies beyond the bounds to them.
    #[cold]
    fn hold_to_bounds(&mut self) {
        let bound = MAX_LAB as f32;
        for k in 0..self.count {
            if !self.rgb.iter().all(|plane| plane[k].is_finite()) {
                self.live &= !(1 << k);
                continue;
            }
            let lab = self.lab.map(|axis| axis[k]);
            // A finite color whose own arithmetic overflowed is as light as can be.
            let overflown = [bound, 0.0, 0.0];
            let held = [0, 1, 2].map(|axis| {
                if lab[axis].is_nan() {
                    overflown[axis]
                } else {
                    lab[axis].clamp(-bound, bound)
                }
            });
            if held != lab {
                self.beyond += 1;
                let rgb = Lab::from(held.map(f64::from)).to_rgb();
                for c in 0..3 {
                    self.lab[c][k] = held[c];
                    self.rgb[c][k] = (rgb[c] / std::f64::consts::PI) as f32;
                }
            }
        }
    }

    /// Whether a texel's color is finite.
    #[inline(always)]
    pub(super) const fn lives(&self, k: usize) -> bool {
        self.live >> k & 1 == 1
    }
}

/// A picture's pixels in lots.
pub(super) fn lots(planes: [&[f32]; 3]) -> impl Iterator<Item = [&[f32]; 3]> {
    let [red, green, blue] = planes.map(|plane| plane.chunks(LANES));
    red.zip(green).zip(blue).map(|((r, g), b)| [r, g, b])
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
    texels.clear();
    texels.reserve(planes[0].len());
    light.clear();
    light.reserve(planes[0].len());
    let beyond = pulp::Arch::new().dispatch(Conversion {
        planes,
        texels: &mut *texels,
        light,
    });
    (planes[0].len() - texels.len(), beyond)
}

/// All lots of a picture, with the widest instructions of the machine, which give the same bits as any others.
struct Conversion<'a> {
    planes: [&'a [f32]; 3],
    texels: &'a mut Vec<Texel>,
    light: &'a mut Vec<[f32; 4]>,
}

impl pulp::NullaryFnOnce for Conversion<'_> {
    type Output = usize;

    #[inline(always)]
    fn call(self) -> usize {
        let (mut lot, mut beyond) = (Lot::EMPTY, 0);
        for planes in lots(self.planes) {
            lot.take(planes);
            beyond += lot.beyond;
            push(&lot, self.texels, self.light);
        }
        beyond
    }
}

/// Adds the finite texels of a lot, and what the picture says of all.
#[inline(always)]
pub(super) fn push(lot: &Lot, texels: &mut Vec<Texel>, light: &mut Vec<[f32; 4]>) {
    let first = light.len() as u32;
    let ([l, a, b], all) = (&lot.lab, 0..lot.count);
    if lot.live == u64::MAX >> (LANES - lot.count) {
        let texel = |k: usize| [l[k], a[k], b[k], disguised(first + k as u32)];
        texels.extend(all.clone().map(texel));
    } else {
        let live = all.clone().filter(|k| lot.lives(*k));
        texels.extend(live.map(|k| [l[k], a[k], b[k], disguised(first + k as u32)]));
    }
    let [red, green, blue] = &lot.rgb;
    light.extend(all.map(|k| [red[k], green[k], blue[k], 0.0]));
}

/// Adds one texel of a lot; it is finite.
#[inline(always)]
pub(super) fn push_one(lot: &Lot, k: usize, texels: &mut Vec<Texel>, light: &mut Vec<[f32; 4]>) {
    let [l, a, b] = &lot.lab;
    texels.push([l[k], a[k], b[k], disguised(light.len() as u32)]);
    let [red, green, blue] = &lot.rgb;
    light.push([red[k], green[k], blue[k], 0.0]);
}

/// What the picture says of a texel, 1/sr.
#[inline]
pub(super) fn light_of(texel: &Texel, light: &[[f32; 4]]) -> [f32; 3] {
    let [r, g, b, _] = light[number(texel)];
    [r, g, b]
}

/// Linear reflectance factor of a texel.
#[inline]
pub(super) fn linear(texel: &Texel, light: &[[f32; 4]]) -> LinearRgb {
    light_of(texel, light).map(|v| f64::from(v) * std::f64::consts::PI)
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
