//! Realisations at weights that are none, far away, or a hair apart.

use crate::paints::{D, H, Stream, at, blend, metallic, pairs, realise};
use carpaint::blend::{Clamp, RealisationWeights, WeightError};
use carpaint::paint::{CarPaint, Chi, Limits, Lobe, MAX_ALPHA, MIN_ALPHA, Reflectance};

const FAR: [[f64; 2]; 12] = [
    [-3.0, 4.0],
    [4.0, -3.0],
    [0.0, 0.0],
    [1.0, -1.0],
    [1e-12, 0.0],
    [1e-12, -1e-12],
    [1e12, 1e12],
    [1e12, -1e12],
    [-1e12, -1e12],
    [1e12, 1e-12],
    [1e6, 1.0 - 1e6],
    [-0.0, 1e-300],
];

/// Finite, not negative, lobes positive, boxes in order: what every realisation is held to.
fn assert_sound(paint: &CarPaint, what: &str) {
    paint
        .validate(&Limits::default())
        .unwrap_or_else(|error| panic!("{what}: {error}"));
    for lobe in &paint.lobes {
        assert!(
            (MIN_ALPHA..=MAX_ALPHA).contains(&lobe.alpha),
            "{what}: {lobe:?}"
        );
    }
    let reflectance = Reflectance::new(paint);
    let grazing = [
        (at(1e-8, 0.0), at(1e-8, std::f64::consts::PI)),
        (at(1.0, 0.0), at(1e-300, 0.0)),
    ];
    for (wi, wo) in pairs(40).into_iter().chain(grazing) {
        let f = reflectance.evaluate(wi, wo, Chi::Table);
        assert!(
            f.iter().all(|v| v.is_finite() && *v >= 0.0),
            "{what}: {f:?} at {wi:?}, {wo:?}"
        );
    }
}

fn clamp<'a>(clamps: &'a [Clamp], field: &str) -> Option<&'a Clamp> {
    clamps.iter().find(|c| c.field == field)
}

#[test]
fn weights_that_are_no_numbers_are_refused_by_list_place_and_value() {
    let blend = blend(&[&metallic(1, H, D), &metallic(2, H, D)]);
    for wrong in [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1.1e12,
        -f64::MAX,
    ] {
        let ask = |change: &dyn Fn(&mut RealisationWeights)| {
            let mut weights = RealisationWeights::even(vec![0.5, 0.5]);
            change(&mut weights);
            blend.realise(&weights).expect_err("refused")
        };
        let bad = Some(vec![0.5, wrong]);
        let refusals = [
            ("weights", ask(&|w| w.weights[1] = wrong), 1),
            ("base", ask(&|w| w.base.clone_from(&bad)), 1),
            (
                "flake_lightness",
                ask(&|w| w.flake_lightness.clone_from(&bad)),
                1,
            ),
            ("flake_color", ask(&|w| w.flake_color.clone_from(&bad)), 1),
            ("flake_saturation", ask(&|w| w.flake_saturation = wrong), 0),
        ];
        for (list, error, place) in refusals {
            let WeightError::Value {
                field,
                index,
                value,
            } = error
            else {
                panic!("{list}: {error}");
            };
            assert_eq!(
                (field, index, value.to_bits()),
                (list, place, wrong.to_bits())
            );
        }
    }
    for count in [0, 1, 3] {
        let error = blend.realise(&RealisationWeights::even(vec![0.5; count]));
        assert!(
            matches!(error, Err(WeightError::Count { given, needed: 2, .. }) if given == count)
        );
    }
}

#[test]
fn the_largest_weights_that_are_accepted_end_in_a_paint() {
    let blend = blend(&[&metallic(1, H, D), &metallic(2, H, D)]);
    for far in FAR {
        let mut weights = RealisationWeights::even(far.to_vec());
        for saturation in [1.0, 0.0, -1.0, 1e12] {
            weights.flake_saturation = saturation;
            let realised = blend.realise(&weights).expect("finite weights");
            assert_sound(
                &realised.paint,
                &format!("{far:?}, saturation {saturation}"),
            );
            assert!(realised.weight_sums.iter().all(|s| s.is_finite()));
        }
    }
}

