//! A target in place of knobs: the cheapest profile that is accurate enough, or the most accurate that is fast enough.
//!
//! The profiles of a short ladder are estimated on the work itself: for an error from cheap to dear until one will do, for a
//! time from the usual one on as long as another look leaves time for the best that is known. Where an estimate's error is of a sample of the
//! slices, it is measured in full before a profile is picked for it, unless the part that is known is too much already.
//! What is picked for a time limit depends on the machine; the result depends on the profile picked and on nothing else.

mod ladder;
mod picked;
mod samples;

use std::time::Instant;

use serde::Serialize;
use utoipa::ToSchema;

use super::estimate::{Estimate, EstimatedError, Work, this_machine};
use super::{Format, IngestOptions, WorkshopError, blend_paints, open_paints};
use crate::accuracy::{Profile, blend_error};
use crate::paint::PaintFile;
use ladder::ladder;
pub use picked::Picked;

/// What a result should keep to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, ToSchema)]
#[schema(as = AskedTarget)]
pub struct Target {
    /// Largest error: of flakes in Lab; of pictures in CIEDE2000, what samples leave to chance and the paint's own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_error: Option<f64>,
    /// Longest time, seconds: of the search for a profile and of the work with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_seconds: Option<f64>,
}

/// How many times longer than the last a profile half of the ladder further on is taken to be looked at for; one half of the
/// way back takes no longer.
const DEARER: f64 = 3.0;

/// A search for a profile, and when it began.
struct Search(Instant);

