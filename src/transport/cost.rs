//! What it costs to move one unit of mass, and the matrix of it that the solvers price.
//!
//! ```text
//! distance          w_ij = ‖c_i − d_j‖
//! squared distance  w_ij = ‖c_i − d_j‖²
//! ```
//!
//! The distance is degenerate for clouds near one line (grey flakes): where two such clouds do not overlap, the monotone
//! and the reversed plan cost the same, yet their halfway blends spread very differently. The solvers therefore minimise
//!
//! ```text
//! d + ε·d²,   ε = TIE_BREAK / D,   D = diagonal of the box around both clouds
//! ```
//!
//! which prefers the monotone plan. Because `d ≤ D`, every cost grows by a factor within `1..=1 + TIE_BREAK`, so the plan
//! found costs at most `(1 + TIE_BREAK)` times the optimum of `d`, and duals of the tilted cost divided by that factor
//! are duals of `d`. Plans report the true cost, never the tilted one.

use super::problem::{Cloud, Problem};

/// Relative tilt of the distance that breaks ties. Half of the 1e-9 by which costs may differ between exact solvers.
pub(super) const TIE_BREAK: f64 = 5e-10;

/// Columns priced together; rows of the matrix are padded to a multiple.
pub(super) const LANES: usize = 8;

/// Cost of moving one unit of mass from one point to another.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Cost {
    /// Euclidean distance, ties broken towards the monotone plan.
    #[default]
    Distance,
    /// Its square, which has no such ties.
    SquaredDistance,
}

impl Cost {
    /// Cost between two points.
    #[must_use]
    pub fn between(self, from: [f64; 3], to: [f64; 3]) -> f64 {
        let [x, y, z] = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let squared = x * x + y * y + z * z;
        match self {
            Self::Distance => squared.sqrt(),
            Self::SquaredDistance => squared,
        }
    }

    /// By how much the matrix may exceed the true cost, as a factor.
    pub(super) fn tilt(self) -> f64 {
        match self {
            Self::Distance => 1.0 + TIE_BREAK,
            Self::SquaredDistance => 1.0,
        }
    }
}

/// Costs of one problem, one padded row a source point. Padding costs infinity.
#[derive(Clone, Debug, Default)]
pub(super) struct CostMatrix {
    lanes: Vec<[f64; LANES]>,
    /// Blocks of [`LANES`] columns in a row.
    stride: usize,
    /// Columns that are targets.
    targets: usize,
    /// Targets, padded with the last one without mass: coordinates by axis, and masses.
    axes: [Vec<[f64; LANES]>; 3],
    masses: Vec<[f64; LANES]>,
    source_means: Vec<f64>,
    target_means: Vec<[f64; LANES]>,
    /// No cost exceeds this.
    largest: f64,
}

impl CostMatrix {
    /// Fills in the tilted costs between two clouds, and their means.
    pub(super) fn fill(&mut self, problem: &Problem, cost: Cost) {
        let (sources, targets) = (problem.source(), problem.target());
        let stride = targets.len().div_ceil(LANES);
        self.stride = stride;
        self.targets = targets.len();
        let last = targets.points()[targets.len() - 1];
        for (axis, values) in self.axes.iter_mut().enumerate() {
            values.clear();
            values.resize(stride, [last[axis]; LANES]);
            for (value, point) in values.as_flattened_mut().iter_mut().zip(targets.points()) {
                *value = point[axis];
            }
        }
        for lanes in [&mut self.masses, &mut self.target_means] {
            lanes.clear();
            lanes.resize(stride, [0.0; LANES]);
        }
        self.masses.as_flattened_mut()[..targets.len()].copy_from_slice(targets.masses());
        self.source_means.clear();
        self.source_means.resize(sources.len(), 0.0);
        // Every row is written whole: what an earlier problem left there need not be cleared.
        self.lanes.resize(sources.len() * stride, [0.0; LANES]);

        let (mut low, mut high) = (sources.points()[0], sources.points()[0]);
        for point in sources.points().iter().chain(targets.points()) {
            for ((low, high), &x) in low.iter_mut().zip(&mut high).zip(point) {
                *low = if x < *low { x } else { *low };
                *high = if x > *high { x } else { *high };
            }
        }
        let diagonal = Cost::Distance.between(low, high);
        self.largest = match cost {
            Cost::Distance => diagonal,
            Cost::SquaredDistance => diagonal * diagonal,
        } * cost.tilt();
        // All points in one place: every cost is 0 whatever epsilon, as long as it is finite.
        let epsilon = TIE_BREAK / diagonal.max(1e-200);
        let tilted = |squared: f64| squared.sqrt() + epsilon * squared;
        let matrix = self;
        match cost {
            Cost::Distance => pulp::Arch::new().dispatch(Rows {
                matrix,
                sources,
                cost: tilted,
            }),
            Cost::SquaredDistance => pulp::Arch::new().dispatch(Rows {
                matrix,
                sources,
                cost: |squared| squared,
            }),
        }
    }

    /// One source point's costs, padded.
    pub(super) fn row(&self, source: usize) -> &[[f64; LANES]] {
        &self.lanes[source * self.stride..(source + 1) * self.stride]
    }

    /// All rows in order.
    pub(super) fn rows(&self) -> impl ExactSizeIterator<Item = &[[f64; LANES]]> + Clone {
        self.lanes.chunks_exact(self.stride)
    }

