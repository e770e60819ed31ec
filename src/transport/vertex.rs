//! From any way of moving the masses to a vertex of the transport polytope that costs no more.
//!
//! Solvers that end with a dense or slightly infeasible flow finish here. The flow is cut down to whole grains that no
//! source or target exceeds; what is left over goes where the greedy start sends it. Then pairs are taken into a forest
//! one by one; one that closes a cycle is pushed around it in the direction that does not raise the cost until an edge of
//! the cycle is empty. A forest has at most `ns + nt − 1` edges.

use super::cost::{CostMatrix, LANES};
use super::plan::Plan;
use super::problem::Problem;
use super::start::{StartMemory, greedy_start, steps_as_flows};
use super::units::Units;

/// Grains from a source to a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Flow {
    pub source: usize,
    pub target: usize,
    pub grains: i64,
}

/// Puts the vertex below a flow of masses into a plan, as entries only.
pub(super) fn vertex_below(
    problem: &Problem,
    matrix: &CostMatrix,
    units: &Units,
    start: &mut StartMemory,
    masses: impl Iterator<Item = (usize, usize, f64)>,
    plan: &mut Plan,
) {
    let mut left = units.clone();
    #[expect(
        clippy::cast_precision_loss,
        reason = "what is cut off goes with the leftovers"
    )]
    let grains_in_all = units.supplies.iter().sum::<i64>() as f64;
    let mut flows = Vec::new();
    for (source, target, mass) in masses {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "beyond i64 it saturates, NaN counts as nothing"
        )]
        let grains = ((mass * grains_in_all) as i64)
            .clamp(0, left.supplies[source].min(left.demands[target]));
        if grains > 0 {
            left.supplies[source] -= grains;
            left.demands[target] -= grains;
            flows.push(Flow {
                source,
                target,
                grains,
            });
        }
    }
    greedy_start(matrix, &left, start);
    flows.extend(steps_as_flows(&start.steps).filter(|flow| flow.grains > 0));
    flows.sort_unstable_by_key(|flow| std::cmp::Reverse((flow.grains, flow.source, flow.target)));

    let mut forest = Forest::new(problem.source().len(), problem.target().len());
    for flow in flows {
        forest.take(flow, matrix);
    }
    plan.restart();
    for source in 0..problem.source().len() {
        let mut edges = forest.edges[source].clone();
        edges.sort_unstable_by_key(|edge| edge.to);
        for edge in edges {
            let target = edge.to - problem.source().len();
            plan.push(units, source, target, edge.grains);
        }
    }
}

