//! The error of a result in one number, with the terms that it is made of.
//!
//! Flakes are distributions of color, and the distance between two of them is W1 in Lab: how far the average texel's
//! color has moved. What the stages misplace adds up by the triangle inequality: pixels to clusters at ingest, slices at
//! angles that a profile leaves out, box to written box in a file. To it comes, of a blend, how much further flakes
//! travel between the paints than they would have to: cost of the plan less its dual bound.
//!
//! ```text
//! error = W1(pixels, clusters) + (cost − dual bound) + W1(slices left out, mixtures) + W1(slices, with fewer clusters)
//!         + W1(box, rounded box)
//! ```
//!
//! What instrument and eye would notice stands beside it: color and lit flakes at the six instrument geometries, and
//! sparkle. Every step measures it against the one before, and the steps' figures are added up, which is no bound. It is
//! measured at weights within the paints, and told of no others.
//!
//! The reference profile's transport and files have none but the first. A realisation outside the paints multiplies
//! what a blend has by the sum of the weights' sizes.

mod picture;
mod seen;
#[cfg(test)]
mod tests;

use serde::Serialize;
use utoipa::ToSchema;

pub use self::picture::PictureError;
pub use self::seen::SeenError;
use super::WritingError;
use super::writing::bundle_rounding_w1;
use crate::blend::Blend;
use crate::export::ExportSettings;
use crate::paint::{Clustering, PaintFile, Percentiles};

/// Error of a result against the reference: in Lab, the distance by which its flakes' colors are misplaced.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ResultError {
    /// Sum of the terms, Lab units; null where one of them is not known.
    pub lab: Option<f64>,
    /// What it is made of.
    pub terms: Vec<Term>,
    /// What would be noticed of it; null where a step was not measured.
    pub seen: Option<SeenError>,
    /// Why `seen` is null.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen: Option<&'static str>,
}

/// One term of an error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
#[schema(as = ErrorTerm)]
pub struct Term {
    /// What it is about: `clusters`, `transport`, `angles`, `reduction`, `rounding`.
    pub what: &'static str,
    /// Lab units; null where it is not known.
    pub lab: Option<f64>,
    /// How it is known.
    pub how: &'static str,
}

impl ResultError {
    /// Of what has no flakes to misplace.
    fn none() -> Self {
        Self::of(Vec::new(), Ok(SeenError::none()))
    }

    fn of(terms: Vec<Term>, seen: Result<SeenError, &'static str>) -> Self {
        Self {
            seen: seen.ok(),
            unseen: seen.err(),
            // An empty sum of f64 is -0.
            lab: (terms.iter().map(|term| term.lab).sum::<Option<f64>>()).map(|sum| sum + 0.0),
            terms,
        }
    }

    /// The same of a file that shows something else than the paint.
    #[must_use]
    pub fn of_other_material(self) -> Self {
        Self {
            seen: None,
            unseen: Some(OTHER_MATERIAL),
            ..self
        }
    }

    /// Why [`lab`](Self::lab) is not known, where it is not.
    #[must_use]
    pub fn unknown(&self) -> Option<&'static str> {
        let unknown = self.terms.iter().find(|term| term.lab.is_none());
        unknown.map(|term| term.how)
    }

    fn seen_or_why(&self) -> Result<SeenError, &'static str> {
        self.seen.ok_or(self.unseen.unwrap_or(NOT_MEASURED))
    }

    /// The same beyond the paints: every term times the sum of the flakes' weights' sizes, at least 1; what would be seen was
    /// not measured there, nor over a base beyond the paints. A solid color stays exact.
    #[must_use]
    pub fn stretched(&self, [flakes, base]: [f64; 2]) -> Self {
        if self.terms.is_empty() {
            return self.clone();
        }
        let by = flakes.max(1.0);
        Self::of(
            self.terms
                .iter()
                .map(|term| Term {
                    lab: term.lab.map(|lab| lab * by),
                    ..*term
                })
                .collect(),
            if by.max(base) <= 1.0 + WITHIN {
                self.seen_or_why()
            } else {
                Err(BEYOND)
            },
        )
    }
}

/// What the sum of weights' sizes of a mixture may be above 1 by rounding.
const WITHIN: f64 = 1e-9;

const CLUSTERS: &str = "measured: W1 of lightness between pixels and clusters, nine of ten of the compared slices are within; \
                        of several paints the worst";
const REALISED: &str = "bounded: error of the blend that a paint was realised from, where it is worse than what was measured of the others";
const UNKNOWN: &str = "the paint was not clustered here from pictures, or is of an older version";
const REDUCTION: &str = "measured: W1 of lightness between slices and the same slices with fewer clusters, nine of ten of the \
                         compared slices are within; of several paints the worst";
const TRANSPORT: &str = "bounded: mean excess of the plans' cost over the dual bound; of several pairs of paints the worst";
const TRANSPORT_SAMPLED: &str = "bounded on slices spread evenly over the angles: mean excess of the plans' cost over the dual bound of each pair alone; of \
                                 several pairs of paints the worst";
const ANGLES: &str = "measured: W1 of lightness between slices left out and the mixtures in their place, nine of ten of the \
                      compared slices are within; of several paints the worst";
