//! Realisations at weights that are none, far away, or a hair apart.

use crate::paints::{D, H, Stream, at, blend, metallic, pairs, realise, solid};
use carpaint::blend::{Blend, Clamp, RealisationWeights, WeightError};
use carpaint::color::{D65_2, LinearRgb, xyz_to_rgb};
use carpaint::paint::{
    CarPaint, Chi, Coat, Direction, Flakes, Limits, Lobe, MAX_ALPHA, MIN_ALPHA, Reflectance,
    at_angles, fresnel, half_angles,
};
use rayon::prelude::*;

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
            let mut weights = RealisationWeights::uniform(vec![0.5, 0.5]);
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
        let error = blend.realise(&RealisationWeights::uniform(vec![0.5; count]));
        assert!(
            matches!(error, Err(WeightError::Count { given, needed: 2, .. }) if given == count)
        );
    }
}

#[test]
fn the_largest_weights_that_are_accepted_end_in_a_paint() {
    let blend = blend(&[&metallic(1, H, D), &metallic(2, H, D)]);
    for far in FAR {
        let mut weights = RealisationWeights::uniform(far.to_vec());
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
    assert_boxes_are_told(&realised.clamps, &boxes_of(&blend), [1e6, -1e6 + 1.0]);
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

/// The boxes of a blend's two paints, cluster by cluster.
fn boxes_of(blend: &Blend) -> [Flakes; 2] {
    [[1.0, 0.0], [0.0, 1.0]].map(|w| realise(blend, &w).paint.flakes.expect("has"))
}

/// Holds what is told of boxes that weights above 4 sum in 64 bits against the sums: of an axis, both corners count as one.
/// How many of its boxes are held.
fn assert_boxes_are_told(clamps: &[Clamp], of: &[Flakes; 2], [w, v]: [f64; 2]) -> Beyond {
    let numbers = 3 * of[0].clusters();
    let none = Beyond {
        of: numbers,
        ..Beyond::default()
    };
    let (mut held, mut inverted) = (none, none);
    let tell = |of: &mut Beyond, by: f64| {
        of.count += usize::from(by > 0.0);
        of.worst = of.worst.max(by);
    };
    for k in 0..of[0].clusters() {
        for axis in 0..3 {
            let mix = |get: fn(&Flakes) -> &Vec<[f32; 3]>| {
                let [x, y] = of.each_ref().map(|f| f64::from(get(f)[k][axis]));
                w * x + v * y
            };
            let (low, high) = (mix(|f| &f.lower), mix(|f| &f.upper));
            tell(&mut held, low.abs().max(high.abs()) - 2000.0);
            tell(&mut inverted, low - high);
        }
    }
    for (rule, want) in [("2000", held), ("inverted", inverted)] {
        let told = clamps
            .iter()
            .find(|c| c.field == "flakes.boxes" && c.bound.contains(rule))
            .map_or(none, |c| Beyond {
                count: c.count,
                of: c.of,
                worst: c.worst,
            });
        // Two products and their sum, in either order: the same bits.
        assert_eq!(told, want, "{w} {v}: {rule}");
    }
    held
}

/// How many numbers of a field leave their bounds, of how many, and the farthest by how much.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Beyond {
    count: usize,
    of: usize,
    worst: f64,
}

impl Beyond {
    fn of(numbers: &[f64], low: f64, high: f64) -> Self {
        let beyond = |v: &f64| (low - v).max(v - high);
        let over = numbers.iter().map(beyond).filter(|v| *v > 0.0);
        Self {
            count: over.clone().count(),
            of: numbers.len(),
            worst: over.fold(0.0, f64::max),
        }
    }
}

/// What two paints' formulas give at two weights that sum to 1, field by field, before anything is held.
fn unheld(a: &CarPaint, b: &CarPaint, [w, v]: [f64; 2]) -> Vec<(&'static str, Beyond)> {
    let linear = |x: f64, y: f64| w * x + v * y;
    let geometric = |x: f64, y: f64| (w * x.ln() + v * y.ln()).exp().min(f64::MAX);
    let (c, d) = (a.coat.expect("coated"), b.coat.expect("coated"));
    let lobes: Vec<(Lobe, Lobe)> = a
        .lobes
        .iter()
        .copied()
        .zip(b.lobes.iter().copied())
        .collect();
    let weights: Vec<f64> = lobes
        .iter()
        .flat_map(|(x, y)| (0..3).map(|k| linear(x.weight[k], y.weight[k])))
        .collect();
    let alphas: Vec<f64> = lobes
        .iter()
        .map(|(x, y)| geometric(x.alpha, y.alpha))
        .collect();
    let f0s: Vec<f64> = lobes.iter().map(|(x, y)| linear(x.f0, y.f0)).collect();
    let diffuse: Vec<f64> = (0..3).map(|k| linear(a.diffuse[k], b.diffuse[k])).collect();
    let colors = |p: &CarPaint| -> Vec<f64> {
        let overall = p.color_table.overall();
        let all = p.color_table.nodes().iter().chain([&overall]);
        all.flat_map(|lab| lab.to_array()).collect()
    };
    let table: Vec<f64> = colors(a)
        .iter()
        .zip(colors(b))
        .map(|(x, y)| linear(*x, y))
        .collect();
    let thickness = |coat: Coat| coat.thickness_um.expect("stated");
    let ior = linear(c.ior, d.ior);
    let (t, u) = (
        a.flakes.as_ref().expect("has").texture,
        b.flakes.as_ref().expect("has").texture,
    );
    let pairs = |x: [f64; 2], y: [f64; 2]| [geometric(x[0], y[0]), geometric(x[1], y[1])];
    let mut fields = vec![
        ("diffuse", Beyond::of(&diffuse, 0.0, 1e3)),
        ("lobes.weight", Beyond::of(&weights, 0.0, 1e3)),
        ("lobes.alpha", Beyond::of(&alphas, 1e-4, 10.0)),
        ("lobes.f0", Beyond::of(&f0s, 0.0, 1.0)),
        ("color_table", Beyond::of(&table, -2000.0, 2000.0)),
        ("coat.ior", Beyond::of(&[ior], 1.0, 4.0)),
        (
            "flakes.texel_um",
            Beyond::of(&[geometric(t.texel_um, u.texel_um)], 1e-3, 1e5),
        ),
        (
            "flakes.grain_um",
            Beyond::of(&[geometric(t.grain_um, u.grain_um)], 1e-3, 1e6),
        ),
        (
            "flakes.lifetime_deg",
            Beyond::of(&pairs(t.lifetime_deg, u.lifetime_deg), 0.01, 1e4),
        ),
        (
            "flakes.persistence_deg",
            Beyond::of(&pairs(t.persistence_deg, u.persistence_deg), 0.01, 1e4),
        ),
    ];
    // A coat that ends at an index of 1 is none, and nothing of it is held.
    if ior > 1.0 {
        let roughness = linear(c.roughness, d.roughness);
        fields.push(("coat.roughness", Beyond::of(&[roughness], 0.0, 1.0)));
        let thick = linear(thickness(c), thickness(d));
        fields.push(("coat.thickness_um", Beyond::of(&[thick], 0.0, 1e6)));
    }
    fields
}

#[test]
fn what_is_held_is_counted_field_by_field_as_the_formulas_have_it() {
    let dressed = |seed: u64, ior: f64, roughness: f64, thickness: f64, times: f64| {
        let mut paint = metallic(seed, H, D);
        paint.coat = Some(Coat {
            ior,
            roughness,
            thickness_um: Some(thickness),
        });
        paint.lobes.sort_by(|x, y| x.alpha.total_cmp(&y.alpha));
        let texture = &mut paint.flakes.as_mut().expect("has").texture;
        texture.texel_um *= times;
        texture.grain_um *= times * times;
        texture.lifetime_deg[0] *= times;
        texture.persistence_deg[1] /= times;
        paint
    };
    // Nearly alike in some numbers and far apart in others, so that each bound bites at some weights and not at others.
    let a = dressed(6, 1.52, 0.02, 35.0, 1.0);
    let b = dressed(7, 1.5, 0.06, 40.0, 1.7);
    let blend = blend(&[&a, &b]);
    let mut bitten: Vec<&str> = Vec::new();
    let (mut partly, mut spared) = (0, 0);
    let (mut boxes_partly, of) = (0, boxes_of(&blend));
    for weights in [
        [0.4, 0.6],
        [-1.0, 2.0],
        [-3.0, 4.0],
        [4.0, -3.0],
        [12.0, -11.0],
        [-25.0, 26.0],
        [61.0, -60.0],
        [-300.0, 301.0],
        [2500.0, -2499.0],
        [1e6, 1.0 - 1e6],
        [1.0 - 1e12, 1e12],
    ] {
        let realised = realise(&blend, &weights);
        for (field, want) in unheld(&a, &b, weights) {
            let Some(told) = clamp(&realised.clamps, field) else {
                assert_eq!(want.count, 0, "{weights:?}: {field} is silent, {want:?}");
                spared += 1;
                continue;
            };
            assert_eq!(
                (told.count, told.of),
                (want.count, want.of),
                "{weights:?}: {told:?}"
            );
            // Two products of weights up to 1e12 cancel to what is left of them; a geometric mean's logarithm, of weights up
            // to 1e3 times 9 where its exponential is a number at all, is rounded as often.
            let scale =
                weights[0].abs() * 1e6 * 8.0 * f64::EPSILON + 1e5 * f64::EPSILON * want.worst;
            assert!(
                (told.worst - want.worst).abs() <= scale,
                "{weights:?}: {told:?} for {want:?}"
            );
            bitten.push(field);
            partly += usize::from(want.count > 0 && want.count < want.of);
        }
        if weights.iter().any(|w| w.abs() > 4.0) {
            let held = assert_boxes_are_told(&realised.clamps, &of, weights);
            boxes_partly += usize::from(held.count > 0 && held.count < held.of);
        }
        // Whatever is told is a field that was recomputed, or a box.
        for told in &realised.clamps {
            assert!(
                told.field == "flakes.boxes"
                    || unheld(&a, &b, weights)
                        .iter()
                        .any(|(field, _)| *field == told.field),
                "{told:?}"
            );
        }
    }
    bitten.sort_unstable();
    bitten.dedup();
    assert_eq!(bitten.len(), 12, "{bitten:?}");
    assert!(partly > 5 && spared > 20, "{partly} {spared}");
    assert!(boxes_partly >= 3, "{boxes_partly}");
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
    let mut weights = RealisationWeights::uniform(vec![1.0, 0.0]);
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

/// How far a step of the weights may move what follows them.
struct Step {
    /// `Σ |Δw_m|`: what is linear in the weights moves by at most so many times the largest `|value_m|`.
    linear: f64,
    /// What a geometric mean's logarithm moves by, of the largest `|ln x_m − ln x_n|`: see [`Step::between`].
    logarithmic: f64,
    /// `Σ |w_m|`, the larger of both ends.
    in_all: f64,
}

/// Sum of weights below which the exponents of a geometric mean turn from `w_m/Σw` to the even mean.
const LEAST_SUM: f64 = 0.1;

impl Step {
    /// From `δ` = [`LEAST_SUM`] on, exponents are `e_m = w_m/Σ`, and `|Δe_m| ≤ |Δw_m|/δ + |w_m| |ΔΣ|/δ²`. Below, they tend to
    /// `1/n` in proportion to `Σ/δ`: that ramp's own slope, `(|w_m| + δ/n)/δ²` for each of `ΔΣ`, and `1/δ` for each of
    /// `Δw_m`, comes in their place, and where both meet, their sum is enough. Exponents sum to 1, so that all logarithms
    /// may be taken from one of them.
    fn between<const N: usize>(before: [f64; N], after: [f64; N]) -> Self {
        let sum = |w: [f64; N]| w.iter().sum::<f64>();
        let moved = (0..N).map(|m| (after[m] - before[m]).abs());
        let linear: f64 = moved.clone().sum();
        let drift = (sum(after) - sum(before)).abs();
        let logarithmic = moved.enumerate().map(|(m, d)| {
            let size = before[m].abs().max(after[m].abs());
            d / LEAST_SUM + drift * (size + 2.0 * LEAST_SUM / N as f64) / (LEAST_SUM * LEAST_SUM)
        });
        let in_all = |w: [f64; N]| w.iter().map(|v| v.abs()).sum::<f64>();
        Self {
            linear,
            logarithmic: logarithmic.sum(),
            in_all: in_all(before).max(in_all(after)),
        }
    }
}

/// Two realisations differ by no more than the step between their weights allows, derived from the formulas:
///
/// - ordering corners and holding to bounds are contractions and add nothing;
/// - a number summed in 64 bits rounds by 8 EPS of `Σ|w|` times the largest of its kind at either end, a geometric mean's
///   logarithm by as much of the exponents' sum of sizes, which is at most `Σ|w|/δ`;
/// - boxes are summed in f32 where weights are moderate: each weight, product and sum rounds by `2^-24` of the sum of sizes,
///   which is at most `Σ |w_m|` times the largest corner; five roundings at each end.
fn assert_no_jump(x: &CarPaint, y: &CarPaint, ends: &[CarPaint], step: &Step) {
    let most =
        |get: &dyn Fn(&CarPaint) -> f64| ends.iter().map(get).fold(0.0_f64, |m, v| m.max(v.abs()));
    let rounding = 16.0 * f64::EPSILON * step.in_all;
    let close = |x: f64, y: f64, reach: f64, what: &str| {
        assert!(
            (x - y).abs() <= (step.linear + rounding) * reach,
            "{what}: {x} {y}, step {}",
            step.linear
        );
    };
    let log_close = |x: f64, y: f64, get: &dyn Fn(&CarPaint) -> f64, what: &str| {
        let logs = || ends.iter().map(|p| get(p).ln());
        let (low, high) = logs().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        let accepted =
            step.logarithmic * (high - low) + rounding / LEAST_SUM * low.abs().max(high.abs());
        assert!(
            (x.ln() - y.ln()).abs() <= accepted + rounding,
            "ln {what}: {x} {y}, step {}, accepted {accepted:e}",
            step.logarithmic
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
        log_close(p.alpha, q.alpha, &|paint| paint.lobes[k].alpha, "α");
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
    if let (Some(c), Some(d)) = (x.coat, y.coat) {
        let roughness = most(&|p| p.coat.map_or(0.0, |c| c.roughness));
        close(c.roughness, d.roughness, roughness, "coat's roughness");
    }
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
    let texture = |p: &CarPaint| {
        let t = p.flakes.as_ref().expect("has flakes").texture;
        let ([l, m], [n, o]) = (t.lifetime_deg, t.persistence_deg);
        [t.texel_um, t.grain_um, l, m, n, o]
    };
    for k in 0..6 {
        log_close(texture(x)[k], texture(y)[k], &|p| texture(p)[k], "texture");
    }
    let ends: Vec<_> = ends.iter().map(boxes).collect();
    for k in 0..fx.clusters() {
        for axis in 0..3 {
            let size =
                |f: &carpaint::paint::Flakes| f.lower[k][axis].abs().max(f.upper[k][axis].abs());
            let reach = f64::from(ends.iter().map(size).fold(0.0, f32::max));
            let accepted = (step.linear + 10.0 * 2.0_f64.powi(-24) * step.in_all) * reach;
            for (p, q) in [
                (fx.lower[k][axis], fy.lower[k][axis]),
                (fx.upper[k][axis], fy.upper[k][axis]),
            ] {
                assert!(
                    f64::from((p - q).abs()) <= accepted,
                    "box {k}: {p} {q}, step {}",
                    step.linear
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
        let realised = realise(&blend, &next);
        inverted += usize::from(!realised.clamps.is_empty());
        // Where the weights sum to 1, exponents are the weights.
        let moved: f64 = (0..3).map(|m| (next[m] - weights[m]).abs()).sum();
        let step = Step {
            logarithmic: moved,
            ..Step::between(weights, next)
        };
        assert_no_jump(&realised.paint, &paint, &ends, &step);
        (weights, paint) = (next, realised.paint);
    }
    assert!(
        inverted > 100,
        "the walk never left the originals: {inverted}"
    );
}

#[test]
fn steps_through_weights_that_sum_to_nothing_never_make_a_parameter_jump() {
    let mut paints = [
        metallic(21, &[0.0, 30.0], &[0.0]),
        metallic(22, &[0.0, 20.0], &[0.0]),
        metallic(23, &[0.0], &[0.0]),
    ];
    assert!(paints.iter().any(|p| p.coat.is_some()));
    for (paint, times) in paints.iter_mut().zip([1.0, 3.0, 0.4]) {
        let texture = &mut paint.flakes.as_mut().expect("has").texture;
        texture.texel_um *= times;
        texture.lifetime_deg = texture.lifetime_deg.map(|v| v / times);
        texture.persistence_deg[0] *= times * times;
    }
    let blend = blend(&[&paints[0], &paints[1], &paints[2]]);
    let ends: Vec<CarPaint> = (0..3)
        .map(|k| realise(&blend, &[0, 1, 2].map(|m| f64::from(u8::from(m == k)))).paint)
        .collect();
    let mut random = Stream(25);
    let sum = |w: &[f64; 3]| w.iter().sum::<f64>();
    let mut weights = [0.8, -1.1, 0.3];
    let mut paint = realise(&blend, &weights).paint;
    let (mut crossed, mut nearly, mut outside) = (0, 0, 0);
    for k in 0..10_000 {
        // Now and then to a billionth beside nothing, and small steps from there.
        let largest = if k % 200 < 40 { -7.0 } else { -1.0 };
        let size = 10.0_f64.powf(random.within(-12.0, largest));
        let mut next = weights.map(|w| (w + size * random.within(-1.0, 1.0)).clamp(-2.0, 2.0));
        // Pulled back to a sum of nothing from either side, by steps as small.
        next[2] -= 0.2 * size * sum(&next).signum();
        if k % 200 == 0 {
            next[2] = 1e-9 - next[0] - next[1];
        }
        let realised = realise(&blend, &next).paint;
        assert_no_jump(&realised, &paint, &ends, &Step::between(weights, next));
        crossed += usize::from(sum(&weights) * sum(&next) < 0.0);
        nearly += usize::from(sum(&next).abs() < 1e-6);
        outside += usize::from(sum(&next).abs() > LEAST_SUM);
        (weights, paint) = (next, realised);
    }
    assert!(
        crossed > 100 && nearly > 1000 && outside > 1000,
        "{crossed} crossings, {nearly} nearly nothing, {outside} far from it"
    );
}

fn has_flakes(paint: &CarPaint) -> &Flakes {
    paint.flakes.as_ref().expect("has flakes")
}

/// How fast light can follow the weights of two uncoated paints at one pair of directions, `[1 − t, t]`, anywhere between
/// two realisations: what is linear in the weights has the ends' difference for its slope, and lies between its two values.
///
/// ```text
/// f = chi S + Ξ,   S = a/π + Σ s F D M/π,   D = e^−x/(α² cos⁴θh),   x = tan²θh/α²,   |∂D/∂ln α| = 2 |x − 1| D
/// light of one axis: ∂/∂t expand(f) = 3 max(f, δ)² ∂f/∂t,   f = (L + 16)/116 + a/500 or − b/200
/// ```
struct Slopes<'a> {
    ends: &'a [CarPaint; 2],
    wi: Direction,
    wo: Direction,
    /// Row of the matrix from XYZ over white to green.
    green: [f64; 3],
}

impl Slopes<'_> {
    /// `|∂/∂t|` of green light of a Lab color that goes along `by`, over colors of at most `most`.
    fn of_color(&self, most: [f64; 3], by: [f64; 3]) -> f64 {
        let slope = |f: f64| 3.0 * f.max(6.0 / 29.0).powi(2);
        (0..3)
            .map(|k| self.green[k].abs() * slope(most[k]) * by[k].abs())
            .sum()
    }

    /// `f` of X, Y and Z of a Lab color, or what they move by with it.
    fn roots([l, a, b]: [f64; 3], offset: f64) -> [f64; 3] {
        let y = (l + offset) / 116.0;
        [y + a / 500.0, y, y - b / 200.0]
    }

    /// Of the color table's green at the pair.
    fn of_table(&self, now: [&CarPaint; 2]) -> f64 {
        let table = &now[0].color_table;
        let lab = |p: &CarPaint, k: usize| p.color_table.nodes()[k].to_array();
        let slopes: Vec<LinearRgb> = (0..table.nodes().len())
            .map(|k| {
                let at = now.map(|p| Self::roots(lab(p, k), 16.0));
                let (x, y) = (lab(&self.ends[0], k), lab(&self.ends[1], k));
                let by = Self::roots([0, 1, 2].map(|c| y[c] - x[c]), 0.0);
                [self.of_color([0, 1, 2].map(|c| at[0][c].max(at[1][c])), by); 3]
            })
            .collect();
        let half = half_angles(self.wi, self.wo);
        at_angles(&slopes, table.theta_h(), table.theta_d(), &half)[1]
    }

    /// Of the flakes' mean green at the pair: the most of any color of a box is the most that its mean moves by.
    fn of_flakes(&self, now: [&CarPaint; 2]) -> f64 {
        let grid = has_flakes(now[0]);
        let slopes: Vec<LinearRgb> = grid
            .offsets
            .windows(2)
            .map(|own| {
                let cluster = |k: usize| {
                    let corner = |p: &CarPaint, code: usize| {
                        let f = has_flakes(p);
                        [0, 1, 2].map(|axis| {
                            let corners = if code >> axis & 1 == 0 {
                                &f.lower
                            } else {
                                &f.upper
                            };
                            f64::from(corners[k][axis])
                        })
                    };
                    let (mut most, mut by) = ([f64::NEG_INFINITY; 3], [0.0_f64; 3]);
                    for code in 0..8 {
                        for p in now {
                            let at = Self::roots(corner(p, code), 16.0);
                            most = [0, 1, 2].map(|c| most[c].max(at[c]));
                        }
                        let (x, y) = (corner(&self.ends[0], code), corner(&self.ends[1], code));
                        let moved = Self::roots([0, 1, 2].map(|c| y[c] - x[c]), 0.0);
                        by = [0, 1, 2].map(|c| by[c].max(moved[c].abs()));
                    }
                    grid.probability[k] * self.of_color(most, by) / std::f64::consts::PI
                };
                [(own[0] as usize..own[1] as usize).map(cluster).sum(); 3]
            })
            .collect();
        let half = half_angles(self.wi, self.wo);
        at_angles(&slopes, &grid.theta_h, &grid.theta_d, &half)[1]
    }

    /// Of the green of diffuse and lobes before the color table.
    fn of_shape(&self, now: [&CarPaint; 2]) -> f64 {
        let half = half_angles(self.wi, self.wo);
        let pi = std::f64::consts::PI;
        let (i_z, o_z) = (self.wi[2], self.wo[2]);
        let masking = (1.0 / (i_z * o_z)).min(2.0 * half.h_z / (half.h_o * i_z.max(o_z)));
        let away = (1.0 - half.h_o).powi(5);
        let lobe = |k: usize| {
            let ([x, y], [p, q]) = (
                now.map(|p| p.lobes[k]),
                self.ends.each_ref().map(|p| p.lobes[k]),
            );
            let d = |alpha: f64| {
                (-half.tan2_h / alpha.powi(2)).exp() / (alpha.powi(2) * half.h_z.powi(4))
            };
            let off = |alpha: f64| (half.tan2_h / alpha.powi(2) - 1.0).abs();
            let (low, high) = (x.alpha.min(y.alpha), x.alpha.max(y.alpha));
            // D is largest where x = 1.
            let most = d(half.tan2_h.sqrt().clamp(low, high));
            let s = x.weight[1].max(y.weight[1]);
            let f = away + (1.0 - away) * x.f0.max(y.f0);
            let turned = 2.0 * off(low).max(off(high)) * (q.alpha.ln() - p.alpha.ln()).abs();
            let by = (q.weight[1] - p.weight[1]).abs() * f
                + s * (1.0 - away) * (q.f0 - p.f0).abs()
                + s * f * turned;
            most * by * masking / pi
        };
        let diffuse = (self.ends[1].diffuse[1] - self.ends[0].diffuse[1]).abs() / pi;
        diffuse + (0..now[0].lobes.len()).map(lobe).sum::<f64>()
    }

    /// What green light may move by between two realisations that are `step` apart.
    fn bound(&self, now: [&CarPaint; 2], step: f64) -> f64 {
        let (chi_slope, shape_slope) = (self.of_table(now), self.of_shape(now));
        let reflectance = Reflectance::new(now[0]);
        let terms = reflectance
            .terms(self.wi, self.wo, Chi::Table)
            .expect("above");
        let table = &now[0].color_table;
        let chi = at_angles(
            reflectance.chi_nodes(),
            table.theta_h(),
            table.theta_d(),
            &terms.half,
        )[1];
        let shape = terms.base[1] / chi;
        let product =
            chi_slope * (shape + shape_slope * step) + (chi.abs() + chi_slope * step) * shape_slope;
        step * (product + self.of_flakes(now))
    }
}

#[test]
fn ten_thousand_steps_of_the_weights_never_make_the_light_jump() {
    let bare = |seed| CarPaint {
        coat: None,
        ..metallic(seed, &[0.0, 30.0], &[0.0])
    };
    let paints = [bare(31), bare(32)];
    let blend = blend(&[&paints[0], &paints[1]]);
    let ends = [[1.0, 0.0], [0.0, 1.0]].map(|w| realise(&blend, &w).paint);
    let slopes = Slopes {
        ends: &ends,
        wi: at(0.8, 0.0),
        wo: at(0.7, 2.5),
        green: [
            xyz_to_rgb([D65_2.x, 0.0, 0.0])[1],
            xyz_to_rgb([0.0, D65_2.y, 0.0])[1],
            xyz_to_rgb([0.0, 0.0, D65_2.z])[1],
        ],
    };
    let light = |p: &CarPaint| Reflectance::new(p).evaluate(slopes.wi, slopes.wo, Chi::Table)[1];
    let mut random = Stream(33);
    let mut t = 0.5;
    let mut paint = realise(&blend, &[0.5, 0.5]).paint;
    let mut before = light(&paint);
    let (mut steepest, mut small, mut allowed) = (0.0_f64, 0, 0.0_f64);
    for _ in 0..10_000 {
        let size = 10.0_f64.powf(random.within(-7.0, -1.0));
        let next = (t + size * random.within(-1.0, 1.0)).clamp(0.0, 1.0);
        let after = realise(&blend, &[1.0 - next, next]).paint;
        let f = light(&after);
        let step = (next - t).abs();
        let bound = slopes.bound([&paint, &after], step);
        // Corners in f32 add an ulp of 70, through the slope of light: 1e-7.
        assert!(
            (f - before).abs() <= bound + 1e-7,
            "{t} to {next}: {before} to {f}, bound {bound}"
        );
        if step > 1e-4 {
            steepest = steepest.max((f - before).abs() / bound);
        } else if step < 1e-5 {
            small += 1;
            allowed = allowed.max((bound + 1e-7) / before);
        }
        (t, before, paint) = (next, f, after);
    }
    // The bound is hardly four times the slope somewhere, and over each of thousands of small steps it allows less than a
    // part in ten thousand of the light: a jump of more would have shown.
    assert!(steepest > 0.25, "{steepest} of the bound");
    assert!(small > 4000 && allowed < 1e-4, "{small} steps, {allowed:e}");
}

#[test]
fn light_of_coated_paints_has_no_step_that_a_smaller_step_of_the_weights_keeps() {
    // A jump stays when the step is halved, a slope does not: every step is halved thirty times towards where the light moves
    // most. What is left is the slope over a step of 1e-11, and the corners' rounding to f32: 2^-22 of
    // what light moves by over a whole weight, which over these paints is below 10.
    let coat = |ior, roughness| {
        Some(Coat {
            ior,
            roughness,
            thickness_um: None,
        })
    };
    let paints = [
        CarPaint {
            coat: coat(1.5, 0.02),
            ..metallic(41, H, D)
        },
        CarPaint {
            coat: coat(1.35, 0.3),
            ..metallic(42, H, D)
        },
        CarPaint {
            coat: None,
            ..metallic(43, H, D)
        },
    ];
    let blend = blend(&[&paints[0], &paints[1], &paints[2]]);
    let pairs = pairs(24);
    let light = |w: &[f64; 3]| -> Vec<f64> {
        let paint = realise(&blend, w).paint;
        let reflectance = Reflectance::new(&paint);
        // Without the coat's own highlight, which becomes a mirror at a roughness of 1e-3: see below.
        let of = |(i, o): &(Direction, Direction)| {
            let t = reflectance.terms(*i, *o, Chi::Table).expect("above");
            [0, 1, 2].map(|k| t.transmission * (t.base[k] + t.flakes[k]))
        };
        pairs.iter().flat_map(of).collect()
    };
    let between = |a: &[f64; 3], b: &[f64; 3]| [0, 1, 2].map(|m| f64::midpoint(a[m], b[m]));
    // Relative to the light itself: next to the mirror it is thousands.
    let apart = |x: &[f64], y: &[f64]| {
        x.iter()
            .zip(y)
            .map(|(x, y)| (x - y).abs() / (1.0 + x.abs().max(y.abs())))
            .fold(0.0, f64::max)
    };
    let mut random = Stream(44);
    let (mut looked_at, mut coatless) = (0, 0);
    for _ in 0..60 {
        // From far out to far out, the sum of weights now 1, now anything.
        let mut ends = [0; 2].map(|_| [0; 3].map(|_| random.within(-1.5, 2.0)));
        if random.unit() < 0.7 {
            ends = ends.map(|[a, b, _]| [a, b, 1.0 - a - b]);
        }
        let at = |t: f64| [0, 1, 2].map(|m| ends[0][m] + t * (ends[1][m] - ends[0][m]));
        let walk: Vec<([f64; 3], Vec<f64>)> = (0..=40)
            .map(|k| at(f64::from(k) / 40.0))
            .map(|w| (w, light(&w)))
            .collect();
        coatless += usize::from(
            walk.iter()
                .any(|(w, _)| realise(&blend, w).paint.coat.is_none()),
        );
        let segments: Vec<_> = walk.windows(2).collect();
        let left = |segment: &[([f64; 3], Vec<f64>)]| {
            let (mut low, mut high) = (segment[0].clone(), segment[1].clone());
            for _ in 0..30 {
                let middle = between(&low.0, &high.0);
                let middle = (middle, light(&middle));
                if apart(&low.1, &middle.1) >= apart(&middle.1, &high.1) {
                    high = middle;
                } else {
                    low = middle;
                }
            }
            (apart(&low.1, &high.1), low.0, high.0)
        };
        for (left, low, high) in segments.into_par_iter().map(left).collect::<Vec<_>>() {
            looked_at += 1;
            assert!(
                left < 10.0 * 2.0_f64.powi(-22),
                "{left:e} between {low:?} and {high:?}"
            );
        }
    }
    assert!(looked_at == 60 * 40 && coatless > 5, "{coatless}");
}

/// `∫ f_coat o_z dω` of a narrow coat over the slopes of its half vectors, `dω_o = 4 (h·i) dω_h`, `dω_h = h_z³ dp dq`: by
/// even steps of a quarter of a width, which integrate a bell curve to e^−158, up to six widths, where e^−36 is left.
fn highlight_albedo(coat: Coat, wi: Direction) -> f64 {
    let (steps, width) = (24_i32, coat.roughness / 4.0);
    let mut sum = 0.0;
    for row in -steps..=steps {
        for column in -steps..=steps {
            let (p, q) = (f64::from(row) * width, f64::from(column) * width);
            let h_z = 1.0 / (1.0 + p * p + q * q).sqrt();
            let h = [p * h_z, q * h_z, h_z];
            let along = h[0] * wi[0] + h[1] * wi[1] + h[2] * wi[2];
            let wo: Direction = std::array::from_fn(|k| 2.0 * along * h[k] - wi[k]);
            sum += coat.highlight(wi, wo) * wo[2] * 4.0 * along * h_z.powi(3) * width * width;
        }
    }
    sum
}

#[test]
fn a_coat_that_becomes_a_mirror_keeps_the_light_it_reflects() {
    // Below a roughness of 1e-3 the highlight is a mirror of weight R(c), above it a lobe: with slopes s of variance α²/2
    // an axis its albedo is the mean of R(c(s)) (1 + s_x tan θ), c(s) = (c + s_x sin θ)/√(1 + s²), which differs from R by
    // α² (|R'| (tan θ + 1) + |R''|/2) at the most and terms of α⁴.
    let coat = |roughness| Coat {
        ior: 1.5,
        roughness,
        thickness_um: None,
    };
    let (a, b) = (
        CarPaint {
            coat: Some(coat(0.5e-3)),
            ..solid(51)
        },
        CarPaint {
            coat: Some(coat(1.7e-3)),
            ..solid(52)
        },
    );
    let blend = blend(&[&a, &b]);
    for degrees in [0.0_f64, 30.0, 60.0, 75.0, 80.0] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let wi = [-sine, 0.0, cosine];
        let r = |c: f64| fresnel(c, 1.5);
        let step = 1e-4;
        let slope = (r(cosine) - r(cosine - step)) / step;
        let bend = (r(cosine) - 2.0 * r(cosine - step) + r(cosine - 2.0 * step)) / (step * step);
        let mut seen = [0, 0];
        let mut totals = Vec::new();
        // The threshold lies at t = 5/12.
        for t in [
            0.3,
            0.4,
            5.0 / 12.0 - 1e-9,
            5.0 / 12.0 + 1e-9,
            0.43,
            0.6,
            1.0,
        ] {
            let paint = realise(&blend, &[1.0 - t, t]).paint;
            let coat = paint.coat.expect("coated");
            seen[usize::from(coat.is_mirror())] += 1;
            let mirror = Reflectance::new(&paint).mirror(wi);
            assert_eq!(coat.is_mirror(), mirror > 0.0);
            let total = if coat.is_mirror() {
                mirror
            } else {
                highlight_albedo(coat, wi)
            };
            let allowed = coat.roughness.powi(2)
                * (slope.abs() * (sine / cosine + 1.0) + bend.abs() / 2.0)
                * 1.1
                + 1e-9;
            assert!(
                (total - r(cosine)).abs() <= allowed,
                "{degrees}°, {t}: {total}, ± {allowed:e}"
            );
            totals.push(total);
        }
        // Across the threshold itself: the same bound at 1e-3, which is nothing an eye could see.
        let jump = (totals[3] - totals[2]).abs();
        assert!(jump < 1e-4 * r(cosine), "{degrees}°: a jump of {jump:e}");
        assert_eq!(seen, [4, 3], "{degrees}°");
    }
}