/// Source duals under which the plan's own pairs are tight, where there are such duals.
///
/// Shortest ways in the residual graph (Bellman and Ford). They exist exactly for optimal plans; otherwise what is found
/// after as many rounds as there are points is still a start for [`Plan::certify`].
pub(super) fn residual_duals(
    problem: &Problem,
    matrix: &CostMatrix,
    plan: &Plan,
    source_duals: &mut Vec<f64>,
    target_duals: &mut Vec<[f64; LANES]>,
) {
    let noise = 1e-15 * matrix.largest();
    source_duals.clear();
    source_duals.resize(problem.source().len(), 0.0);
    target_duals.clear();
    target_duals.resize(matrix.stride(), [0.0; LANES]);
    for _ in 0..problem.source().len() + problem.target().len() {
        super::plan::target_duals_for(matrix, source_duals, target_duals);
        let values = target_duals.as_flattened();
        let mut changed = false;
        for entry in &plan.entries {
            let tight = matrix.at(entry.source, entry.target) - values[entry.target];
            if tight > source_duals[entry.source] + noise {
                source_duals[entry.source] = tight;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    to: usize,
    grains: i64,
}

/// Edges with flow, listed at both ends; sources first, targets behind them.
struct Forest {
    sources: usize,
    edges: Vec<Vec<Edge>>,
    /// Scratch of the search: where a point was reached from.
    reached: Vec<Option<usize>>,
}

impl Forest {
    fn new(sources: usize, targets: usize) -> Self {
        Self {
            sources,
            edges: vec![Vec::new(); sources + targets],
            reached: vec![None; sources + targets],
        }
    }

    /// Takes in a flow; keeps the forest a forest.
    fn take(&mut self, flow: Flow, matrix: &CostMatrix) {
        let (from, to) = (flow.source, self.sources + flow.target);
        let Some(way) = self.way(from, to) else {
            self.add(from, to, flow.grains);
            return;
        };
        if let [from, to] = way[..] {
            self.add(from, to, flow.grains);
            return;
        }
        // Along the way from the source, flow on the 1st, 3rd, … edge falls when the new edge's rises.
        let cost = |pair: &[usize]| {
            let (source, target) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
            matrix.at(source, target - self.sources)
        };
        let mut change = matrix.at(flow.source, flow.target);
        for (step, pair) in way.windows(2).enumerate() {
            change += if step.is_multiple_of(2) {
                -cost(pair)
            } else {
                cost(pair)
            };
        }
        let raise = change < 0.0;
        let falls = |step: usize| step.is_multiple_of(2) == raise;
        let mut turn = if raise { i64::MAX } else { flow.grains };
        for (step, pair) in way.windows(2).enumerate() {
            if falls(step) {
                turn = turn.min(self.grains(pair[0], pair[1]));
            }
        }
        for (step, pair) in way.windows(2).enumerate() {
            self.add(pair[0], pair[1], if falls(step) { -turn } else { turn });
        }
        self.add(
            from,
            to,
            if raise {
                flow.grains + turn
            } else {
                flow.grains - turn
            },
        );
    }

    fn grains(&self, a: usize, b: usize) -> i64 {
        self.edges[a]
            .iter()
            .find(|edge| edge.to == b)
            .map_or(0, |edge| edge.grains)
    }

    /// Adds grains to an edge, which comes and goes with its flow.
    fn add(&mut self, a: usize, b: usize, grains: i64) {
        for (a, b) in [(a, b), (b, a)] {
            let edges = &mut self.edges[a];
            if let Some(at) = edges.iter().position(|edge| edge.to == b) {
                edges[at].grains += grains;
                if edges[at].grains == 0 {
                    edges.swap_remove(at);
                }
            } else if grains != 0 {
                edges.push(Edge { to: b, grains });
            }
        }
    }

    /// The points on the way between two points, both included.
    fn way(&mut self, from: usize, to: usize) -> Option<Vec<usize>> {
        self.reached.fill(None);
        self.reached[from] = Some(from);
        let mut open = vec![from];
        while let Some(at) = open.pop() {
            if at == to {
                break;
            }
            for edge in &self.edges[at] {
                if self.reached[edge.to].is_none() {
                    self.reached[edge.to] = Some(at);
                    open.push(edge.to);
                }
            }
        }
        self.reached[to]?;
        let mut way = vec![to];
        let mut at = to;
        while at != from {
            at = self.reached[at]?;
            way.push(at);
        }
        way.reverse();
        Some(way)
    }
}

#[cfg(test)]
mod tests {
    use super::super::cost::Cost;
    use super::super::workspace::Workspace;
    use super::*;

    #[test]
    fn a_dense_flow_becomes_a_forest_that_costs_no_more() {
        let points = |shift: f64| -> Vec<[f64; 3]> {
            (0..12)
                .map(|i| {
                    let t = f64::from(i);
                    [
                        t * 1.7 + shift,
                        (t * 2.3).sin() * 9.0,
                        (t * 0.9).cos() * 5.0,
                    ]
                })
                .collect()
        };
        let masses: Vec<f64> = (1..=12).map(f64::from).collect();
        let problem =
            Problem::new(&points(0.0), &masses, &points(4.0), &masses).expect("a fine problem");
        let mut workspace = Workspace::default();
        workspace.prepare(&problem, Cost::Distance);
        let (p, q) = (problem.source().masses(), problem.target().masses());
        let product = || (0..12).flat_map(|i| (0..12).map(move |j| (i, j)));
        let dense: f64 = product()
            .map(|(i, j)| p[i] * q[j] * workspace.matrix.at(i, j))
            .sum();
        let mut plan = Plan::default();
        vertex_below(
            &problem,
            &workspace.matrix,
            &workspace.units,
            &mut workspace.start,
            product().map(|(i, j)| (i, j, p[i] * q[j])),
            &mut plan,
        );
        plan.price(&problem, Cost::Distance);
        assert!(plan.entries.len() <= 23, "{}", plan.entries.len());
        assert!(plan.cost <= dense, "{} > {dense}", plan.cost);
        let mut arrived = [0.0; 12];
        for entry in &plan.entries {
            arrived[entry.target] += entry.mass;
        }
        assert!(arrived.iter().zip(q).all(|(a, q)| (a - q).abs() < 1e-14));
    }
}
