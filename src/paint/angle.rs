//! Angle grids: the θh and θd at which a table or a flake slice stands.

use serde::{Deserialize, Serialize};

/// Least step of a grid, degrees: far below any instrument's lens, and ten times what single precision tells apart.
pub const LEAST_STEP_DEG: f64 = 1e-4;

/// Angles in degrees, at least one, within `0..=90`, each at least [`LEAST_STEP_DEG`] above the one before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct AngleGrid {
    degrees: Vec<f64>,
}

/// Why a list of numbers is no angle grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AngleGridError {
    /// No angle at all.
    #[error("an angle grid needs at least one angle")]
    Empty,
    /// An angle outside `0..=90` or not finite.
    #[error("angle {index} is {value:?}°, accepted is 0 to 90")]
    Range {
        /// Position in the list.
        index: usize,
        /// The offending angle.
        value: f64,
    },
    /// An angle that is not above the one before it, or by hardly anything.
    #[error(
        "angle {index} is {value:?}° after {before:?}°, angles must ascend by {LEAST_STEP_DEG}° at least"
    )]
    Order {
        /// Position in the list.
        index: usize,
        /// The offending angle.
        value: f64,
        /// The angle before it.
        before: f64,
    },
}

/// Where an angle falls between two grid angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bracket {
    /// Index of the angle at or below.
    pub low: usize,
    /// Index of the angle above, or `low` at the border.
    pub high: usize,
    /// Weight of `high`, in `0..=1`.
    pub fraction: f64,
}

impl AngleGrid {
    /// A grid of these angles in degrees.
    ///
    /// # Errors
    ///
    /// [`AngleGridError`] for an empty list, an angle outside `0..=90`, or one that is not [`LEAST_STEP_DEG`] above the
    /// one before it.
    pub fn new(degrees: Vec<f64>) -> Result<Self, AngleGridError> {
        if degrees.is_empty() {
            return Err(AngleGridError::Empty);
        }
        for (index, &value) in degrees.iter().enumerate() {
            if !(0.0..=90.0).contains(&value) {
                return Err(AngleGridError::Range { index, value });
            }
            // A decimal step is a rounding away from itself.
            if index > 0 && value - degrees[index - 1] < LEAST_STEP_DEG * (1.0 - 1e-6) {
                return Err(AngleGridError::Order {
                    index,
                    value,
                    before: degrees[index - 1],
                });
            }
        }
        Ok(Self { degrees })
    }

    /// The grid with the single angle 0.
    #[must_use]
    pub fn single() -> Self {
        Self { degrees: vec![0.0] }
    }

    /// The angles, ascending.
    #[must_use]
    pub fn degrees(&self) -> &[f64] {
        &self.degrees
    }

    /// How many angles, at least one.
    #[must_use]
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.degrees.len()
    }

    /// Indices of every `step`-th angle from the first on, and of the last, so that the range stays what it was.
    #[must_use]
    pub fn every(&self, step: usize) -> Vec<usize> {
        let last = self.degrees.len() - 1;
        let mut kept: Vec<usize> = (0..=last).step_by(step.max(1)).collect();
        if kept.last() != Some(&last) {
            kept.push(last);
        }
        kept
    }

    /// The angles at these indices, which ascend strictly.
    ///
    /// # Panics
    ///
    /// When an index is no angle of the grid, or there is none.
    #[must_use]
    pub fn at(&self, indices: &[usize]) -> Self {
        assert!(!indices.is_empty(), "a grid has an angle");
        Self {
            degrees: indices.iter().map(|&k| self.degrees[k]).collect(),
        }
    }

    /// Finds an angle in degrees between its neighbours; outside the range the border angle holds.
    #[must_use]
    pub fn bracket(&self, angle_deg: f64) -> Bracket {
        let above = self.degrees.partition_point(|&d| d <= angle_deg);
        if above == 0 {
            return Bracket {
                low: 0,
                high: 0,
                fraction: 0.0,
            };
        }
        let low = above - 1;
        if above == self.degrees.len() {
            return Bracket {
                low,
                high: low,
                fraction: 0.0,
            };
        }
        let fraction = (angle_deg - self.degrees[low]) / (self.degrees[above] - self.degrees[low]);
        Bracket {
            low,
            high: above,
            fraction,
        }
    }

    /// As [`Self::bracket`], but an angle nearer than [`LEAST_STEP_DEG`] to one of the grid's counts as that: what
    /// [`Self::union`] makes one is one.
    #[must_use]
    pub fn bracket_of_near(&self, angle_deg: f64) -> Bracket {
        let bracket = self.bracket(angle_deg);
        let near = |index: &usize| (self.degrees[*index] - angle_deg).abs() < LEAST_STEP_DEG;
        match [bracket.low, bracket.high].into_iter().find(near) {
            Some(index) => Bracket {
                low: index,
                high: index,
                fraction: 0.0,
            },
            None => bracket,
        }
    }

    /// Whether both grids have the same angles, but for less than [`LEAST_STEP_DEG`].
    #[must_use]
    pub fn is_near(&self, other: &Self) -> bool {
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < LEAST_STEP_DEG;
        self.len() == other.len() && self.degrees.iter().zip(&other.degrees).all(near)
    }

    /// The angles of both grids, each once; of two nearer than [`LEAST_STEP_DEG`] the smaller.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let mut degrees: Vec<f64> = self.degrees.iter().chain(&other.degrees).copied().collect();
        degrees.sort_by(f64::total_cmp);
        degrees.dedup_by(|above, kept| *above - *kept < LEAST_STEP_DEG);
        Self { degrees }
    }
}

