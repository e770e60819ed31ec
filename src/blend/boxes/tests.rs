//! Sums of boxes beside sums corner by corner.

use super::*;
use crate::paint::AngleGrid;
use proptest::prelude::*;

fn boxes(count: usize, seed: f32) -> Boxes {
    let corner = |k: usize, up: f32| {
        let at = (k as f32 * 0.37 + seed).sin() * 60.0;
        [at + up, at * 0.3 + up * 0.5, up - at]
    };
    Boxes {
        lower: (0..count).map(|k| corner(k, 0.0)).collect(),
        upper: (0..count).map(|k| corner(k, 3.0 + seed)).collect(),
    }
}

fn flakes(boxes: Vec<Boxes>) -> BlendedFlakes {
    let clusters = boxes[0].lower.len();
    BlendedFlakes::new(
        [AngleGrid::single(), AngleGrid::single()],
        vec![0, u32::try_from(clusters).expect("few")].into(),
        vec![1.0 / clusters as f64; clusters].into(),
        boxes,
        vec![],
    )
}

fn mixed(boxes: Vec<Boxes>, weights: &[[f64; 3]]) -> (Boxes, Account) {
    let mut out = Boxes::default();
    let account = mix_boxes(&flakes(boxes), weights, &mut out);
    (out, account)
}

/// Corner by corner, in 64 bits.
fn plainly(paints: &[Boxes], weights: &[[f64; 3]], k: usize, axis: usize) -> [f64; 2] {
    let mut pair = [0.0, 0.0];
    for (paint, w) in paints.iter().zip(weights) {
        pair[0] += w[axis] * f64::from(paint.lower[k][axis]);
        pair[1] += w[axis] * f64::from(paint.upper[k][axis]);
    }
    [pair[0].min(pair[1]), pair[0].max(pair[1])].map(|v| v.clamp(-MAX_LAB, MAX_LAB))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn every_corner_is_its_weighted_sum(
        count in 1..700_usize, weights in prop::collection::vec(prop::array::uniform3(-40.0..40.0_f64), 2..=5),
        small in prop::bool::ANY, alike in prop::bool::ANY,
    ) {
        let weights: Vec<[f64; 3]> = weights.iter()
            .map(|w| if alike { [w[0]; 3] } else { *w })
            .map(|w| w.map(|w| if small { w / 10.0 } else { w }))
            .collect();
        let paints: Vec<Boxes> = (0..weights.len()).map(|m| boxes(count, m as f32)).collect();
        let (mixed, account) = mixed(paints.clone(), &weights);
        // Products and sums of numbers below 70: 2 M roundings of 2^-24 each in 32 bits, one in 64.
        let size: f64 = weights.iter().flatten().fold(1.0, |m: f64, w| m.max(w.abs())) * 70.0;
        let tolerance = 2.0 * weights.len() as f64 * size * f64::from(f32::EPSILON);
        let mut inverted = 0;
        for k in 0..count {
            for axis in 0..3 {
                let [low, high] = plainly(&paints, &weights, k, axis);
                prop_assert!((f64::from(mixed.lower[k][axis]) - low).abs() <= tolerance);
                prop_assert!((f64::from(mixed.upper[k][axis]) - high).abs() <= tolerance);
                let width = |w: &[f64; 3], own: &Boxes| w[axis] * f64::from(own.upper[k][axis] - own.lower[k][axis]);
                let width: f64 = weights.iter().zip(&paints).map(|(w, own)| width(w, own)).sum();
                inverted += usize::from(width < -tolerance);
            }
        }
        prop_assert!(account.inverted >= inverted, "{} of at least {inverted}", account.inverted);
        prop_assert!(inverted == 0 || account.narrowest < 0.0);
    }
}

#[test]
fn a_weight_of_one_gives_the_very_boxes() {
    let paints = vec![boxes(1000, 0.0), boxes(1000, 1.0)];
    let (mixed, account) = mixed(paints.clone(), &[[1.0; 3], [0.0; 3]]);
    assert_eq!(mixed, paints[0]);
    assert_eq!(account, Account::default());
}

