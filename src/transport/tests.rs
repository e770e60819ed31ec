//! Facts every solver of this room must agree with.

use proptest::prelude::*;

use super::*;

fn on_a_line(positions: &[f64]) -> Vec<[f64; 3]> {
    // A direction of length 1 that is no axis.
    let scaled = |x: f64| [x * 2.0 / 7.0, x * 3.0 / 7.0, x * 6.0 / 7.0];
    positions.iter().map(|&x| scaled(x)).collect()
}

/// On a line the optimum moves mass in order: `Σ |F⁻¹(t) − G⁻¹(t)|^power dt`.
fn closed_form(source: &[(f64, f64)], target: &[(f64, f64)], power: i32) -> f64 {
    let sorted = |cloud: &[(f64, f64)]| {
        let mut cloud = cloud.to_vec();
        cloud.sort_by(|a, b| a.0.total_cmp(&b.0));
        let sum: f64 = cloud.iter().map(|point| point.1).sum();
        for point in &mut cloud {
            point.1 /= sum;
        }
        cloud
    };
    let (mut from, mut to) = (sorted(source), sorted(target));
    let (mut i, mut j, mut cost) = (0, 0, 0.0);
    while i < from.len() && j < to.len() {
        let mass = from[i].1.min(to[j].1);
        cost += mass * (from[i].0 - to[j].0).abs().powi(power);
        from[i].1 -= mass;
        to[j].1 -= mass;
        if from[i].1 <= to[j].1 {
            i += 1;
        } else {
            j += 1;
        }
    }
    cost
}

fn line_problem(source: &[(f64, f64)], target: &[(f64, f64)]) -> Problem {
    let split = |cloud: &[(f64, f64)]| -> (Vec<f64>, Vec<f64>) { cloud.iter().copied().unzip() };
    let ((xs, p), (ys, q)) = (split(source), split(target));
    Problem::new(&on_a_line(&xs), &p, &on_a_line(&ys), &q).expect("a fine problem")
}

fn line() -> impl Strategy<Value = Vec<(f64, f64)>> {
    prop::collection::vec((0.0..100.0_f64, 0.01..1.0_f64), 1..20)
}

fn cloud() -> impl Strategy<Value = Vec<([f64; 3], f64)>> {
    let point = prop::array::uniform3(-50.0..50.0_f64);
    prop::collection::vec((point, 0.001..1.0_f64), 1..30)
}

fn problem(source: &[([f64; 3], f64)], target: &[([f64; 3], f64)]) -> Problem {
    let mut problem = Problem::default();
    problem
        .refill(source.iter().copied(), target.iter().copied())
        .expect("a fine problem");
    problem
}

fn exact(problem: &Problem, cost: Cost) -> Plan {
    solve(problem, Method::Exact, cost, &mut Workspace::default()).expect("solved")
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs() + 1e-12
}

/// Duals that any pair could improve on, or a gap they do not bear out, is no certificate.
fn certified(problem: &Problem, cost: Cost, plan: &Plan) -> Result<(), TestCaseError> {
    let (from, to) = (problem.source(), problem.target());
    let mut dual = 0.0;
    for (i, &point) in from.points().iter().enumerate() {
        dual += from.masses()[i] * plan.source_duals[i];
        for (j, &other) in to.points().iter().enumerate() {
            let slack = cost.between(point, other) - plan.source_duals[i] - plan.target_duals[j];
            // A few roundings of potentials, which are some hundreds here, or their squares.
            prop_assert!(slack >= -1e-9, "pair {i}, {j}: {slack:e}");
        }
    }
    for (mass, v) in to.masses().iter().zip(&plan.target_duals) {
        dual += mass * v;
    }
    prop_assert!(plan.gap >= 0.0 && (plan.cost - dual - plan.gap).abs() < 1e-9);
    prop_assert!(plan.entries.len() < from.len() + to.len());
    let mut sent = vec![0.0; from.len()];
    let mut arrived = vec![0.0; to.len()];
    for entry in &plan.entries {
        prop_assert!(entry.mass > 0.0);
        sent[entry.source] += entry.mass;
        arrived[entry.target] += entry.mass;
    }
    for (got, want) in sent
        .iter()
        .zip(from.masses())
        .chain(arrived.iter().zip(to.masses()))
    {
        prop_assert!((got - want).abs() < 1e-12, "{got} for {want}");
    }
    let order = |entry: &PlanEntry| (entry.source, entry.target);
    prop_assert!(
        plan.entries
            .windows(2)
            .all(|two| order(&two[0]) < order(&two[1]))
    );
    Ok(())
}

