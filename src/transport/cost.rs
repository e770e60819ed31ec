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
    /// Target coordinates by axis, padded.
    axes: [Vec<[f64; LANES]>; 3],
    /// No cost exceeds this.
    largest: f64,
}

impl CostMatrix {
    /// Fills in the tilted costs between two clouds.
    pub(super) fn fill(&mut self, sources: &[[f64; 3]], targets: &[[f64; 3]], cost: Cost) {
        let stride = targets.len().div_ceil(LANES);
        self.stride = stride;
        let [xs, ys, zs] = &mut self.axes;
        for (axis, values) in [&mut *xs, &mut *ys, &mut *zs].into_iter().enumerate() {
            values.clear();
            let (blocks, rest) = targets.as_chunks::<LANES>();
            values.extend(blocks.iter().map(|block| block.map(|point| point[axis])));
            if !rest.is_empty() {
                let mut last = [f64::INFINITY; LANES];
                for (value, point) in last.iter_mut().zip(rest) {
                    *value = point[axis];
                }
                values.push(last);
            }
        }
        let (mut low, mut high) = (sources[0], sources[0]);
        for point in sources.iter().chain(targets) {
            for ((low, high), &x) in low.iter_mut().zip(&mut high).zip(point) {
                *low = if x < *low { x } else { *low };
                *high = if x > *high { x } else { *high };
            }
        }
        let diagonal = Cost::Distance.between(low, high);
        // All points in one place: every cost is 0 whatever epsilon, as long as it is finite.
        let epsilon = TIE_BREAK / diagonal.max(1e-200);
        self.largest = match cost {
            Cost::Distance => diagonal,
            Cost::SquaredDistance => diagonal * diagonal,
        } * cost.tilt();
        self.lanes.clear();
        for &[x, y, z] in sources {
            let columns = xs.iter().zip(&*ys).zip(&*zs);
            self.lanes.extend(columns.map(|((xs, ys), zs)| {
                let mut costs = [0.0; LANES];
                for lane in 0..LANES {
                    let (dx, dy, dz) = (xs[lane] - x, ys[lane] - y, zs[lane] - z);
                    let squared = dx * dx + dy * dy + dz * dz;
                    costs[lane] = match cost {
                        Cost::Distance => {
                            let distance = squared.sqrt();
                            distance + epsilon * squared
                        }
                        Cost::SquaredDistance => squared,
                    };
                }
                costs
            }));
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

    /// A bound no cost exceeds.
    pub(super) fn largest(&self) -> f64 {
        self.largest
    }

    /// Blocks of [`LANES`] columns in a row.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }
}
