//! Laws of blends on small paints made by hand.

use super::*;
use crate::color::Lab;
use crate::paint::{Chi, Flakes, Limits, Reflectance};
use proptest::prelude::*;

fn grid(degrees: &[f64]) -> AngleGrid {
    AngleGrid::new(degrees.to_vec()).expect("ascending")
}

/// A paint whose every number depends on `seed`, with slices on the given angles.
fn paint(seed: u32, theta_h: &[f64], theta_d: &[f64]) -> CarPaint {
    let mut state = seed;
    let mut next = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / 16_777_216.0
    };
    let mut flakes = Flakes {
        theta_h: grid(theta_h),
        theta_d: grid(theta_d),
        offsets: vec![0].into(),
        probability: vec![].into(),
        lower: Vec::new(),
        upper: Vec::new(),
        texture: FlakeTexture {
            texel_um: 20.0,
            grain_um: 10.0 + 10.0 * next(),
            lifetime_deg: [3.0 + next(), 20.0],
            persistence_deg: [6.0 + next(), 40.0],
        },
    };
    for _ in 0..flakes.slices() {
        let masses: Vec<f64> = (0..7).map(|_| 0.05 + next()).collect();
        let sum: f64 = masses.iter().sum();
        for mass in masses {
            let corner: [f32; 3] = [
                (60.0 * next()) as f32,
                (40.0 * next() - 20.0) as f32,
                (40.0 * next() - 20.0) as f32,
            ];
            flakes.probability.push(mass / sum);
            flakes.lower.push(corner);
            flakes.upper.push(corner.map(|c| c + (9.0 * next()) as f32));
        }
        flakes.offsets.push(flakes.probability.len() as u32);
    }
    let nodes = (0..4)
        .map(|_| Lab {
            l: 40.0 + 50.0 * next(),
            a: 30.0 * next(),
            b: -30.0 * next(),
        })
        .collect();
    CarPaint {
        coat: (!seed.is_multiple_of(3)).then(|| Coat {
            ior: 1.4 + 0.2 * next(),
            roughness: 0.02,
            thickness_um: None,
        }),
        diffuse: [next(), next(), next()],
        lobes: (0..3)
            .map(|k| Lobe {
                weight: [next(), next(), next()],
                alpha: 0.08 * 2.0_f64.powi(k) * (1.0 + next()),
                f0: next(),
            })
            .collect(),
        color_table: ColorTable::new(
            grid(&[0.0, 50.0]),
            grid(&[0.0, 40.0]),
            nodes,
            Lab {
                l: 70.0,
                a: 0.0,
                b: 0.0,
            },
        )
        .expect("fits"),
        flakes: Some(flakes),
    }
}

const H: &[f64] = &[0.0, 12.0, 30.0];
const D: &[f64] = &[0.0, 25.0];

fn blend(paints: &[&CarPaint]) -> Blend {
    let names = ["first", "second", "third", "fourth", "fifth"];
    let ingredients: Vec<Ingredient<'_>> = paints
        .iter()
        .zip(names)
        .map(|(paint, name)| Ingredient { name, paint })
        .collect();
    Blend::new(&ingredients, &BlendSettings::default(), &|_| ()).expect("blends")
}

fn at(blend: &Blend, weights: &[f64]) -> CarPaint {
    let realised = blend
        .realise(&RealisationWeights::uniform(weights.to_vec()))
        .expect("weights fit");
    realised
        .paint
        .validate(&Limits::default())
        .expect("a realisation is a valid paint");
    realised.paint
}

/// Probability of each distinct box of a slice.
fn distribution(flakes: &Flakes, slice: usize) -> Vec<([u32; 6], f64)> {
    let slice = flakes.slice_at(slice);
    let mut boxes: Vec<([u32; 6], f64)> = Vec::new();
    for k in 0..slice.probability.len() {
        let (l, u) = (
            slice.lower[k].map(|v| (v + 0.0).to_bits()),
            slice.upper[k].map(|v| (v + 0.0).to_bits()),
        );
        boxes.push(([l[0], l[1], l[2], u[0], u[1], u[2]], slice.probability[k]));
    }
    boxes.sort_by_key(|b| b.0);
    boxes.dedup_by(|later, first| {
        let same = later.0 == first.0;
        if same {
            first.1 += later.1;
        }
        same
    });
    boxes
}

