//! The transport solvers against a linear program of another's making, and against their own certificates.
//!
//! - 900 problems like those of a paint's precompute (six kinds of hard ones among them): cost within `1e-9·opt + 1e-12` of
//!   what `good_lp` finds, wherever `good_lp`'s own marginals hold to 1e-9. How often it failed is printed.
//! - Many random problems meant to break a solver, each judged by its dual certificate, whose terms are recomputed here
//!   from points and masses alone. `CARPAINT_FUZZ` says how many.
//!
//! Tolerances. Costs are sums of at most 99 products, rounded to a few 1e-16 relatively; the tie-break may cost 5e-10 of
//! the optimum. Duals are sums of costs along a tree way, each step rounding by at most 1.1e-16 of the largest potential;
//! potentials stay within some ten largest costs, ways within some twenty steps, which makes 2e-14 of the largest cost.
//! Masses are whole units of 2^-55 or so; a hundred clusters round by less than 1e-14.

#![expect(
    clippy::needless_for_each,
    reason = "a line that changes all masses reads best as one"
)]

use carpaint::transport::{Cost, Method, Plan, Problem, Solver, Workspace, solve};
use good_lp::solvers::microlp::microlp;
use good_lp::{Expression, ProblemVariables, Solution, SolverModel, variable};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

/// Random problems certified when `CARPAINT_FUZZ` does not say otherwise.
const FUZZED: usize = 20_000;

/// Of those, every how many-th is also given to `good_lp`.
const WITH_LP_EVERY: usize = 100;

fn fuzzed() -> usize {
    std::env::var("CARPAINT_FUZZ").map_or(FUZZED, |count| {
        count.parse().expect("CARPAINT_FUZZ is a number")
    })
}

/// Rounding allowed to duals, as a part of the largest cost.
const DUAL_ROUNDING: f64 = 2e-14;

#[derive(Clone, Debug, Default)]
struct Clouds {
    kind: &'static str,
    source: Vec<[f64; 3]>,
    source_masses: Vec<f64>,
    target: Vec<[f64; 3]>,
    target_masses: Vec<f64>,
}

impl Clouds {
    fn problem(&self) -> Problem {
        Problem::new(
            &self.source,
            &self.source_masses,
            &self.target,
            &self.target_masses,
        )
        .unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }
}

/// What is wrong with a plan, judged from the problem alone.
fn faults(clouds: &Clouds, cost: Cost, plan: &Plan) -> Option<String> {
    let scaled = |masses: &[f64]| -> Vec<f64> {
        let sum: f64 = masses.iter().sum();
        masses.iter().map(|mass| mass / sum).collect()
    };
    let (p, q) = (scaled(&clouds.source_masses), scaled(&clouds.target_masses));
    let w = |i: usize, j: usize| cost.between(clouds.source[i], clouds.target[j]);

    if plan.entries.len() > p.len() + q.len() - 1 {
        return Some(format!("{} entries", plan.entries.len()));
    }
    let mut sent = vec![0.0; p.len()];
    let mut arrived = vec![0.0; q.len()];
    let mut spent = 0.0;
    for (k, entry) in plan.entries.iter().enumerate() {
        let place = |k: usize| (plan.entries[k].source, plan.entries[k].target);
        if k > 0 && place(k - 1) >= place(k) {
            return Some(format!("entry {k} is out of order"));
        }
        if entry.mass <= 0.0 || entry.mass.is_nan() {
            return Some(format!("entry {k} moves {}", entry.mass));
        }
        sent[entry.source] += entry.mass;
        arrived[entry.target] += entry.mass;
        spent += entry.mass * w(entry.source, entry.target);
    }
    for (side, moved, masses) in [("source", &sent, &p), ("target", &arrived, &q)] {
        for (i, (&moved, &mass)) in moved.iter().zip(masses).enumerate() {
            if moved <= 0.0 || (moved - mass).abs() > 1e-12 {
                return Some(format!("{side} {i} has {mass:e}, moves {moved:e}"));
            }
            if side == "source" && (moved / mass - 1.0).abs() > 1e-9 {
                return Some(format!("source {i} has {mass:e}, moves {moved:e}"));
            }
        }
    }
    let mut largest = 0.0_f64;
    let mut least_slack = f64::INFINITY;
    for i in 0..p.len() {
        for j in 0..q.len() {
            largest = largest.max(w(i, j));
            least_slack = least_slack.min(w(i, j) - plan.source_duals[i] - plan.target_duals[j]);
        }
    }
    let rounding = DUAL_ROUNDING * largest;
    if least_slack < -rounding || least_slack.is_nan() {
        return Some(format!(
            "duals exceed a cost by {:e} of the largest",
            -least_slack / largest
        ));
    }
    let dot = |masses: &[f64], duals: &[f64]| -> f64 {
        masses
            .iter()
            .zip(duals)
            .map(|(mass, dual)| mass * dual)
            .sum()
    };
    let dual = dot(&p, &plan.source_duals) + dot(&q, &plan.target_duals);
    let gap = spent - dual;
    if (spent - plan.cost).abs() > 1e-12 * spent
        || (gap - plan.gap).abs() > rounding + 1e-12 * spent
    {
        return Some(format!(
            "cost {} said {}, gap {gap:e} said {:e}",
            spent, plan.cost, plan.gap
        ));
    }
    if gap > 1e-9 * spent + rounding {
        return Some(format!(
            "gap {gap:e} of {spent:e}, largest cost {largest:e}"
        ));
    }
    None
}