#[test]
fn grey_clouds_that_do_not_overlap_move_in_order() {
    // Every plan between them costs the same; only the order of the lightest and darkest differs.
    let source = [(30.0, 0.25), (10.0, 0.25), (20.0, 0.25), (0.0, 0.25)];
    let target = [(70.0, 0.25), (60.0, 0.25), (90.0, 0.25), (80.0, 0.25)];
    let plan = exact(&line_problem(&source, &target), Cost::Distance);
    let moved: Vec<_> = plan
        .entries
        .iter()
        .map(|e| (source[e.source].0, target[e.target].0))
        .collect();
    assert_eq!(
        moved,
        [(30.0, 90.0), (10.0, 70.0), (20.0, 80.0), (0.0, 60.0)]
    );
    assert!(close(plan.cost, 60.0), "{}", plan.cost);
}

#[test]
fn one_point_a_side_is_a_plan() {
    let plan = exact(
        &line_problem(&[(3.0, 7.0)], &[(5.0, 1e-200)]),
        Cost::SquaredDistance,
    );
    assert_eq!(
        plan.entries,
        [PlanEntry {
            source: 0,
            target: 0,
            mass: 1.0
        }]
    );
    assert!(close(plan.cost, 4.0));
}

#[test]
fn a_cloud_onto_itself_stays_where_it_is() {
    let cloud: Vec<_> = (1..40)
        .map(|i| (f64::from(i * 7 % 41), f64::from(i).recip()))
        .collect();
    let problem = line_problem(&cloud, &cloud);
    for cost in [Cost::Distance, Cost::SquaredDistance] {
        let plan = exact(&problem, cost);
        assert_eq!(plan.cost, 0.0);
        assert_eq!(plan.entries.len(), 39);
        for (i, entry) in plan.entries.iter().enumerate() {
            assert_eq!((entry.source, entry.target), (i, i));
            assert!((entry.mass - problem.source().masses()[i]).abs() < 1e-15);
        }
    }
}

#[test]
fn tiny_masses_arrive_as_themselves() {
    let source = [(0.0, 1e-300), (1.0, 0.5), (2.0, 0.5), (3.0, 1e-30)];
    let target = [(5.0, 0.3), (6.0, 1e-200), (7.0, 0.7)];
    let plan = exact(&line_problem(&source, &target), Cost::Distance);
    let sum_of = |want: &dyn Fn(&PlanEntry) -> bool| -> f64 {
        plan.entries
            .iter()
            .filter(|e| want(e))
            .map(|e| e.mass)
            .sum()
    };
    assert!((sum_of(&|e| e.source == 0) / 1e-300 - 1.0).abs() < 1e-12);
    assert!((sum_of(&|e| e.source == 3) / 1e-30 - 1.0).abs() < 1e-12);
    assert!((sum_of(&|e| e.target == 1) / 1e-200 - 1.0).abs() < 1e-12);
}

#[test]
fn clouds_of_every_tree_width_are_solved() {
    let mut workspace = Workspace::default();
    for size in [63, 64, 65, 128, 129, 257, 513, 1025] {
        let spread = |step: f64| -> Vec<(f64, f64)> {
            (0..size)
                .map(|i| {
                    (
                        (f64::from(i) * step).fract() * 100.0,
                        1.0 + f64::from(i % 7),
                    )
                })
                .collect()
        };
        let (source, target) = (spread(0.618_034), spread(0.414_214)[..40].to_vec());
        let plan = solve(
            &line_problem(&source, &target),
            Method::Exact,
            Cost::SquaredDistance,
            &mut workspace,
        )
        .expect("solved");
        let want = closed_form(&source, &target, 2);
        assert!(close(plan.cost, want), "{size}: {} for {want}", plan.cost);
    }
}