#[test]
fn boxes_that_far_weights_turn_inside_out_are_put_in_order_and_counted() {
    let (a, b) = (metallic(5, H, D), metallic(6, H, D));
    let blend = blend(&[&a, &b]);
    let (of_a, of_b) = (
        realise(&blend, &[1.0, 0.0]).paint,
        realise(&blend, &[0.0, 1.0]).paint,
    );
    let (of_a, of_b) = (of_a.flakes.expect("has"), of_b.flakes.expect("has"));
    for [w, v] in [[-3.0, 4.0], [4.0, -3.0], [-1.0, -1.0]] {
        let realised = realise(&blend, &[w, v]);
        let got = realised.paint.flakes.as_ref().expect("has flakes");
        let (mut inverted, mut in_doubt, mut narrowest) = (0, 0, 0.0_f64);
        for k in 0..got.clusters() {
            for axis in 0..3 {
                let mix = |x: f32, y: f32| w * f64::from(x) + v * f64::from(y);
                let low = mix(of_a.lower[k][axis], of_b.lower[k][axis]);
                let high = mix(of_a.upper[k][axis], of_b.upper[k][axis]);
                // Weights up to 4 are summed in f32: each weight, each product and each of two sums rounds by 2^-24 of
                // the sum of sizes.
                let sizes =
                    (w * f64::from(of_a.upper[k][axis].abs().max(of_a.lower[k][axis].abs()))).abs()
                        + (v * f64::from(of_b.upper[k][axis].abs().max(of_b.lower[k][axis].abs())))
                            .abs();
                let rounding = 4.0 * 2.0_f64.powi(-24) * sizes;
                inverted += usize::from(high < low);
                in_doubt += usize::from((high - low).abs() <= 2.0 * rounding);
                narrowest = narrowest.min(high - low);
                assert!((f64::from(got.lower[k][axis]) - low.min(high)).abs() <= rounding);
                assert!((f64::from(got.upper[k][axis]) - low.max(high)).abs() <= rounding);
            }
        }
        let told = realised
            .clamps
            .iter()
            .find(|c| c.bound.starts_with("inverted"))
            .expect("told");
        // A width within rounding of 0 may count as either; hardly one is.
        assert_eq!(told.of, 3 * got.clusters());
        assert!(
            told.count.abs_diff(inverted) <= in_doubt && in_doubt < 3,
            "{w} {v}: {told:?}, {inverted}"
        );
        // Corners below 70, weights of 7 in all: 8 roundings of 2^-24 of 500.
        assert!(
            inverted > 0 && (told.worst + narrowest).abs() <= 8.0 * 2.0_f64.powi(-24) * 500.0,
            "{told:?} {narrowest}"
        );
    }
}

#[test]
fn every_bound_that_bites_is_reported_with_how_many_and_how_far() {
    let (a, b) = (metallic(6, H, D), metallic(7, H, D));
    assert!(a.coat.is_some() && b.coat.is_some());
    let blend = blend(&[&a, &b]);
    let realised = realise(&blend, &[1e6, -1e6 + 1.0]);
    // Each field independently: what the linear formula gives, beyond the bound by how much.
    let linear = |x: f64, y: f64| 1e6 * x + (1.0 - 1e6) * y;
    let told =
        |field: &str| clamp(&realised.clamps, field).unwrap_or_else(|| panic!("{field} is silent"));
    let diffuse: Vec<f64> = (0..3).map(|c| linear(a.diffuse[c], b.diffuse[c])).collect();
    let beyond = |v: f64, low: f64, high: f64| (low - v).max(v - high).max(0.0);
    let over: Vec<f64> = diffuse
        .iter()
        .map(|v| beyond(*v, 0.0, 1e3))
        .filter(|v| *v > 0.0)
        .collect();
    let entry = told("diffuse");
    assert_eq!((entry.count, entry.of), (over.len(), 3));
    let worst = over.iter().fold(0.0, |m: f64, v| m.max(*v));
    // Products of 1e6 cancel to numbers of 1e5: 1e6 EPS, relatively.
    assert!(
        (entry.worst / worst - 1.0).abs() < 1e-9,
        "{entry:?} {worst}"
    );
    let ior = linear(a.coat.expect("coated").ior, b.coat.expect("coated").ior);
    let entry = told("coat.ior");
    assert_eq!(entry.count, 1);
    assert!(
        (entry.worst / beyond(ior, 1.0, 4.0) - 1.0).abs() < 1e-9,
        "{entry:?} {ior}"
    );
    let boxes: Vec<&Clamp> = realised
        .clamps
        .iter()
        .filter(|c| c.field == "flakes.boxes")
        .collect();
    assert!(
        boxes
            .iter()
            .any(|c| c.bound.contains("2000") && c.count > 0 && c.worst > 1e4),
        "{boxes:?}"
    );
    for field in ["lobes.alpha", "lobes.weight", "color_table", "lobes.f0"] {
        let entry = told(field);
        assert!(
            entry.count > 0 && entry.count <= entry.of && entry.worst > 0.0,
            "{entry:?}"
        );
    }
    // And inside the originals nothing bites and nothing is told.
    for t in [0.0, 0.3, 1.0] {
        assert!(realise(&blend, &[1.0 - t, t]).clamps.is_empty());
    }
}