/// `good_lp`'s optimum, or why there is none.
fn reference(clouds: &Clouds) -> Result<f64, String> {
    const SCALE: f64 = 1e5;
    let problem = clouds.problem();
    let (p, q) = (problem.source().masses(), problem.target().masses());
    let mut variables = ProblemVariables::new();
    let x = variables.add_vector(variable().min(0.0), p.len() * q.len());
    let cost: Vec<f64> = clouds
        .source
        .iter()
        .flat_map(|&from| {
            clouds
                .target
                .iter()
                .map(move |&to| Cost::Distance.between(from, to))
        })
        .collect();
    let largest = cost.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let objective = x.iter().zip(&cost).map(|(&x, &w)| x * (w / largest));
    let objective: Expression = objective.sum();
    let mut model = variables.minimise(objective).using(microlp);
    for (i, mass) in p.iter().enumerate() {
        let row: Expression = x[i * q.len()..(i + 1) * q.len()].iter().sum();
        model.add_constraint(row.eq(mass * SCALE));
    }
    for (j, mass) in q.iter().enumerate().take(q.len() - 1) {
        let column: Expression = x[j..].iter().step_by(q.len()).sum();
        model.add_constraint(column.eq(mass * SCALE));
    }
    let solution = model.solve().map_err(|error| error.to_string())?;
    let x: Vec<f64> = x.iter().map(|&x| solution.value(x) / SCALE).collect();
    for (i, mass) in p.iter().enumerate() {
        let sum: f64 = x[i * q.len()..(i + 1) * q.len()].iter().sum();
        if (sum - mass).abs() > 1e-9 {
            return Err(format!("source {i} has {mass}, moves {sum}"));
        }
    }
    for (j, mass) in q.iter().enumerate() {
        let sum: f64 = x[j..].iter().step_by(q.len()).sum();
        if (sum - mass).abs() > 1e-9 {
            return Err(format!("target {j} has {mass}, gets {sum}"));
        }
    }
    if let Some(x) = x.iter().find(|x| **x < -1e-9) {
        return Err(format!("moves {x}"));
    }
    Ok(x.iter().zip(&cost).map(|(x, w)| x * w).sum())
}

