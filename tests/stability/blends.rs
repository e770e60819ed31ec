//! Blends at their ends, in other orders, and of paints that hardly blend.

use crate::paints::{D, H, Stream, blend, flakes, grid, metallic, pairs, realise, solid};
use carpaint::blend::{Blend, BlendError, BlendSettings, Ingredient, RealisationWeights};
use carpaint::color::Lab;
use carpaint::paint::{
    AngleGrid, CarPaint, Chi, Coat, ColorTable, Flakes, Limits, Lobe, Reflectance,
};
use std::collections::BTreeMap;

/// Probability by box of one slice: what is left when clusters that carry the same box are merged again.
fn regrouped(flakes: &Flakes, slice: usize) -> BTreeMap<[u32; 6], f64> {
    let slice = flakes.slice_at(slice);
    let mut groups = BTreeMap::new();
    for (k, p) in slice.probability.iter().enumerate() {
        let (l, u) = (slice.lower[k], slice.upper[k]);
        // A box at −0 is the box at 0.
        let key = [l[0], l[1], l[2], u[0], u[1], u[2]].map(|v| (v + 0.0).to_bits());
        *groups.entry(key).or_insert(0.0) += p;
    }
    groups
}

/// Lobes that add something, by ascending roughness.
fn present(lobes: &[Lobe]) -> Vec<Lobe> {
    let mut list: Vec<Lobe> = lobes.iter().copied().filter(|l| !l.is_absent()).collect();
    list.sort_by(|x, y| x.alpha.total_cmp(&y.alpha));
    list
}

/// Where each of a grid's angles stands on another that holds them all.
fn places(of: &AngleGrid, on: &AngleGrid) -> Vec<usize> {
    let place = |x: &f64| on.degrees().iter().position(|y| y == x);
    of.degrees()
        .iter()
        .map(|x| place(x).expect("on the grid"))
        .collect()
}

/// Nodes of a color table at the angles of another's grid, θd fastest, and the one color for all.
fn colors_at(table: &ColorTable, of: &ColorTable) -> Vec<[f64; 3]> {
    let columns = places(of.theta_d(), table.theta_d());
    let rows = places(of.theta_h(), table.theta_h());
    let nodes = rows.iter().flat_map(|row| {
        let node = |column: &usize| table.nodes()[row * table.theta_d().len() + column];
        columns.iter().map(node).collect::<Vec<_>>()
    });
    nodes.chain([table.overall()]).map(Lab::to_array).collect()
}

/// The original's own numbers, bit for bit, and its slices: boxes bit for bit, probabilities within 1e-12.
fn assert_is(paint: &CarPaint, original: &CarPaint, what: &str) {
    assert_has_the_base_of(paint, original, what);
    let (Some(got), Some(want)) = (&paint.flakes, &original.flakes) else {
        assert_eq!(paint.flakes.is_some(), original.flakes.is_some(), "{what}");
        return;
    };
    assert_eq!(got.texture, want.texture, "{what}");
    for (h, row) in places(&want.theta_h, &got.theta_h).into_iter().enumerate() {
        for (d, column) in places(&want.theta_d, &got.theta_d).into_iter().enumerate() {
            let got = regrouped(got, row * got.theta_d.len() + column);
            let want = regrouped(want, h * want.theta_d.len() + d);
            assert!(
                got.keys().eq(want.keys()),
                "{what}: boxes differ in slice {h}, {d}"
            );
            for (x, y) in got.values().zip(want.values()) {
                // Masses are whole units of 2^-55; a hundred clusters round by less than 1e-14.
                assert!((x - y).abs() <= 1e-12, "{what}: {x} {y}");
            }
        }
    }
}

/// Everything but the flakes, bit for bit: on a finer grid the color table's own nodes.
fn assert_has_the_base_of(paint: &CarPaint, original: &CarPaint, what: &str) {
    assert_eq!(paint.coat, original.coat, "{what}");
    assert_eq!(paint.diffuse, original.diffuse, "{what}");
    assert_eq!(present(&paint.lobes), present(&original.lobes), "{what}");
    let (got, want) = (&paint.color_table, &original.color_table);
    let bits = |colors: Vec<[f64; 3]>| -> Vec<[u64; 3]> {
        // A color at −0 is the color at 0.
        colors
            .iter()
            .map(|lab| lab.map(|v| (v + 0.0).to_bits()))
            .collect()
    };
    assert_eq!(
        bits(colors_at(got, want)),
        bits(colors_at(want, want)),
        "{what}: colors differ"
    );
}

fn unit_weights(n: usize, k: usize) -> Vec<f64> {
    (0..n).map(|m| if m == k { 1.0 } else { 0.0 }).collect()
}

