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
    for edge in forest.edges() {
        plan.push(units, edge.source, edge.target, edge.grains);
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

/// Edges with flow, each known to the end that hangs from the other; sources first, targets behind them.
struct Forest {
    sources: usize,
    /// What a point hangs from, and the grains on that edge; none for a root.
    up: Vec<Option<(usize, i64)>>,
    /// Scratch: the ways up from both ends of a new edge, and for each point the search in which it was on the source's.
    source_way: Vec<usize>,
    target_way: Vec<usize>,
    passed: Vec<usize>,
    searches: usize,
}

impl Forest {
    fn new(sources: usize, targets: usize) -> Self {
        Self {
            sources,
            up: vec![None; sources + targets],
            source_way: Vec::new(),
            target_way: Vec::new(),
            passed: vec![0; sources + targets],
            searches: 0,
        }
    }

    /// Takes in a flow; keeps the forest a forest.
    fn take(&mut self, flow: Flow, matrix: &CostMatrix) {
        let (from, to) = (flow.source, self.sources + flow.target);
        if !self.find_cycle(from, to) {
            self.link(from, to, flow.grains);
            return;
        }
        // Around the cycle flow falls and rises in turn, from the source up as from the target up: with the new edge's
        // rising, it falls on the 1st, 3rd, … of both ways.
        let mut change = matrix.at(flow.source, flow.target);
        for way in [&self.source_way, &self.target_way] {
            for (step, &point) in way.iter().enumerate() {
                let cost = self.cost_up(point, matrix);
                change += if step.is_multiple_of(2) { -cost } else { cost };
            }
        }
        let raise = change < 0.0;
        let falls = |step: usize| step.is_multiple_of(2) == raise;
        let mut turn = if raise { i64::MAX } else { flow.grains };
        for way in [&self.source_way, &self.target_way] {
            for (step, &point) in way.iter().enumerate() {
                if let (true, Some((_, grains))) = (falls(step), self.up[point]) {
                    turn = turn.min(grains);
                }
            }
        }
        for way in [&self.source_way, &self.target_way] {
            for (step, &point) in way.iter().enumerate() {
                let change = if falls(step) { -turn } else { turn };
                self.up[point] = self.up[point]
                    .map(|(parent, grains)| (parent, grains + change))
                    .filter(|&(_, grains)| grains > 0);
            }
        }
        let grains = if raise {
            flow.grains + turn
        } else {
            flow.grains - turn
        };
        if grains > 0 {
            self.link(from, to, grains);
        }
    }

    /// Lists the points from either end up to where the ways meet, which is not listed; false if they do not.
    fn find_cycle(&mut self, from: usize, to: usize) -> bool {
        self.searches += 1;
        self.source_way.clear();
        self.target_way.clear();
        let mut at = from;
        loop {
            self.passed[at] = self.searches;
            self.source_way.push(at);
            let Some((parent, _)) = self.up[at] else {
                break;
            };
            at = parent;
        }
        at = to;
        while self.passed[at] != self.searches {
            self.target_way.push(at);
            let Some((parent, _)) = self.up[at] else {
                return false;
            };
            at = parent;
        }
        let meets = self.source_way.iter().position(|&point| point == at);
        self.source_way.truncate(meets.unwrap_or(0));
        true
    }

    /// What a grain costs on the edge up from a point; 0 for a root.
    fn cost_up(&self, point: usize, matrix: &CostMatrix) -> f64 {
        self.up[point].map_or(0.0, |(parent, _)| {
            let (source, target) = self.pair(point, parent);
            matrix.at(source, target)
        })
    }

    fn pair(&self, a: usize, b: usize) -> (usize, usize) {
        (a.min(b), a.max(b) - self.sources)
    }

    /// Joins two trees by an edge: the target's is turned round to hang from the source.
    fn link(&mut self, from: usize, to: usize, grains: i64) {
        let mut hung = Some((from, grains));
        let mut at = to;
        loop {
            let Some((parent, grains)) = std::mem::replace(&mut self.up[at], hung) else {
                return;
            };
            hung = Some((at, grains));
            at = parent;
        }
    }

    /// All edges with their grains, by source, then target.
    fn edges(&self) -> Vec<Flow> {
        let mut edges: Vec<Flow> = self
            .up
            .iter()
            .enumerate()
            .filter_map(|(point, up)| {
                let (parent, grains) = (*up)?;
                let (source, target) = self.pair(point, parent);
                Some(Flow {
                    source,
                    target,
                    grains,
                })
            })
            .collect();
        edges.sort_unstable_by_key(|edge| (edge.source, edge.target));
        edges
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
