//! Means of boxes beside sums over them, and beside themselves alone.

use super::*;
use crate::color::Lab;
use proptest::prelude::*;

/// A fine midpoint rule over the whole box, on its own arithmetic.
fn by_sums(lower: [f32; 3], upper: [f32; 3], n: u32) -> LinearRgb {
    let mut sum = [0.0; 3];
    let at = |k: usize, s: u32| {
        f64::from(lower[k])
            + (f64::from(upper[k]) - f64::from(lower[k])) * (f64::from(s) + 0.5) / f64::from(n)
    };
    for x in 0..n {
        for y in 0..n {
            for z in 0..n {
                let rgb = Lab {
                    l: at(0, x),
                    a: at(1, y),
                    b: at(2, z),
                }
                .to_rgb();
                for k in 0..3 {
                    sum[k] += rgb[k];
                }
            }
        }
    }
    sum.map(|s| s / f64::from(n).powi(3))
}

/// The second difference of P2 as it stands in the formula, without a rule for thin boxes.
fn plain(m: f64, ds: f64, dt: f64) -> f64 {
    (p2(m + ds + dt) - p2(m + ds - dt) - p2(m - ds + dt) + p2(m - ds - dt)) / (4.0 * ds * dt)
}

/// The same in single precision.
fn plain_f32(m: f32, ds: f32, dt: f32) -> f32 {
    let d = KNEE as f32;
    let p2 = |f: f32| {
        if f > d {
            f.powi(5) / 20.0 - 0.75 * d.powi(4) * f + d.powi(5) / 5.0
        } else {
            d * d * f.powi(3) / 2.0 - d.powi(3) * f * f
        }
    };
    (p2(m + ds + dt) - p2(m + ds - dt) - p2(m - ds + dt) + p2(m - ds - dt)) / (4.0 * ds * dt)
}

/// Mean over the box by the midpoint rule, exact to `(2h/n)²/24 · 6f`: below 2e-12 for what is thin.
fn by_midpoints(m: f64, ds: f64, dt: f64) -> f64 {
    let n = 400;
    let at = |k: i32, half: f64| half * ((2.0 * f64::from(k) + 1.0) / f64::from(n) - 1.0);
    let row = |j: i32| {
        (0..n)
            .map(|k| expand(m + at(j, ds) + at(k, dt)))
            .sum::<f64>()
    };
    (0..n).map(row).sum::<f64>() / f64::from(n * n)
}

#[test]
fn differences_of_p2_cancel_where_a_box_is_thin_and_the_rule_for_thin_boxes_does_not() {
    for exponent in 0..12 {
        let half = 1.9e-3 * 0.1_f64.powf(f64::from(exponent) / 2.0);
        let (mut ruled, mut bare, mut single) = (0.0_f64, 0.0_f64, 0.0_f64);
        for place in [-0.9, -0.3, 0.0, 0.4, 0.8] {
            for ratio in [1.0, 0.3] {
                let m = KNEE + place * half;
                let want = by_midpoints(m, half, ratio * half);
                let off = |got: f64| (got / want - 1.0).abs();
                ruled = ruled.max(off(mean_of_sum(m, half, ratio * half)));
                bare = bare.max(off(plain(m, half, ratio * half)));
                let f32 = plain_f32(m as f32, half as f32, (ratio * half) as f32);
                single = single.max(off(f64::from(f32)));
            }
        }
        // Gauss errs where the second derivative jumps by 6 δ, by less than h²/1000 of it; light there is δ³. The
        // midpoint rule adds rows and columns of 400: as many roundings.
        let accepted = half * half / 1000.0 * 6.0 / (KNEE * KNEE) + 400.0 * f64::EPSILON;
        assert!(ruled <= accepted, "{half:e}: {ruled:e}");
        // Of four numbers of 2e-4 the second difference keeps h²: in f64 less than Gauss keeps from 1e-4 on and nothing
        // from 1e-8 on, in f32 three digits at the best.
        if half < 1e-4 {
            assert!(bare > ruled, "{half:e}: {bare:e} {ruled:e}");
        }
        assert!(half > 2e-8 || bare > 1e-3, "{half:e}: {bare:e}");
        assert!(single > 1e-3, "{half:e}: {single:e}");
        assert!(half > 1e-4 || single > 1.0 - 1e-9, "{half:e}: {single:e}");
    }
    assert!(plain(KNEE, 0.0, 0.0).is_nan() && mean_of_sum(KNEE, 0.0, 0.0) == expand(KNEE));
}