fn normal(rng: &mut StdRng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

fn power_of_ten(rng: &mut StdRng, from: f64, to: f64) -> f64 {
    10.0_f64.powf(rng.random_range(from..to))
}

/// A paint whose clusters drift over a grid of angles: centers and masses of 50 clusters at any place of the grid.
struct Paint {
    clusters: Vec<Cluster>,
}

struct Cluster {
    lightness: f64,
    a: f64,
    b: f64,
    mass: f64,
    swing: f64,
    phase: [f64; 2],
}

impl Paint {
    fn new(rng: &mut StdRng) -> Self {
        let steep = rng.random_range(1.4..2.6);
        let (hue, chroma) = (rng.random_range(0.0..6.3_f64), rng.random_range(0.0..35.0));
        let spread = rng.random_range(6.0..22.0);
        let cluster = |rank: i32| {
            let sparkle = rng.random_bool(0.1);
            Cluster {
                lightness: if sparkle {
                    100.0 - 30.0 * (1.0 - rng.random::<f64>()).ln()
                } else {
                    (3.3 + 0.6 * normal(rng)).exp().clamp(5.0, 100.0)
                },
                a: hue.cos() * chroma + spread * normal(rng),
                b: hue.sin() * chroma + spread * normal(rng),
                mass: f64::from(rank).powf(-steep) * (0.6 * normal(rng)).exp(),
                swing: rng.random_range(0.02..0.22),
                phase: [rng.random_range(0.0..6.3), rng.random_range(0.0..6.3)],
            }
        };
        Self {
            clusters: (1..=50).map(cluster).collect(),
        }
    }

    fn slice(&self, u: f64, v: f64, rng: &mut StdRng) -> (Vec<[f64; 3]>, Vec<f64>) {
        let lobe = (-(u - v).powi(2) / 0.05).exp() * (1.0 - 0.5 * u);
        let turn = std::f64::consts::TAU;
        let one = |cluster: &Cluster| {
            let wave = 1.0 + cluster.swing * (turn * u + cluster.phase[0]).sin() + 0.35 * lobe;
            let tint = 0.7 + 0.3 * (0.5 * turn * v + cluster.phase[1]).cos();
            let point = [
                (cluster.lightness * wave + 0.6 * normal(rng)).clamp(0.5, 250.0),
                (cluster.a * tint + 5.0 * lobe + 0.6 * normal(rng)).clamp(-60.0, 60.0),
                (cluster.b * tint - 5.0 * lobe + 0.6 * normal(rng)).clamp(-60.0, 60.0),
            ];
            let drift = 0.5 * (turn * (u + v) + cluster.phase[0]).sin() + 0.15 * normal(rng);
            (point, (cluster.mass * drift.exp()).max(1e-6))
        };
        let (points, mut masses): (Vec<_>, Vec<f64>) = self.clusters.iter().map(one).unzip();
        normalise(&mut masses);
        (points, masses)
    }
}

fn normalise(masses: &mut [f64]) {
    let sum: f64 = masses.iter().sum();
    masses.iter_mut().for_each(|mass| *mass /= sum);
}

/// 30 × 30 slices of two paints, three in ten made hard in one of six ways.
fn paint_slices(seed: u64) -> Vec<Clouds> {
    let mut rng = StdRng::seed_from_u64(seed);
    let rng = &mut rng;
    let (from, to) = (Paint::new(rng), Paint::new(rng));
    let kinds = ["dup", "uneven", "near", "dominant", "offsum", "tiny"];
    (0..900_i32)
        .map(|place| {
            let (u, v) = (f64::from(place / 30) / 29.0, f64::from(place % 30) / 29.0);
            let (source, source_masses) = from.slice(u, v, rng);
            let (target, target_masses) = to.slice(u, v, rng);
            let kind = if rng.random_bool(0.3) {
                kinds[rng.random_range(0..kinds.len())]
            } else {
                "smooth"
            };
            let mut clouds = Clouds {
                kind,
                source,
                source_masses,
                target,
                target_masses,
            };
            harden(&mut clouds, rng);
            clouds
        })
        .collect()
}

fn harden(clouds: &mut Clouds, rng: &mut StdRng) {
    let Clouds {
        kind,
        source,
        source_masses: p,
        target,
        target_masses: q,
    } = clouds;
    match *kind {
        "dup" => {
            for _ in 0..12 {
                let mut any = || rng.random_range(0..50);
                source[any()] = source[any()];
                target[any()] = source[any()];
            }
            if rng.random_bool(0.3) {
                for k in 0..50 {
                    source[k] = source[rng.random_range(0..4)];
                    target[k] = target[rng.random_range(0..4)];
                }
            }
        }
        "uneven" => {
            for (points, masses) in [(source, p), (target, q)] {
                let most = if rng.random_bool(0.2) { 1 } else { 50 };
                let count = rng.random_range(1..=most);
                points.truncate(count);
                masses.truncate(count);
            }
        }
        "near" => {
            target.clone_from(source);
            q.clone_from(p);
            if rng.random_bool(0.75) {
                let (shift, change) =
                    (power_of_ten(rng, -9.0, -1.0), power_of_ten(rng, -9.0, -1.0));
                target
                    .as_flattened_mut()
                    .iter_mut()
                    .for_each(|x| *x += shift * normal(rng));
                q.iter_mut()
                    .for_each(|mass| *mass *= (change * normal(rng)).exp());
            }
        }
        "dominant" => {
            for masses in [p, q] {
                masses.iter_mut().for_each(|mass| *mass *= 1e-4);
                masses[rng.random_range(0..50)] = 1.0;
                if rng.random_bool(0.5) {
                    break;
                }
            }
        }
        "offsum" => {
            for masses in [p, q] {
                let off = 1.0 + rng.random_range(-1e-7..1e-7);
                masses.iter_mut().for_each(|mass| *mass *= off);
            }
        }
        "tiny" => {
            if rng.random_bool(0.5) {
                p.fill(0.02);
                q.fill(0.02);
            } else {
                for masses in [p, q] {
                    for mass in masses {
                        if rng.random_bool(0.6) {
                            *mass = 1e-6 * power_of_ten(rng, -6.0, 0.0);
                        }
                    }
                }
            }
        }
        _ => {}
    }
}

/// A small problem with as many of a solver's troubles as fit.
fn nasty(rng: &mut StdRng) -> Clouds {
    let most = [2, 6, 14, 40][rng.random_range(0..4)];
    let scale = match rng.random_range(0..4) {
        0 => power_of_ten(rng, -12.0, 12.0),
        _ => 1.0,
    };
    let pattern = rng.random_range(0..6);
    let point = |rng: &mut StdRng| -> [f64; 3] {
        let mut lattice = |size: u8| f64::from(rng.random_range(0..size)) * scale;
        match pattern {
            0 => [lattice(3), lattice(3), lattice(3)],
            1 => [lattice(9), 0.0, 0.0],
            2 => [scale; 3],
            3 => {
                // Near a line that is no axis.
                let t = rng.random_range(0.0..100.0) * scale;
                [0.6 * t, 0.48 * t, 0.64 * t]
            }
            _ => [0; 3].map(|_| rng.random_range(-100.0..100.0) * scale),
        }
    };
    let cloud = |rng: &mut StdRng| {
        let count = rng.random_range(1..=most);
        let points: Vec<_> = (0..count).map(|_| point(rng)).collect();
        let style = rng.random_range(0..5);
        let mut masses: Vec<f64> = (0..count)
            .map(|_| match style {
                0 => 1.0,
                1 => f64::from(rng.random_range(1..4_u8)),
                2 => power_of_ten(rng, -300.0, 0.0),
                3 => power_of_ten(rng, -16.0, 0.0),
                _ => rng.random_range(0.001..1.0),
            })
            .collect();
        if rng.random_bool(0.7) {
            normalise(&mut masses);
            masses.iter_mut().for_each(|mass| *mass = mass.max(1e-300));
        }
        if rng.random_bool(0.3) {
            let off = 1.0 + rng.random_range(-1e-7..1e-7);
            masses.iter_mut().for_each(|mass| *mass *= off);
        }
        (points, masses)
    };
    let (source, source_masses) = cloud(rng);
    let (mut target, mut target_masses) = cloud(rng);
    if rng.random_bool(0.1) {
        target.clone_from(&source);
        target_masses.clone_from(&source_masses);
        if rng.random_bool(0.5) {
            target.reverse();
            target_masses.reverse();
        }
    }
    Clouds {
        kind: "nasty",
        source,
        source_masses,
        target,
        target_masses,
    }
}

#[test]
fn paint_slices_cost_what_the_linear_program_says() {
    let mut workspace = Workspace::default();
    let mut plan = Plan::default();
    let mut failed = 0;
    for (k, clouds) in paint_slices(7).iter().enumerate() {
        let problem = clouds.problem();
        Method::Exact
            .solve_into(&problem, Cost::Distance, &mut workspace, &mut plan)
            .unwrap_or_else(|error| panic!("{k}, {}: {error}", clouds.kind));
        if let Some(fault) = faults(clouds, Cost::Distance, &plan) {
            panic!("{k}, {}: {fault}", clouds.kind);
        }
        match reference(clouds) {
            Ok(optimum) => assert!(
                (plan.cost - optimum).abs() <= 1e-9 * optimum + 1e-12,
                "{k}, {}: {} for {optimum}",
                clouds.kind,
                plan.cost
            ),
            Err(error) => {
                failed += 1;
                println!("good_lp failed on {k}, {}: {error}", clouds.kind);
            }
        }
    }
    println!("good_lp failed on {failed} of 900 paint slices");
    assert!(failed <= 45, "the oracle is silent on {failed} of 900");
}

#[test]
fn problems_meant_to_break_a_solver_are_certified() {
    let mut workspace = Workspace::default();
    let mut plan = Plan::default();
    let count = fuzzed();
    let mut compared = 0;
    let mut failed = 0;
    for seed in 0..count {
        let mut rng = StdRng::seed_from_u64(seed as u64);
        let clouds = nasty(&mut rng);
        let problem = clouds.problem();
        for cost in [Cost::Distance, Cost::SquaredDistance] {
            Method::Exact
                .solve_into(&problem, cost, &mut workspace, &mut plan)
                .unwrap_or_else(|error| panic!("seed {seed}, {cost:?}: {error}"));
            if let Some(fault) = faults(&clouds, cost, &plan) {
                panic!("seed {seed}, {cost:?}: {fault}\n{clouds:?}");
            }
            if cost == Cost::Distance && seed.is_multiple_of(WITH_LP_EVERY) {
                match reference(&clouds) {
                    Ok(optimum) => {
                        compared += 1;
                        // The problem's own scale stands for the 1 of a Lab cost.
                        let largest = clouds
                            .source
                            .iter()
                            .flat_map(|&s| {
                                clouds
                                    .target
                                    .iter()
                                    .map(move |&t| Cost::Distance.between(s, t))
                            })
                            .fold(0.0, f64::max);
                        assert!(
                            (plan.cost - optimum).abs() <= 1e-9 * optimum + 1e-12 * largest,
                            "seed {seed}: {} for {optimum}",
                            plan.cost
                        );
                    }
                    Err(_) => failed += 1,
                }
            }
        }
    }
    println!("{count} problems certified; good_lp agreed on {compared} and failed on {failed}");
}

#[test]
fn cheap_solvers_are_bounded_by_their_certificates_on_paint_slices() {
    let mut workspace = Workspace::default();
    for (k, clouds) in paint_slices(8).iter().enumerate().step_by(20) {
        let problem = clouds.problem();
        let exact = solve(&problem, Method::Exact, Cost::Distance, &mut workspace).expect("solved");
        for method in [Method::Greedy, Method::Sinkhorn { epsilon: 0.1 }] {
            let plan = solve(&problem, method, Cost::Distance, &mut workspace)
                .unwrap_or_else(|error| panic!("{k}, {}: {error}", clouds.kind));
            let rounding = 1e-12 + 1e-9 * exact.cost;
            assert!(plan.cost >= exact.cost - rounding, "{k}, {method:?}");
            assert!(
                plan.cost - plan.gap <= exact.cost + rounding,
                "{k}, {method:?}"
            );
        }
    }
}
