//! Checks of transport, blend, realisation, and of the machine under them.

use std::collections::BTreeMap;

use super::{Check, Subject, worse};
use crate::blend::{Blend, BlendSettings, Ingredient, RealisationWeights};
use crate::color::ciede2000;
use crate::fit::Stream;
use crate::paint::{AngleGrid, CarPaint, Chi, Flakes, LEAST_STEP_DEG, Limits, Lobe, Reflectance};
use crate::transport::{Cost, Method, Plan, Problem, Workspace, solve};

/// Slices that are transported one by one.
const SLICES: usize = 100;
/// Of those, every how many-th is also given to the linear program.
const WITH_LP_EVERY: usize = 10;
/// Pairs of clusters after which no further slice is transported: a hundred slices of 400 clusters.
const MOST_PAIRS: usize = 16_000_000;
/// Pairs of clusters that a linear program is asked about; it takes seconds with more.
const MOST_LP_PAIRS: usize = 128 * 128;

/// Cluster centers and probabilities of slice `k`, counted round; a paint without flakes is one black cluster.
fn cloud(paint: &CarPaint, k: usize) -> (Vec<[f64; 3]>, Vec<f64>) {
    let Some(flakes) = &paint.flakes else {
        return (vec![[0.0; 3]], vec![1.0]);
    };
    let slice = flakes.slice_at(k % flakes.slices());
    (0..slice.probability.len())
        .filter(|&c| slice.probability[c] > 0.0)
        .map(|c| (slice.center(c), slice.probability[c]))
        .unzip()
}

/// How far the plan's marginals are from the problem's masses at the worst.
fn marginal_error(problem: &Problem, plan: &Plan) -> f64 {
    let mut sent: Vec<f64> = problem.source().masses().to_vec();
    let mut got: Vec<f64> = problem.target().masses().to_vec();
    for entry in &plan.entries {
        sent[entry.source] -= entry.mass;
        got[entry.target] -= entry.mass;
    }
    sent.iter().chain(&got).fold(0.0, |m, v| worse(m, v.abs()))
}

/// The exact solver on slices of both paints: marginals, its own certificate, and another solver.
pub(super) fn transport(subject: &Subject<'_>) -> Vec<Check> {
    let mut workspace = Workspace::default();
    let (mut refused, mut silent, mut compared, mut too_large) = (0, 0, 0, 0);
    let (mut transported, mut pairs) = (0, 0);
    let (mut marginal, mut gap, mut apart) = (0.0_f64, 0.0_f64, 0.0_f64);
    for k in 0..SLICES {
        // Steps that are prime to most grids visit slices all over them.
        let ((s, p), (t, q)) = (cloud(subject.paint, 37 * k), cloud(subject.partner, 37 * k));
        if pairs >= MOST_PAIRS {
            break;
        }
        transported += 1;
        pairs += s.len() * t.len();
        let Ok(problem) = Problem::new(&s, &p, &t, &q) else {
            refused += 1;
            continue;
        };
        let Ok(plan) = solve(&problem, Method::Exact, Cost::Distance, &mut workspace) else {
            refused += 1;
            continue;
        };
        marginal = worse(marginal, marginal_error(&problem, &plan));
        gap = worse(gap, plan.gap / (plan.cost + 1e-3));
        if k % WITH_LP_EVERY != 0 {
            continue;
        }
        if s.len() * t.len() > MOST_LP_PAIRS {
            too_large += 1;
        } else {
            match solve(
                &problem,
                Method::LinearProgram,
                Cost::Distance,
                &mut workspace,
            ) {
                Ok(other) => {
                    compared += 1;
                    apart = worse(apart, (other.cost - plan.cost).abs() / (plan.cost + 1e-3));
                }
                Err(_) => silent += 1,
            }
        }
    }
    let mut checks = vec![
        Check::none(
            format!("transport of {transported} slices"),
            refused,
            "slices refused",
        ),
        Check::at_most(
            "masses before and after transport",
            marginal,
            1e-12,
            "of a mass of 1",
        ),
        Check::at_most("gap to the dual bound", gap, 1e-9, "of the cost"),
    ];
    if too_large > 0 {
        // Said, and no fault: other checks hold the plans of these slices.
        checks.push(Check::at_most(
            "slices too large to ask a linear program about",
            f64::from(too_large),
            10.0,
            "of 10 slices",
        ));
    }
    if compared > 0 {
        checks.push(Check::at_most(
            "cost against a linear program's",
            apart,
            1e-9,
            "of the cost",
        ));
    }
    checks.push(Check::at_most(
        "the linear program gave no answer",
        f64::from(silent),
        5.0,
        "of 10 slices",
    ));
    checks
}