#[test]
fn at_weight_one_of_a_paint_the_blend_is_that_paint_to_the_bit() {
    for (n, seed) in [(2, 100), (3, 200), (4, 300), (5, 400)] {
        let paints: Vec<CarPaint> = (0..n).map(|k| metallic(seed + k, H, D)).collect();
        let blend = blend(&paints.iter().collect::<Vec<_>>());
        for (k, original) in paints.iter().enumerate() {
            let realised = realise(&blend, &unit_weights(paints.len(), k));
            assert!(realised.clamps.is_empty(), "{:?}", realised.clamps);
            assert_is(&realised.paint, original, &format!("paint {k} of {n}"));
            assert_eq!(realised.paint.color_table, original.color_table);
        }
    }
}

#[test]
fn a_coat_that_only_one_paint_has_or_whose_thickness_only_one_knows_comes_back_as_it_was() {
    let coat = |ior, roughness, thickness_um| {
        Some(Coat {
            ior,
            roughness,
            thickness_um,
        })
    };
    let coats = [
        None,
        coat(1.5, 0.02, None),
        coat(1.4, 0.3, Some(40.0)),
        coat(1.6, 0.0, Some(35.5)),
        coat(1.0, 0.1, Some(1.0)),
    ];
    for (a, first) in coats.iter().enumerate() {
        for (b, second) in coats.iter().enumerate() {
            let paints = [(first, 1), (second, 2)].map(|(coat, seed)| CarPaint {
                coat: *coat,
                ..solid(seed)
            });
            let blend = blend(&[&paints[0], &paints[1]]);
            for k in 0..2 {
                let realised = realise(&blend, &unit_weights(2, k));
                assert_is(
                    &realised.paint,
                    &paints[k],
                    &format!("coats {a} and {b}, paint {k}"),
                );
            }
        }
    }
}

#[test]
fn a_paint_with_itself_is_that_paint_at_every_weight() {
    let a = metallic(1, H, D);
    let blend = blend(&[&a, &a]);
    assert_eq!(blend.report().mean_cost, 0.0);
    for t in [0.0, 1.0] {
        assert_is(
            &realise(&blend, &[1.0 - t, t]).paint,
            &a,
            &format!("at {t}"),
        );
    }
    // Weights that sum to 1, yet Σ w x is x only to a rounding of each weight, product and sum.
    for weights in [[0.7, 0.3], [-3.0, 4.0], [4.5, -3.5], [1e6, 1.0 - 1e6]] {
        let realised = realise(&blend, &weights);
        assert!(
            realised.clamps.is_empty(),
            "{weights:?}: {:?}",
            realised.clamps
        );
        assert_combined(&realised.paint, &a, &weights);
    }
}

/// A paint mixed from nothing but itself: what is summed in 64 bits is off by 4 EPS of the sum of sizes, `Σ|w|` times the
/// number; a geometric mean of equal numbers is that number. Boxes are summed in 32 bits up to weights of 4, with 2^-22 in
/// place of 4 EPS, and in 64 beyond, where only their last rounding is one of 32.
fn assert_combined(got: &CarPaint, want: &CarPaint, weights: &[f64]) {
    let size: f64 = weights.iter().map(|w| w.abs()).sum();
    let what = format!("{weights:?}");
    let close = |x: f64, y: f64, field: &str| {
        assert!(
            (x - y).abs() <= size * 4.0 * f64::EPSILON * y.abs(),
            "{what}, {field}: {x:?} instead of {y:?}"
        );
    };
    let (c, d) = (got.coat.expect("coated"), want.coat.expect("coated"));
    close(c.ior, d.ior, "index");
    close(c.roughness, d.roughness, "coat's roughness");
    assert_eq!(c.thickness_um, d.thickness_um);
    for k in 0..3 {
        close(got.diffuse[k], want.diffuse[k], "diffuse");
    }
    let mut lobes = want.lobes.clone();
    lobes.sort_by(|x, y| x.alpha.total_cmp(&y.alpha));
    assert_eq!(got.lobes.len(), lobes.len());
    for (x, y) in got.lobes.iter().zip(&lobes) {
        assert_eq!(x.alpha, y.alpha, "{what}");
        close(x.f0, y.f0, "F0");
        for k in 0..3 {
            close(x.weight[k], y.weight[k], "lobe's weight");
        }
    }
    let (x, y) = (&got.color_table, &want.color_table);
    assert_eq!((x.theta_h(), x.theta_d()), (y.theta_h(), y.theta_d()));
    let colors = x
        .nodes()
        .iter()
        .chain([x.overall()].iter())
        .copied()
        .collect::<Vec<_>>();
    let originals = y
        .nodes()
        .iter()
        .chain([y.overall()].iter())
        .copied()
        .collect::<Vec<_>>();
    for (x, y) in colors.iter().zip(&originals) {
        for k in 0..3 {
            close(x.to_array()[k], y.to_array()[k], "color");
        }
    }
    let (x, y) = (
        got.flakes.as_ref().expect("has"),
        want.flakes.as_ref().expect("has"),
    );
    assert_eq!(x.texture, y.texture, "{what}");
    assert_eq!(
        (&x.theta_h, &x.theta_d, &x.offsets),
        (&y.theta_h, &y.theta_d, &y.offsets)
    );
    let rounding = if weights.iter().all(|w| w.abs() <= 4.0) {
        size * 2.0_f64.powi(-22)
    } else {
        2.0_f64.powi(-24) + size * 4.0 * f64::EPSILON
    };
    // Clusters of a slice may come in another order: boxes are compared by their lower corners' order.
    for slice in 0..y.slices() {
        let sorted = |f: &Flakes| {
            let slice = f.slice_at(slice);
            let mut list: Vec<_> = (0..slice.probability.len())
                .map(|k| (slice.lower[k], slice.upper[k], slice.probability[k]))
                .collect();
            list.sort_by(|x, y| x.0[0].total_cmp(&y.0[0]));
            list
        };
        for (x, y) in sorted(x).iter().zip(&sorted(y)) {
            assert!((x.2 - y.2).abs() <= 1e-12, "{what}: {x:?} {y:?}");
            for k in 0..3 {
                let corner = f64::from(y.0[k].abs().max(y.1[k].abs()));
                let off = f64::from(x.0[k] - y.0[k])
                    .abs()
                    .max(f64::from(x.1[k] - y.1[k]).abs());
                assert!(off <= rounding * corner, "{what}: {x:?} instead of {y:?}");
            }
        }
    }
}