fn same_distributions(x: &Flakes, y: &Flakes) {
    for slice in 0..x.slices() {
        let (x, y) = (distribution(x, slice), distribution(y, slice));
        assert_eq!(x.len(), y.len());
        for (x, y) in x.iter().zip(&y) {
            assert_eq!(x.0, y.0, "boxes are the original's, bit for bit");
            assert!((x.1 - y.1).abs() < 1e-12);
        }
    }
}

fn active(lobes: &[Lobe]) -> Vec<Lobe> {
    let mut lobes: Vec<Lobe> = lobes.iter().copied().filter(|l| !l.is_absent()).collect();
    lobes.sort_by(|x, y| x.alpha.total_cmp(&y.alpha));
    lobes
}

#[test]
fn at_weight_one_a_blend_is_that_paint() {
    let paints: Vec<CarPaint> = [1, 2, 3].map(|seed| paint(seed, H, D)).into();
    for count in [2, 3] {
        let all: Vec<&CarPaint> = paints[..count].iter().collect();
        let blend = blend(&all);
        for (k, original) in all.iter().enumerate() {
            let mut weights = vec![0.0; count];
            weights[k] = 1.0;
            let paint = at(&blend, &weights);
            assert_eq!(paint.coat, original.coat);
            assert_eq!(paint.diffuse, original.diffuse);
            assert_eq!(paint.lobes, active(&original.lobes));
            assert_eq!(paint.color_table, original.color_table);
            let (got, want) = (
                paint.flakes.expect("has flakes"),
                original.flakes.as_ref().expect("has flakes"),
            );
            assert_eq!(got.texture, want.texture);
            same_distributions(&got, want);
        }
    }
}

#[test]
fn a_blend_and_its_reverse_are_one() {
    let (a, b) = (paint(4, H, D), paint(5, H, &[0.0, 10.0, 25.0]));
    let (forth, back) = (blend(&[&a, &b]), blend(&[&b, &a]));
    for t in [0.0, 0.2, 0.5, 1.0, -2.0, 3.5] {
        assert_eq!(at(&forth, &[1.0 - t, t]), at(&back, &[t, 1.0 - t]));
    }
}

fn blend_by(paints: &[&CarPaint], settings: &BlendSettings) -> Blend {
    let ingredients: Vec<Ingredient<'_>> = paints
        .iter()
        .map(|paint| Ingredient { name: "p", paint })
        .collect();
    Blend::new(&ingredients, settings, &|_| ()).expect("blends")
}

/// Sum over all pairs of the mean distances, and the report.
fn pairwise(blend: &Blend) -> f64 {
    blend.report().pairs.iter().map(|p| p.mean_cost).sum()
}

#[test]
fn the_cheapest_order_is_never_dearer_than_the_canonical_one_and_once_cheaper() {
    let mut cheaper = 0;
    for seed in 0..8 {
        let paints: Vec<CarPaint> = (0..4)
            .map(|k| paint(100 * seed + k, &[0.0, 20.0], &[0.0]))
            .collect();
        let paints: Vec<&CarPaint> = paints.iter().collect();
        let of = |order| {
            let settings = BlendSettings {
                order,
                ..BlendSettings::default()
            };
            blend_by(&paints, &settings)
        };
        let canonical = of(Order::Canonical);
        let cheapest = of(Order::Cheapest);
        // Two slices are few enough to be all tried.
        assert_eq!(of(Order::Sampled).report().order, cheapest.report().order);
        let (most, least) = (pairwise(&canonical), pairwise(&cheapest));
        assert!(least <= most * (1.0 + 1e-12), "{least} {most}");
        cheaper += usize::from(least < most * (1.0 - 1e-6));
        assert_eq!(canonical.report().order, [0, 1, 2, 3]);
        for own in 0..4 {
            let mut weights = [0.0; 4];
            weights[own] = 1.0;
            let alone = at(&cheapest, &weights).flakes.expect("flakes");
            same_distributions(&alone, paints[own].flakes.as_ref().expect("flakes"));
        }
    }
    assert!(cheaper > 0, "an order never mattered");
}