fn blend(first: &CarPaint, second: &CarPaint) -> Option<Blend> {
    let ingredients =
        [("first", first), ("second", second)].map(|(name, paint)| Ingredient { name, paint });
    Blend::new(&ingredients, &BlendSettings::default(), &|_| ()).ok()
}

fn at(blend: &Blend, weights: [f64; 2]) -> Option<CarPaint> {
    let weights = RealisationWeights::uniform(weights.to_vec());
    blend.realise(&weights).ok().map(|realised| realised.paint)
}

/// Parameters of a blend at weight 1 that are not the paint's own, to the bit: coat, diffuse, lobes, the color table at the
/// paint's own angles, and slices there, boxes to the bit and probabilities to 1e-12.
pub(super) fn differences(end: &CarPaint, own: &CarPaint) -> usize {
    let lobes = |paint: &CarPaint| -> Vec<Lobe> {
        let present = paint.lobes.iter().filter(|lobe| !lobe.is_absent());
        let mut list: Vec<Lobe> = present.copied().collect();
        list.sort_by(|x, y| x.alpha.total_cmp(&y.alpha));
        list
    };
    let (table, own_table) = (&end.color_table, &own.color_table);
    let grids = [table.theta_h(), table.theta_d()];
    let own_grids = [own_table.theta_h(), own_table.theta_d()];
    let colors = pairs_of(grids, own_grids)
        .filter(|(k, j)| k.is_none_or(|k| table.nodes()[k] != own_table.nodes()[*j]));
    let differing = usize::from(end.coat != own.coat)
        + usize::from(end.diffuse != own.diffuse)
        + usize::from(lobes(end) != lobes(own))
        + usize::from(table.overall() != own_table.overall())
        + colors.count();
    let Some(own) = &own.flakes else {
        return differing;
    };
    let Some(end) = &end.flakes else {
        return differing + own.slices();
    };
    let slices = pairs_of([&end.theta_h, &end.theta_d], [&own.theta_h, &own.theta_d])
        .filter(|(k, j)| k.is_none_or(|k| !alike(&regrouped(end, k), &regrouped(own, *j))));
    differing + usize::from(end.texture != own.texture) + slices.count()
}

/// Of every pair of a paint's own angles its place on the blend's grid, where it is there, and on its own.
fn pairs_of<'a>(
    [theta_h, theta_d]: [&'a AngleGrid; 2],
    [own_h, own_d]: [&'a AngleGrid; 2],
) -> impl Iterator<Item = (Option<usize>, usize)> + 'a {
    let near = |x: f64, y: f64| (x - y).abs() < LEAST_STEP_DEG;
    let place = move |grid: &AngleGrid, angle| grid.degrees().iter().position(|x| near(*x, angle));
    (0..own_h.len() * own_d.len()).map(move |k| {
        let row = place(theta_h, own_h.degrees()[k / own_d.len()]);
        let column = place(theta_d, own_d.degrees()[k % own_d.len()]);
        let there = row.zip(column);
        (there.map(|(row, column)| row * theta_d.len() + column), k)
    })
}

/// Whether angles of a paint are in its blend only as near ones of the other paint.
fn are_rounded_otherwise(end: &CarPaint, own: &CarPaint) -> bool {
    let (Some(end), Some(own)) = (&end.flakes, &own.flakes) else {
        return false;
    };
    let lacks = |grid: &AngleGrid, own: &AngleGrid| {
        own.degrees()
            .iter()
            .any(|angle| !grid.degrees().contains(angle))
    };
    lacks(&end.theta_h, &own.theta_h) || lacks(&end.theta_d, &own.theta_d)
}