impl Search {
    fn seconds(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

impl Target {
    /// Whether anything is asked for.
    #[must_use]
    pub const fn is_some(&self) -> bool {
        self.max_error.is_some() || self.max_seconds.is_some()
    }

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for a limit that is not above 0.
    pub fn check(&self) -> Result<(), WorkshopError> {
        for (name, value) in [
            ("max_error", self.max_error),
            ("max_seconds", self.max_seconds),
        ] {
            if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                let problem = format!("{name} is {value}, accepted is a number above 0");
                return Err(WorkshopError::usage(name, problem));
            }
        }
        Ok(())
    }

    /// Whether work is done in time after a search of so many seconds.
    fn is_in_time(&self, estimate: &Estimate, searched: f64) -> bool {
        self.max_seconds
            .is_none_or(|most| searched + estimate.seconds <= most)
    }

    /// Whether what is known of an error already is too much.
    fn is_too_far(&self, estimate: &Estimate) -> bool {
        let (known, most) = (estimate.error.at_least, self.max_error);
        known.zip(most).is_some_and(|(known, most)| known > most)
    }

    fn is_met(&self, estimate: &Estimate, searched: f64) -> bool {
        self.is_in_time(estimate, searched)
            && self
                .max_error
                .is_none_or(|most| estimate.error.value.is_some_and(|error| error <= most))
    }

    /// Picks a profile for some work.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for limits that are none, and for what would be refused when the work is done.
    pub fn pick(&self, work: &Work<'_>) -> Result<Picked, WorkshopError> {
        self.check()?;
        if let (
            Work::Realise {
                format: Format::Glb,
                ..
            },
            Some(most),
        ) = (work, self.max_error)
        {
            let problem = format!(
                "max_error is {most} for a GLB, whose material is fitted: what that loses stands in the file and in no \
                 profile's hands, accepted are max_seconds, and max_error of zip, json and paint"
            );
            return Err(WorkshopError::usage("max_error", problem));
        }
        let search = Search(Instant::now());
        if let Work::Preview(picture) = work {
            return samples::pick_samples(self, picture, &search);
        }
        let mut estimates = match self.max_error {
            Some(_) => self.accurate_enough(work, &search)?,
            None => self.fast_enough(work, &search)?,
        };
        loop {
            let searched = search.seconds();
            let best = self
                .best(&estimates, searched)
                .ok_or_else(|| WorkshopError::internal("there is no profile to pick from"))?;
            let rough = |e: &&mut Estimate| e.knobs == best.knobs && e.error.at_least.is_some();
            match estimates.iter_mut().find(rough) {
                // What is told of the best that could be done is measured too.
                Some(rough) if self.max_error.is_some() => measure_error(work, rough)?,
                _ => return Ok(self.picked(best, estimates.len(), searched)),
            }
        }
    }

    /// Estimates from cheap to dear: what comes after one that is accurate enough, or too slow, is not looked at.
    fn accurate_enough(
        &self,
        work: &Work<'_>,
        search: &Search,
    ) -> Result<Vec<Estimate>, WorkshopError> {
        let mut estimates = Vec::new();
        for profile in ladder(work) {
            let mut estimate = work.estimate(&profile)?;
            let too_slow = !self.is_in_time(&estimate, search.seconds());
            if !too_slow && !self.is_too_far(&estimate) {
                measure_error(work, &mut estimate)?;
            }
            let enough = self.is_met(&estimate, search.seconds());
            estimates.push(estimate);
            if enough || too_slow {
                break;
            }
        }
        Ok(estimates)
    }

    /// Estimates from the usual profile on: half of the finer ones is leapt over as long as the work is done in time, half of
    /// what was leapt over is gone back otherwise, and no more is looked at than leaves time for the best that is known.
    /// Where nothing is done in time, the fastest is looked at too. Of files the finest is the fastest, so that it is the one
    /// to look at.
    fn fast_enough(
        &self,
        work: &Work<'_>,
        search: &Search,
    ) -> Result<Vec<Estimate>, WorkshopError> {
        let most = self.max_seconds.unwrap_or(f64::INFINITY);
        let mut ladder = ladder(work);
        if matches!(work, Work::Realise { .. } | Work::Bundle { .. }) {
            ladder.drain(..ladder.len() - 1);
        }
        // A look should take what looks take.
        let _ = this_machine();
        let usual = ladder.iter().position(|own| *own == Profile::standard());
        let mut estimates: Vec<(usize, Estimate)> = Vec::new();
        let (mut finer, mut too_slow) = (0, ladder.len());
        // Seconds of the last look, and of the best work that is known to be done in time.
        let (mut last, mut at_hand) = (0.0_f64, 0.0_f64);
        let mut went_back = false;
        while finer < too_slow {
            let begun = search.seconds();
            let dearer = if went_back { 1.0 } else { DEARER };
            if !estimates.is_empty() && begun + dearer * last + at_hand > most {
                break;
            }
            let place = match usual {
                Some(usual) if estimates.is_empty() => usual,
                _ => usize::midpoint(finer, too_slow),
            };
            let estimate = work.estimate(&ladder[place])?;
            last = search.seconds() - begun;
            if self.is_in_time(&estimate, search.seconds()) {
                finer = place + 1;
                went_back = false;
                at_hand = estimate.seconds;
            } else {
                too_slow = place;
                went_back = true;
            }
            estimates.push((place, estimate));
        }
        // A look may have taken what was left of the time.
        let searched = search.seconds();
        let is_late = (estimates.iter()).all(|(_, own)| !self.is_in_time(own, searched));
        if is_late && estimates.iter().all(|(place, _)| *place > 0) {
            estimates.push((0, work.estimate(&ladder[0])?));
        }
        estimates.sort_by_key(|(place, _)| *place);
        Ok(estimates.into_iter().map(|(_, own)| own).collect())
    }

    fn picked(&self, estimate: Estimate, tried: usize, searched: f64) -> Picked {
        Picked {
            target: *self,
            met: self.is_met(&estimate, searched),
            estimate,
            tried,
            searched,
        }
    }

    /// Of estimates from cheap to dear: with a largest error the cheapest that meets all, with a longest time alone the
    /// most accurate; where none does, the most accurate in time, and where none is in time, the fastest.
    fn best(&self, estimates: &[Estimate], searched: f64) -> Option<Estimate> {
        let error_of = |e: &Estimate| e.error.value.unwrap_or(f64::INFINITY);
        // Of equals the first, which is the cheapest whatever the clock says.
        let finer = |x: &Estimate, y: &Estimate| error_of(x).total_cmp(&error_of(y));
        let in_time: Vec<Estimate> = (estimates.iter())
            .filter(|e| self.is_in_time(e, searched))
            .cloned()
            .collect();
        if in_time.is_empty() {
            let faster = |x: &Estimate, y: &Estimate| x.seconds.total_cmp(&y.seconds);
            return estimates.iter().cloned().min_by(faster);
        }
        let cheapest = in_time.iter().find(|e| self.is_met(e, searched)).cloned();
        match (cheapest, self.max_error) {
            (Some(cheapest), Some(_)) => Some(cheapest),
            // What is not known is least where least is left out.
            _ if in_time.iter().all(|e| e.error.value.is_none()) => in_time.last().cloned(),
            _ => in_time.into_iter().min_by(finer),
        }
    }
}

/// Replaces an error that was estimated on some slices by the one of all.
fn measure_error(work: &Work<'_>, estimate: &mut Estimate) -> Result<(), WorkshopError> {
    let profile = estimate.knobs;
    estimate.error.at_least = None;
    match *work {
        Work::Blend { paints } => {
            let blend = blend_paints(paints, &profile, &|_| ())?.blend;
            estimate.error = EstimatedError::lab(&blend_error(&blend));
        }
        Work::BlendNames { names, options } => {
            let options = IngestOptions {
                profile,
                ..options.clone()
            };
            let paints = open_paints(names, &options, &|_| ())?;
            let paints: Vec<&PaintFile> = paints.iter().collect();
            measure_error(&Work::Blend { paints: &paints }, estimate)?;
        }
        // An ingest and a picture are compared on the very slices and pixels that the result is compared on, a file with the
        // whole of what is written.
        Work::Ingest { .. } | Work::Realise { .. } | Work::Bundle { .. } | Work::Preview(_) => {}
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workshop::Stage;

    fn estimate(seconds: f64, error: f64) -> Estimate {
        Estimate {
            profile: "custom",
            knobs: Profile::standard(),
            seconds,
            stages: vec![Stage {
                stage: "all",
                seconds,
            }],
            bytes: 0,
            error: EstimatedError {
                value: Some(error),
                unit: "Lab",
                unknown: None,
                at_least: None,
            },
        }
    }

    #[test]
    fn the_cheapest_that_is_accurate_enough_wins_and_the_finest_in_time() {
        let ladder = || {
            vec![
                estimate(1.0, 0.9),
                estimate(2.0, 0.5),
                estimate(3.0, 0.2),
                estimate(4.0, 0.2),
            ]
        };
        let after = |searched, max_error, max_seconds| {
            let target = Target {
                max_error,
                max_seconds,
            };
            let best = target.best(&ladder(), searched).expect("one of four");
            (best.seconds, target.is_met(&best, searched))
        };
        let best = |max_error, max_seconds| after(0.0, max_error, max_seconds);
        assert_eq!(best(Some(0.5), None), (2.0, true));
        assert_eq!(best(Some(0.6), Some(2.5)), (2.0, true));
        assert_eq!(best(None, Some(3.5)), (3.0, true));
        assert_eq!(best(None, Some(0.5)), (1.0, false));
        assert_eq!(best(Some(0.1), None), (3.0, false));
        assert_eq!(best(Some(0.1), Some(2.0)), (2.0, false));
        // The search is part of what is waited for.
        assert_eq!(after(1.0, None, Some(3.5)), (2.0, true));
        assert_eq!(after(3.0, None, Some(3.5)), (1.0, false));
    }

    #[test]
    fn of_errors_that_are_not_known_the_dearest_in_time_is_taken() {
        let unknown: Vec<Estimate> = [1.0, 2.0, 4.0]
            .into_iter()
            .map(|seconds| {
                let mut unknown = estimate(seconds, 0.0);
                unknown.error.value = None;
                unknown
            })
            .collect();
        let target = Target {
            max_error: Some(0.5),
            max_seconds: Some(3.0),
        };
        let best = target.best(&unknown, 0.0).expect("two are in time");
        assert_eq!((best.seconds, target.is_met(&best, 0.0)), (2.0, false));
    }

    #[test]
    fn only_what_is_known_to_be_too_much_is_not_measured() {
        let target = Target {
            max_error: Some(0.5),
            max_seconds: None,
        };
        for (at_least, too_far) in [(None, false), (Some(0.5), false), (Some(0.51), true)] {
            let mut rough = estimate(1.0, 0.9);
            rough.error.at_least = at_least;
            assert_eq!(target.is_too_far(&rough), too_far, "{at_least:?}");
        }
    }

    #[test]
    fn limits_that_are_none_are_refused_by_name() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let target = Target {
                max_seconds: Some(bad),
                ..Target::default()
            };
            let error = target.check().expect_err("refused");
            assert_eq!(error.field.as_deref(), Some("max_seconds"));
        }
    }
}
