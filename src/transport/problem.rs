//! Two weighted point clouds, checked and brought to mass 1, and what can be wrong with them.
//!
//! Masses arrive with sums a rounding away from 1 (and in practice up to 1e-7 off, or unnormalised). Each side is
//! divided by its own sum, so a cluster is never dropped and none gains from another's rounding. A mass of zero is
//! refused: it has no place in a plan, and a caller that has one has lost a cluster already.
//!
//! Range: coordinates up to 1e100 in size, masses in `(0, 1e300]`, up to [`MOST_POINTS`] points a side.

/// The most points one side may have.
pub const MOST_POINTS: usize = 4096;

/// The largest coordinate, in size, whose squared distances stay finite with room to sum them.
const LARGEST_COORDINATE: f64 = 1e100;

/// The largest mass whose sum over [`MOST_POINTS`] stays finite.
const LARGEST_MASS: f64 = 1e300;

/// One of the two clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Where mass comes from.
    Source,
    /// Where mass goes to.
    Target,
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Source => "source",
            Self::Target => "target",
        })
    }
}

/// Why there is no transport plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TransportError {
    /// A cloud without points.
    #[error("the {0} cloud has no points")]
    Empty(Side),
    /// As many masses as points are needed.
    #[error("the {side} cloud has {points} points and {masses} masses")]
    Unpaired {
        /// Which cloud.
        side: Side,
        /// Points given.
        points: usize,
        /// Masses given.
        masses: usize,
    },
    /// More than [`MOST_POINTS`] points.
    #[error("the {side} cloud has {points} points, more than {MOST_POINTS}")]
    TooManyPoints {
        /// Which cloud.
        side: Side,
        /// Points given.
        points: usize,
    },
    /// A coordinate that is not finite, or so large that its squares are not.
    #[error("{side} point {index}: coordinate {axis} is {value}, not within ±1e100")]
    Point {
        /// Which cloud.
        side: Side,
        /// Which point of it.
        index: usize,
        /// Which of its three coordinates.
        axis: usize,
        /// The offending coordinate.
        value: f64,
    },
    /// A mass that is not positive, or not finite.
    #[error("{side} point {index}: mass {value} is not within (0, 1e300]")]
    Mass {
        /// Which cloud.
        side: Side,
        /// Which point of it.
        index: usize,
        /// The offending mass.
        value: f64,
    },
    /// A smoothing of the Sinkhorn solver outside `1e-9..=1e3`.
    #[error("Sinkhorn epsilon {0} is not within 1e-9..=1e3")]
    Epsilon(f64),
    /// An iterative solver that ran out of steps before it met its promise.
    #[error(
        "not converged after {steps} steps: residual {residual:e}, promised {promised:e}; a greater epsilon or the exact \
         transport ends"
    )]
    NotConverged {
        /// Steps made.
        steps: usize,
        /// Residual reached.
        residual: f64,
        /// Residual promised.
        promised: f64,
    },
    /// The linear-programming library gave up, or gave an answer that does not move the masses.
    #[error("linear program: {0}")]
    LinearProgram(String),
}

/// One cloud: points, and masses that sum to 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    points: Vec<[f64; 3]>,
    masses: Vec<f64>,
}

impl Cloud {
    /// The points, in the order given.
    #[must_use]
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The masses, in the order given, divided by their sum.
    #[must_use]
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point, as in a problem that was never filled.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    fn clear(&mut self) {
        self.points.clear();
        self.masses.clear();
    }

    fn fill(
        &mut self,
        side: Side,
        weighted: impl IntoIterator<Item = ([f64; 3], f64)>,
    ) -> Result<(), TransportError> {
        self.clear();
        for (point, mass) in weighted {
            self.points.push(point);
            self.masses.push(mass);
        }
        if self.points.is_empty() {
            return Err(TransportError::Empty(side));
        }
        if self.points.len() > MOST_POINTS {
            return Err(TransportError::TooManyPoints {
                side,
                points: self.points.len(),
            });
        }
        for (index, point) in self.points.iter().enumerate() {
            // One comparison refuses NaN as well, which is never within bounds.
            if let Some(axis) = point
                .iter()
                .position(|x| !(-LARGEST_COORDINATE..=LARGEST_COORDINATE).contains(x))
            {
                let value = point[axis];
                return Err(TransportError::Point {
                    side,
                    index,
                    axis,
                    value,
                });
            }
        }
        if let Some(index) = self
            .masses
            .iter()
            .position(|&mass| !(mass > 0.0 && mass <= LARGEST_MASS))
        {
            let value = self.masses[index];
            return Err(TransportError::Mass { side, index, value });
        }
        let sum: f64 = self.masses.iter().sum();
        for mass in &mut self.masses {
            // Beside a neighbour of 1e300 a mass may underflow; it stays positive, so its cluster stays.
            *mass = (*mass / sum).max(f64::MIN_POSITIVE);
        }
        Ok(())
    }
}

/// A transport problem: move the source cloud's mass onto the target cloud's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problem {
    source: Cloud,
    target: Cloud,
}