#[test]
fn costs_grow_with_the_scale_from_atoms_to_galaxies() {
    let scaled = |scale: f64| {
        let cloud = |f: f64| -> Vec<([f64; 3], f64)> {
            (1..=20)
                .map(|i| {
                    let at = |g: f64| (f64::from(i) * f * g).sin() * scale;
                    ([at(1.0), at(2.0), at(3.0)], f64::from(i))
                })
                .collect()
        };
        problem(&cloud(0.7), &cloud(1.1))
    };
    for (cost, power) in [(Cost::Distance, 1), (Cost::SquaredDistance, 2)] {
        let one = exact(&scaled(1.0), cost);
        for scale in [1e-60_f64, 1e-12, 1e12, 1e99] {
            let plan = exact(&scaled(scale), cost);
            let factor = scale.powi(power);
            assert!(
                close(plan.cost / factor, one.cost),
                "{scale:e}: {}",
                plan.cost
            );
            assert!(
                plan.gap / factor <= 1e-9 * one.cost,
                "{scale:e}: {:e}",
                plan.gap
            );
        }
    }
}

#[test]
fn an_earlier_problem_leaves_no_trace() {
    let easy = line_problem(&[(1.0, 1.0)], &[(2.0, 0.5), (3.0, 0.5)]);
    let hard = line_problem(
        &(0..50)
            .map(|i| (f64::from(i * 37 % 50), 1.0))
            .collect::<Vec<_>>(),
        &(0..30)
            .map(|i| (f64::from(i * 11 % 30), 2.0))
            .collect::<Vec<_>>(),
    );
    let methods = [
        Method::Exact,
        Method::Greedy,
        Method::LinearProgram,
        Method::Sinkhorn { epsilon: 0.1 },
    ];
    let mut used = Workspace::default();
    for method in methods {
        let fresh =
            solve(&hard, method, Cost::Distance, &mut Workspace::default()).expect("solved");
        solve(&easy, Method::Exact, Cost::SquaredDistance, &mut used).expect("solved");
        let again = solve(&hard, method, Cost::Distance, &mut used).expect("solved");
        assert_eq!(fresh, again, "{method:?}");
    }
}

#[test]
fn an_unfilled_problem_and_a_senseless_smoothing_are_refused() {
    let mut workspace = Workspace::default();
    let empty = Problem::default();
    for method in [
        Method::Exact,
        Method::Greedy,
        Method::LinearProgram,
        Method::Sinkhorn { epsilon: 0.1 },
    ] {
        assert_eq!(
            solve(&empty, method, Cost::Distance, &mut workspace),
            Err(TransportError::Empty(Side::Source))
        );
    }
    let problem = line_problem(&[(0.0, 1.0)], &[(1.0, 1.0)]);
    for epsilon in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-10] {
        let refused = solve(
            &problem,
            Method::Sinkhorn { epsilon },
            Cost::Distance,
            &mut workspace,
        );
        assert!(
            matches!(refused, Err(TransportError::Epsilon(_))),
            "{epsilon}: {refused:?}"
        );
    }
}