#[test]
fn a_few_slices_tell_the_order_in_which_all_are_joined() {
    let axis: Vec<f64> = (0..7).map(|k| 10.0 * f64::from(k)).collect();
    let paints: Vec<CarPaint> = (0..3).map(|seed| paint(seed, &axis, &axis)).collect();
    let ingredients: Vec<Ingredient<'_>> = paints
        .iter()
        .map(|paint| Ingredient { name: "p", paint })
        .collect();
    let settings = BlendSettings::default();
    assert_eq!(settings.order, Order::Sampled);
    let on_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let shares = std::sync::Mutex::new(Vec::new());
        let tell = |share: f32| shares.lock().expect("whole").push(share);
        let blend = pool
            .expect("threads")
            .install(|| Blend::new(&ingredients, &settings, &tell));
        let mut shares = shares.into_inner().expect("whole");
        shares.sort_by(f32::total_cmp);
        (blend.expect("blends"), shares)
    };
    let (blend, shares) = on_threads(1);
    let few = Order::Sampled.telling([7, 7], 3).len();
    assert!(few < 49);
    // The few in three orders and all in one are told of at every 64th and at the end.
    assert_eq!(shares, [64.0 / (3 * few + 49) as f32, 1.0]);
    let bytes = blend.to_bytes().expect("finite");
    assert!(bytes == on_threads(8).0.to_bytes().expect("finite"));
    let grid = || AngleGrid::new(axis.clone()).expect("ascends");
    let look = |joined: &[usize]| {
        let look = Look {
            angles: [grid(), grid()],
            joined,
        };
        let blend = Blend::on(&ingredients, &settings, Some(look), &|_| ());
        blend.expect("blends").to_bytes().expect("finite")
    };
    let told = &blend.report().order;
    for order in super::order::orders(3, Order::Cheapest) {
        assert_eq!(look(&order) == bytes, order == *told, "{order:?} {told:?}");
    }
}

#[test]
fn every_pair_says_how_far_it_is_from_the_best_of_its_own() {
    let paints: Vec<CarPaint> = (1..4)
        .map(|seed| paint(seed, &[0.0, 30.0], &[0.0, 20.0]))
        .collect();
    let paints: Vec<&CarPaint> = paints.iter().collect();
    let of = |method| {
        let settings = BlendSettings {
            method,
            ..BlendSettings::default()
        };
        (
            blend_by(&paints[..2], &settings),
            blend_by(&paints, &settings),
        )
    };
    let (two, three) = of(crate::transport::Method::Exact);
    let [pair] = &two.report().pairs[..] else {
        panic!("{:?}", two.report());
    };
    assert!(pair.largest_gap <= 1e-6 && pair.checked == 4, "{pair:?}");
    assert!((pair.mean_cost - two.report().mean_cost).abs() < 1e-5);
    assert_eq!(three.report().pairs.len(), 3);
    // Whatever joins three, no pair of them is cheaper than by itself.
    let alone = &three.report().pairs[0];
    assert_eq!(alone.paints, [0, 1]);
    assert!(three.report().pairs.iter().any(|p| p.mean_gap > 1e-3));
    let (greedy, _) = of(crate::transport::Method::Greedy);
    let excess = greedy.report().pairs[0].mean_cost - pair.mean_cost;
    assert!(excess >= -1e-9 && greedy.report().pairs[0].mean_gap >= excess - 1e-9);
}

#[test]
fn slices_on_which_smoothing_does_not_converge_are_smoothed_more_and_counted() {
    // Of slices of seven clusters one in forty does not converge at a smoothing of a billionth.
    let angles: Vec<f64> = (0..12).map(|k| 5.0 * f64::from(k)).collect();
    let paints = [3, 4].map(|seed| paint(seed, &angles, &angles));
    let paints: Vec<&CarPaint> = paints.iter().collect();
    let by = |epsilon| {
        let settings = BlendSettings {
            method: crate::transport::Method::Sinkhorn { epsilon },
            ..BlendSettings::default()
        };
        blend_by(&paints, &settings)
    };
    let (fine, coarse) = (by(1e-9), by(10.0));
    assert!(fine.report.smoothed_more > 0, "{:?}", fine.report);
    assert_eq!(coarse.report.smoothed_more, 0);
    assert!(fine.report.mean_cost < coarse.report.mean_cost);
}

#[test]
fn next_to_weight_one_it_is_the_same_to_a_millionth() {
    let (a, b) = (paint(6, H, D), paint(7, &[0.0, 20.0], D));
    let blend = blend(&[&a, &b]);
    let near = at(&blend, &[1.0 - 1e-9, 1e-9]);
    let (near, exact) = (Reflectance::new(&near), Reflectance::new(&a));
    for k in 0..40 {
        let (t, p) = (0.02 + 0.035 * f64::from(k), f64::from(k));
        let (wi, wo) = (
            [t.sin() * p.cos(), t.sin() * p.sin(), t.cos()],
            [-(0.5 * t).sin(), 0.0, (0.5 * t).cos()],
        );
        for (x, y) in
            near.evaluate(wi, wo, Chi::Table)
                .iter()
                .zip(exact.evaluate(wi, wo, Chi::Table))
        {
            assert!((x - y).abs() <= 1e-6 * (y.abs() + 1e-3), "{x} {y}");
        }
    }
}

