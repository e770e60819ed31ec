//! The base of a paint from a measured reflectance: shape first, then color, with or without a coat of its own.
//!
//! The measurement is fitted bare and, where it was made in air, with an explicit coat. The coat is taken when it
//! brings the result clearly nearer to the measurement, or when the bare fit misses its aim and the coat helps:
//! a second, wide lobe must not become a coat for a per cent.

mod guesses;

use super::color_table::{Frame, TableFit, fit_color_table};
use super::directions::{TRUSTED_DEG, measure};
use super::lobes::{CoatSearch, Shape, fit_shape, unit_of};
use super::residual::{Judge, Percentiles};
use super::steps::Tell;
use crate::color::LinearRgb;
use crate::measurement::MeasuredBrdf;
use crate::paint::{
    CarPaint, Chi, Coat, ColorTable, Direction, FitResiduals, Lobe, MAX_WEIGHT, Reflectance,
};
use guesses::held_to_energy;

/// Samples that the shape is fitted to.
const SAMPLES: usize = 8000;
/// Fewer samples than this say nothing about a dozen parameters.
const LEAST_SAMPLES: usize = 200;
/// What the logarithm of all errors together must fall by for a coat to be taken.
const COAT_GAIN: f64 = 0.2;
/// What it must fall by for a coat that is as smooth and dense as a clear coat.
const COAT_GAIN_IF_CLEAR: f64 = 0.05;
const CLEAR_ROUGHNESS: f64 = 0.1;
const CLEAR_IOR: f64 = 1.3;
/// What it must fall by where the bare fit misses [`AIM`].
const COAT_GAIN_IN_NEED: f64 = 0.03;
/// Share of the time after which the measurement is judged, and share of a search that goes into the shape.
const JUDGED: f32 = 0.1;
const SHAPED: f32 = 0.8;
/// Error against the floor that a fit aims at.
const AIM: f64 = 1.2;

/// What is known of the coat before the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CoatChoice {
    /// Measured in air; a coat is made explicit where that fits better.
    ByResidual,
    /// Measured in air, through a coat of this index; 1 is none.
    Ior(f64),
    /// Angles and values are those inside a coat of this index, which is not fitted; 1 where the paint has none.
    Inside(f64),
}

/// A fitted base.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedBase {
    /// Lambertian albedo.
    pub diffuse: LinearRgb,
    /// Lobes by ascending roughness.
    pub lobes: Vec<Lobe>,
    /// Color by angle.
    pub color_table: ColorTable,
    /// The coat that was made explicit; never one under [`CoatChoice::Inside`].
    pub coat: Option<Coat>,
    /// Distance from the measurement, and the floor.
    pub residuals: FitResiduals,
    /// What a reader of the paint should know.
    pub warnings: Vec<String>,
}

/// Why a measurement has no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// An index out of range.
    #[error("the coat's index of refraction is {0}, accepted is 1 to 4")]
    Ior(f64),
    /// Too few valid values.
    #[error("{found} of {asked} sampled directions hold a valid value, a fit needs {needed}")]
    TooFewSamples {
        /// Valid samples.
        found: usize,
        /// Samples asked for.
        asked: usize,
        /// Samples needed.
        needed: usize,
    },
    /// Nothing above zero.
    #[error("no sampled direction reflects any light")]
    Dark,
    /// Values that no reflectance takes.
    #[error("{field} would be {value:e}, accepted is up to 1000: the measurement is not in 1/sr")]
    NotAReflectance {
        /// Parameter of the fit.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// The descent found no finite answer.
    #[error("no start of the fit ended in a finite answer")]
    NoAnswer,
}

/// One way to explain the measurement.
struct Candidate {
    shape: Shape,
    fitted: TableFit,
    /// Errors of the fit and of its lobes alone, over the floor's: lower is better.
    score: f64,
    /// Worst error away from the mirror over the floor's.
    worst: f64,
}