#[test]
fn weights_that_sum_to_nothing_are_allowed_and_the_sum_is_told() {
    let blend = blend(&[&metallic(1, H, D), &metallic(2, H, D)]);
    let realised = realise(&blend, &[0.0, 0.0]);
    assert_eq!(realised.weight_sums, [0.0; 3]);
    assert_eq!(realised.paint.diffuse, [0.0; 3]);
    // Lobes of weight 0 stand at the even mean of their partners' roughness.
    let (a, b) = (
        realise(&blend, &[1.0, 0.0]).paint,
        realise(&blend, &[0.0, 1.0]).paint,
    );
    for (k, lobe) in realised.paint.lobes.iter().enumerate() {
        assert_eq!(lobe.weight, [0.0; 3]);
        let want = (a.lobes[k].alpha * b.lobes[k].alpha).sqrt();
        assert!(
            (lobe.alpha / want - 1.0).abs() <= 16.0 * f64::EPSILON,
            "{lobe:?} {want}"
        );
    }
}

#[test]
fn each_part_answers_to_its_own_weights_only() {
    let blend = blend(&[&metallic(3, H, D), &metallic(4, H, D)]);
    let mut weights = RealisationWeights::even(vec![1.0, 0.0]);
    weights.flake_lightness = Some(vec![-3.0, 4.0]);
    let moved = blend.realise(&weights).expect("finite").paint;
    let still = realise(&blend, &[1.0, 0.0]).paint;
    assert_eq!(
        (moved.coat, moved.diffuse, &moved.lobes),
        (still.coat, still.diffuse, &still.lobes)
    );
    assert_eq!(moved.color_table, still.color_table);
    let (moved, still) = (moved.flakes.expect("has"), still.flakes.expect("has"));
    for (x, y) in moved.lower.iter().zip(&still.lower) {
        assert_eq!([x[1], x[2]], [y[1], y[2]]);
    }
    assert!(moved.lower != still.lower);
}

/// How far two realisations of weights `w` and `v` may differ, derived from the formulas of the realisation:
///
/// - what is linear in the weights moves by at most `Σ |Δw_m| · max_m |value_m|`;
/// - `ln α = Σ w_m ln α_m` where weights sum to 1, so it moves by at most `Σ |Δw_m| · max_m |ln α_m|`;
/// - ordering corners and holding to bounds are contractions and add nothing;
/// - boxes are summed in f32 where weights are moderate: each weight, product and sum rounds by `2^-24` of the sum of sizes,
///   which is at most `Σ |w_m|` times the largest corner; five roundings at each end.
fn assert_no_jump(x: &CarPaint, y: &CarPaint, ends: &[CarPaint], step: f64, weights_in_all: f64) {
    let most =
        |get: &dyn Fn(&CarPaint) -> f64| ends.iter().map(get).fold(0.0_f64, |m, v| m.max(v.abs()));
    // Rounding of a sum of three products, and of the two sums' difference.
    let rounding = 16.0 * f64::EPSILON;
    let close = |x: f64, y: f64, reach: f64, what: &str| {
        assert!(
            (x - y).abs() <= step * reach + rounding * reach * 4.0,
            "{what}: {x} {y}, step {step}"
        );
    };
    for c in 0..3 {
        close(
            x.diffuse[c],
            y.diffuse[c],
            most(&|p| p.diffuse[c]),
            "diffuse",
        );
    }
    for k in 0..x.lobes.len() {
        let (p, q) = (x.lobes[k], y.lobes[k]);
        let lobe = |get: &dyn Fn(&Lobe) -> f64| most(&|paint| get(&paint.lobes[k]));
        close(p.alpha.ln(), q.alpha.ln(), lobe(&|l| l.alpha.ln()), "ln α");
        close(p.f0, q.f0, lobe(&|l| l.f0), "F0");
        for c in 0..3 {
            close(
                p.weight[c],
                q.weight[c],
                lobe(&|l| l.weight[c]),
                "lobe weight",
            );
        }
    }
    let ior = |p: &CarPaint| p.coat.map_or(1.0, |c| c.ior);
    close(ior(x), ior(y), most(&ior), "ior");
    for (k, (p, q)) in x
        .color_table
        .nodes()
        .iter()
        .zip(y.color_table.nodes())
        .enumerate()
    {
        for axis in 0..3 {
            let reach = most(&|e| e.color_table.nodes()[k].to_array()[axis]);
            close(p.to_array()[axis], q.to_array()[axis], reach, "color table");
        }
    }
    let boxes = |p: &CarPaint| p.flakes.clone().expect("has flakes");
    let (fx, fy) = (boxes(x), boxes(y));
    assert_eq!(fx.probability, fy.probability);
    let ends: Vec<_> = ends.iter().map(boxes).collect();
    for k in 0..fx.clusters() {
        for axis in 0..3 {
            let size =
                |f: &carpaint::paint::Flakes| f.lower[k][axis].abs().max(f.upper[k][axis].abs());
            let reach = f64::from(ends.iter().map(size).fold(0.0, f32::max));
            let accepted = (step + 10.0 * 2.0_f64.powi(-24) * weights_in_all) * reach;
            for (p, q) in [
                (fx.lower[k][axis], fy.lower[k][axis]),
                (fx.upper[k][axis], fy.upper[k][axis]),
            ] {
                assert!(
                    f64::from((p - q).abs()) <= accepted,
                    "box {k}: {p} {q}, step {step}"
                );
            }
        }
    }
}

