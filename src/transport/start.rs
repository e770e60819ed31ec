//! A feasible basis to begin with, or to make do with: the cheaper of two.
//!
//! One is greedy: source by source, cheapest target first. Costs are judged after subtracting each target's mean cost, a
//! first guess of its dual: a target far from everybody is then not shunned until only bad offers are left. For the same
//! reason the sources' turns are in the order of their best offers at first, less their own mean costs: those far from
//! everybody choose first, and those in the middle, who can go anywhere at a like price, take what is left. (Russell judges
//! every pair anew by what is left, and by the greatest costs of rows and columns where these are means.) On paint slices
//! that saves a quarter to a half of the pivots that the order of the list leaves.
//!
//! The other is monotone: both clouds are sorted along the axis on which they spread most, and mass flows in that order.
//! Where clouds lie on a line, as gray flakes do along lightness, it is optimal, and the greedy one far from it.
//!
//! Every step empties a source or fills a target, so the steps are the edges of a spanning tree, listed from the leaves
//! up: each closes a point, whose parent is the other end.
//!
//! E. J. Russell, "Extension of Dantzig's algorithm to finding an initial near-optimal basis for the transportation
//! problem", Operations Research 17, 1969.

use super::cost::{CostMatrix, LANES};
use super::problem::Problem;
use super::units::Units;
use super::vertex::Flow;

/// A step of the start: a point is done with, and what flows between it and a point that is not yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Closing {
    /// A source is empty.
    Source {
        /// The source.
        closed: usize,
        /// The target of its last flow.
        parent: usize,
        /// That flow.
        grains: i64,
    },
    /// A target is full.
    Target {
        /// The target.
        closed: usize,
        /// The source of its last flow.
        parent: usize,
        /// That flow.
        grains: i64,
    },
}

/// The cheapest column of a row after subtracting the column's value.
#[inline(always)]
pub(super) fn row_minimum(row: &[[f64; LANES]], values: &[[f64; LANES]]) -> f64 {
    let mut least = [f64::INFINITY; LANES];
    for (costs, values) in row.iter().zip(values) {
        for lane in 0..LANES {
            let reduced = costs[lane] - values[lane];
            least[lane] = if least[lane] < reduced {
                least[lane]
            } else {
                reduced
            };
        }
    }
    let mut smallest = least[0];
    for &value in &least[1..] {
        smallest = if value < smallest { value } else { smallest };
    }
    smallest
}

/// The first column that attains a row's minimum.
#[inline(always)]
pub(super) fn column_of(row: &[[f64; LANES]], values: &[[f64; LANES]], minimum: f64) -> usize {
    for (block, (costs, values)) in row.iter().zip(values).enumerate() {
        let mut hit = false;
        for lane in 0..LANES {
            hit |= costs[lane] - values[lane] == minimum;
        }
        if hit {
            let lane = (0..LANES).find(|&lane| costs[lane] - values[lane] == minimum);
            return block * LANES + lane.unwrap_or(0);
        }
    }
    0
}

/// The memory of a start.
#[derive(Clone, Debug, Default)]
pub(super) struct StartMemory {
    /// The steps, from the leaves up. The last one closes the last source onto the last open target.
    pub steps: Vec<Closing>,
    values: Vec<[f64; LANES]>,
    /// Whose turn is when: what is judged by, and the source.
    order: Vec<(f64, usize)>,
    left: Vec<i64>,
    monotone: Monotone,
}

/// The memory of a monotone start.
#[derive(Clone, Debug, Default)]
struct Monotone {
    steps: Vec<Closing>,
    /// Places along the axis, and whose they are.
    sources: Vec<(f64, usize)>,
    targets: Vec<(f64, usize)>,
}

impl StartMemory {
    /// Potentials under which all steps' pairs are tight.
    pub(super) fn tree_duals(
        &self,
        matrix: &CostMatrix,
        source_duals: &mut [f64],
        target_duals: &mut [[f64; LANES]],
    ) {
        let target_duals = target_duals.as_flattened_mut();
        for (k, &step) in self.steps.iter().rev().enumerate() {
            match step {
                Closing::Source { closed, parent, .. } => {
                    if k == 0 {
                        target_duals[parent] = 0.0;
                    }
                    source_duals[closed] = matrix.at(closed, parent) - target_duals[parent];
                }
                Closing::Target { closed, parent, .. } => {
                    target_duals[closed] = matrix.at(parent, closed) - source_duals[parent];
                }
            }
        }
    }
}

/// The steps as flows, in their order.
pub(super) fn steps_as_flows(steps: &[Closing]) -> impl Iterator<Item = Flow> + '_ {
    steps.iter().map(|&step| match step {
        Closing::Source {
            closed,
            parent,
            grains,
        } => Flow {
            source: closed,
            target: parent,
            grains,
        },
        Closing::Target {
            closed,
            parent,
            grains,
        } => Flow {
            source: parent,
            target: closed,
            grains,
        },
    })
}

/// Lists the steps of the cheaper start.
#[inline(always)]
pub(super) fn cheaper_start(
    problem: &Problem,
    matrix: &CostMatrix,
    units: &Units,
    memory: &mut StartMemory,
) {
    greedy_start(matrix, units, memory);
    memory.monotone.run(problem, units);
    if cost_of(&memory.monotone.steps, matrix) < cost_of(&memory.steps, matrix) {
        std::mem::swap(&mut memory.steps, &mut memory.monotone.steps);
    }
}