#[test]
fn a_blend_and_its_reverse_agree_to_the_last_bit() {
    let (a, b) = (metallic(4, H, D), metallic(5, H, &[0.0, 10.0, 25.0]));
    let (forth, back) = (blend(&[&a, &b]), blend(&[&b, &a]));
    for t in [0.0, 1e-9, 0.2, 0.5, 0.7, 1.0, -3.0, 4.0] {
        let (x, y) = (
            realise(&forth, &[1.0 - t, t]),
            realise(&back, &[t, 1.0 - t]),
        );
        assert_eq!(x.paint, y.paint, "at {t}");
        assert_eq!(x.clamps, y.clamps, "at {t}");
    }
}

#[test]
fn five_paints_in_any_order_are_one_blend() {
    let paints: Vec<CarPaint> = (0..5)
        .map(|k| metallic(500 + k, &[0.0, 20.0], &[0.0]))
        .collect();
    let weights = [0.3, 0.1, 0.25, -0.05, 0.4];
    let want = realise(&blend(&paints.iter().collect::<Vec<_>>()), &weights).paint;
    want.validate(&Limits::default()).expect("a paint");
    for order in [[4, 3, 2, 1, 0], [1, 0, 2, 4, 3], [2, 4, 1, 3, 0]] {
        let shuffled = order.map(|k| &paints[k]);
        let got = realise(&blend(&shuffled), &order.map(|k| weights[k]));
        assert_eq!(got.paint, want, "{order:?}");
    }
}

#[test]
fn two_paints_given_twice_are_one_blend_in_any_order() {
    let (a, b) = (metallic(13, H, D), metallic(14, H, &[0.0, 10.0]));
    let given = [&a, &b, &a, &b];
    for weights in [[0.3_f64, 0.1, 0.25, 0.35], [1.5, -0.75, 0.5, -0.25]] {
        let size: f64 = weights.iter().map(|w| w.abs()).sum();
        let want = realise(&blend(&given), &weights).paint;
        let mut orders = 0;
        for code in 0..256_usize {
            let order = [code & 3, code >> 2 & 3, code >> 4 & 3, code >> 6];
            if (0..4).any(|k| !order.contains(&k)) {
                continue;
            }
            orders += 1;
            let got = realise(&blend(&order.map(|k| given[k])), &order.map(|k| weights[k])).paint;
            // The two of a kind share a hash and stand in the order given: sums of four go another way round, three
            // roundings of each, and that of the products.
            let accepted = 5.0 * f64::EPSILON * size;
            for k in 0..3 {
                assert!((got.diffuse[k] - want.diffuse[k]).abs() <= accepted * 0.5);
            }
            for (x, y) in got.lobes.iter().zip(&want.lobes) {
                // Logarithms below 3, through an exponential.
                assert!(
                    (x.alpha / y.alpha - 1.0).abs() <= 8.0 * accepted,
                    "{order:?}"
                );
                assert!((x.f0 - y.f0).abs() <= accepted, "{order:?}");
            }
            let (x, y) = (got.flakes.expect("has"), want.flakes.as_ref().expect("has"));
            assert_eq!(x.offsets, y.offsets, "{order:?}");
            assert_eq!(x.probability, y.probability, "{order:?}");
            let corners = x
                .lower
                .iter()
                .zip(&y.lower)
                .chain(x.upper.iter().zip(&y.upper));
            for (x, y) in corners.flat_map(|(x, y)| x.iter().zip(y)) {
                // Corners of the originals are below 70 in L and 30 in a and b.
                let accepted = 5.0 * 2.0_f64.powi(-24) * size * 70.0;
                assert!(f64::from(x - y).abs() <= accepted, "{order:?}: {x} {y}");
            }
        }
        assert_eq!(orders, 24);
    }
}

