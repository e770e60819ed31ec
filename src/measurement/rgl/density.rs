//! Tables over the unit square: bilinear values, and densities with their integrals.

/// A rectangle of values over the unit square, bilinear in between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    pub(super) rows: usize,
    pub(super) columns: usize,
}

/// Where a point of the unit square lies among an extent's vertices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) row: usize,
    pub(super) column: usize,
    /// Offsets in the cell, `0..=1`.
    pub(super) x: f64,
    pub(super) y: f64,
}

impl Extent {
    pub(super) const fn len(self) -> usize {
        self.rows * self.columns
    }

    pub(super) fn cell(self, u: f64, v: f64) -> Cell {
        let (column, x) = split(u, self.columns);
        let (row, y) = split(v, self.rows);
        Cell { row, column, x, y }
    }

    /// Bilinear value in a table of this extent.
    pub(super) fn bilinear(self, table: &[f32], cell: Cell) -> f64 {
        let at =
            |r: usize, c: usize| f64::from(table[(cell.row + r) * self.columns + cell.column + c]);
        let lower = (1.0 - cell.x) * at(0, 0) + cell.x * at(0, 1);
        let upper = (1.0 - cell.x) * at(1, 0) + cell.x * at(1, 1);
        (1.0 - cell.y) * lower + cell.y * upper
    }
}

/// Vertex below a coordinate in `0..=1` among `count >= 2`, and the offset from it.
pub(super) fn split(u: f64, count: usize) -> (usize, f64) {
    let x = u.clamp(0.0, 1.0) * f64::from(u32::try_from(count - 1).unwrap_or(u32::MAX));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0..=count-1 by the clamp.
    let low = (x as usize).min(count - 2);
    (low, x - f64::from(u32::try_from(low).unwrap_or(u32::MAX)))
}

/// The density of visible normals for one incidence, with its integrals along rows and over rows.
#[derive(Clone, Debug)]
pub(super) struct Density {
    pub(super) values: Vec<f64>,
    /// Integral along a row up to each vertex, in cells.
    pub(super) along: Vec<f64>,
    /// Integral over rows up to each row, in cells.
    pub(super) over: Vec<f64>,
}

impl Density {
    pub(super) fn new(extent: Extent, raw: &[f32]) -> Self {
        let mut along = Vec::with_capacity(extent.len());
        let mut over = Vec::with_capacity(extent.rows);
        let (mut sum, mut before) = (0.0, None);
        for row in raw.chunks_exact(extent.columns) {
            let mut integral = 0.0;
            along.push(0.0);
            for pair in row.windows(2) {
                integral += f64::midpoint(f64::from(pair[0]), f64::from(pair[1]));
                along.push(integral);
            }
            if let Some(before) = before {
                sum += f64::midpoint(before, integral);
            }
            over.push(sum);
            before = Some(integral);
        }
        let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        let scaled = |v: Vec<f64>| v.into_iter().map(|x| x * scale).collect();
        Self {
            values: raw.iter().map(|&v| f64::from(v) * scale).collect(),
            along: scaled(along),
            over: scaled(over),
        }
    }
}