const ROUNDING_OF_ALL: &str =
    "bounded: W1 between the boxes and the boxes read back, worst slice of the worst paint";
const ROUNDING: &str = "bounded: W1 between the boxes and the boxes read back, worst of the slices at the instrument geometries";

const NOT_MEASURED: &str = "a step was not measured: a paint was not clustered here from pictures, or is of an older version";
const REALISED_UNSEEN: &str = "a paint was realised from a blend where this was not measured: beyond its paints, or by an older version";
const BEYOND: &str =
    "it is measured within the paints; these weights, or this saturation, lead beyond them";
const OTHER_MATERIAL: &str =
    "the file shows a material that was fitted to the paint; what that loses stands beside";
const AT_ANY_WEIGHTS: &str =
    "what is seen of the rounding depends on the weights, which whoever shows the file chooses";

/// Error of a paint; nothing is misplaced in a solid color.
#[must_use]
pub fn paint_error(file: &PaintFile) -> ResultError {
    if file.paint.flakes.is_none() {
        return ResultError::none();
    }
    let clustering = file.clustering.as_ref();
    ResultError::of(
        vec![clusters([clustering].into_iter())],
        SeenError::of_clusters(clustering),
    )
}

/// Error of a blend at any weights between 0 and 1 that sum to 1: such a mixture moves no color further than its paints.
#[must_use]
pub fn blend_error(blend: &Blend) -> ResultError {
    let report = blend.report();
    if report.slices == 0 {
        return ResultError::none();
    }
    // A paint without flakes is exact.
    let with_flakes = blend.clusterings().enumerate().filter(|(k, _)| {
        let place = blend.place(*k);
        !report.without_flakes.contains(&place)
    });
    let worst = report.pairs.iter().map(|pair| pair.mean_gap);
    let worst_of = |get: fn(&Clustering) -> Option<Percentiles>| {
        let all = blend
            .clusterings()
            .filter_map(|clustering| get(clustering?));
        all.map(|w1| w1.p90).reduce(f64::max)
    };
    let mut terms = vec![
        clusters(with_flakes.clone().map(|(_, clustering)| clustering)),
        Term {
            what: "transport",
            lab: Some(worst.fold(0.0, f64::max)),
            how: if report
                .pairs
                .iter()
                .all(|pair| pair.checked == report.slices)
            {
                TRANSPORT
            } else {
                TRANSPORT_SAMPLED
            },
        },
    ];
    for (what, lab, how) in [
        ("angles", worst_of(|own| own.left_out_w1), ANGLES),
        ("reduction", worst_of(|own| own.reduced_w1), REDUCTION),
    ] {
        terms.extend(lab.map(|lab| Term {
            what,
            lab: Some(lab),
            how,
        }));
    }
    let each = with_flakes.map(|(_, clustering)| SeenError::of_clusters(clustering));
    let seen = each.reduce(|x, y| Ok(x?.or_worse(y?)));
    let seen = seen.unwrap_or(Err(NOT_MEASURED));
    let seen = seen.and_then(|seen| {
        seen.and_transport(&report.against_exact)
            .ok_or(NOT_MEASURED)
    });
    ResultError::of(terms, seen)
}

/// Error of a file written from a paint or a blend of this error.
#[must_use]
pub fn file_error(of: &ResultError, writing: Option<&WritingError>) -> ResultError {
    let rounding = writing.map(|writing| Term {
        what: "rounding",
        lab: Some(writing.rounding_w1),
        how: ROUNDING,
    });
    let seen = of.seen_or_why().map(|seen| match writing {
        Some(writing) => seen.and(&writing.instrument, &writing.lit, &writing.sparkle),
        None => seen,
    });
    ResultError::of(of.terms.iter().copied().chain(rounding).collect(), seen)
}

/// Error of the bundle of a whole blend, at any weights between 0 and 1 that sum to 1.
#[must_use]
pub fn bundle_error(blend: &Blend, settings: &ExportSettings) -> ResultError {
    let rounding = bundle_rounding_w1(blend, settings).map(|lab| Term {
        what: "rounding",
        lab: Some(lab),
        how: ROUNDING_OF_ALL,
    });
    let of = blend_error(blend);
    let is_rounded = rounding.is_some_and(|term| term.lab != Some(0.0));
    let terms = of.terms.iter().copied().chain(rounding);
    let seen = of.seen_or_why().and_then(|seen| {
        if is_rounded {
            Err(AT_ANY_WEIGHTS)
        } else {
            Ok(seen)
        }
    });
    ResultError::of(terms.collect(), seen)
}

fn clusters<'a>(of: impl Iterator<Item = Option<&'a Clustering>>) -> Term {
    let mut worst = Some(0.0_f64);
    let mut realised = false;
    for clustering in of {
        let measured = clustering.and_then(|c| c.error.as_ref());
        let own = measured.map(|e| e.lightness_w1.p90).or_else(|| {
            let of_blend = clustering?.realised_lab?;
            realised = true;
            Some(of_blend)
        });
        worst = worst.zip(own).map(|(worst, own)| worst.max(own));
    }
    let how = match worst {
        None => UNKNOWN,
        Some(_) if realised => REALISED,
        Some(_) => CLUSTERS,
    };
    Term {
        what: "clusters",
        lab: worst,
        how,
    }
}