/// Mean over probability of every slice's lower and upper corners.
fn mean_corners(paint: &CarPaint) -> Vec<f64> {
    let flakes = paint.flakes.as_ref().expect("flakes");
    let mut means = Vec::new();
    for ends in flakes.offsets.windows(2) {
        for corners in [&flakes.lower, &flakes.upper] {
            for axis in 0..3 {
                let clusters = ends[0] as usize..ends[1] as usize;
                let weighted = |k: usize| flakes.probability[k] * f64::from(corners[k][axis]);
                means.push(clusters.map(weighted).sum());
            }
        }
    }
    means
}

#[test]
fn a_paint_given_twice_counts_with_both_weights() {
    let (a, b) = (metallic(11, H, D), metallic(12, H, D));
    let thrice = blend(&[&a, &b, &a]);
    let twice = blend(&[&a, &b]);
    for (w, v) in [
        ([0.3, 0.5, 0.2], [0.5, 0.5]),
        ([1.0, 0.0, 0.0], [1.0, 0.0]),
        ([0.0, 0.0, 1.0], [1.0, 0.0]),
    ] {
        let (x, y) = (realise(&thrice, &w).paint, realise(&twice, &v).paint);
        let (fx, fy) = (Reflectance::new(&x), Reflectance::new(&y));
        for (wi, wo) in pairs(60) {
            let (x, y) = (
                fx.evaluate(wi, wo, Chi::Table),
                fy.evaluate(wi, wo, Chi::Table),
            );
            for c in 0..3 {
                // Weights and parameters agree to an EPS or two; the exponent of a lobe multiplies that by up to 745,
                // f32 corners add 1e-7 of the flakes. A paint that comes again goes where it went before.
                assert!((x[c] - y[c]).abs() <= 1e-6 * y[c] + 1e-9, "{x:?} {y:?}");
            }
        }
        for (p, q) in x.diffuse.iter().zip(y.diffuse) {
            assert!((p - q).abs() <= 4.0 * f64::EPSILON * q);
        }
        // Whatever corresponds to what, the mean corner is that of the weights: corners up to 2000 are f32, with half
        // an ulp of 6e-5 each, which the probabilities average.
        for (p, q) in mean_corners(&x).iter().zip(mean_corners(&y)) {
            assert!((p - q).abs() <= 1e-4, "{p} {q}");
        }
        for (p, q) in x.lobes.iter().zip(&y.lobes) {
            // α is a product of powers: its logarithm (below 3) rounds a few times.
            assert!((p.alpha / q.alpha - 1.0).abs() <= 32.0 * f64::EPSILON);
        }
    }
}

/// The same paint to a millionth: of every parameter, of every color, and of every box and its probability.
fn assert_is_nearly(paint: &CarPaint, original: &CarPaint, what: &str) {
    // 1e-9 of another paint's numbers, none of which is more than a thousand times as large.
    let close = |x: f64, y: f64, field: &str| {
        assert!(
            (x - y).abs() <= 1e-6 * y.abs().max(1e-3),
            "{what}, {field}: {x} instead of {y}"
        );
    };
    let ior = |p: &CarPaint| p.coat.map_or(1.0, |c| c.ior);
    close(ior(paint), ior(original), "index");
    if let (Some(x), Some(y)) = (paint.coat, original.coat) {
        close(x.roughness, y.roughness, "coat's roughness");
    }
    for k in 0..3 {
        close(paint.diffuse[k], original.diffuse[k], "diffuse");
    }
    let (x, y) = (present(&paint.lobes), present(&original.lobes));
    assert_eq!(x.len(), y.len(), "{what}");
    for (x, y) in x.iter().zip(&y) {
        close(x.alpha, y.alpha, "α");
        close(x.f0, y.f0, "F0");
        for k in 0..3 {
            close(x.weight[k], y.weight[k], "lobe's weight");
        }
    }
    let (got, want) = (&paint.color_table, &original.color_table);
    for (x, y) in colors_at(got, want).iter().zip(colors_at(want, want)) {
        for k in 0..3 {
            // Of Lab, which is up to 100, a millionth: an axis of a gray is 0.
            assert!(
                (x[k] - y[k]).abs() <= 1e-6,
                "{what}: {x:?} instead of {y:?}"
            );
        }
    }
    let Some(got) = &paint.flakes else {
        assert!(original.flakes.is_none(), "{what}");
        return;
    };
    let Some(want) = &original.flakes else {
        // A solid color's clusters are black.
        let corners = got.lower.iter().chain(&got.upper).flatten();
        assert!(
            corners.copied().all(|v| v.abs() <= 1e-6),
            "{what}: not black"
        );
        return;
    };
    for (h, row) in places(&want.theta_h, &got.theta_h).into_iter().enumerate() {
        for (d, column) in places(&want.theta_d, &got.theta_d).into_iter().enumerate() {
            let own = want.slice_at(h * want.theta_d.len() + d);
            let got = got.slice_at(row * got.theta_d.len() + column);
            let mut shares = vec![0.0; own.probability.len()];
            for (k, p) in got.probability.iter().enumerate() {
                // Each cluster lies on a box of the original, to a millionth of a Lab unit or of the corner.
                let near = |(x, y): (&f32, &f32)| {
                    f64::from(x - y).abs() <= 1e-6 * f64::from(y.abs()).max(1.0)
                };
                let on = |j: &usize| {
                    got.lower[k].iter().zip(&own.lower[*j]).all(near)
                        && got.upper[k].iter().zip(&own.upper[*j]).all(near)
                };
                let place = (0..shares.len()).find(on);
                shares[place.unwrap_or_else(|| panic!("{what}: a box of no original"))] += p;
            }
            for (x, y) in shares.iter().zip(own.probability) {
                // Probabilities do not follow the weights at all.
                assert!((x - y).abs() <= 1e-12, "{what}: {x} instead of {y}");
            }
        }
    }
}