/// Two to five paints; weights that may turn boxes and such that may not; sums that leave the range and that do not.
#[test]
fn lists_that_were_used_before_give_the_same() {
    // A block is 2048 corners.
    for (count, paints) in [(500, 2), (4999, 2), (2049, 3), (256, 4), (1000, 5)] {
        for (share, first, axes) in [
            (0.3, 0.4, [1.0; 3]),
            (0.3, 0.4, [1.0, 0.5, 0.25]),
            (-0.4, 1.9, [1.0; 3]),
            (1.2, 0.9, [1.0, 1.0, 0.5]),
        ] {
            for far in [0.0_f32, 980.0] {
                let all = || -> Vec<Boxes> {
                    let moved = |m: usize| {
                        let mut own = boxes(count, m as f32);
                        for corner in own.lower.iter_mut().chain(&mut own.upper) {
                            *corner = corner.map(|v| v + far);
                        }
                        own
                    };
                    (0..paints).map(moved).collect()
                };
                let mut weights = vec![axes.map(|axis| axis * share); paints];
                weights[0] = axes.map(|axis| axis * first);
                let fresh = mixed(all(), &weights);
                let leaves = fresh.1.beyond > 0;
                let sum = first + share * (paints - 1) as f64;
                assert_eq!(leaves, sum * f64::from(far) > 2000.0, "{sum} {far}");
                for used in [3, count, 2000] {
                    let mut out = boxes(used, 7.0);
                    let account = mix_boxes(&flakes(all()), &weights, &mut out);
                    assert_eq!((&out, &account), (&fresh.0, &fresh.1));
                }
                let all = all();
                for k in 0..count {
                    for axis in 0..3 {
                        let plain = plainly(&all, &weights, k, axis);
                        let own = [fresh.0.lower[k][axis], fresh.0.upper[k][axis]];
                        // Five products and sums of at most 1.9 · 1000.
                        let close = |(x, y): (f32, f64)| (f64::from(x) - y).abs() < 5e-3;
                        assert!(own.into_iter().zip(plain).all(close), "{own:?} {plain:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn moderate_and_large_weights_meet_where_they_part() {
    let at = |w: f64| {
        let paints = vec![boxes(999, 0.0), boxes(999, 1.0)];
        mixed(paints, &[[w; 3], [1.0 - w; 3]]).0
    };
    let (narrow, wide) = (at(MODERATE), at(MODERATE + 1e-12));
    let corners = narrow.lower.iter().chain(&narrow.upper).flatten();
    for (a, b) in corners.zip(wide.lower.iter().chain(&wide.upper).flatten()) {
        // Four products and sums of at most 4 · 70.
        assert!((a - b).abs() <= 4.0 * 280.0 * f32::EPSILON, "{a} {b}");
    }
}

#[test]
fn a_paint_that_reaches_the_bound_leaves_the_range_only_with_others_that_reach_far() {
    let one = |far: f32| Boxes {
        lower: vec![[-far; 3]],
        upper: vec![[far; 3]],
    };
    for (other, weight, leaves) in [(300.0, 0.5, false), (1900.0, 0.6, true)] {
        let (pair, weights) = (vec![one(2000.0), one(other)], [[weight; 3]; 2]);
        let most = farthest(&flakes(pair.clone()).reaches, &weights);
        assert!(most.iter().all(|far| (*far > MAX_LAB) == leaves));
        let (out, account) = mixed(pair, &weights);
        assert_eq!(account.beyond, if leaves { 3 } else { 0 });
        assert!(out.upper[0][0] <= 2000.0, "{out:?}");
    }
}

#[test]
fn inverted_and_distant_corners_are_counted() {
    let one = |low: f32, high: f32| Boxes {
        lower: vec![[low; 3]],
        upper: vec![[high; 3]],
    };
    let pair = vec![one(10.0, 12.0), one(10.0, 20.0)];
    let (out, account) = mixed(pair, &[[2.0; 3], [-1.0; 3]]);
    assert_eq!((out.lower[0], out.upper[0]), ([4.0; 3], [10.0; 3]));
    assert_eq!((account.inverted, account.narrowest), (3, -6.0));
    let far = vec![one(10.0, 12.0), one(1.0, 1.0)];
    let (out, account) = mixed(far, &[[1e9; 3], [0.0; 3]]);
    assert_eq!((out.lower[0], out.upper[0]), ([2000.0; 3], [2000.0; 3]));
    assert_eq!((account.beyond, account.furthest), (3, 12e9 - 2000.0));
    let near = vec![one(900.0, 1000.0), one(-10.0, 1.0)];
    let (out, account) = mixed(near, &[[3.0; 3], [-2.0; 3]]);
    assert_eq!((out.lower[0], out.upper[0]), ([2000.0; 3], [2000.0; 3]));
    assert_eq!((account.beyond, account.furthest), (3, 998.0));
}

#[test]
fn corners_that_are_no_numbers_are_never_summed_quickly() {
    let mut paints = vec![boxes(20, 0.0), boxes(20, 1.0)];
    for worst in [f32::NAN, f32::NEG_INFINITY] {
        paints[1].upper[19][2] = worst;
        let flakes = flakes(paints.clone());
        assert_eq!(flakes.reaches[1], f32::INFINITY);
        let weights = [[1.0; 3], [0.0; 3]];
        assert!(farthest(&flakes.reaches, &weights)[2].is_nan());
        // Its sum is none, even without weight: the other corner stands in for it.
        let mut out = Boxes::default();
        mix_boxes(&flakes, &weights, &mut out);
        assert_eq!(out.upper[19][2], paints[0].lower[19][2]);
        assert_eq!(out.upper[..19], paints[0].upper[..19]);
    }
}
