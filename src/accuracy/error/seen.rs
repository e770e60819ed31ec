//! What would be noticed of an error, at the instrument geometries.

use serde::Serialize;
use utoipa::ToSchema;

use super::{NOT_MEASURED, REALISED_UNSEEN};
use crate::blend::BlendDeviation;
use crate::paint::{ASPECULAR_DEG, Clustering, SeenDifference};

/// What would be noticed of an error: sums of what was measured step by step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct SeenError {
    /// Aspecular angles of the instrument geometries, degrees.
    pub aspecular_deg: [f64; 6],
    /// CIEDE2000 of the mean color at each.
    pub delta_e_2000: [f64; 6],
    /// Relative error of how many flakes are lit at each, fewer than one texel in a thousand counted as that many.
    pub lit: [f64; 6],
    /// Relative error of the 99.9th percentile of the flakes' luminance: of clusters nine of ten compared slices are
    /// within, of transport and file it is the worst geometry.
    pub sparkle: f64,
    /// How it is known.
    pub how: &'static str,
}

impl SeenError {
    /// Of what has no flakes to misplace.
    pub(super) fn none() -> Self {
        Self {
            aspecular_deg: ASPECULAR_DEG,
            delta_e_2000: [0.0; 6],
            lit: [0.0; 6],
            sparkle: 0.0,
            how: NOTHING,
        }
    }

    /// The same as a paint keeps it that is realised with it.
    #[must_use]
    pub const fn kept(&self) -> SeenDifference {
        SeenDifference {
            delta_e_2000: self.delta_e_2000,
            sparkle: [self.sparkle; 6],
            lit: self.lit,
        }
    }

    /// Of clusters against pixels, or of the blend that they were realised from; and of the angles that were left out and
    /// the clusters that were merged since.
    ///
    /// # Errors
    ///
    /// Why it is not known, where a step was not measured.
    pub(super) fn of_clusters(clustering: Option<&Clustering>) -> Result<Self, &'static str> {
        let clustering = clustering.ok_or(NOT_MEASURED)?;
        let mut seen = match (&clustering.error, clustering.realised_seen) {
            (Some(error), _) => Self {
                delta_e_2000: error.instrument,
                lit: error.lit.ok_or(NOT_MEASURED)?,
                sparkle: error.sparkle.p90,
                how: SEEN,
                ..Self::none()
            },
            (None, Some(of_blend)) => Self {
                how: SEEN,
                ..Self::none()
            }
            .and_step(&of_blend),
            (None, None) if clustering.realised_lab.is_some() => return Err(REALISED_UNSEEN),
            (None, None) => return Err(NOT_MEASURED),
        };
        if clustering.left_out_w1.is_some() {
            seen = seen.and_step(&clustering.left_out_seen.ok_or(NOT_MEASURED)?);
        }
        if clustering.reduced_w1.is_some() {
            seen = seen.and_step(&clustering.reduced_seen.ok_or(NOT_MEASURED)?);
        }
        Ok(seen)
    }

    fn and_step(self, step: &SeenDifference) -> Self {
        self.and(&step.delta_e_2000, &step.lit, &step.sparkle)
    }

    /// The worse of two, figure by figure.
    pub(super) fn or_worse(self, other: Self) -> Self {
        Self {
            delta_e_2000: each(self.delta_e_2000, &other.delta_e_2000, f64::max),
            lit: each(self.lit, &other.lit, f64::max),
            sparkle: self.sparkle.max(other.sparkle),
            ..self
        }
    }

    /// With what another transport than the exact one adds; that lists nothing.
    pub(super) fn and_transport(self, deviations: &[BlendDeviation]) -> Option<Self> {
        if deviations.is_empty() {
            return Some(self);
        }
        let at = |angle: f64| deviations.iter().find(|own| own.aspecular_deg == angle);
        let each = self.aspecular_deg.map(at).into_iter();
        let each = each.collect::<Option<Vec<&BlendDeviation>>>()?;
        let lit = each.iter().map(|own| own.lit);
        let lit = lit.collect::<Option<Vec<f64>>>()?;
        let color: Vec<f64> = each.iter().map(|own| own.delta_e_2000).collect();
        let sparkle: Vec<f64> = each.iter().map(|own| own.sparkle).collect();
        Some(self.and(&color, &lit, &sparkle))
    }

    /// With what another step adds at each geometry.
    pub(super) fn and(self, delta_e_2000: &[f64], lit: &[f64], sparkle: &[f64]) -> Self {
        let sum = |x: f64, y: f64| x + y;
        Self {
            delta_e_2000: each(self.delta_e_2000, delta_e_2000, sum),
            lit: each(self.lit, lit, sum),
            sparkle: self.sparkle + sparkle.iter().copied().fold(0.0, f64::max),
            ..self
        }
    }
}

fn each(mut all: [f64; 6], others: &[f64], of: impl Fn(f64, f64) -> f64) -> [f64; 6] {
    for (own, &other) in all.iter_mut().zip(others) {
        *own = of(*own, other);
    }
    all
}

const NOTHING: &str = "exact: there are no flakes to misplace";

const SEEN: &str = "measured step by step and added up: clusters against pixels, or the blend that a paint was realised from, fewer \
                    angles or clusters against all, of several paints the worst, each over its own base; a blend against exact transport in the same order, at equal weights; a file against the paint";