#[test]
fn a_billionth_beside_weight_one_is_the_same_paint_to_a_millionth() {
    let a = metallic(21, H, D);
    let b = metallic(22, &[0.0, 20.0], D);
    let c = metallic(23, H, &[0.0, 7.0, 25.0]);
    let (d, e) = (solid(24), solid(27));
    let f = CarPaint {
        color_table: table(&[0.0, 33.0], &[0.0, 10.0, 40.0], 25),
        ..metallic(26, H, D)
    };
    let mixtures: [&[&CarPaint]; 8] = [
        &[&a, &b],
        &[&a, &c],
        &[&a, &d],
        &[&a, &e],
        &[&a, &f],
        &[&a, &b, &c],
        &[&a, &d, &f, &b],
        &[&a, &b, &c, &d, &f],
    ];
    for paints in mixtures {
        let blend = blend(paints);
        for (k, exact) in paints.iter().enumerate() {
            let others = (paints.len() - 1) as f64;
            let weights: Vec<f64> = (0..paints.len())
                .map(|m| if m == k { 1.0 - 1e-9 } else { 1e-9 / others })
                .collect();
            let what = format!("paint {k} of {}", paints.len());
            let paint = realise(&blend, &weights).paint;
            assert_is_nearly(&paint, exact, &what);
            let (near, exact) = (Reflectance::new(&paint), Reflectance::new(exact));
            for (wi, wo) in pairs(200) {
                let y = exact.evaluate(wi, wo, Chi::Table);
                for (x, y) in near.evaluate(wi, wo, Chi::Table).iter().zip(y) {
                    // 1e-9 of parameters no more than 1e3 times each other; ln α moves by 1e-9 · ln 50, D by 745 times
                    // that at the most before it is 0. Below 1e-3 1/sr nobody sees a part in 1e6.
                    assert!(
                        (x - y).abs() <= 1e-6 * (y.abs() + 1e-3),
                        "{what}: {x} instead of {y}"
                    );
                }
            }
        }
    }
}

#[test]
fn masses_of_a_millionth_of_a_millionth_are_not_lost() {
    let mut a = metallic(31, &[0.0], &[0.0]);
    let mut masses = [1e-12; 7];
    masses[3] = 1.0 - 6e-12;
    a.flakes.as_mut().expect("has flakes").probability = masses.to_vec().into();
    let b = metallic(32, &[0.0], &[0.0]);
    let blend = blend(&[&a, &b]);
    let back = realise(&blend, &[1.0, 0.0]).paint;
    let (got, want) = (
        regrouped(back.flakes.as_ref().expect("has"), 0),
        regrouped(a.flakes.as_ref().expect("has"), 0),
    );
    for (x, y) in got.values().zip(want.values()) {
        // A light source's mass is given back by its own units: relatively, not only absolutely.
        assert!((x / y - 1.0).abs() <= 1e-9, "{x:e} instead of {y:e}");
    }
    assert_eq!(got.len(), 7);
}

