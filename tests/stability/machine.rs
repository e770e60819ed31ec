//! The same numbers on any number of threads, on every run, in every build, and after a hundred million additions.

use crate::paints::{D, H, Stream, blend, metallic, pairs, realise, solid};
use carpaint::blend::{Blend, BlendSettings, Ingredient};
use carpaint::color::LinearRgb;
use carpaint::export::{About, ExportSettings, bundle};
use carpaint::fit::{
    ClusterSettings, Clusterer, CoatChoice, FittedBase, FlakeRecipe, fit_base, reduce_clusters,
    simulate_flakes,
};
use carpaint::measurement::MeasuredBrdf;
use carpaint::paint::{
    CarPaint, Chi, Coat, Direction, Limits, Provenance, Reflectance, Slice, half_angles, mean_color,
};
use carpaint::render::{Scene, Shape, render, texels};
use carpaint::transport::{Cost, Method, Problem, Workspace, solve};
use std::f64::consts::PI;

fn on_threads<T: Send>(threads: usize, work: impl Fn() -> T + Send + Sync) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("a pool").install(&work)
}

/// One answer on 1, 2 and 8 threads, twice each.
fn assert_the_same<T: PartialEq + Send>(what: &str, work: impl Fn() -> T + Send + Sync) {
    let first = on_threads(1, &work);
    for threads in [1, 2, 8, 8] {
        assert!(
            on_threads(threads, &work) == first,
            "{what} differs on {threads} threads"
        );
    }
}

fn about() -> About {
    About {
        name: "same".into(),
        provenance: Provenance {
            source: "sample".into(),
            ..Provenance::default()
        },
        report: serde_json::Value::Null,
    }
}

#[test]
fn one_two_and_eight_threads_give_the_same_bits() {
    let angles: Vec<f64> = (0..9).map(|k| f64::from(k) * 7.0).collect();
    let (a, b) = (metallic(1, &angles, D), metallic(2, &angles, &[0.0, 10.0]));
    assert_the_same("a blend", || blend(&[&a, &b]));
    let blended = blend(&[&a, &b]);
    assert_the_same("its file", || blended.to_bytes());
    let half = realise(&blended, &[0.5, 0.5]).paint;
    assert_the_same("a realisation", || realise(&blended, &[0.5, 0.5]).paint);
    assert_the_same("merged clusters", || {
        reduce_clusters(half.flakes.as_ref().expect("has"), 5)
    });
    assert_the_same("a bundle", || {
        bundle(&half, &about(), &ExportSettings::default()).expect("a bundle")
    });
    let smooth = BlendSettings {
        method: Method::Sinkhorn { epsilon: 0.05 },
        ..BlendSettings::default()
    };
    let given = [&a, &b].map(|paint| Ingredient { name: "one", paint });
    assert_the_same("a smoothed blend", || {
        Blend::new(&given, &smooth, &|_| ())
            .expect("these paints blend")
            .to_bytes()
    });
}

#[test]
fn pictures_and_flakes_have_the_same_bits_on_one_two_and_eight_threads() {
    let paint = metallic(3, H, D);
    let mut scene = Scene::new(Shape::Sphere, [40, 30]);
    scene.samples_per_pixel = 4;
    assert_the_same("a preview", || {
        let drawn = render(&paint, &scene, &Limits::default(), &|_| ()).expect("a picture");
        let told = serde_json::to_string(&drawn.report).expect("JSON");
        (
            drawn.film.to_exr().expect("an EXR"),
            drawn.film.to_png().expect("a PNG"),
            told,
        )
    });
    assert_the_same("texels", || {
        texels(&paint, 10.0, 5.0, [96, 64], 7, &Limits::default()).expect("texels")
    });
    // The way of measured flakes: pictures, clusters, grain and lifetime.
    let recipe = FlakeRecipe {
        texels: 64,
        angles: 5,
        ..FlakeRecipe::default()
    };
    let base = solid(4);
    assert_the_same("flakes of pictures", || {
        let found = simulate_flakes(&base, &recipe, &ClusterSettings::default(), &|_, _| ())
            .expect("flakes");
        (found.flakes, found.clustering, found.warnings)
    });
}