/// Probability by box of a slice.
fn regrouped(flakes: &Flakes, slice: usize) -> BTreeMap<[u32; 6], f64> {
    let slice = flakes.slice_at(slice);
    let mut groups = BTreeMap::new();
    for (k, p) in slice.probability.iter().enumerate() {
        let ([a, b, c], [d, e, f]) = (slice.lower[k], slice.upper[k]);
        // A box at −0 is the box at 0.
        let key = [a, b, c, d, e, f].map(|v| (v + 0.0).to_bits());
        if *p > 0.0 {
            *groups.entry(key).or_insert(0.0) += p;
        }
    }
    groups
}

fn alike(x: &BTreeMap<[u32; 6], f64>, y: &BTreeMap<[u32; 6], f64>) -> bool {
    x.keys().eq(y.keys())
        && x.values()
            .zip(y.values())
            .all(|(p, q)| (p - q).abs() <= 1e-12)
}

/// At weight 1 the blend is the paint; and a blend is its reverse.
pub(super) fn ends(subject: &Subject<'_>) -> Vec<Check> {
    let (a, b) = (subject.paint, subject.partner);
    let (Some(forth), Some(back)) = (blend(a, b), blend(b, a)) else {
        return vec![Check::none("blend with a sample", 1, "blends refused")];
    };
    let mut differing = 0;
    let (mut mean, mut accepted) = (0.0_f64, 1e-9);
    match at(&forth, [1.0, 0.0]) {
        Some(end) => {
            differing += differences(&end, a);
            if are_rounded_otherwise(&end, a) {
                // Light that changes ten times a degree, on angles that moved by less than the least step.
                accepted = 10.0 * LEAST_STEP_DEG;
            }
            // Slices of the paint's own grid, by what they reflect: probabilities regroup to 1e-12.
            let (end, own) = (Reflectance::new(&end), &subject.reflectance);
            for (wi, wo) in crate::paint::instrument_pairs() {
                let terms = |r: &Reflectance<'_>| r.terms(wi, wo, Chi::Table);
                if let (Some(x), Some(y)) = (terms(&end), terms(own)) {
                    for (x, y) in x.flakes.iter().zip(y.flakes) {
                        mean = worse(mean, (x - y).abs() / (y.abs() + 1e-6));
                    }
                }
            }
        }
        None => differing += 1,
    }
    let turned = [0.0, 0.3, 1.0, -2.0]
        .into_iter()
        .filter(|&t| at(&forth, [1.0 - t, t]) != at(&back, [t, 1.0 - t]));
    vec![
        Check::none(
            "a blend at weight 1 of the paint",
            differing,
            "parameters differ",
        ),
        Check::at_most("and its flakes' mean", mean, accepted, "relative"),
        Check::none("a blend and its reverse", turned.count(), "weights differ"),
    ]
}

