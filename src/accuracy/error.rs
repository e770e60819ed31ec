//! The error of a result in one number, with the terms that it is made of.
//!
//! Flakes are distributions of color, and the distance between two of them is W1 in Lab: how far the average texel's
//! color has moved. What the stages misplace adds up by the triangle inequality: pixels to clusters at ingest, slices at
//! angles that a profile leaves out, box to written box in a file. To it comes, of a blend, how much further flakes
//! travel between the paints than they would have to: cost of the plan less its dual bound.
//!
//! ```text
//! error = W1(pixels, clusters) + (cost − dual bound) + W1(slices left out, mixtures) + W1(box, rounded box)
//! ```
//!
//! What instrument and eye would notice stands beside it: color and lit flakes at the six instrument geometries, and
//! sparkle. Every step measures it against the one before, and the steps' figures are added up, which is no bound. It is
//! measured at weights within the paints, and told of no others.
//!
//! The reference profile's transport and files have none of the last three. A realisation outside the paints multiplies
//! the first two by the sum of the weights' sizes.

use serde::Serialize;

use super::WritingError;
use super::writing::bundle_rounding_w1;
use crate::blend::{Blend, BlendDeviation};
use crate::export::ExportSettings;
use crate::paint::{ASPECULAR_DEG, Clustering, PaintFile};

/// Error of a result against the reference: in Lab, the distance by which its flakes' colors are misplaced.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResultError {
    /// Sum of the terms, Lab units; null where one of them is not known.
    pub lab: Option<f64>,
    /// What it is made of.
    pub terms: Vec<Term>,
    /// What would be noticed of it; null for a solid color, and where a step was not measured.
    pub seen: Option<SeenError>,
}

/// What would be noticed of an error: sums of what was measured step by step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
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

/// One term of an error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Term {
    /// What it is about: `clusters`, `transport`, `angles`, `rounding`.
    pub what: &'static str,
    /// Lab units; null where it is not known.
    pub lab: Option<f64>,
    /// How it is known.
    pub how: &'static str,
}

impl ResultError {
    /// Of what has no flakes to misplace.
    fn none() -> Self {
        Self::of(Vec::new(), None)
    }

    fn of(terms: Vec<Term>, seen: Option<SeenError>) -> Self {
        Self {
            seen,
            // An empty sum of f64 is -0.
            lab: (terms.iter().map(|term| term.lab).sum::<Option<f64>>()).map(|sum| sum + 0.0),
            terms,
        }
    }

    /// The same of a file that shows something else than the paint.
    #[must_use]
    pub fn unseen(self) -> Self {
        Self { seen: None, ..self }
    }

    /// The same beyond the paints: every term times the sum of the weights' sizes, at least 1; what would be seen was not
    /// measured there.
    #[must_use]
    pub fn stretched(&self, sum_of_sizes: f64) -> Self {
        let by = sum_of_sizes.max(1.0);
        Self::of(
            self.terms
                .iter()
                .map(|term| Term {
                    lab: term.lab.map(|lab| lab * by),
                    ..*term
                })
                .collect(),
            self.seen.filter(|_| by <= 1.0 + WITHIN),
        )
    }
}

impl SeenError {
    /// Of clusters against pixels, and of the angles that were left out since.
    fn of_clusters(clustering: Option<&Clustering>) -> Option<Self> {
        let clustering = clustering?;
        let error = clustering.error.as_ref()?;
        let of_clusters = Self {
            aspecular_deg: ASPECULAR_DEG,
            delta_e_2000: error.instrument,
            lit: error.lit?,
            sparkle: error.sparkle.p90,
            how: SEEN,
        };
        if clustering.left_out_w1.is_none() {
            return Some(of_clusters);
        }
        let seen = clustering.left_out_seen?;
        Some(of_clusters.and(&seen.delta_e_2000, &seen.lit, &seen.sparkle))
    }

    /// The worse of two, figure by figure.
    fn or_worse(self, other: Self) -> Self {
        Self {
            delta_e_2000: each(self.delta_e_2000, &other.delta_e_2000, f64::max),
            lit: each(self.lit, &other.lit, f64::max),
            sparkle: self.sparkle.max(other.sparkle),
            ..self
        }
    }

