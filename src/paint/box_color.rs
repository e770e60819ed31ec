//! Mean linear color of a CIELAB box, in closed form.
//!
//! Colors are uniform in the box, and light adds in linear RGB, so the mean color is not the color of the mean:
//!
//! ```text
//! fy ~ U[(L0+16)/116, (L1+16)/116],  u ~ U[a0,a1]/500,  v ~ U[b0,b1]/200,  fx = fy + u,  fz = fy − v
//! E[Y]/Yn = ΔP1/Δfy,   E[X]/Xn = second difference of P2 over Δfy Δu,   Z with −v
//! ```
//!
//! P1, P2 are the first and second integrals of the inverse compression. Wholly above the knee the mean is
//! `m³ + 3m·var`, wholly below it is linear: both exact, and what nearly every box takes. Only a box across the knee
//! needs the integrals, and where it is also thin the differences cancel: there 4-point Gauss is used.

#[cfg(test)]
mod tests;

use crate::color::{D65_2, KNEE, LinearRgb, compress, expand, expand_dark, rgb_to_xyz, xyz_to_rgb};

/// Half width below which differences of P2 lose more than Gauss quadrature does.
const THIN: f64 = 2e-3;

/// Mean linear sRGB of colors uniform in a Lab box. Corners may be given in any order.
#[must_use]
pub fn mean_color(lower: [f32; 3], upper: [f32; 3]) -> LinearRgb {
    xyz_to_rgb(mean_xyz(lower, upper))
}

/// [`mean_color`] in XYZ, white of Y = 1, of box after box to `each`: what is summed over many boxes need be taken to
/// sRGB only once.
pub(super) fn mean_xyz_of_each(lower: &[[f32; 3]], upper: &[[f32; 3]], each: impl FnMut([f64; 3])) {
    pulp::Arch::new().dispatch(Means { lower, upper, each });
}

fn mean_xyz(lower: [f32; 3], upper: [f32; 3]) -> [f64; 3] {
    let [x, y, z] = side_by_side(&[lower], &[upper]);
    [x[0], y[0], z[0]]
}

/// Boxes whose means are taken side by side.
const LANES: usize = 8;

/// The means of boxes, compiled for wide registers too.
struct Means<'a, F> {
    lower: &'a [[f32; 3]],
    upper: &'a [[f32; 3]],
    each: F,
}

impl<F: FnMut([f64; 3])> pulp::NullaryFnOnce for Means<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let (lower, lower_rest) = self.lower.as_chunks::<LANES>();
        let (upper, upper_rest) = self.upper.as_chunks::<LANES>();
        for (lower, upper) in lower.iter().zip(upper) {
            let [x, y, z] = side_by_side(lower, upper);
            for k in 0..LANES {
                (self.each)([x[k], y[k], z[k]]);
            }
        }
        for (&lower, &upper) in lower_rest.iter().zip(upper_rest) {
            (self.each)(mean_xyz(lower, upper));
        }
    }
}

/// Mean X, Y and Z of boxes.
#[inline(always)]
fn side_by_side<const N: usize>(lower: &[[f32; 3]; N], upper: &[[f32; 3]; N]) -> [[f64; N]; 3] {
    let [mut middle, mut reach] = [[[0.0; N]; 3]; 2];
    for k in 0..N {
        for axis in 0..3 {
            let (low, high) = (f64::from(lower[k][axis]), f64::from(upper[k][axis]));
            // Lab of magnitudes below 2^1023: the plain sum is the midpoint.
            middle[axis][k] = (low + high) * 0.5;
            reach[axis][k] = (high - low).abs() * 0.5;
        }
    }
    for k in 0..N {
        middle[0][k] = (middle[0][k] + 16.0) * (1.0 / 116.0);
        reach[0][k] *= 1.0 / 116.0;
        middle[1][k] *= 1.0 / 500.0;
        reach[1][k] *= 1.0 / 500.0;
        middle[2][k] *= 1.0 / 200.0;
        reach[2][k] *= 1.0 / 200.0;
    }
    let [y, mut x, mut z] = middle;
    for k in 0..N {
        x[k] += y[k];
        z[k] = y[k] - z[k];
    }
    let [dy, du, dv] = reach;
    [
        means_of_sums(D65_2.x, &x, &dy, &du),
        means_of_sums(D65_2.y, &y, &dy, &[0.0; N]),
        means_of_sums(D65_2.z, &z, &dy, &dv),
    ]
}

/// `white` times [`mean_of_sum`], which decides box by box what is decided here of all boxes at once.
#[inline(always)]
fn means_of_sums<const N: usize>(
    white: f64,
    m: &[f64; N],
    ds: &[f64; N],
    dt: &[f64; N],
) -> [f64; N] {
    let mut means = [0.0; N];
    for k in 0..N {
        let bright = bright_mean_of_sum(m[k], ds[k], dt[k]);
        let is_bright = m[k] - (ds[k] + dt[k]) >= KNEE;
        means[k] = white * if is_bright { bright } else { expand_dark(m[k]) };
    }
    let mut across = 0_u64;
    for k in 0..N {
        let reach = ds[k] + dt[k];
        across += u64::from(!(m[k] - reach >= KNEE || m[k] + reach <= KNEE));
    }
    if across > 0 {
        for k in 0..N {
            means[k] = white * mean_of_sum(m[k], ds[k], dt[k]);
        }
    }
    means
}