/// An angle grid prepared for millions of look-ups in single precision.
#[derive(Clone, Debug)]
pub(crate) struct QuickGrid {
    degrees: Vec<f32>,
    /// Last angle at or below each half degree.
    start: Vec<u32>,
}

/// [`Bracket`] in single precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct QuickBracket {
    pub(crate) low: usize,
    pub(crate) high: usize,
    pub(crate) fraction: f32,
}

impl QuickGrid {
    #[allow(clippy::cast_possible_truncation)] // degrees to texel precision, indices of few angles
    pub(crate) fn new(grid: &AngleGrid) -> Self {
        let degrees: Vec<f32> = grid.degrees.iter().map(|&d| d as f32).collect();
        let start = (0..=180_u16).map(|half| {
            let at = f32::from(half) / 2.0;
            degrees.partition_point(|&d| d <= at).saturating_sub(1) as u32
        });
        Self {
            start: start.collect(),
            degrees,
        }
    }

    pub(crate) const fn len(&self) -> usize {
        self.degrees.len()
    }

    /// Finds an angle in degrees between its neighbours; outside the range the border angle holds.
    #[inline]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates, clamped to the table
    pub(crate) fn bracket(&self, angle_deg: f32) -> QuickBracket {
        let mut low = self.start[((angle_deg * 2.0) as usize).min(180)] as usize;
        let last = self.degrees.len() - 1;
        while low < last && self.degrees[low + 1] <= angle_deg {
            low += 1;
        }
        if low == last {
            return QuickBracket {
                low,
                high: low,
                fraction: 0.0,
            };
        }
        let (below, above) = (self.degrees[low], self.degrees[low + 1]);
        QuickBracket {
            low,
            high: low + 1,
            fraction: ((angle_deg - below) / (above - below)).max(0.0),
        }
    }
}

impl TryFrom<Vec<f64>> for AngleGrid {
    type Error = AngleGridError;
    fn try_from(degrees: Vec<f64>) -> Result<Self, AngleGridError> {
        Self::new(degrees)
    }
}

impl From<AngleGrid> for Vec<f64> {
    fn from(grid: AngleGrid) -> Self {
        grid.degrees
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_that_do_not_ascend_are_refused_by_place_and_value() {
        let error = AngleGrid::new(vec![0.0, 5.0, 5.0]).expect_err("refused");
        assert_eq!(
            error,
            AngleGridError::Order {
                index: 2,
                value: 5.0,
                before: 5.0
            }
        );
        assert!(AngleGrid::new(vec![f64::NAN]).is_err());
        assert!(AngleGrid::new(vec![0.0, 90.1]).is_err());
    }

    #[test]
    fn angles_that_were_rounded_otherwise_are_the_same_angles() {
        let grid = |degrees: &[f64]| AngleGrid::new(degrees.to_vec()).expect("a grid");
        let (exact, rounded) = (
            grid(&[0.0, 66.0 / 23.0, 132.0 / 23.0]),
            grid(&[0.0, 2.8696, 5.7391]),
        );
        let both = exact.union(&rounded);
        assert_eq!(both.degrees(), [0.0, 66.0 / 23.0, 5.7391]);
        assert!(both.is_near(&exact) && both.is_near(&rounded));
        for grid in [&exact, &rounded] {
            for (k, &angle) in both.degrees().iter().enumerate() {
                let bracket = grid.bracket_of_near(angle);
                assert_eq!((bracket.low, bracket.high, bracket.fraction), (k, k, 0.0));
            }
        }
        assert!(!exact.is_near(&grid(&[0.0, 2.8698, 5.7391])));
        assert_eq!(exact.bracket_of_near(1.0), exact.bracket(1.0));
    }

    #[test]
    fn the_quick_grid_finds_the_same_neighbours() {
        for degrees in [
            vec![0.0],
            vec![10.0, 20.0],
            vec![0.0, 0.1, 0.2, 0.7, 33.3, 66.0],
            vec![90.0],
        ] {
            let grid = AngleGrid::new(degrees).expect("ascending");
            let quick = QuickGrid::new(&grid);
            for step in 0..1000_u16 {
                let angle = f64::from(step) * 0.095;
                #[allow(clippy::cast_possible_truncation)]
                let (want, got) = (grid.bracket(angle), quick.bracket(angle as f32));
                let at = |low: usize, fraction: f64| {
                    let high = (low + 1).min(grid.len() - 1);
                    grid.degrees()[low] * (1.0 - fraction) + grid.degrees()[high] * fraction
                };
                assert!(
                    (at(want.low, want.fraction) - at(got.low, f64::from(got.fraction))).abs()
                        < 1e-4,
                    "{angle}"
                );
            }
        }
    }

    #[test]
    fn a_bracket_holds_the_border_outside_the_range() {
        let grid = AngleGrid::new(vec![10.0, 20.0]).expect("ascending");
        assert_eq!(
            grid.bracket(5.0),
            Bracket {
                low: 0,
                high: 0,
                fraction: 0.0
            }
        );
        assert_eq!(
            grid.bracket(12.5),
            Bracket {
                low: 0,
                high: 1,
                fraction: 0.25
            }
        );
        assert_eq!(
            grid.bracket(20.0),
            Bracket {
                low: 1,
                high: 1,
                fraction: 0.0
            }
        );
        assert_eq!(
            grid.bracket(80.0),
            Bracket {
                low: 1,
                high: 1,
                fraction: 0.0
            }
        );
    }
}