#[test]
fn masses_of_a_millionth_of_a_millionth_on_both_sides_are_not_lost() {
    let light = |seed: u64, heavy: usize| {
        let mut paint = metallic(seed, &[0.0], &[0.0]);
        let mut masses = [1e-12; 7];
        masses[heavy] = 1.0 - 6e-12;
        paint.flakes.as_mut().expect("has flakes").probability = masses.to_vec().into();
        paint
    };
    for (heavy_a, heavy_b) in [(3, 3), (0, 6), (5, 1)] {
        let paints = [light(33, heavy_a), light(34, heavy_b)];
        let blend = blend(&[&paints[0], &paints[1]]);
        for (k, original) in paints.iter().enumerate() {
            let back = realise(&blend, &unit_weights(2, k)).paint;
            let (got, want) = (
                regrouped(back.flakes.as_ref().expect("has"), 0),
                regrouped(original.flakes.as_ref().expect("has"), 0),
            );
            assert_eq!(got.len(), 7, "{heavy_a} {heavy_b}: a box was lost");
            for (x, y) in got.values().zip(want.values()) {
                // Masses are whole units of 2^-55, and each of at most 13 flows is scaled by one side's mass per unit,
                // which rounding to units moved by half a unit of 36,000: 13 · 2^-56 of the whole, and as many units of
                // a sum that holds them.
                assert!(
                    (x - y).abs() <= 26.0 * 2.0_f64.powi(-55),
                    "{x:e} instead of {y:e}"
                );
            }
        }
    }
}

#[test]
fn paints_that_differ_by_less_than_a_rounding_blend_into_themselves() {
    let a = metallic(41, H, D);
    let mut b = a.clone();
    let mut random = Stream(42);
    let flakes = b.flakes.as_mut().expect("has flakes");
    for corner in flakes.lower.iter_mut().chain(&mut flakes.upper) {
        *corner = corner.map(|v| v + (1e-6 * random.unit()) as f32);
    }
    for (low, high) in flakes.lower.iter().zip(&mut flakes.upper) {
        (0..3).for_each(|k| high[k] = high[k].max(low[k]));
    }
    b.diffuse[0] *= 1.0 + f64::EPSILON;
    let blend = blend(&[&a, &b]);
    // Nothing moves farther than the corners differ: 1e-6 an axis, and an ulp of f32 at 64, 7.6e-6.
    assert!(
        blend.report().mean_cost <= 3.0 * 8.7e-6,
        "{:?}",
        blend.report()
    );
    let half = realise(&blend, &[0.5, 0.5]).paint;
    let means = |p: &CarPaint| Reflectance::new(p).flake_means().to_vec();
    for (x, y) in means(&half)
        .iter()
        .flatten()
        .zip(means(&a).iter().flatten())
    {
        assert!((x - y).abs() <= 1e-6, "{x} {y}");
    }
}

#[test]
fn flakes_fade_out_towards_a_solid_color_and_never_jump() {
    let (metallic, solid) = (metallic(51, H, D), solid(52));
    let blend = blend(&[&metallic, &solid]);
    let energy = |t: f64| -> f64 {
        let paint = realise(&blend, &[1.0 - t, t]).paint;
        Reflectance::new(&paint)
            .flake_means()
            .iter()
            .flatten()
            .map(|v| v.abs())
            .sum()
    };
    let steps: Vec<f64> = (0..=20).map(|k| energy(f64::from(k) / 20.0)).collect();
    assert!(steps.windows(2).all(|w| w[1] <= w[0]), "{steps:?}");
    // Corners are (1 − t) of the metallic's. f moves by its Lab's parts in 116, 500 and 200, light by 3 f² of that, and
    // the rows of the matrix from XYZ, white's 1.09 included, sum to 10.7 in size.
    let flakes = metallic.flakes.as_ref().expect("has flakes");
    let lipschitz: f64 = (0..flakes.slices())
        .flat_map(|k| {
            let slice = flakes.slice_at(k);
            (0..slice.probability.len()).map(move |k| {
                let most = |axis: usize| {
                    f64::from(slice.lower[k][axis].abs().max(slice.upper[k][axis].abs()))
                };
                let slope = most(0) / 116.0 + most(1) / 500.0 + most(2) / 200.0;
                let f = slope + 16.0 / 116.0;
                slice.probability[k] * 10.7 * 3.0 * f * f * slope / std::f64::consts::PI
            })
        })
        .sum();
    let mut times: Vec<f64> = (0..=1000).map(|k| f64::from(k) / 1000.0).collect();
    for near in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15] {
        times.extend([near, 1.0 - near, 0.5 + near]);
    }
    times.sort_by(f64::total_cmp);
    let (mut steepest, mut before) = (0.0_f64, energy(0.0));
    for t in times.windows(2) {
        let after = energy(t[1]);
        let step = t[1] - t[0];
        // Weights, products and sums of corners in 32 bits are as good as a step of 2^-22.
        assert!(
            (after - before).abs() <= lipschitz * (step + 2.0_f64.powi(-22)),
            "{t:?}: {before} to {after}"
        );
        if step > 1e-4 {
            steepest = steepest.max((after - before).abs() / step);
        }
        before = after;
    }
    assert!(steepest > 0.05 * lipschitz, "{steepest} of {lipschitz}");
    // Black's Lab is 0, whose light is (16/116 − 4/29) rounded: no more than EPS.
    assert!(steps[20] <= 36.0 * f64::EPSILON, "{steps:?}");
    assert_is(
        &realise(&blend, &[1.0, 0.0]).paint,
        &metallic,
        "the metallic",
    );
    // The other end keeps the clusters, all of them black, over the solid color's own base.
    let end = realise(&blend, &[0.0, 1.0]).paint;
    assert_has_the_base_of(&end, &solid, "the solid color");
    let black = end.flakes.expect("black ones");
    let corners = black.lower.iter().chain(&black.upper).flatten();
    assert!(corners.clone().count() > 0 && corners.clone().all(|v| *v == 0.0));
}