#[test]
fn ten_thousand_steps_of_the_weights_never_make_a_parameter_jump() {
    let paints = [
        metallic(21, &[0.0, 30.0], &[0.0]),
        metallic(22, &[0.0, 20.0], &[0.0]),
        metallic(23, &[0.0], &[0.0]),
    ];
    let blend = blend(&[&paints[0], &paints[1], &paints[2]]);
    let ends: Vec<CarPaint> = (0..3)
        .map(|k| realise(&blend, &[0, 1, 2].map(|m| f64::from(u8::from(m == k)))).paint)
        .collect();
    let mut random = Stream(24);
    let (mut weights, mut paint) = ([0.4, 0.3, 0.3], realise(&blend, &[0.4, 0.3, 0.3]).paint);
    let mut inverted = 0;
    for _ in 0..10_000 {
        let size = 10.0_f64.powf(random.within(-9.0, -1.0));
        let (d, e) = (
            size * random.within(-1.0, 1.0),
            size * random.within(-1.0, 1.0),
        );
        let mut next = [weights[0] + d, weights[1] + e, 0.0];
        // Far extrapolation is walked through too, and turned round at its ends.
        for w in &mut next[..2] {
            *w = w.clamp(-3.0, 4.0);
        }
        next[2] = 1.0 - next[0] - next[1];
        // The third weight's own rounding moves the sum of all by an EPS of 7.
        let step: f64 =
            (0..3).map(|m| (next[m] - weights[m]).abs()).sum::<f64>() + 16.0 * f64::EPSILON;
        let realised = realise(&blend, &next);
        inverted += usize::from(!realised.clamps.is_empty());
        let in_all = |w: &[f64; 3]| w.iter().map(|v| v.abs()).sum::<f64>();
        let weights_in_all = in_all(&next).max(in_all(&weights));
        assert_no_jump(&realised.paint, &paint, &ends, step, weights_in_all);
        (weights, paint) = (next, realised.paint);
    }
    assert!(
        inverted > 100,
        "the walk never left the originals: {inverted}"
    );
}

/// All corners of a paint's boxes.
fn corners(paint: &CarPaint) -> Vec<[f64; 3]> {
    let flakes = paint.flakes.as_ref().expect("has");
    let all = flakes.lower.iter().chain(&flakes.upper);
    all.map(|corner| corner.map(f64::from)).collect()
}