/// Fits diffuse, lobes, color table and, where asked for, the coat of a measured reflectance.
///
/// # Errors
///
/// [`FitError`] for an index out of range, a measurement with too few valid values or no light at all, and one whose
/// values are no reflectance.
pub fn fit_base(measured: &dyn MeasuredBrdf, coat: CoatChoice) -> Result<FittedBase, FitError> {
    fit_base_telling(measured, coat, &|_| ())
}

/// The same, with a function that hears the share done, 0 to 1, after every start of a search and every node of a table.
///
/// # Errors
///
/// As [`fit_base`].
pub fn fit_base_telling(
    measured: &dyn MeasuredBrdf,
    coat: CoatChoice,
    progress: Tell<'_>,
) -> Result<FittedBase, FitError> {
    let (frame, searches) = match coat {
        CoatChoice::ByResidual => (Frame::Air, vec![CoatSearch::Bare, CoatSearch::Free]),
        CoatChoice::Ior(ior) | CoatChoice::Inside(ior) if !(1.0..=4.0).contains(&ior) => {
            return Err(FitError::Ior(ior));
        }
        CoatChoice::Ior(1.0) => (Frame::Air, vec![CoatSearch::Bare]),
        CoatChoice::Ior(ior) => (Frame::Air, vec![CoatSearch::Index(ior)]),
        CoatChoice::Inside(ior) => (Frame::Inside(ior), vec![CoatSearch::Bare]),
    };
    // Inside a coat light never leaves the cone of total reflection.
    let cone = match frame {
        Frame::Inside(ior) if ior > 1.0 => ((1.0 / ior).asin().to_degrees() + 5.0).min(TRUSTED_DEG),
        _ => TRUSTED_DEG,
    };
    progress(0.0);
    let samples = measure(measured, SAMPLES, cone, 0xBA5E);
    if samples.len() < LEAST_SAMPLES {
        return Err(FitError::TooFewSamples {
            found: samples.len(),
            asked: SAMPLES,
            needed: LEAST_SAMPLES,
        });
    }
    if !samples.iter().any(|s| s.luminance > 0.0) {
        return Err(FitError::Dark);
    }
    let unit = unit_of(&samples);
    progress(0.02);
    let judge = Judge::new(measured, frame, cone, unit);
    let floors = judge.floor_errors();
    let mut candidates: Vec<Candidate> = Vec::new();
    #[allow(clippy::cast_precision_loss)] // a progress bar
    let each = (1.0 - JUDGED) / searches.len() as f32;
    for (k, search) in searches.into_iter().enumerate() {
        #[allow(clippy::cast_precision_loss)] // a progress bar
        let begun = JUDGED + each * k as f32;
        progress(begun);
        let bare = candidates.first().map(|c| &c.shape);
        let shape = fit_shape(&samples, search, unit, bare, &|share| {
            progress(begun + each * SHAPED * share);
        });
        let Some(shape) = shape else {
            continue;
        };
        let tell = |share: f32| progress(begun + each * (SHAPED + (1.0 - SHAPED) * share));
        let table = fit_color_table(measured, &shape, frame, &samples, unit, &tell);
        candidates.push(candidate(shape, table, &judge, &floors));
    }
    let mut candidates = candidates.into_iter();
    let mut best = candidates.next().ok_or(FitError::NoAnswer)?;
    for other in candidates {
        let gain = best.score - other.score;
        let clear = other
            .shape
            .coat
            .is_some_and(|(ior, roughness)| roughness <= CLEAR_ROUGHNESS && ior >= CLEAR_IOR);
        let needed = match () {
            () if best.worst > AIM => COAT_GAIN_IN_NEED,
            () if clear => COAT_GAIN_IF_CLEAR,
            () => COAT_GAIN,
        };
        if gain > needed {
            best = other;
        }
    }
    finish(best, &judge, frame)
}