#[test]
fn a_realisation_over_an_old_one_is_that_of_new_memory() {
    let pair = blend(&[&paint(6, H, D), &paint(7, &[0.0, 20.0], D)]);
    let mut solid = paint(11, H, D);
    solid.flakes = None;
    let other = blend(&[&paint(10, &[0.0], D), &solid]);
    let weights = |w: f64| RealisationWeights::uniform(vec![w, 1.0 - w]);
    let mut old = other.realise(&weights(0.3)).expect("realised");
    for w in [0.5, 1.0, 1.4, -0.7, 9.0, 0.0] {
        old = pair.realise_over(&weights(w), old).expect("realised");
        assert_eq!(old, pair.realise(&weights(w)).expect("realised"));
    }
    assert!(pair.realise_over(&weights(f64::NAN), old).is_err());
}

#[test]
fn realisations_share_what_no_weight_changes() {
    let pair = blend(&[&paint(6, H, D), &paint(7, H, D)]);
    let [one, other] = [0.2, 1.3].map(|w| at(&pair, &[w, 1.0 - w]).flakes.expect("has flakes"));
    assert!(std::ptr::eq(
        one.probability.as_ptr(),
        other.probability.as_ptr()
    ));
    assert!(std::ptr::eq(one.offsets.as_ptr(), other.offsets.as_ptr()));
}

#[test]
fn the_halfway_of_two_spikes_is_a_spike() {
    let spike = |l: f32| {
        let mut paint = paint(8, &[0.0], &[0.0]);
        let flakes = paint.flakes.as_mut().expect("has flakes");
        (flakes.offsets, flakes.probability) = (vec![0, 1].into(), vec![1.0].into());
        (flakes.lower, flakes.upper) = (vec![[l, 0.0, 0.0]], vec![[l, 0.0, 0.0]]);
        paint
    };
    let half = at(&blend(&[&spike(20.0), &spike(80.0)]), &[0.5, 0.5])
        .flakes
        .expect("has flakes");
    assert_eq!(
        (half.lower, half.probability),
        (vec![[50.0, 0.0, 0.0]], vec![1.0].into())
    );
}

#[test]
fn flakes_fade_into_a_solid_color() {
    let (metallic, mut solid) = (paint(10, H, D), paint(11, H, D));
    solid.flakes = None;
    let blend = blend(&[&metallic, &solid]);
    let none = at(&blend, &[0.0, 1.0]);
    assert!(
        Reflectance::new(&none)
            .flake_means()
            .iter()
            .flatten()
            .all(|v| v.abs() < 1e-12)
    );
    assert_eq!(
        at(&blend, &[0.4, 0.6]).flakes.expect("has").texture,
        metallic.flakes.expect("has").texture
    );
}

#[test]
fn each_part_follows_its_own_weights() {
    let (a, b) = (paint(13, H, D), paint(14, H, D));
    let blend = blend(&[&a, &b]);
    let mut weights = RealisationWeights::uniform(vec![1.0, 0.0]);
    weights.flake_lightness = Some(vec![0.0, 1.0]);
    weights.flake_saturation = 0.0;
    let mixed = blend.realise(&weights).expect("fits").paint;
    let (of_a, of_b) = (at(&blend, &[1.0, 0.0]), at(&blend, &[0.0, 1.0]));
    assert_eq!(
        (mixed.diffuse, &mixed.color_table),
        (of_a.diffuse, &of_a.color_table)
    );
    let (mixed, of_b) = (mixed.flakes.expect("has"), of_b.flakes.expect("has"));
    assert!(
        mixed
            .lower
            .iter()
            .zip(&of_b.lower)
            .all(|(x, y)| x[0] == y[0] && x[1] == 0.0 && x[2] == 0.0)
    );
    assert_eq!(mixed.texture, of_b.texture);
}

