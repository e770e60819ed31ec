//! What a request will cost and how accurate it will be, before it is made.
//!
//! A request is estimated by doing a small part of it on this machine, now: every k-th angle of the very paints, a few
//! pixels of the very picture. Time and bytes of two such samples, one larger than the other, give what is fixed and what
//! grows with the work; the error is measured on the larger sample. A sample takes a few hundredths of the time of the
//! whole, and as it runs under the same load, the estimate is of this machine as it is. What is soon done is done whole.
//! What cannot be done in part is reckoned from what a [machine](this_machine) was calibrated to take: writing to the
//! disk, hashing, and the fit of a bare reflectance table, which costs as much as a number of evaluations of a paint.
//!
//! Results never depend on an estimate; what is picked for a time limit does.

mod blend;
mod ingest;
mod machine;
mod preview;
mod realise;
mod work;

use std::time::Instant;

use serde::Serialize;
use utoipa::ToSchema;

pub use blend::{estimate_blend, estimate_blend_of};
pub use ingest::{estimate_ingest, sample_to_estimate};
pub use machine::{learn_machine, study_machine, this_machine};
pub use preview::{PictureWork, SmallPictures, estimate_preview};
pub use realise::{estimate_bundle, estimate_realise};
pub use work::Work;

use crate::accuracy::{PictureError, Profile, ResultError};

/// What a request will cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Name of the profile it is for.
    pub profile: &'static str,
    /// Its knobs.
    pub knobs: Profile,
    /// Wall time, seconds.
    pub seconds: f64,
    /// The same by stage.
    pub stages: Vec<Stage>,
    /// Size of the answer.
    pub bytes: u64,
    /// How far the answer is from the reference profile's.
    pub error: EstimatedError,
}

/// Time of one stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
#[schema(as = EstimatedStage)]
pub struct Stage {
    /// What is done.
    pub stage: &'static str,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// An error to expect.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct EstimatedError {
    /// How much; null where it is not known.
    pub value: Option<f64>,
    /// Of what: `Lab`, misplaced colors of flakes; or `CIEDE2000` of a picture, in the mean: what its samples leave to
    /// chance, and how far off the paint in it is.
    pub unit: &'static str,
    /// Why there is no value, where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknown: Option<&'static str>,
    /// What it will be at least, in the same unit, where `value` is of a sample and a part of it is known already as it
    /// will be measured.
    #[serde(skip)]
    pub at_least: Option<f64>,
}

impl EstimatedError {
    pub(super) fn lab(of: &ResultError) -> Self {
        Self {
            value: of.lab,
            unknown: of.unknown(),
            unit: "Lab",
            at_least: None,
        }
    }

    fn of_picture(of: &PictureError) -> Self {
        let value = of.delta_e_2000;
        Self {
            value,
            unknown: value.is_none().then_some(of.how),
            unit: "CIEDE2000",
            at_least: None,
        }
    }

    const fn not_known(unit: &'static str, why: &'static str) -> Self {
        Self {
            value: None,
            unknown: Some(why),
            unit,
            at_least: None,
        }
    }
}

impl std::fmt::Display for EstimatedError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.value {
            Some(value) => write!(f, "{value:.4} {}", self.unit),
            None => f.write_str("not known"),
        }
    }
}

impl Estimate {
    /// The same with stages that come before.
    #[must_use]
    pub fn after(mut self, mut before: Vec<Stage>) -> Self {
        self.seconds += before.iter().map(|stage| stage.seconds).sum::<f64>();
        before.append(&mut self.stages);
        self.stages = before;
        self
    }

    fn new(profile: &Profile, stages: Vec<Stage>, bytes: f64, error: EstimatedError) -> Self {
        let mut named: Vec<Stage> = Vec::with_capacity(stages.len());
        for own in stages {
            match named.iter_mut().find(|stage| stage.stage == own.stage) {
                Some(stage) => stage.seconds += own.seconds,
                None => named.push(own),
            }
        }
        let stages = named;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a size
        let bytes = bytes.max(0.0).round() as u64;
        Self {
            profile: profile.name(),
            knobs: *profile,
            seconds: stages.iter().map(|stage| stage.seconds).sum(),
            stages,
            bytes,
            error,
        }
    }
}

/// Angles on an axis of the smaller and of the larger sample.
type Sizes = [usize; 2];

/// Angles of samples whose every slice is treated alike.
const FEW_ANGLES: Sizes = [3, 6];