struct Satin;

impl MeasuredBrdf for Satin {
    fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
        let peak = (-half_angles(wi, wo).tan2_h / 0.03).exp();
        Some([0.05 + peak, 0.03 + peak, 0.02 + 0.5 * peak])
    }
}

#[test]
fn a_fit_has_the_same_bits_on_one_two_and_eight_threads() {
    let fit = || -> FittedBase { fit_base(&Satin, CoatChoice::Ior(1.0)).expect("a fit") };
    let first = on_threads(1, fit);
    for threads in [2, 8] {
        assert_eq!(on_threads(threads, fit), first, "{threads} threads");
    }
}

#[test]
fn what_was_computed_before_in_the_same_memory_changes_no_bit() {
    let clouds = |seed: u64, n: usize| -> (Vec<[f64; 3]>, Vec<f64>) {
        let mut random = Stream(seed);
        let points = (0..n)
            .map(|_| [0; 3].map(|_| random.within(0.0, 100.0)))
            .collect();
        (points, (0..n).map(|_| random.within(0.01, 1.0)).collect())
    };
    let mut used = Workspace::default();
    for seed in 0..60 {
        let n = 1 + (seed as usize * 7) % 70;
        let ((s, p), (t, q)) = (clouds(seed, n), clouds(seed + 1000, 71 - n));
        let problem = Problem::new(&s, &p, &t, &q).expect("fine");
        for method in [
            Method::Exact,
            Method::Greedy,
            Method::Sinkhorn { epsilon: 0.5 },
        ] {
            let fresh = solve(&problem, method, Cost::Distance, &mut Workspace::default());
            let again = solve(&problem, method, Cost::Distance, &mut used);
            assert_eq!(
                fresh.expect("solved"),
                again.expect("solved"),
                "{seed}, {method:?}"
            );
        }
    }
}

/// Neumaier's compensated sum: good to an EPS of the sum, whatever its length.
#[derive(Clone, Copy, Default)]
struct Compensated {
    sum: f64,
    lost: f64,
}

impl Compensated {
    fn add(&mut self, value: f64) {
        let sum = self.sum + value;
        self.lost += if self.sum.abs() >= value.abs() {
            (self.sum - sum) + value
        } else {
            (value - sum) + self.sum
        };
        self.sum = sum;
    }

    fn total(self) -> f64 {
        self.sum + self.lost
    }
}

#[test]
fn the_mean_of_a_slice_is_that_of_a_compensated_sum_where_f32_stops_counting() {
    // A hundred million texels of one gray plane, each summed by the clustering in three channels: more than any picture
    // that is accepted, and as many terms as f32 has no chance with.
    let n = 100_000_000_u32;
    let mut random = Stream(4);
    let plane: Vec<f32> = (0..n).map(|_| (0.3 + 0.2 * random.unit()) as f32).collect();
    let settings = ClusterSettings {
        clusters: 1,
        ..ClusterSettings::default()
    };
    let found = Clusterer::default()
        .cluster([&plane; 3], &settings)
        .expect("finite");
    let slice = Slice {
        probability: &found.probability,
        lower: &found.lower,
        upper: &found.upper,
    };
    let (mut exact, mut single) = (Compensated::default(), 0.0_f32);
    for v in &plane {
        exact.add(f64::from(*v));
        single += v;
    }
    let want = exact.total() / f64::from(n);
    for mean in slice.mean() {
        // A running sum in f64 is off by n EPS/2 of itself at the very most, 1.1e-8 here; the box's corners are f32, whose
        // half ulp at L = 115 is 4e-6 of 116 in f, tripled in light and through the matrix: 2e-7 of a light of 1.3/π.
        assert!((mean - want).abs() < 4e-7, "{mean} instead of {want}");
    }
    // From 2^22 on an f32 sum moves in steps of 0.5, and from 2^23 on by whole ones: it stops counting 0.4 altogether.
    assert!(
        (f64::from(single) / f64::from(n) - want).abs() > 0.1,
        "f32 would have been good enough"
    );
}