#[test]
fn far_weights_stay_valid_and_say_what_was_held() {
    let blend = blend(&[&paint(16, H, D), &paint(17, H, D)]);
    for far in [
        [-2.0, 3.0],
        [0.0, 0.0],
        [1e6, -1e6],
        [1e12, 1e12],
        [1e-12, 0.0],
        [-3.0, 4.0],
    ] {
        let realised = blend
            .realise(&RealisationWeights::uniform(far.to_vec()))
            .expect("finite weights");
        realised.paint.validate(&Limits::default()).expect("valid");
        let reflectance = Reflectance::new(&realised.paint);
        let f = reflectance.evaluate([0.0, 0.6, 0.8], [0.6, 0.0, 0.8], Chi::Table);
        assert!(
            f.iter().all(|v| v.is_finite() && *v >= 0.0),
            "{far:?}: {f:?}"
        );
    }
    let clamps = blend
        .realise(&RealisationWeights::uniform(vec![-3.0, 4.0]))
        .expect("finite")
        .clamps;
    assert!(
        clamps
            .iter()
            .any(|c| c.field == "flakes.boxes" && c.count > 0 && c.worst > 0.0),
        "{clamps:?}"
    );
}

#[test]
fn colors_of_a_table_that_leave_the_range_are_held_and_counted() {
    let (a, b) = (paint(16, H, D), paint(17, H, D));
    let weights = [-60.0, 100.0];
    let realised = blend(&[&a, &b])
        .realise(&RealisationWeights::uniform(weights.to_vec()))
        .expect("finite");
    let labs = |paint: &CarPaint| -> Vec<f64> {
        let table = &paint.color_table;
        let all = table.nodes().iter().copied().chain([table.overall()]);
        all.flat_map(Lab::to_array).collect()
    };
    let pairs = labs(&a).into_iter().zip(labs(&b));
    let sums: Vec<f64> = pairs
        .map(|(a, b)| weights[0] * a + weights[1] * b)
        .collect();
    let beyond = || {
        sums.iter()
            .map(|v| v.abs() - 2000.0)
            .filter(|far| *far > 0.0)
    };
    let told = realised.clamps.iter().find(|c| c.field == "color_table");
    let told = told.expect("a lightness of 70 goes to 2800");
    assert_eq!((told.count, told.of), (beyond().count(), sums.len()));
    assert!((told.worst - beyond().fold(0.0, f64::max)).abs() < 1e-9);
    for (held, sum) in labs(&realised.paint).iter().zip(&sums) {
        assert!(
            (held - sum.clamp(-2000.0, 2000.0)).abs() < 1e-9,
            "{held} {sum}"
        );
    }
}

#[test]
fn weights_that_are_none_are_refused_by_field_and_value() {
    let blend = blend(&[&paint(19, H, D), &paint(20, H, D)]);
    let error = |w: RealisationWeights| blend.realise(&w).expect_err("refused").to_string();
    assert!(error(RealisationWeights::uniform(vec![1.0])).contains("needs 2: first, second"));
    assert!(error(RealisationWeights::uniform(vec![f64::NAN, 1.0])).contains("weights[0] is NaN"));
    let mut weights = RealisationWeights::uniform(vec![1.0, 0.0]);
    weights.base = Some(vec![0.0, f64::INFINITY]);
    assert!(error(weights).contains("base[1] is inf"));
}

#[test]
fn a_file_gives_the_blend_back() {
    let blend = blend(&[
        &paint(22, H, D),
        &paint(23, &[0.0, 40.0], D),
        &paint(24, H, D),
    ]);
    let bytes = blend.to_bytes().expect("finite");
    assert_eq!(
        Blend::from_bytes(&bytes, &Limits::default()).expect("reads"),
        blend
    );
    let cut = Blend::from_bytes(&bytes[..bytes.len() - 7], &Limits::default());
    assert!(cut.expect_err("cut").to_string().contains("damaged"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    /// Every box corner moves linearly, so no realisation is further from its neighbour than the weights' step times
    /// the sum of the largest corners.
    #[test]
    fn a_small_step_of_the_weights_is_a_small_step_of_the_boxes(t in -2.0..3.0_f64, step in -1e-3..1e-3_f64) {
        let blend = blend(&[&paint(25, H, D), &paint(26, H, D)]);
        let (x, y) = (at(&blend, &[1.0 - t, t]), at(&blend, &[1.0 - t - step, t + step]));
        let (x, y) = (x.flakes.expect("has"), y.flakes.expect("has"));
        for (x, y) in x.lower.iter().chain(&x.upper).zip(y.lower.iter().chain(&y.upper)) {
            for axis in 0..3 {
                // Corners lie within ±70 Lab; f32 rounds at 2^-24 of a few hundred.
                prop_assert!(f64::from((x[axis] - y[axis]).abs()) <= step.abs() * 140.0 + 1e-4);
            }
        }
    }
}