    /// One cost.
    pub(super) fn at(&self, source: usize, target: usize) -> f64 {
        self.row(source).as_flattened()[target]
    }

    /// Each source's mean cost over the targets, weighted by their masses.
    pub(super) fn source_means(&self) -> &[f64] {
        &self.source_means
    }

    /// Each target's mean cost over the sources, weighted by their masses, padded with numbers.
    pub(super) fn target_means(&self) -> &[[f64; LANES]] {
        &self.target_means
    }

    /// A bound no cost exceeds.
    pub(super) fn largest(&self) -> f64 {
        self.largest
    }

    /// Blocks of [`LANES`] columns in a row.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }
}

/// The rows of a matrix, compiled for wide registers too.
struct Rows<'a, F> {
    matrix: &'a mut CostMatrix,
    sources: &'a Cloud,
    /// Cost of a squared distance.
    cost: F,
}

impl<F: Fn(f64) -> f64> pulp::NullaryFnOnce for Rows<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self {
            matrix,
            sources,
            cost,
        } = self;
        let CostMatrix {
            lanes,
            stride,
            axes: [xs, ys, zs],
            targets,
            masses,
            source_means,
            target_means,
            ..
        } = matrix;
        for (((row, &[x, y, z]), &supply), mean) in lanes
            .chunks_exact_mut(*stride)
            .zip(sources.points())
            .zip(sources.masses())
            .zip(source_means)
        {
            let mut sums = [0.0; LANES];
            let places = xs.iter().zip(&*ys).zip(&*zs).zip(&*masses);
            for ((costs, means), (((xs, ys), zs), masses)) in
                row.iter_mut().zip(&mut *target_means).zip(places)
            {
                // One loop a purpose: of all in one the compiler makes no vectors.
                let mut block = [0.0; LANES];
                for lane in 0..LANES {
                    let (dx, dy, dz) = (xs[lane] - x, ys[lane] - y, zs[lane] - z);
                    block[lane] = cost(dx * dx + dy * dy + dz * dz);
                }
                for lane in 0..LANES {
                    sums[lane] += masses[lane] * block[lane];
                }
                for lane in 0..LANES {
                    means[lane] += supply * block[lane];
                }
                *costs = block;
            }
            *mean = sums.iter().sum();
            row.as_flattened_mut()[*targets..].fill(f64::INFINITY);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::NullaryFnOnce;

    fn scattered(sources: u32, targets: u32) -> Problem {
        let at = |k: u32| {
            [
                f64::from(k * 7 % 11),
                f64::from(k * k % 13),
                f64::from(k) / 3.0,
            ]
        };
        let cloud = |n: u32, from: u32| -> (Vec<_>, Vec<_>) {
            (from..from + n)
                .map(|k| (at(k), f64::from(1 + k % 5)))
                .unzip()
        };
        let ((from, supplies), (to, demands)) = (cloud(sources, 0), cloud(targets, 40));
        Problem::new(&from, &supplies, &to, &demands).expect("a fine problem")
    }

    #[test]
    fn costs_and_means_are_those_of_plain_loops_however_many_points_fill_a_row() {
        for (ns, nt) in [(1, 1), (3, 7), (5, 8), (4, 9), (9, 17)] {
            let problem = scattered(ns, nt);
            let (from, to) = (problem.source(), problem.target());
            for cost in [Cost::Distance, Cost::SquaredDistance] {
                let mut matrix = CostMatrix::default();
                // Twice: nothing of a larger problem shows.
                for problem in [&scattered(12, 30), &problem] {
                    matrix.fill(problem, cost);
                }
                let near = |x: f64, y: f64| (x - y).abs() <= 1e-8 * (1.0 + y.abs());
                let plain = |i: usize, j: usize| cost.between(from.points()[i], to.points()[j]);
                for i in 0..from.len() {
                    let costs: Vec<f64> = (0..to.len()).map(|j| plain(i, j)).collect();
                    let row = matrix.row(i).as_flattened();
                    assert!(row.iter().zip(&costs).all(|(x, y)| near(*x, *y)));
                    assert!(row[to.len()..].iter().all(|cost| *cost == f64::INFINITY));
                    let mean = costs.iter().zip(to.masses()).map(|(c, m)| c * m).sum();
                    assert!(near(matrix.source_means()[i], mean));
                }
                let means = matrix.target_means().as_flattened();
                for j in 0..to.len() {
                    let costs = (0..from.len()).map(|i| plain(i, j) * from.masses()[i]);
                    assert!(near(means[j], costs.sum()));
                }
                assert!(means.iter().all(|mean| mean.is_finite()));
            }
        }
    }

    #[test]
    fn every_width_of_registers_gives_the_same_bits() {
        let problem = scattered(23, 37);
        let mut wide = CostMatrix::default();
        wide.fill(&problem, Cost::SquaredDistance);
        let mut plain = wide.clone();
        plain.lanes.as_flattened_mut().fill(0.0);
        plain.target_means.as_flattened_mut().fill(0.0);
        Rows {
            matrix: &mut plain,
            sources: problem.source(),
            cost: |squared| squared,
        }
        .call();
        assert_eq!(plain.lanes, wide.lanes);
        assert_eq!(plain.source_means, wide.source_means);
        assert_eq!(plain.target_means, wide.target_means);
    }
}
