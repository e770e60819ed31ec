//! The color table chi(θh, θd): the color of diffuse and lobes by half angle.
//!
//! Nodes are kept in CIELAB, where blending happens (Golla and Klein 2018, 4.2), and read in linear sRGB, where
//! interpolation between nodes happens: `chi = 1` is Lab white. Border nodes hold outside the grid.

use serde::{Deserialize, Serialize};

use super::angle::{AngleGrid, Bracket};
use super::direction::HalfAngles;
use crate::color::{Lab, LinearRgb};

/// Color of the base by angle.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorTable {
    theta_h: AngleGrid,
    theta_d: AngleGrid,
    nodes: Vec<Lab>,
    overall: Lab,
}

/// Why numbers make no color table.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[non_exhaustive]
pub enum ColorTableError {
    /// Not one color per angle pair.
    #[error("a color table of {theta_h} x {theta_d} angles has {nodes} colors")]
    Size {
        /// Angles of θh.
        theta_h: usize,
        /// Angles of θd.
        theta_d: usize,
        /// Colors given.
        nodes: usize,
    },
    /// A color that is not finite.
    #[error("the color at theta_h {row}, theta_d {column} is not finite")]
    NotFinite {
        /// Index of θh.
        row: usize,
        /// Index of θd.
        column: usize,
    },
}

impl ColorTable {
    /// A table of `theta_h.len() x theta_d.len()` colors, θd fastest, and the one color that stands for all of them.
    ///
    /// # Errors
    ///
    /// [`ColorTableError`] when the counts differ or a color is not finite.
    pub fn new(
        theta_h: AngleGrid,
        theta_d: AngleGrid,
        nodes: Vec<Lab>,
        overall: Lab,
    ) -> Result<Self, ColorTableError> {
        if nodes.len() != theta_h.len() * theta_d.len() {
            let (theta_h, theta_d) = (theta_h.len(), theta_d.len());
            return Err(ColorTableError::Size {
                theta_h,
                theta_d,
                nodes: nodes.len(),
            });
        }
        let finite = |lab: &Lab| lab.to_array().iter().all(|v| v.is_finite());
        if let Some(k) = nodes.iter().position(|lab| !finite(lab)) {
            return Err(ColorTableError::NotFinite {
                row: k / theta_d.len(),
                column: k % theta_d.len(),
            });
        }
        if !finite(&overall) {
            return Err(ColorTableError::NotFinite { row: 0, column: 0 });
        }
        Ok(Self {
            theta_h,
            theta_d,
            nodes,
            overall,
        })
    }

    /// A table that leaves every color as it is.
    #[must_use]
    pub fn white() -> Self {
        let white = Lab {
            l: 100.0,
            a: 0.0,
            b: 0.0,
        };
        Self {
            theta_h: AngleGrid::single(),
            theta_d: AngleGrid::single(),
            nodes: vec![white],
            overall: white,
        }
    }

    /// Angles of the rows.
    #[must_use]
    pub const fn theta_h(&self) -> &AngleGrid {
        &self.theta_h
    }

    /// Angles of the columns.
    #[must_use]
    pub const fn theta_d(&self) -> &AngleGrid {
        &self.theta_d
    }

    /// The colors, θd fastest.
    #[must_use]
    pub fn nodes(&self) -> &[Lab] {
        &self.nodes
    }

    /// The one color that stands for the table where a table is not wanted.
    #[must_use]
    pub const fn overall(&self) -> Lab {
        self.overall
    }

    /// The same function on other angles, exact where they contain this table's own.
    #[must_use]
    pub fn on(&self, theta_h: &AngleGrid, theta_d: &AngleGrid) -> Self {
        if (&self.theta_h, &self.theta_d) == (theta_h, theta_d) {
            return self.clone();
        }
        let rgb: Vec<LinearRgb> = self.nodes.iter().map(|lab| lab.to_rgb()).collect();
        let mut nodes = Vec::with_capacity(theta_h.len() * theta_d.len());
        for &h in theta_h.degrees() {
            for &d in theta_d.degrees() {
                let (row, column) = (
                    self.theta_h.bracket_of_near(h),
                    self.theta_d.bracket_of_near(d),
                );
                nodes.push(match (on_node(row), on_node(column)) {
                    (Some(r), Some(c)) => self.nodes[r * self.theta_d.len() + c],
                    _ => Lab::from_rgb(bilinear(&rgb, self.theta_d.len(), row, column)),
                });
            }
        }
        Self {
            theta_h: theta_h.clone(),
            theta_d: theta_d.clone(),
            nodes,
            overall: self.overall,
        }
    }
}

fn on_node(bracket: Bracket) -> Option<usize> {
    (bracket.fraction == 0.0).then_some(bracket.low)
}

/// Value of a table of colors, θd fastest, at the angles of a pair of directions: bilinear between its nodes, the border
/// nodes' outside them.
///
/// # Panics
///
/// When the table has not one color per angle pair.
#[must_use]
pub fn at_angles(
    table: &[LinearRgb],
    theta_h: &AngleGrid,
    theta_d: &AngleGrid,
    half: &HalfAngles,
) -> LinearRgb {
    let row = theta_h.bracket(half.theta_h.to_degrees());
    let column = theta_d.bracket(half.theta_d.to_degrees());
    bilinear(table, theta_d.len(), row, column)
}

/// Bilinear value of a row-major table of colors.
fn bilinear(table: &[LinearRgb], columns: usize, row: Bracket, column: Bracket) -> LinearRgb {
    let at = |r: usize, c: usize| table[r * columns + c];
    let (u, v) = (row.fraction, column.fraction);
    let corners = [
        at(row.low, column.low),
        at(row.low, column.high),
        at(row.high, column.low),
        at(row.high, column.high),
    ];
    let weights = [(1.0 - u) * (1.0 - v), (1.0 - u) * v, u * (1.0 - v), u * v];
    std::array::from_fn(|k| corners.iter().zip(weights).map(|(c, w)| c[k] * w).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finer_grid_is_the_same_function() {
        let grid = |d: &[f64]| AngleGrid::new(d.to_vec()).expect("ascending");
        let nodes: Vec<Lab> = (0..6)
            .map(|k| Lab {
                l: 20.0 + 10.0 * f64::from(k),
                a: 5.0,
                b: -7.0,
            })
            .collect();
        let table = ColorTable::new(
            grid(&[0.0, 30.0, 60.0]),
            grid(&[0.0, 50.0]),
            nodes,
            Lab::default(),
        )
        .expect("fits");
        let finer = table.on(
            &grid(&[0.0, 10.0, 30.0, 60.0, 70.0]),
            &grid(&[0.0, 20.0, 50.0]),
        );
        let read = |t: &ColorTable, h: f64, d: f64| {
            let rgb: Vec<LinearRgb> = t.nodes().iter().map(|lab| lab.to_rgb()).collect();
            bilinear(
                &rgb,
                t.theta_d().len(),
                t.theta_h().bracket(h),
                t.theta_d().bracket(d),
            )
        };
        for (h, d) in [(0.0, 0.0), (7.0, 33.0), (45.0, 12.0), (80.0, 60.0)] {
            for (x, y) in read(&table, h, d).iter().zip(read(&finer, h, d)) {
                assert!((x - y).abs() < 1e-14, "{h} {d}");
            }
        }
        assert_eq!(finer.nodes()[0], table.nodes()[0]);
    }
}