#[test]
fn differing_grids_blend_on_their_union_and_keep_every_own_slice() {
    let (a, b) = (
        metallic(61, &[0.0, 12.0, 30.0], &[0.0, 25.0]),
        metallic(62, &[5.0, 12.0, 60.0], &[10.0]),
    );
    let blend = blend(&[&a, &b]);
    let (of_a, of_b) = (
        realise(&blend, &[1.0, 0.0]).paint,
        realise(&blend, &[0.0, 1.0]).paint,
    );
    let flakes = of_a.flakes.as_ref().expect("has flakes");
    assert_eq!(flakes.theta_h.degrees(), [0.0, 5.0, 12.0, 30.0, 60.0]);
    assert_eq!(flakes.theta_d.degrees(), [0.0, 10.0, 25.0]);
    assert_is(&of_a, &a, "a");
    assert_is(&of_b, &b, "b");
    // In between a mixture of neighbours has exactly the interpolated mean: the functions are one everywhere.
    for (mixed, own) in [(&of_a, &a), (&of_b, &b)] {
        let (mixed, own) = (Reflectance::new(mixed), Reflectance::new(own));
        for (wi, wo) in pairs(300) {
            let (x, y) = (
                mixed.terms(wi, wo, Chi::Table),
                own.terms(wi, wo, Chi::Table),
            );
            let (x, y) = (x.expect("above"), y.expect("above"));
            for c in 0..3 {
                // Probabilities are regrouped to 1e-12 and colors are below 1.
                assert!((x.flakes[c] - y.flakes[c]).abs() <= 1e-12, "{x:?} {y:?}");
            }
        }
    }
    assert_eq!(blend.report().mixed.len(), 2);
}

/// One instrument writes a twenty-third of 66 degrees with four decimals, another with all: the same slice, no mixture.
#[test]
fn angles_that_were_rounded_otherwise_are_the_same_angles() {
    let exact = [0.0, 66.0 / 23.0, 132.0 / 23.0];
    let rounded = [0.0, 2.8696, 5.7391];
    let made = |seed, angles: &[f64]| CarPaint {
        color_table: table(angles, &[0.0, 45.0], seed),
        ..metallic(seed, angles, &[0.0, 45.0])
    };
    let (a, b) = (made(63, &exact), made(64, &rounded));
    let blend = blend(&[&a, &b]);
    assert!(
        blend.report().mixed.is_empty(),
        "{:?}",
        blend.report().mixed
    );
    for (weights, own) in [([1.0, 0.0], &a), ([0.0, 1.0], &b)] {
        let mut end = realise(&blend, &weights).paint;
        let (flakes, of_own) = (
            end.flakes.as_mut().expect("has"),
            own.flakes.as_ref().expect("has"),
        );
        let colors = &end.color_table;
        for grid in [&flakes.theta_h, colors.theta_h()] {
            assert!(grid.is_near(&of_own.theta_h), "{grid:?}");
        }
        // But for the last digits of its angles the blend's end is the paint, to the bit.
        flakes.theta_h = of_own.theta_h.clone();
        end.color_table = ColorTable::new(
            of_own.theta_h.clone(),
            colors.theta_d().clone(),
            colors.nodes().to_vec(),
            colors.overall(),
        )
        .expect("one color a node");
        assert_is(&end, own, "rounded otherwise");
    }
}

/// A color table on these angles, none of its colors like another.
fn table(theta_h: &[f64], theta_d: &[f64], seed: u64) -> ColorTable {
    let mut random = Stream(seed);
    let mut color = || Lab {
        l: random.within(20.0, 90.0),
        a: random.within(-20.0, 20.0),
        b: random.within(-20.0, 20.0),
    };
    let nodes = (0..theta_h.len() * theta_d.len())
        .map(|_| color())
        .collect();
    let overall = color();
    ColorTable::new(grid(theta_h), grid(theta_d), nodes, overall).expect("one color a node")
}