/// Random steps of the weights against the Lipschitz bound of the boxes: `Σ|Δw| · largest corner`, and f32's rounding.
pub(super) fn steps(subject: &Subject<'_>) -> Vec<Check> {
    let case = "jump of a flake over its Lipschitz bound, 200 steps";
    let Some(blend) = blend(subject.paint, subject.partner) else {
        return vec![Check::none(case, 1, "blends refused")];
    };
    let corners = |paint: Option<CarPaint>| -> Vec<f64> {
        let flakes = paint.and_then(|p| p.flakes);
        let both = flakes.iter().flat_map(|f| f.lower.iter().chain(&f.upper));
        both.flatten().map(|v| f64::from(*v)).collect()
    };
    let (a, b) = (
        corners(at(&blend, [1.0, 0.0])),
        corners(at(&blend, [0.0, 1.0])),
    );
    // Corners of one box change places when it is turned inside out: the larger of the two counts for both.
    let half = a.len() / 2;
    let reach = |k: usize| {
        let at = |list: &[f64]| list[k % half].abs().max(list[k % half + half].abs());
        at(&a).max(at(&b))
    };
    let mut random = Stream::new(3);
    let (mut t, mut before, mut worst) = (0.5, corners(at(&blend, [0.5, 0.5])), 0.0_f64);
    for _ in 0..200 {
        let size = 10.0_f64.powf(random.within(-6.0, -1.0));
        let next = (t + size * random.within(-1.0, 1.0)).clamp(-1.0, 2.0);
        let after = corners(at(&blend, [1.0 - next, next]));
        let step = 2.0 * (next - t).abs();
        for (k, (x, y)) in after.iter().zip(&before).enumerate() {
            // Boxes are summed in f32: five roundings a sum of Σ|w| ≤ 3 times the largest corner, at both ends.
            let bound = (step + 10.0 * 3.0 * f64::from(f32::EPSILON) / 2.0) * reach(k) + 1e-30;
            worst = worse(worst, (x - y).abs() / bound);
        }
        (t, before) = (next, after);
    }
    vec![Check::at_most(case, worst, 1.0, "of the bound")]
}

/// Weights far from any paint still give one.
pub(super) fn far_weights(subject: &Subject<'_>) -> Vec<Check> {
    let far = [
        [-3.0, 4.0],
        [4.0, -3.0],
        [0.0, 0.0],
        [1e12, -1e12],
        [1e-12, 0.0],
    ];
    let blend = blend(subject.paint, subject.partner);
    let wrong = far.into_iter().filter(|weights| {
        let paint = blend.as_ref().and_then(|b| at(b, *weights));
        paint.is_none_or(|p| p.validate(&Limits::default()).is_err())
    });
    let wrong = wrong.count();
    let nan = blend.and_then(|b| at(&b, [f64::NAN, 1.0])).is_some();
    vec![
        Check::none(
            "weights from (-3, 4) to (1e12, -1e12)",
            wrong,
            "not a paint",
        ),
        Check::none("a weight that is no number", usize::from(nan), "accepted"),
    ]
}

/// The same bits on any number of threads, and the numbers that the authors' machine computed.
pub(super) fn machine(subject: &Subject<'_>) -> Vec<Check> {
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let blend = || blend(subject.paint, subject.partner).map(|b| b.to_bytes().ok());
        pool.ok().and_then(|pool| pool.install(blend)).flatten()
    };
    let first = bytes(1);
    let differing = [2, 8]
        .into_iter()
        .filter(|n| first.is_none() || bytes(*n) != first);
    // CIEDE2000 of one of Sharma's pairs to 16 digits, a transport along a line by hand, Fresnel at 60° for 1.5.
    let known = [
        (
            ciede2000([50.0, 2.5, 0.0].into(), [73.0, 25.0, -18.0].into()),
            27.149_231_300_746_26,
        ),
        (by_hand(), 1.75),
        (crate::paint::fresnel(0.5, 1.5), 0.089_186_712_802_212_78),
    ];
    let off = known.map(|(got, want): (f64, f64)| (got / want - 1.0).abs());
    vec![
        Check::none("1, 2 and 8 threads", differing.count(), "answers differ"),
        Check::at_most(
            "numbers known beforehand",
            off.into_iter().fold(0.0, worse),
            1e-12,
            "relative",
        ),
    ]
}

/// Half the mass goes by 1, a quarter by 2, a quarter by 3: 1.75.
fn by_hand() -> f64 {
    let on_line = |x: [f64; 3]| x.map(|x| [x, 0.0, 0.0]);
    let (from, to) = (on_line([0.0, 10.0, 20.0]), on_line([1.0, 12.0, 23.0]));
    let masses = [0.5, 0.25, 0.25];
    Problem::new(&from, &masses, &to, &masses)
        .and_then(|problem| {
            solve(
                &problem,
                Method::Exact,
                Cost::Distance,
                &mut Workspace::default(),
            )
        })
        .map_or(f64::NAN, |plan| plan.cost)
}