#[test]
fn boxes_side_by_side_have_the_means_that_they_have_alone() {
    // Bright, dark, across the knee, thin, inside out, and no number; in eights, and what is left over.
    let corner = |k: u32, up: f32| {
        let l = (k * 37 % 101) as f32 * 0.4 - 9.0;
        [
            l + up,
            (k * 13 % 50) as f32 - 25.0,
            20.0 - (k % 7) as f32 * up,
        ]
    };
    let lower: Vec<_> = (0..93).map(|k| corner(k, 0.0)).collect();
    let mut upper: Vec<_> = (0..93).map(|k| corner(k, (k % 5) as f32 - 1.0)).collect();
    upper[40][1] = f32::NAN;
    for first in [0, 7, 90] {
        let (lower, upper) = (&lower[first..], &upper[first..]);
        let mut means = Vec::new();
        mean_xyz_of_each(lower, upper, |xyz| means.push(xyz.map(f64::to_bits)));
        let mut narrow = Vec::new();
        let each = |xyz: [f64; 3]| narrow.push(xyz.map(f64::to_bits));
        pulp::NullaryFnOnce::call(Means { lower, upper, each });
        let alone = lower.iter().zip(upper).map(|(&low, &high)| {
            let [lo, hi] = [low, high].map(|corner| corner.map(f64::from));
            let half = |k: usize, scale: f64| (hi[k] - lo[k]).abs() * 0.5 * scale;
            let middle = |k: usize| (lo[k] + hi[k]) * 0.5;
            let y = (middle(0) + 16.0) * (1.0 / 116.0);
            let dy = half(0, 1.0 / 116.0);
            let x = middle(1) * (1.0 / 500.0) + y;
            let z = y - middle(2) * (1.0 / 200.0);
            [
                D65_2.x * mean_of_sum(x, dy, half(1, 1.0 / 500.0)),
                D65_2.y * mean_of_sum(y, dy, 0.0),
                D65_2.z * mean_of_sum(z, dy, half(2, 1.0 / 200.0)),
            ]
            .map(f64::to_bits)
        });
        assert_eq!(means, alone.collect::<Vec<_>>());
        assert_eq!(means, narrow);
    }
}

#[test]
fn a_point_is_its_own_mean() {
    let lab = [40.0_f32, 12.0, -30.0];
    let want = Lab::from(lab.map(f64::from)).to_rgb();
    for (x, y) in mean_color(lab, lab).iter().zip(want) {
        assert!((x - y).abs() < 1e-15);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn the_middle_of_a_mean_gives_that_mean(
        center in prop::array::uniform3(-60.0..400.0_f64), log_half in prop::array::uniform3(-4.0..2.0_f64),
        guess in -50.0..50.0_f64,
    ) {
        let half = log_half.map(|h| 10.0_f64.powf(h));
        // Corners that an f32 holds exactly, so that only the inversion is judged.
        let lower: [f32; 3] = std::array::from_fn(|k| (center[k] - half[k]) as f32);
        let upper: [f32; 3] = std::array::from_fn(|k| (center[k] + half[k]) as f32);
        let middle: [f64; 3] = std::array::from_fn(|k| f64::midpoint(f64::from(lower[k]), f64::from(upper[k])));
        let exact: [f64; 3] = std::array::from_fn(|k| (f64::from(upper[k]) - f64::from(lower[k])) / 2.0);
        let found = center_of_mean(exact, mean_color(lower, upper), middle.map(|m| m + guess));
        // The mean carries some eps of the cube of f (10 at most); its slope is 3 KNEE² at the least, and a, b
        // multiply f by 500 and 200. In thin boxes across the knee P2 loses digits: see THIN.
        for k in 0..3 {
            prop_assert!((found[k] - middle[k]).abs() < 1e-6, "{found:?} {middle:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn the_closed_form_agrees_with_sums_over_the_box(
        center in prop::array::uniform3(-20.0..120.0_f32), log_half in prop::array::uniform3(-3.0..1.6_f32),
    ) {
        let half = log_half.map(|h| 10.0_f32.powf(h));
        let lower: [f32; 3] = std::array::from_fn(|k| center[k] - half[k]);
        let upper: [f32; 3] = std::array::from_fn(|k| center[k] + half[k]);
        let (got, want) = (mean_color(lower, upper), by_sums(lower, upper, 40));
        for (x, y) in got.iter().zip(want) {
            // The midpoint rule's own error: h²/24 of the second derivative over 40 steps, matrix factor 3.
            let scale = half.iter().fold(0.0_f64, |m, h| m.max(f64::from(*h) / 100.0)).powi(2) * 3e-3 + 1e-9;
            prop_assert!((x - y).abs() <= scale, "{x} {y} {scale}");
        }
    }
}