#[test]
fn ten_thousand_steps_of_the_weights_never_make_the_light_jump() {
    // One direction pair, an uncoated paint: f = chi (a/π + Σ s F D M/π) + Ξ with M its geometry, all but D linear or
    // a polynomial of what is linear. D = e^−x/(α² cos⁴θh), x = tan²θh/α², has |∂D/∂ln α| = 2 |x − 1| D ≤ 2/(α² cos⁴θh).
    let bare = |seed| CarPaint {
        coat: None,
        ..metallic(seed, &[0.0, 30.0], &[0.0])
    };
    let paints = [bare(31), bare(32)];
    let blend = blend(&[&paints[0], &paints[1]]);
    let (wi, wo) = (at(0.8, 0.0), at(0.7, 2.5));
    let pi = std::f64::consts::PI;
    let terms = |p: &CarPaint| {
        Reflectance::new(p)
            .terms(wi, wo, Chi::Table)
            .expect("above")
    };
    let half = terms(&paints[0]).half;
    let geometry = (1.0_f64 / (0.8 * 0.7)).min(2.0 * half.h_z / (half.h_o * 0.8)) / pi;
    let cos4 = half.h_z.powi(4);
    let ends = [[1.0, 0.0], [0.0, 1.0]].map(|w| realise(&blend, &w).paint);
    let most =
        |get: &dyn Fn(&CarPaint) -> f64| ends.iter().map(get).fold(0.0_f64, |m, v| m.max(v.abs()));
    // Inside the originals: every quantity lies between its two ends.
    let shape_slope = (0..3).map(|k| {
        let least = ends
            .iter()
            .map(|p| p.lobes[k].alpha)
            .fold(f64::INFINITY, f64::min);
        let log = most(&|p| p.lobes[k].alpha.ln());
        let (s, d) = (
            most(&|p| p.lobes[k].weight[1]),
            1.0 / (least * least * cos4),
        );
        // Product rule over s, F0 (|∂F/∂F0| ≤ 1, F ≤ 1) and ln α.
        geometry * d * (s + s * 1.0 + s * 2.0 * log)
    });
    let shape_slope = most(&|p| p.diffuse[1]) / pi + shape_slope.sum::<f64>();
    let shape_most = most(&|p| p.diffuse[1]) / pi
        + (0..3)
            .map(|k| {
                let least = ends
                    .iter()
                    .map(|p| p.lobes[k].alpha)
                    .fold(f64::INFINITY, f64::min);
                geometry * most(&|p| p.lobes[k].weight[1]) / (least * least * cos4)
            })
            .sum::<f64>();
    // Green of chi and of flakes: light moves by 3 f² of f, f by 1/116, 1/500, 1/200 of Lab, and the row of the matrix
    // to green sums to 0.97 + 1.88 + 0.04 in size.
    let green = |lab: [f64; 3]| {
        let f = (lab[0].abs() + 16.0) / 116.0 + lab[1].abs() / 500.0 + lab[2].abs() / 200.0;
        let slope = lab[0].abs() / 116.0 + lab[1].abs() / 500.0 + lab[2].abs() / 200.0;
        2.89 * 1.09 * 3.0 * f * f * slope
    };
    let axis_most = |axis: usize, get: &dyn Fn(&CarPaint) -> Vec<[f64; 3]>| {
        most(&|p| get(p).iter().fold(0.0_f64, |m, v| m.max(v[axis].abs())))
    };
    let table = |p: &CarPaint| {
        p.color_table
            .nodes()
            .iter()
            .map(|n| n.to_array())
            .collect::<Vec<_>>()
    };
    let chi_slope = green([0, 1, 2].map(|k| axis_most(k, &table)));
    let chi_most = 2.89
        * 1.09
        * ((axis_most(0, &table) + 16.0) / 116.0
            + axis_most(1, &table) / 500.0
            + axis_most(2, &table) / 200.0)
            .powi(3);
    let flake_slope = green([0, 1, 2].map(|k| axis_most(k, &corners))) / pi;
    let lipschitz = chi_slope * shape_most + chi_most * shape_slope + flake_slope;

    let mut random = Stream(33);
    let mut t = 0.5;
    let mut before =
        Reflectance::new(&realise(&blend, &[0.5, 0.5]).paint).evaluate(wi, wo, Chi::Table)[1];
    let (mut steepest, mut smallest) = (0.0_f64, 1.0_f64);
    for _ in 0..10_000 {
        let size = 10.0_f64.powf(random.within(-7.0, -1.0));
        let next = (t + size * random.within(-1.0, 1.0)).clamp(0.0, 1.0);
        let paint = realise(&blend, &[1.0 - next, next]).paint;
        let f = Reflectance::new(&paint).evaluate(wi, wo, Chi::Table)[1];
        // Weights of both paints move; corners in f32 add an ulp of 70, through the slope of light: 1e-7.
        let step = 2.0 * (next - t).abs();
        assert!(
            (f - before).abs() <= lipschitz * step + 1e-7,
            "{t} to {next}: {before} to {f}"
        );
        if step > 1e-5 {
            steepest = steepest.max((f - before).abs() / step);
        } else if step > 0.0 {
            smallest = smallest.min(step);
        }
        (t, before) = (next, f);
    }
    // The bound is worth something: over the smallest steps it allows a thousandth of the light and less, so that a jump
    // of more would have shown.
    assert!(
        lipschitz * smallest < 1e-3 * before,
        "{lipschitz} {smallest} {before}"
    );
    assert!(steepest > 1e-4 * lipschitz, "{steepest} of {lipschitz}");
}