/// What the steps cost, mass counted in grains.
fn cost_of(steps: &[Closing], matrix: &CostMatrix) -> f64 {
    #[expect(
        clippy::cast_precision_loss,
        reason = "it only says which start is cheaper"
    )]
    steps_as_flows(steps)
        .map(|flow| matrix.at(flow.source, flow.target) * flow.grains as f64)
        .sum()
}

impl Monotone {
    fn run(&mut self, problem: &Problem, units: &Units) {
        let Self {
            steps,
            sources,
            targets,
        } = self;
        let axis = widest_axis(problem);
        for (places, cloud) in [
            (&mut *sources, problem.source()),
            (&mut *targets, problem.target()),
        ] {
            places.clear();
            places.extend(cloud.points().iter().enumerate().map(|(k, p)| (p[axis], k)));
            sort(places);
        }
        steps.clear();
        let (mut sources, mut targets) = (sources.iter(), targets.iter());
        let next = |places: &mut std::slice::Iter<'_, (f64, usize)>, grains: &[i64]| {
            places.next().map(|&(_, point)| (point, grains[point]))
        };
        let (Some(mut source), Some(mut target)) = (
            next(&mut sources, &units.supplies),
            next(&mut targets, &units.demands),
        ) else {
            return;
        };
        loop {
            // The last target stays open to the end, as the last source does until then.
            if targets.len() == 0 || source.1 < target.1 && sources.len() > 0 {
                steps.push(Closing::Source {
                    closed: source.0,
                    parent: target.0,
                    grains: source.1,
                });
                target.1 -= source.1;
                let Some(following) = next(&mut sources, &units.supplies) else {
                    return;
                };
                source = following;
            } else {
                steps.push(Closing::Target {
                    closed: target.0,
                    parent: source.0,
                    grains: target.1,
                });
                source.1 -= target.1;
                let Some(following) = next(&mut targets, &units.demands) else {
                    return;
                };
                target = following;
            }
        }
    }
}

/// By value, then by number.
fn sort(numbered: &mut [(f64, usize)]) {
    numbered.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
}

/// The axis on which both clouds together spread most, the first of equals.
fn widest_axis(problem: &Problem) -> usize {
    let points = || {
        problem
            .source()
            .points()
            .iter()
            .chain(problem.target().points())
    };
    let spread: [f64; 3] = std::array::from_fn(|axis| {
        let (low, high) = points().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
            (low.min(p[axis]), high.max(p[axis]))
        });
        high - low
    });
    (1..3).fold(0, |widest, axis| {
        if spread[axis] > spread[widest] {
            axis
        } else {
            widest
        }
    })
}

/// Lists the steps of the greedy start. The units may be leftovers of a problem's: the means are of all of it, and only
/// guess.
#[inline(always)]
pub(super) fn greedy_start(matrix: &CostMatrix, units: &Units, memory: &mut StartMemory) {
    let StartMemory {
        steps,
        values,
        order,
        left,
        ..
    } = memory;
    values.clear();
    values.extend_from_slice(matrix.target_means());
    order.clear();
    // A loop, because a closure of an iterator need not be compiled for the wide registers that the caller is.
    for (source, (row, mean)) in matrix.rows().zip(matrix.source_means()).enumerate() {
        order.push((row_minimum(row, values) - mean, source));
    }
    sort(order);
    left.clear();
    left.extend_from_slice(&units.demands);
    steps.clear();
    let mut open = left.len();
    for (turn, &(_, source)) in order.iter().enumerate() {
        let is_last = turn + 1 == order.len();
        let row = matrix.row(source);
        let mut supply = units.supplies[source];
        loop {
            let target = column_of(row, values, row_minimum(row, values));
            let demand = left[target];
            // One target stays open to the end: it is the root, and takes what is left.
            if open == 1 || supply < demand && !is_last {
                left[target] = demand - supply;
                steps.push(Closing::Source {
                    closed: source,
                    parent: target,
                    grains: supply,
                });
                break;
            }
            supply -= demand;
            open -= 1;
            values.as_flattened_mut()[target] = f64::NEG_INFINITY;
            steps.push(Closing::Target {
                closed: target,
                parent: source,
                grains: demand,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::cost::Cost;
    use super::*;

    #[test]
    fn who_is_far_from_everybody_chooses_first() {
        let at = |x: f64| [x, 0.0, 0.0];
        let sources = [at(5.0), at(0.0), at(11.0)];
        let targets = [at(5.5), at(0.5), at(10.0)];
        let problem = Problem::new(&sources, &[1.0; 3], &targets, &[1.0; 3]).expect("fine");
        let (mut matrix, mut units) = (CostMatrix::default(), Units::default());
        matrix.fill(&problem, Cost::Distance);
        units.fill(&problem);
        let mut start = StartMemory::default();
        greedy_start(&matrix, &units, &mut start);
        let in_the_middle = start.order.last().map(|&(_, source)| source);
        assert_eq!(in_the_middle, Some(0), "it can go anywhere at a like price");
        let last = start.steps.last().copied();
        assert!(matches!(last, Some(Closing::Source { closed: 0, .. })));
    }
}