#[test]
fn the_mean_of_a_slice_of_eight_million_clusters_is_that_of_a_compensated_sum() {
    // The closed form's running sum, in f64 and in order, over 2,000 times the clusters that a paint may have. Its worst
    // error is n/2 EPS of the sum of sizes, 9.3e-10; roundings that fall either way make √n/2 EPS, 3.2e-13, and ten times
    // that is what is held here. Each term is a product and a sum of three products: a few EPS more.
    let n = 1_usize << 23;
    let mut random = Stream(6);
    let probability: Vec<f64> = (0..n).map(|_| random.within(0.5, 1.5) / n as f64).collect();
    let lower: Vec<[f32; 3]> = (0..n)
        .map(|_| [random.within(10.0, 60.0) as f32, 1.0, -2.0])
        .collect();
    let upper: Vec<[f32; 3]> = lower
        .iter()
        .map(|[l, a, b]| [l + 5.0, a + 1.0, b + 1.0])
        .collect();
    let slice = Slice {
        probability: &probability,
        lower: &lower,
        upper: &upper,
    };
    let (mut exact, mut single) = ([Compensated::default(); 3], 0.0_f32);
    for k in 0..n {
        let color = mean_color(lower[k], upper[k]);
        for c in 0..3 {
            exact[c].add(probability[k] * color[c]);
        }
        single += (probability[k] * color[1]) as f32;
    }
    for (mean, exact) in slice.mean().into_iter().zip(exact) {
        let want = exact.total() / PI;
        let accepted = 10.0 * (n as f64).sqrt() / 2.0 * f64::EPSILON;
        assert!(
            (mean / want - 1.0).abs() <= accepted,
            "{mean} instead of {want}"
        );
    }
    assert!(
        (f64::from(single) / exact[1].total() - 1.0).abs() > 1e-5,
        "f32 would have been good enough"
    );
}

