//! Estimates of files: a realisation, or the bundle of a whole blend.

use std::time::Duration;

use super::{
    Estimate, EstimatedError, Stage, extrapolated, keep_stage, shortest, step_for, timed,
    write_stage,
};
use crate::accuracy::{Profile, ResultError, bundle_error};
use crate::blend::{Blend, RealisationWeights};
use crate::paint::{CarPaint, Flakes, PaintFile};
use crate::workshop::bundling::bundle_blend;
use crate::workshop::realising::{Format, Made, error_as_written, realise};
use crate::workshop::{Lap, Thing, WorkshopError};

/// Angles on an axis of the two samples: writing has a fixed part that small samples say little of.
const ANGLES: [usize; 2] = [4, 9];

/// Clusters up to which a file is made whole to tell what it takes, once, or twice where a service keeps it: that is done in some
/// hundredths of a second.
const FEW_CLUSTERS: usize = 150_000;

/// What the first go takes longer than the shortest of three: nobody's memory is warm then.
const COLD: f64 = 1.3;

/// What writing a paint, or a blend at the given weights, will take; opening it not included.
///
/// # Errors
///
/// What [`realise`] refuses.
pub fn estimate_realise(
    thing: &Thing,
    weights: Option<&RealisationWeights>,
    format: Format,
    profile: &Profile,
    written: bool,
) -> Result<Estimate, WorkshopError> {
    let make = |sample: &Thing| realise(sample, weights, format, profile);
    let error = error_as_written(thing, weights, format, &profile.export)?;
    of_file(thing, profile, written, &error, &make)
}

/// What writing the bundle of a whole blend will take; opening it not included.
///
/// # Errors
///
/// What [`bundle_blend`] refuses.
pub fn estimate_bundle(
    thing: &Thing,
    profile: &Profile,
    written: bool,
) -> Result<Estimate, WorkshopError> {
    let make = |sample: &Thing| bundle_blend(sample, profile);
    let Thing::Blend(blend) = thing else {
        // It says why.
        return Err(make(thing)
            .err()
            .unwrap_or_else(|| WorkshopError::internal("a paint was bundled")));
    };
    let error = bundle_error(blend, &profile.export);
    of_file(thing, profile, written, &error, &make)
}

/// What `make` will take: it is done where that is soon done, otherwise told by what it takes on two samples. The error is
/// of the whole, for its range says how coarsely it is rounded.
fn of_file(
    thing: &Thing,
    profile: &Profile,
    written: bool,
    error: &ResultError,
    make: &dyn Fn(&Thing) -> Result<Made, WorkshopError>,
) -> Result<Estimate, WorkshopError> {
    if clusters(thing) <= FEW_CLUSTERS {
        let mut made = make(thing)?;
        if !written {
            // A service has what is made once, and its memory is warm.
            let again = make(thing)?;
            let took = |made: &Made| made.stages.iter().map(|(_, time)| *time).sum::<Duration>();
            if took(&again) < took(&made) {
                made = again;
            }
        }
        let bytes = made.bytes.len() as f64;
        let stage = |(stage, time): Lap| Stage {
            stage,
            seconds: time.as_secs_f64(),
        };
        return Ok(of_stages(
            made.stages.into_iter().map(stage).collect(),
            (profile, written, bytes, error),
        ));
    }
    let whole = slices(thing);
    let mut samples = Vec::new();
    let mut first_go = 0.0;
    for wanted in ANGLES {
        let sample = sample_of(thing, wanted);
        if samples.is_empty() {
            // What is made once and kept, such as the tile of random numbers, is made in the first go.
            first_go = timed(|| make(&sample).map(drop)).0;
        }
        let (seconds, made) = shortest(|| make(&sample));
        samples.push((slices(&sample), seconds, made?));
    }
    let at = |get: &dyn Fn(usize) -> f64| {
        extrapolated((samples[0].0, get(0)), (samples[1].0, get(1)), whole)
    };
    let bytes = at(&|k| samples[k].2.bytes.len() as f64);
    let once = (first_go - samples[0].1).max(0.0);
    let took = |k: usize, stage: &str| -> f64 {
        let own = samples[k]
            .2
            .stages
            .iter()
            .filter(|(name, _)| *name == stage);
        own.map(|(_, time)| time.as_secs_f64()).sum()
    };
    let mut stages: Vec<Stage> = (samples[1].2.stages.iter())
        .map(|&(stage, _)| Stage {
            stage,
            seconds: COLD * at(&|k| took(k, stage)),
        })
        .collect();
    if let Some(last) = stages.last_mut() {
        last.seconds += once;
    }
    Ok(of_stages(stages, (profile, written, bytes, error)))
}

/// These stages, and writing so many bytes, or keeping them.
fn of_stages(
    mut stages: Vec<Stage>,
    (profile, written, bytes, error): (&Profile, bool, f64, &ResultError),
) -> Estimate {
    if written {
        stages.extend(write_stage(bytes));
    } else {
        stages.push(keep_stage(bytes));
    }
    Estimate::new(profile, stages, bytes, EstimatedError::lab(error))
}

fn clusters(thing: &Thing) -> usize {
    match thing {
        Thing::Paint(file) => file.paint.flakes.as_ref().map_or(0, Flakes::clusters),
        Thing::Blend(blend) => blend.report().clusters,
    }
}

fn slices(thing: &Thing) -> f64 {
    let count = match thing {
        Thing::Paint(file) => file.paint.flakes.as_ref().map_or(1, Flakes::slices),
        Thing::Blend(blend) => blend.angles().map_or(1, |[h, d]| h * d),
    };
    count as f64
}

fn sample_of(thing: &Thing, wanted: usize) -> Thing {
    match thing {
        Thing::Paint(file) => {
            let flakes = file.paint.flakes.as_ref().map(|f| {
                let rows = f.theta_h.every(step_for(f.theta_h.len(), wanted));
                let columns = f.theta_d.every(step_for(f.theta_d.len(), wanted));
                f.only(&rows, &columns)
            });
            Thing::Paint(Box::new(PaintFile {
                paint: CarPaint {
                    flakes,
                    ..file.paint.clone()
                },
                ..(**file).clone()
            }))
        }
        Thing::Blend(blend) => Thing::Blend(Box::new(thinned(blend, wanted))),
    }
}

fn thinned(blend: &Blend, wanted: usize) -> Blend {
    match blend.angles() {
        Some(angles) => blend.thinned(angles.map(|n| step_for(n, wanted))),
        None => blend.clone(),
    }
}