    /// With what another transport than the exact one adds; that lists nothing.
    fn and_transport(self, deviations: &[BlendDeviation]) -> Option<Self> {
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
    fn and(self, delta_e_2000: &[f64], lit: &[f64], sparkle: &[f64]) -> Self {
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

/// What the sum of weights' sizes of a mixture may be above 1 by rounding.
const WITHIN: f64 = 1e-9;

const SEEN: &str = "measured step by step and added up: clusters against pixels, and fewer angles against all, of several paints the \
                    worst; a blend against exact transport in the same order, at equal weights; a file against the paint";

const CLUSTERS: &str = "measured: W1 of lightness between pixels and clusters, nine of ten of the compared slices are within; \
                        of several paints the worst";
const REALISED: &str = "bounded: error of the blend that a paint was realised from, where it is worse than what was measured of the others";
const UNKNOWN: &str = "not known: the paint was not clustered here from pictures, was reduced to fewer clusters, or is of an older version";
const TRANSPORT: &str = "bounded: mean excess of the plans' cost over the dual bound; of several pairs of paints the worst";
const TRANSPORT_SAMPLED: &str = "bounded on slices spread evenly over the angles: mean excess of the plans' cost over the dual bound of each pair alone; of \
                                 several pairs of paints the worst";
const ANGLES: &str = "measured: W1 of lightness between slices left out and the mixtures in their place, nine of ten of the \
                      compared slices are within; of several paints the worst";
const ROUNDING_OF_ALL: &str =
    "bounded: W1 between the boxes and the boxes read back, worst slice of the worst paint";
const ROUNDING: &str = "bounded: W1 between the boxes and the boxes read back, worst of the slices at the instrument geometries";

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
    let left_out = blend
        .clusterings()
        .filter_map(|clustering| Some(clustering?.left_out_w1?.p90))
        .reduce(f64::max);
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
    terms.extend(left_out.map(|lab| Term {
        what: "angles",
        lab: Some(lab),
        how: ANGLES,
    }));
    let each = with_flakes.map(|(_, clustering)| SeenError::of_clusters(clustering));
    let seen = each.reduce(|x, y| Some(x?.or_worse(y?))).flatten();
    let seen = seen.and_then(|seen| seen.and_transport(&report.against_exact));
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
    let seen = of.seen.map(|seen| match writing {
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
    // What would be noticed of the rounding depends on the weights.
    let of = blend_error(blend);
    ResultError::of(of.terms.into_iter().chain(rounding).collect(), None)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{ClusteringError, LeftOutSeen, Percentiles};

    fn clustering(color: f64, lit: Option<f64>, sparkle: f64) -> Clustering {
        let at_p90 = |p90| Percentiles {
            p90,
            ..Percentiles::default()
        };
        Clustering {
            clusters: 50,
            box_rule: "moments".to_owned(),
            angle_step: 1,
            w1_bound: None,
            left_out_w1: None,
            left_out_seen: None,
            error: Some(ClusteringError {
                slices: 20,
                of: 100,
                lightness_w1: at_p90(0.3),
                mean_luminance: Percentiles::default(),
                sparkle: at_p90(sparkle),
                instrument: [color; 6],
                lit: lit.map(|lit| [lit; 6]),
            }),
            realised_lab: None,
        }
    }

    fn seen(clustering: &Clustering) -> Option<SeenError> {
        SeenError::of_clusters(Some(clustering))
    }

    fn deviations(lit: Option<f64>) -> Vec<BlendDeviation> {
        // In another order than the geometries'.
        ASPECULAR_DEG
            .iter()
            .rev()
            .map(|&aspecular_deg| BlendDeviation {
                aspecular_deg,
                delta_e_2000: aspecular_deg.abs(),
                sparkle: 0.01,
                lit,
            })
            .collect()
    }

    #[test]
    fn what_was_not_measured_is_not_told() {
        assert!(SeenError::of_clusters(None).is_none());
        assert!(seen(&clustering(0.1, None, 0.0)).is_none());
        let thinned = Clustering {
            left_out_w1: Some(Percentiles::default()),
            ..clustering(0.1, Some(0.1), 0.0)
        };
        assert!(seen(&thinned).is_none());
        let known = Clustering {
            left_out_seen: Some(LeftOutSeen {
                delta_e_2000: [0.5; 6],
                sparkle: [0.25, 0.125, 0.0, 0.0, 0.0, 0.0],
                lit: [0.25; 6],
            }),
            ..thinned
        };
        let known = seen(&known).expect("measured");
        assert_eq!((known.delta_e_2000, known.sparkle), ([0.6; 6], 0.25));
        assert_eq!(known.lit, [0.35; 6]);
        let whole = seen(&clustering(0.1, Some(0.1), 0.0)).expect("measured");
        assert!(whole.and_transport(&deviations(None)).is_none());
        assert!(whole.and_transport(&deviations(Some(0.0))[1..]).is_none());
        assert_eq!(whole.and_transport(&[]), Some(whole));
    }

    #[test]
    fn the_worst_paint_counts_and_steps_add_up_geometry_by_geometry() {
        let first = seen(&clustering(0.1, Some(0.3), 0.02)).expect("measured");
        let second = seen(&clustering(0.2, Some(0.1), 0.01)).expect("measured");
        let worse = first.or_worse(second);
        assert_eq!(
            (worse.delta_e_2000, worse.lit, worse.sparkle),
            ([0.2; 6], [0.3; 6], 0.02)
        );
        let blended = worse
            .and_transport(&deviations(Some(0.5)))
            .expect("measured");
        assert_eq!(
            blended.delta_e_2000,
            ASPECULAR_DEG.map(|angle| 0.2 + angle.abs())
        );
        assert_eq!((blended.lit, blended.sparkle), ([0.8; 6], 0.03));
        let writing = WritingError {
            rounding_w1: 0.05,
            instrument: vec![1.0; 6],
            sparkle: vec![0.0, 0.0, 0.07, 0.0, 0.0, 0.0],
            lit: vec![0.1; 6],
            inverse_cdf_loss: None,
        };
        let of = ResultError::of(Vec::new(), Some(worse));
        let file = file_error(&of, Some(&writing));
        let seen = file.seen.expect("measured");
        assert_eq!((seen.delta_e_2000, file.lab), ([1.2; 6], Some(0.05)));
        assert!((seen.lit[3] - 0.4).abs() < 1e-12 && (seen.sparkle - 0.09).abs() < 1e-12);
        assert!(of.stretched(1.0).seen.is_some() && of.stretched(1.6).seen.is_none());
        assert!(of.unseen().seen.is_none());
    }
}