/// Numbers of every room from inputs without any rounding, in a fixed order, with the relative tolerance of each.
fn digest() -> Vec<(&'static str, f64, f64)> {
    let eps = f64::EPSILON;
    let (a, b) = (metallic(1, H, D), metallic(2, H, &[0.0, 10.0]));
    let blended: Blend = blend(&[&a, &b]);
    let half: CarPaint = realise(&blended, &[0.5, 0.5]).paint;
    let light = |paint: &CarPaint| {
        let reflectance = Reflectance::new(paint);
        let sum = |(wi, wo): &(Direction, Direction)| reflectance.evaluate(*wi, *wo, Chi::Table)[1];
        pairs(200).iter().map(sum).sum::<f64>() / PI
    };
    let mean = |paint: &CarPaint| paint.flakes.as_ref().expect("has").slice(1, 0).mean()[0];
    let fitted = fit_base(&Satin, CoatChoice::Ior(1.0)).expect("a fit");
    let cloud = |seed: u64| -> (Vec<[f64; 3]>, Vec<f64>) {
        let mut random = Stream(seed);
        let points = (0..50).map(|_| [0; 3].map(|_| random.within(0.0, 100.0)));
        (
            points.collect(),
            (0..50).map(|_| random.within(0.01, 1.0)).collect(),
        )
    };
    let ((s, p), (t, q)) = (cloud(1), cloud(2));
    let problem = Problem::new(&s, &p, &t, &q).expect("fine");
    let plan = solve(
        &problem,
        Method::Exact,
        Cost::Distance,
        &mut Workspace::default(),
    );
    let smooth = solve(
        &problem,
        Method::Sinkhorn { epsilon: 0.05 },
        Cost::Distance,
        &mut Workspace::default(),
    );
    let rough = CarPaint {
        coat: Some(Coat {
            roughness: 0.1,
            ..Coat::smooth(1.5)
        }),
        ..solid(3)
    };
    let highlight = light(&rough);
    let mut random = Stream(7);
    let texels: Vec<f32> = (0..4096).map(|_| random.unit() as f32).collect();
    let found = Clusterer::default().cluster([&texels; 3], &ClusterSettings::default());
    let found = found.expect("finite");
    let clustered = (found.probability.iter().zip(&found.upper))
        .map(|(p, upper)| p * f64::from(upper[0]))
        .sum();
    let mut scene = Scene::new(Shape::Sphere, [32, 32]);
    scene.samples_per_pixel = 4;
    let drawn = render(&a, &scene, &Limits::default(), &|_| ()).expect("a picture");
    let pixels = drawn.film.pixels().iter().flatten().map(|v| f64::from(*v));
    let lab = carpaint::color::Lab::from_rgb([0.7, 0.1, 0.02]);
    let other = carpaint::color::Lab::from_rgb([0.6, 0.15, 0.02]);
    vec![
        // Two cube roots that may differ by an ulp between libraries, times 500.
        ("color.lab_a", lab.a, 64.0 * eps),
        // Some forty operations, powers and trigonometry among them.
        (
            "color.difference",
            carpaint::color::ciede2000(lab, other),
            1e-13,
        ),
        // Lobes: the exponent, up to 100 where it counts, multiplies an ulp of its argument.
        ("paint.light", light(&a), 1e-12),
        ("paint.flakes", mean(&a), 1e-13),
        (
            "paint.energy",
            carpaint::paint::certify(&a).albedo[0],
            1e-12,
        ),
        // A cost is promised to 1e-9 by any plan, to rounding by the same one.
        ("blend.cost", blended.report().mean_cost, 1e-12),
        ("blend.light", light(&half), 1e-9),
        ("blend.flakes", mean(&half), 1e-9),
        // Where a descent ends: its stopping rule is 1e-9 of the cost, whose root the parameters are good to, and a start
        // more or less decides nothing here.
        ("fit.width", fitted.lobes[0].alpha, 1e-4),
        ("transport.cost", plan.expect("solved").cost, 1e-12),
        // Pixels are f32: 3,072 of them, whose roundings of 2^-24 in each of some hundred operations fall either way; but one
        // that picks another flake for a rounding differs by its whole light, a thousandth of the picture.
        ("render.light", pixels.sum::<f64>(), 1e-3),
        ("paint.coat", highlight, 1e-12),
        // A sum of texels and the cube roots of two corners, which are f32: an ulp of those.
        ("fit.clusters", clustered, 1e-6),
        // Stops at a residual of its masses, after as many steps; its dual sum moves by as little.
        ("transport.smooth", smooth.expect("solved").cost, 1e-9),
    ]
}

/// What [`digest`] gave in a build of the profile `dev` on x86-64. No test runs both builds: whichever is tested is held to
/// these numbers, `cargo test` and `cargo test --release` alike, and two that meet them agree to twice the tolerance.
const DIGEST: [(&str, f64); 14] = [
    ("color.lab_a", 48.065_824_920_177_135),
    ("color.difference", 7.890_569_434_651_515),
    ("paint.light", 10_150.650_871_189_984),
    ("paint.flakes", 0.024_615_349_186_518_184),
    ("paint.energy", 0.428_705_859_640_638_9),
    ("blend.cost", 21.028_432_684_714_286),
    ("blend.light", 8_486.120_524_845_85),
    ("blend.flakes", 0.037_126_390_359_910_57),
    ("fit.width", 0.169_042_248_672_450_24),
    ("transport.cost", 24.014_615_716_711_106),
    ("render.light", 644.088_590_264_320_4),
    ("paint.coat", 1_018.895_553_386_850_5),
    ("fit.clusters", 112.787_367_970_682_68),
    ("transport.smooth", 24.062_643_337_004_566),
];

#[test]
fn every_build_computes_the_numbers_that_were_written_down() {
    let (mut off, digest) = (Vec::new(), digest());
    for ((name, got, tolerance), (known, want)) in digest.into_iter().zip(DIGEST) {
        assert_eq!(name, known);
        if (got - want).abs() > tolerance * want.abs() {
            off.push(format!("(\"{name}\", {got:?}) instead of {want:?}"));
        }
    }
    assert!(off.is_empty(), "{}", off.join("\n"));
}
