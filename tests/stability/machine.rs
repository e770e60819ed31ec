//! The same numbers on any number of threads, on every run, in every build, and after a hundred million additions.

use crate::paints::{D, H, Stream, blend, metallic, pairs, realise, solid};
use carpaint::blend::{Blend, BlendSettings};
use carpaint::color::LinearRgb;
use carpaint::export::{About, ExportSettings, bundle};
use carpaint::fit::{
    ClusterSettings, Clusterer, CoatChoice, FittedBase, fit_base, reduce_clusters,
};
use carpaint::measurement::MeasuredBrdf;
use carpaint::paint::{CarPaint, Chi, Direction, Provenance, Reflectance, Slice, half_angles};
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
    // As large as a default test should be: 8 million texels, 25 million values in one slice.
    let n = 1_u32 << 23;
    let mut random = Stream(4);
    let planes: [Vec<f32>; 3] =
        std::array::from_fn(|_| (0..n).map(|_| (0.3 + 0.2 * random.unit()) as f32).collect());
    let settings = ClusterSettings {
        clusters: 1,
        ..ClusterSettings::default()
    };
    let found = Clusterer::default()
        .cluster(planes.each_ref().map(Vec::as_slice), &settings)
        .expect("finite");
    let mean = Slice {
        probability: &found.probability,
        lower: &found.lower,
        upper: &found.upper,
    }
    .mean();
    for c in 0..3 {
        let (mut exact, mut single) = (Compensated::default(), 0.0_f32);
        for v in &planes[c] {
            exact.add(f64::from(*v));
            single += v;
        }
        let want = exact.total() / f64::from(n);
        // A running sum in f64 is off by n EPS/2 at the very most, 1e-9 here; the box's corners are f32, whose half ulp
        // at L = 115 is 4e-6 of 116 in f, tripled in light and through the matrix: 2e-7 of a light of 1.3/π.
        assert!(
            (mean[c] - want).abs() < 4e-7,
            "{} instead of {want}",
            mean[c]
        );
        // From 2^22 on an f32 sum moves in steps of 0.5 and loses a good part of each addition of 0.4.
        assert!(
            (f64::from(single) / f64::from(n) - want).abs() > 1e-4,
            "f32 would have been good enough"
        );
    }
}

#[test]
fn a_hundred_million_evaluations_sum_to_what_a_compensated_sum_says() {
    // The running sums of the house are plain f64 in a fixed order, over at most the 4 Mi texels of a slice, which the
    // test above runs whole; here the same rule has 24 times as many terms. Its worst error is n/2 EPS of the sum of sizes,
    // 1.1e-8 for 1e8 values; roundings that fall either way make √n/2 EPS, 1.1e-12. These values come round again and
    // again, and their roundings with them: between the two.
    let paint = solid(5);
    let reflectance = Reflectance::new(&paint);
    let values: Vec<f64> = pairs(1000)
        .into_iter()
        .map(|(wi, wo)| reflectance.evaluate(wi, wo, Chi::Table)[1])
        .collect();
    let (mut plain, mut exact, mut single) = (0.0_f64, Compensated::default(), 0.0_f32);
    for _ in 0..100_000 {
        for &v in &values {
            plain += v;
            exact.add(v);
            single += v as f32;
        }
    }
    let want = exact.total();
    assert!(
        (plain / want - 1.0).abs() < 1e8 / 2.0 * f64::EPSILON,
        "{plain} instead of {want}"
    );
    // An exact answer exists: 1e5 times the sum of a thousand, which a thousand roundings cannot spoil.
    let mut once = Compensated::default();
    for v in &values {
        once.add(*v);
    }
    assert!((want / (1e5 * once.total()) - 1.0).abs() < 4.0 * f64::EPSILON);
    assert!(
        (f64::from(single) / want - 1.0).abs() > 1e-3,
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
        (
            "blend.settings",
            f64::from(u8::from(*blended.settings() == BlendSettings::default())),
            0.0,
        ),
    ]
}

/// What [`digest`] gave in an unoptimised build on x86-64; a release build and another machine must give it too.
const DIGEST: [(&str, f64); 9] = [
    ("color.lab_a", 48.065_824_920_177_135),
    ("color.difference", 7.890_569_434_651_515),
    ("paint.light", 10_150.650_871_189_984),
    ("paint.flakes", 0.024_615_349_186_518_184),
    ("paint.energy", 0.428_705_192_042_741_2),
    ("blend.cost", 21.028_432_684_714_286),
    ("blend.light", 8_486.120_524_845_85),
    ("blend.flakes", 0.037_126_390_359_910_57),
    ("blend.settings", 1.0),
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