#[test]
fn methods_are_stored_in_snake_case() {
    let text = serde_json::to_string(&[
        Method::Exact,
        Method::Sinkhorn { epsilon: 0.01 },
        Method::LinearProgram,
    ])
    .expect("written");
    assert_eq!(
        text,
        r#"["exact",{"sinkhorn":{"epsilon":0.01}},"linear_program"]"#
    );
    let cost: Cost = serde_json::from_str(r#""squared_distance""#).expect("read");
    assert_eq!(cost, Cost::SquaredDistance);
}

#[test]
fn sinkhorn_keeps_its_promise_or_says_that_it_cannot() {
    let wave = |i: i32, f: f64| (f64::from(i) * f).sin() * 40.0;
    let cloud = |f: f64| -> Vec<([f64; 3], f64)> {
        (1..=20)
            .map(|i| {
                (
                    [wave(i, f), wave(i, 2.0 * f), wave(i, 3.0 * f)],
                    f64::from(i).powi(-2),
                )
            })
            .collect()
    };
    let problem = problem(&cloud(0.7), &cloud(1.1));
    let optimum = exact(&problem, Cost::Distance).cost;
    let mut converged = 0;
    for exponent in 0..=8 {
        let epsilon = 10.0_f64.powi(-exponent);
        match solve(
            &problem,
            Method::Sinkhorn { epsilon },
            Cost::Distance,
            &mut Workspace::default(),
        ) {
            Ok(plan) => {
                converged += 1;
                assert!(plan.cost >= optimum * (1.0 - 1e-9), "{epsilon}");
                assert!(plan.cost - plan.gap <= optimum * (1.0 + 1e-9), "{epsilon}");
                // A smoothing of ε·mean over at most ln(20²) nats of entropy, and the mass that rounding moves.
                assert!(
                    plan.cost - optimum <= 6.0 * epsilon * 60.0 + 1e-3,
                    "{epsilon}: {}",
                    plan.cost
                );
            }
            Err(error) => assert!(
                matches!(error, TransportError::NotConverged { .. }),
                "{error}"
            ),
        }
    }
    assert!(converged >= 3, "only {converged} of 9 converged");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn on_a_line_the_cost_is_the_sorted_one(source in line(), target in line()) {
        let problem = line_problem(&source, &target);
        for (cost, power) in [(Cost::Distance, 1), (Cost::SquaredDistance, 2)] {
            let plan = exact(&problem, cost);
            let want = closed_form(&source, &target, power);
            prop_assert!(close(plan.cost, want), "{} for {want}", plan.cost);
        }
    }

    #[test]
    fn of_all_plans_between_grey_clouds_apart_the_monotone_one_is_taken(dark in line(), light in line()) {
        // All plans cost the same by distance; the monotone one is the cheapest by its square. What the tilt cannot
        // tell from rounding is worth 1e-5 of the squared extent.
        let light: Vec<_> = light.iter().map(|&(x, mass)| (x + 110.0, mass)).collect();
        let problem = line_problem(&dark, &light);
        let plan = exact(&problem, Cost::Distance);
        let squared: f64 = plan
            .entries
            .iter()
            .map(|e| e.mass * (dark[e.source].0 - light[e.target].0).powi(2))
            .sum();
        let least = closed_form(&dark, &light, 2);
        prop_assert!(squared <= least + 1e-5 * 210.0 * 210.0, "{squared} for {least}");
    }

    #[test]
    fn moving_a_cloud_by_a_vector_costs_its_length(
        cloud in cloud(), by in prop::array::uniform3(-30.0..30.0_f64),
    ) {
        let moved: Vec<_> = cloud
            .iter()
            .map(|&([x, y, z], mass)| ([x + by[0], y + by[1], z + by[2]], mass))
            .collect();
        let problem = problem(&cloud, &moved);
        let length = Cost::Distance.between([0.0; 3], by);
        prop_assert!(close(exact(&problem, Cost::Distance).cost, length));
        prop_assert!(close(exact(&problem, Cost::SquaredDistance).cost, length * length));
    }

    #[test]
    fn every_solver_certifies_what_it_says(source in cloud(), target in cloud()) {
        let problem = problem(&source, &target);
        let mut workspace = Workspace::default();
        for cost in [Cost::Distance, Cost::SquaredDistance] {
            let optimum = exact(&problem, cost);
            certified(&problem, cost, &optimum)?;
            prop_assert!(optimum.gap <= 1e-9 * optimum.cost + 1e-11);
            for method in [Method::Greedy, Method::Sinkhorn { epsilon: 0.05 }, Method::LinearProgram] {
                match solve(&problem, method, cost, &mut workspace) {
                    Ok(plan) => {
                        certified(&problem, cost, &plan)?;
                        prop_assert!(plan.cost >= optimum.cost * (1.0 - 1e-9) - 1e-12);
                        if method == Method::LinearProgram {
                            prop_assert!(plan.cost <= optimum.cost * (1.0 + 1e-8) + 1e-9);
                        }
                    }
                    Err(TransportError::LinearProgram(_)) if method == Method::LinearProgram => {}
                    Err(error) => prop_assert!(false, "{method:?}: {error}"),
                }
            }
        }
    }
}