#[test]
fn differing_grids_of_color_tables_blend_on_their_union_and_keep_every_own_color() {
    let dressed = |seed, color_table| CarPaint {
        color_table,
        ..metallic(seed, H, D)
    };
    let paints = [
        dressed(63, table(&[0.0, 12.0, 50.0], &[0.0, 40.0], 66)),
        dressed(64, table(&[3.0, 12.0, 80.0], &[20.0], 67)),
        dressed(65, table(&[0.0], &[0.0, 40.0, 60.0], 68)),
    ];
    let blend = blend(&paints.iter().collect::<Vec<_>>());
    for (k, own) in paints.iter().enumerate() {
        let back = realise(&blend, &unit_weights(3, k)).paint;
        let angles = (back.color_table.theta_h(), back.color_table.theta_d());
        assert_eq!(angles.0.degrees(), [0.0, 3.0, 12.0, 50.0, 80.0]);
        assert_eq!(angles.1.degrees(), [0.0, 20.0, 40.0, 60.0]);
        assert_is(&back, own, &format!("paint {k}"));
        // In between a node of the union has the interpolated color: the functions are one everywhere.
        let (back, own) = (Reflectance::new(&back), Reflectance::new(own));
        for (wi, wo) in pairs(300) {
            let (x, y) = (
                back.terms(wi, wo, Chi::Table).expect("above"),
                own.terms(wi, wo, Chi::Table).expect("above"),
            );
            for c in 0..3 {
                // A node goes to Lab and back, some twenty roundings of colors of 1; the base multiplies them.
                let accepted = 1e-14 * y.base.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                assert!(
                    (x.base[c] - y.base[c]).abs() <= 10.0 * accepted,
                    "{x:?} {y:?}"
                );
            }
        }
    }
}

#[test]
fn halfway_between_two_peaks_is_one_peak_and_not_two() {
    // Two peaks of ten clusters each, from close together to far apart: halfway lies at 50, where a mixture would have
    // stayed at 20 and at 80. (The tie-break tells two clusters apart from 0.13 L on: 2 ΔL² · 5e-10/D against the prices'
    // 4e-15 D, D = 70.)
    for spacing in [1.0_f32, 0.5, 0.3, 0.2] {
        let spread = |l: f32| -> CarPaint {
            let cluster = |k: u8| {
                let corner = l + f32::from(k) * spacing;
                (0.1, [corner, 0.0, 0.0], [corner + 0.5 * spacing, 0.0, 0.0])
            };
            CarPaint {
                flakes: Some(flakes(
                    &[0.0],
                    &[0.0],
                    &(0..10).map(cluster).collect::<Vec<_>>(),
                )),
                ..solid(71)
            }
        };
        let blend = blend(&[&spread(20.0), &spread(80.0)]);
        let half = realise(&blend, &[0.5, 0.5]).paint.flakes.expect("has");
        assert!(half.probability.len() <= 19);
        // Two halves of corners up to 90: three roundings of 2^-24 each.
        let rounding = 3.0 * 2.0_f32.powi(-24) * 90.0;
        for (low, high) in half.lower.iter().zip(&half.upper) {
            // Monotone: the k-th of one with the k-th of the other, at 50 + k.
            assert!(
                low[0] >= 50.0 - rounding && high[0] <= 50.0 + 9.5 * spacing + rounding,
                "{spacing}: {low:?} {high:?}"
            );
        }
        // And it is as wide as the two it lies between, where the reversed plan of equal cost would have been a point.
        let center = |k: usize| f64::from(half.lower[k][0] + half.upper[k][0]) / 2.0;
        let mean: f64 = (0..half.probability.len())
            .map(|k| half.probability[k] * center(k))
            .sum();
        let spread = (0..half.probability.len())
            .map(|k| half.probability[k] * (center(k) - mean).powi(2))
            .sum::<f64>()
            .sqrt();
        // Ten points apart by the spacing: √((100 − 1)/12) of it, of masses good to 1e-14 and centers to the rounding.
        let want = (99.0_f64 / 12.0).sqrt() * f64::from(spacing);
        assert!(
            (spread - want).abs() <= f64::from(rounding),
            "{spacing}: {spread} instead of {want}"
        );
    }
}

#[test]
fn one_paint_or_six_are_refused_with_their_number() {
    let a = solid(81);
    let ingredients = |n: usize| {
        vec![
            Ingredient {
                name: "a",
                paint: &a
            };
            n
        ]
    };
    for n in [0, 1, 6] {
        let refused = Blend::new(&ingredients(n), &BlendSettings::default(), &|_| ());
        assert_eq!(refused.expect_err("refused"), BlendError::Paints(n));
    }
    let five = Blend::new(&ingredients(5), &BlendSettings::default(), &|_| ()).expect("five");
    five.realise(&RealisationWeights::uniform(vec![0.2; 5]))
        .expect("five weights");
}