impl Problem {
    /// A problem from points and masses, which may have any positive sum.
    ///
    /// # Errors
    ///
    /// [`TransportError::Empty`], [`TransportError::Unpaired`], [`TransportError::TooManyPoints`],
    /// [`TransportError::Point`] or [`TransportError::Mass`], with the first offender.
    ///
    /// # Examples
    ///
    /// ```
    /// # use carpaint::transport::Problem;
    /// let problem = Problem::new(&[[0.0; 3]], &[2.0], &[[1.0; 3], [2.0; 3]], &[1.0, 3.0])?;
    /// assert_eq!(problem.target().masses(), [0.25, 0.75]);
    /// # Ok::<(), carpaint::transport::TransportError>(())
    /// ```
    pub fn new(
        source_points: &[[f64; 3]],
        source_masses: &[f64],
        target_points: &[[f64; 3]],
        target_masses: &[f64],
    ) -> Result<Self, TransportError> {
        let mut problem = Self::default();
        problem.refill_slices(source_points, source_masses, target_points, target_masses)?;
        Ok(problem)
    }

    /// [`Problem::new`] into the memory of an earlier problem.
    ///
    /// # Errors
    ///
    /// As [`Problem::new`]; the problem is empty then.
    pub fn refill_slices(
        &mut self,
        source_points: &[[f64; 3]],
        source_masses: &[f64],
        target_points: &[[f64; 3]],
        target_masses: &[f64],
    ) -> Result<(), TransportError> {
        for (side, points, masses) in [
            (Side::Source, source_points.len(), source_masses.len()),
            (Side::Target, target_points.len(), target_masses.len()),
        ] {
            if points != masses {
                self.source.clear();
                self.target.clear();
                return Err(TransportError::Unpaired {
                    side,
                    points,
                    masses,
                });
            }
        }
        let pair = |(&point, &mass): (&[f64; 3], &f64)| (point, mass);
        self.refill(
            source_points.iter().zip(source_masses).map(pair),
            target_points.iter().zip(target_masses).map(pair),
        )
    }

    /// Replaces both clouds, keeping the memory: what a caller with many slices uses.
    ///
    /// # Errors
    ///
    /// As [`Problem::new`]; the problem is empty then.
    pub fn refill(
        &mut self,
        source: impl IntoIterator<Item = ([f64; 3], f64)>,
        target: impl IntoIterator<Item = ([f64; 3], f64)>,
    ) -> Result<(), TransportError> {
        let filled = self
            .source
            .fill(Side::Source, source)
            .and_then(|()| self.target.fill(Side::Target, target));
        if filled.is_err() {
            self.source.clear();
            self.target.clear();
        }
        filled
    }

    /// Where mass comes from.
    #[must_use]
    pub fn source(&self) -> &Cloud {
        &self.source
    }

    /// Where mass goes to.
    #[must_use]
    pub fn target(&self) -> &Cloud {
        &self.target
    }

    /// Refuses a problem that was never filled.
    pub(super) fn check_filled(&self) -> Result<(), TransportError> {
        if self.source.is_empty() {
            return Err(TransportError::Empty(Side::Source));
        }
        if self.target.is_empty() {
            return Err(TransportError::Empty(Side::Target));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORIGIN: [f64; 3] = [0.0; 3];

    #[test]
    fn masses_are_rescaled_and_none_is_dropped() {
        let problem = Problem::new(&[ORIGIN; 3], &[1e-300, 2.0, 6.0], &[ORIGIN], &[1e-7])
            .expect("positive masses");
        assert_eq!(problem.source().masses(), [1e-300 / 8.0, 0.25, 0.75]);
        assert_eq!(problem.target().masses(), [1.0]);
    }

    #[test]
    fn offenders_are_named_with_place_and_value() {
        let nan = Problem::new(
            &[ORIGIN, [0.0, f64::NAN, 0.0]],
            &[1.0; 2],
            &[ORIGIN],
            &[1.0],
        );
        assert!(matches!(
            nan,
            Err(TransportError::Point {
                side: Side::Source,
                index: 1,
                axis: 1,
                value
            }) if value.is_nan()
        ));
        for bad in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            let refused = Problem::new(&[ORIGIN], &[1.0], &[ORIGIN; 2], &[1.0, bad]);
            assert!(
                matches!(
                    refused,
                    Err(TransportError::Mass {
                        side: Side::Target,
                        index: 1,
                        ..
                    })
                ),
                "{bad}: {refused:?}"
            );
        }
        assert_eq!(
            Problem::new(&[], &[], &[ORIGIN], &[1.0]),
            Err(TransportError::Empty(Side::Source))
        );
        assert_eq!(
            Problem::new(&[ORIGIN], &[1.0], &[ORIGIN], &[]),
            Err(TransportError::Unpaired {
                side: Side::Target,
                points: 1,
                masses: 0
            })
        );
        assert!(matches!(
            Problem::new(&[[1e101, 0.0, 0.0]], &[1.0], &[ORIGIN], &[1.0]),
            Err(TransportError::Point { axis: 0, .. })
        ));
    }

    #[test]
    fn a_refused_refill_leaves_an_empty_problem() {
        let mut problem = Problem::new(&[ORIGIN], &[1.0], &[ORIGIN], &[1.0]).expect("fine");
        problem
            .refill([(ORIGIN, 1.0)], [(ORIGIN, 0.0)])
            .expect_err("zero mass");
        assert!(problem.check_filled().is_err());
    }
}