/// Middle of the box of these half widths in Lab whose mean linear sRGB this is: the inverse of [`mean_color`].
///
/// `near` is a guess, the closer the faster. The mean of a box grows strictly with its middle, so there is one answer.
#[must_use]
pub fn center_of_mean(half: [f64; 3], mean: LinearRgb, near: [f64; 3]) -> [f64; 3] {
    let xyz = rgb_to_xyz(mean);
    let (dy, du, dv) = (half[0] / 116.0, half[1] / 500.0, half[2] / 200.0);
    let y = (near[0] + 16.0) / 116.0;
    let x = middle_of_mean(xyz[0] / D65_2.x, dy, du, y + near[1] / 500.0);
    let z = middle_of_mean(xyz[2] / D65_2.z, dy, dv, y - near[2] / 200.0);
    let y = middle_of_mean(xyz[1] / D65_2.y, dy, 0.0, y);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The `m` at which [`mean_of_sum`] is `t`: secant steps from a guess, held in a bracket.
fn middle_of_mean(t: f64, ds: f64, dt: f64, near: f64) -> f64 {
    let reach = ds + dt;
    let dark = t / (3.0 * KNEE * KNEE) + 4.0 / 29.0;
    if dark + reach <= KNEE {
        return dark;
    }
    // The compression's inverse is convex and above its own tangent at the knee: its mean over a box is at least its
    // value in the middle and at most its value at the upper end.
    let value = compress(t);
    let (mut low, mut high) = (value - reach, value);
    let tolerance = 2.0 * f64::EPSILON * (t.abs() + KNEE.powi(3));
    let mut m = near.clamp(low, high);
    let mut miss = mean_of_sum(m, ds, dt) - t;
    let mut slope = 3.0 * m.max(KNEE).powi(2) + ds * ds + dt * dt;
    for _ in 0..100 {
        if miss.abs() <= tolerance {
            break;
        }
        if miss > 0.0 {
            high = m;
        } else {
            low = m;
        }
        let step = m - miss / slope;
        let next = if step > low && step < high {
            step
        } else {
            f64::midpoint(low, high)
        };
        if next == m {
            break;
        }
        let after = mean_of_sum(next, ds, dt) - t;
        let secant = (after - miss) / (next - m);
        if secant > 0.0 {
            slope = secant;
        }
        (m, miss) = (next, after);
    }
    m
}

/// Mean of the inverse compression of `m + s + t`, `s` and `t` uniform with half widths `ds`, `dt`.
#[inline]
fn mean_of_sum(m: f64, ds: f64, dt: f64) -> f64 {
    let reach = ds + dt;
    if m - reach >= KNEE {
        bright_mean_of_sum(m, ds, dt)
    } else if m + reach <= KNEE {
        expand(m)
    } else {
        mean_across_knee(m, ds, dt)
    }
}

/// The same wholly above the knee.
#[inline(always)]
fn bright_mean_of_sum(m: f64, ds: f64, dt: f64) -> f64 {
    m * m * m + m * (ds * ds + dt * dt)
}

#[inline(never)]
fn mean_across_knee(m: f64, ds: f64, dt: f64) -> f64 {
    let reach = ds + dt;
    let (wide, narrow) = (ds.max(dt), ds.min(dt));
    if wide < THIN {
        gauss(m, wide, |x| gauss(x, narrow, expand))
    } else if narrow < THIN {
        gauss(m, narrow, |x| (p1(x + wide) - p1(x - wide)) / (2.0 * wide))
    } else {
        (p2(m + reach) - p2(m + wide - narrow) - p2(m - wide + narrow) + p2(m - reach))
            / (4.0 * wide * narrow)
    }
}

fn gauss(m: f64, half: f64, f: impl Fn(f64) -> f64) -> f64 {
    const NODE: [f64; 2] = [0.339_981_043_584_856_26, 0.861_136_311_594_052_6];
    const WEIGHT: [f64; 2] = [0.652_145_154_862_546_1, 0.347_854_845_137_453_86];
    if half == 0.0 {
        return f(m);
    }
    NODE.iter()
        .zip(WEIGHT)
        .map(|(x, w)| w * f64::midpoint(f(m - half * x), f(m + half * x)))
        .sum()
}

fn p1(f: f64) -> f64 {
    let d = KNEE;
    if f > d {
        f.powi(4) / 4.0 - 0.75 * d.powi(4)
    } else {
        1.5 * d * d * f * f - 2.0 * d.powi(3) * f
    }
}

fn p2(f: f64) -> f64 {
    let d = KNEE;
    if f > d {
        f.powi(5) / 20.0 - 0.75 * d.powi(4) * f + d.powi(5) / 5.0
    } else {
        d * d * f.powi(3) / 2.0 - d.powi(3) * f * f
    }
}