fn candidate(
    shape: Shape,
    fitted: TableFit,
    judge: &Judge,
    floors: &[Percentiles; 2],
) -> Candidate {
    let paint = paint_of(&shape, fitted.table.clone());
    let reflectance = Reflectance::new(&paint);
    let with = |chi: Chi| {
        judge.luminance_errors(|wi: Direction, wo: Direction| reflectance.evaluate(wi, wo, chi))
    };
    let (full, alone) = (with(Chi::Table), with(Chi::Overall));
    // A floor of nothing (computed data) must not make every error infinite.
    let over = |e: f64, f: f64| (e + 1e-3) / (f + 1e-3);
    let ratios = [
        over(full[0].median, floors[0].median),
        over(full[0].p90, floors[0].p90),
        over(full[1].median, floors[1].median),
        over(full[1].p90, floors[1].p90),
        over(alone[0].median, floors[0].median),
        over(alone[0].p90, floors[0].p90),
    ];
    let score = ratios.iter().map(|r| r.ln()).sum::<f64>() / 6.0;
    // The lobes alone may err twice and one and a half times as much.
    let worst = ratios[0]
        .max(ratios[1])
        .max(AIM * ratios[4] / 1.9)
        .max(AIM * ratios[5] / 1.4);
    Candidate {
        shape,
        fitted,
        score,
        worst,
    }
}

fn paint_of(shape: &Shape, color_table: ColorTable) -> CarPaint {
    let lobe = |&(s, alpha, f0): &(f64, f64, f64)| Lobe {
        weight: [s; 3],
        alpha,
        f0,
    };
    CarPaint {
        coat: shape.coat.map(|(ior, roughness)| Coat {
            ior,
            roughness,
            thickness_um: None,
        }),
        diffuse: [shape.diffuse; 3],
        lobes: shape.lobes.iter().map(lobe).collect(),
        color_table,
        flakes: None,
    }
}

fn finish(best: Candidate, judge: &Judge, frame: Frame) -> Result<FittedBase, FitError> {
    let shape = best.shape;
    for (field, value) in [("diffuse", shape.diffuse)]
        .into_iter()
        .chain(shape.lobes.map(|l| ("a lobe's weight", l.0)))
    {
        if !(0.0..=MAX_WEIGHT).contains(&value) {
            return Err(FitError::NotAReflectance { field, value });
        }
    }
    let mut warnings = Vec::new();
    if shape.agreeing < 2 {
        warnings.push(format!(
            "only one of {} starts of the fit reached its result: other lobes may explain the measurement as well",
            shape.starts
        ));
    }
    let TableFit {
        table,
        mapped,
        guessed,
    } = best.fitted;
    if mapped > 0 {
        warnings.push(format!(
            "{mapped} colors of the color table lay outside sRGB and became the nearest color inside"
        ));
    }
    let mut paint = paint_of(&shape, table);
    // Inside a coat light never comes to graze.
    if frame == Frame::Air
        && let Some(held) = held_to_energy(&paint, &guessed)
    {
        paint = held;
        warnings.push(
            "where nothing was measured the color was made paler, and darker if need be, until the paint gives back no \
             more light than it gets"
                .to_owned(),
        );
    }
    let reflectance = Reflectance::new(&paint);
    let residuals = judge.residuals(|wi, wo| reflectance.evaluate(wi, wo, Chi::Table));
    let all = &residuals.all;
    if all.median > 1.3 * all.floor_median + 1e-3 || all.p90 > 1.3 * all.floor_p90 + 1e-3 {
        warnings.push(format!(
            "the fit errs by {:.1} % (median) and {:.1} % (90th percentile), a free function of the half angles by {:.1} % \
             and {:.1} %",
            100.0 * all.median, 100.0 * all.p90, 100.0 * all.floor_median, 100.0 * all.floor_p90
        ));
    }
    let CarPaint {
        coat,
        diffuse,
        lobes,
        color_table,
        ..
    } = paint;
    Ok(FittedBase {
        diffuse,
        lobes,
        color_table,
        coat,
        residuals,
        warnings,
    })
}

#[cfg(test)]
mod tests;
