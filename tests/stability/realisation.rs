//! Realisations at weights that are none, far away, or a hair apart.

use crate::paints::{D, H, Stream, at, blend, metallic, pairs, realise, solid};
use carpaint::blend::{Clamp, RealisationWeights, WeightError};
use carpaint::paint::{
    CarPaint, Chi, Coat, Direction, Limits, Lobe, MAX_ALPHA, MIN_ALPHA, Reflectance, fresnel,
};

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
                (told.worst - want.worst).abs() <= scale || told.worst == f64::MAX,
                "{weights:?}: {told:?} for {want:?}"
            );
            bitten.push(field);
            partly += usize::from(want.count > 0 && want.count < want.of);
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

#[test]
fn light_of_coated_paints_has_no_step_that_a_smaller_step_of_the_weights_keeps() {
    // A jump stays when the step is halved, a slope does not: from each place where the light moves most, steps are halved
    // thirty times towards it. What is left is the slope over a step of 1e-11, and the corners' rounding to f32: 2^-22 of
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
        let steepest = walk
            .windows(2)
            .max_by(|x, y| apart(&x[0].1, &x[1].1).total_cmp(&apart(&y[0].1, &y[1].1)))
            .expect("steps");
        let (mut low, mut high) = (steepest[0].clone(), steepest[1].clone());
        for _ in 0..30 {
            let middle = between(&low.0, &high.0);
            let middle = (middle, light(&middle));
            if apart(&low.1, &middle.1) >= apart(&middle.1, &high.1) {
                high = middle;
            } else {
                low = middle;
            }
        }
        looked_at += 1;
        let left = apart(&low.1, &high.1);
        assert!(
            left < 10.0 * 2.0_f64.powi(-22),
            "{left:e} between {:?} and {:?}",
            low.0,
            high.0
        );
    }
    assert!(looked_at == 60 && coatless > 5, "{coatless}");
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