/// Angles of a sample on each axis: of a grid that has but one on an axis, as many on the other as on both.
fn wanted_on(angles: [usize; 2], wanted: usize) -> [usize; 2] {
    let [h, d] = angles.map(|n| n == 1);
    [
        if d { wanted * wanted } else { wanted },
        if h { wanted * wanted } else { wanted },
    ]
}

/// Step at which an axis of so many angles is left with about `wanted`.
fn step_for(angles: usize, wanted: usize) -> usize {
    (angles - 1).div_ceil((wanted - 1).max(1)).max(1)
}

/// Angles that are left of so many at a step; the last is always kept.
fn left_at(angles: usize, step: usize) -> usize {
    (angles - 1).div_ceil(step) + 1
}

/// Writing a result of this size to disk; nothing, where this machine could not write.
fn write_stage(bytes: f64) -> Option<Stage> {
    let seconds = this_machine().write_seconds(bytes)?;
    let stage = "write";
    Some(Stage { stage, seconds })
}

/// Times that a job writes to its store's catalogue as much as a file's end takes: when it is queued, taken up and done.
const COMMITS: f64 = 3.0;

/// What a job writes of itself.
fn job_seconds() -> f64 {
    COMMITS * this_machine().write_seconds(0.0).unwrap_or(0.0)
}

/// What a service takes to hash and keep an upload of so many bytes and to make a job of it, beside the job itself.
#[must_use]
pub fn receive_stage(bytes: f64) -> Stage {
    let machine = this_machine();
    let kept = machine.write_seconds(bytes).unwrap_or(0.0);
    Stage {
        stage: "receive",
        seconds: machine.hash_seconds(bytes) + kept + job_seconds(),
    }
}

/// Times that copying and hashing a result in memory takes as long as hashing a file that the system has at hand.
const KEEPING: f64 = 2.0;

/// What a service takes to keep a result of this size among those it has at hand.
fn keep_stage(bytes: f64) -> Stage {
    Stage {
        stage: "keep",
        seconds: KEEPING * this_machine().hash_seconds(bytes),
    }
}

/// Seconds that something takes, and what it gives.
fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let begun = Instant::now();
    let made = work();
    (begun.elapsed().as_secs_f64(), made)
}

/// What the only go takes longer than the shortest of several.
const COLD: f64 = 1.2;

/// Seconds below which one go says little.
const SHORT: f64 = 0.05;

/// What the only go takes longer than [`steady`] goes whose shortest took so many seconds: one that was long was itself
/// the only one.
fn cold(seconds: f64) -> f64 {
    if seconds > SHORT { 1.0 } else { COLD }
}

/// The shortest of so many goes of what is short, one of what is long.
fn steady<T>(goes: usize, mut work: impl FnMut() -> T) -> (f64, T) {
    let (mut least, mut made) = timed(&mut work);
    for _ in 1..goes {
        if least > SHORT {
            break;
        }
        let (seconds, again) = timed(&mut work);
        if seconds < least {
            (least, made) = (seconds, again);
        }
    }
    (least, made)
}

/// The shortest of three goes: what the work takes when nothing comes between.
fn shortest<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let (mut least, mut made) = timed(&mut work);
    for _ in 0..2 {
        let (seconds, again) = timed(&mut work);
        if seconds < least {
            (least, made) = (seconds, again);
        }
    }
    (least, made)
}

/// A line through two samples, (size, value) each, read at another size: neither part of it is negative.
fn extrapolated(small: (f64, f64), large: (f64, f64), size: f64) -> f64 {
    let per_unit = if large.0 > small.0 {
        (large.1 - small.1) / (large.0 - small.0)
    } else {
        large.1 / large.0.max(1.0)
    };
    let per_unit = per_unit.max(0.0);
    let fixed = large.1 - per_unit * large.0;
    if fixed < 0.0 {
        return large.1 / large.0.max(1.0) * size;
    }
    fixed + per_unit * size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_two_samples_has_no_negative_part() {
        assert_eq!(extrapolated((1.0, 3.0), (3.0, 5.0), 10.0), 12.0);
        assert_eq!(extrapolated((1.0, 6.0), (3.0, 5.0), 10.0), 5.0);
        assert_eq!(extrapolated((1.0, 1.0), (2.0, 4.0), 10.0), 20.0);
    }

    #[test]
    fn a_step_leaves_as_many_angles_as_a_grid_keeps() {
        for angles in 1..40 {
            let grid =
                crate::paint::AngleGrid::new((0..angles).map(|k| f64::from(k) * 2.0).collect())
                    .expect("ascends");
            for step in 1..9 {
                assert_eq!(
                    left_at(angles as usize, step),
                    grid.every(step).len(),
                    "{angles} {step}"
                );
            }
        }
    }
}
