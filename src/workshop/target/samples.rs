//! How many samples per pixel meet a target: any number will do, so it is reckoned and then checked.
//!
//! How far off the paint is, no number of samples mends: chance may take what that leaves of the error allowed. Time follows
//! from a few small pictures. The error of chance falls about as one over the root of the samples: it is
//! measured on a lattice of pixels, the number that should do follows, and is measured in turn.

use std::cell::RefCell;

use super::{Picked, Search, Target};
use crate::accuracy::Profile;
use crate::workshop::estimate::{PictureWork, SmallPictures};
use crate::workshop::{MOST_SAMPLES, WorkshopError};

/// Samples per pixel that the error is measured with first.
const FIRST: u32 = 8;
/// How often a number is reckoned and measured: doublings from the first to the most, and a few between.
const GOES: usize = 14;
/// Share of the error allowed that is aimed at, and that is near enough.
const AIM: f64 = 0.95;
const NEAR: f64 = 0.8;

/// Pixels that are drawn to tell an error, at most.
const TOLD_PIXELS: f64 = 2.0 * 1024.0;

/// By how much a picture may take longer than estimated.
const MARGIN: f64 = 1.15;

/// Samples per pixel and the error measured with them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Measured {
    samples: u32,
    error: f64,
}

/// Picks the samples of a picture.
pub(super) fn pick_samples(
    target: &Target,
    picture: &PictureWork<'_>,
    search: &Search,
) -> Result<Picked, WorkshopError> {
    let [width, height] = picture.options.size.map(u64::from);
    // Who draws into a file of his own waits as long as he likes; a service has a limit.
    let most = if picture.written {
        u64::MAX
    } else {
        MOST_SAMPLES / (width * height).max(1)
    };
    #[allow(clippy::cast_possible_truncation)] // at most the limit
    let most = most.clamp(1, picture.limits.samples.into()) as u32;
    let few = FIRST.min(most);
    let small = SmallPictures::to_search(picture, few)?;
    let measured = RefCell::new(Vec::new());
    let measure = |samples: u32| {
        let of = picture.error_of(samples)?;
        measured.borrow_mut().push(samples);
        Ok::<_, WorkshopError>(of)
    };
    // Telling the error takes its time too: about as long as a small picture, and its share of the pixels.
    let told = (TOLD_PIXELS / (width * height).max(1) as f64).min(1.0);
    let telling =
        |samples: u32| small.least_seconds() + told * small.seconds(picture, samples.max(1));
    // Most that are drawn in what is left of the time, if something else takes so many seconds before.
    let in_time = |before: f64| {
        let fits = |samples: u32| {
            let seconds = small.seconds(picture, samples);
            target
                .max_seconds
                .is_none_or(|most| search.seconds() + before + MARGIN * seconds <= most)
        };
        if fits(most) {
            return most;
        }
        let (mut fit, mut too_many) = (0, most);
        while too_many - fit > 1 {
            let middle = fit.midpoint(too_many);
            if fits(middle) {
                fit = middle;
            } else {
                too_many = middle;
            }
        }
        fit
    };
    let (samples, in_time_at_all, error) = match target.max_error {
        None => {
            let most = in_time(telling(in_time(0.0)));
            let samples = most.max(1);
            (samples, most > 0, measure(samples)?)
        }
        Some(allowed) => {
            let of_few = measure(few)?;
            let first = Measured {
                samples: few,
                error: of_few.samples,
            };
            let for_chance = for_chance(allowed, of_few.paint, first, most);
            // What leaves no time for a picture of as many samples is not measured.
            let worth_it = |samples: u32| samples <= in_time(telling(samples));
            let wanted = samples_for(for_chance, first, most, &mut |samples| {
                let of = worth_it(samples).then(|| measure(samples)).transpose()?;
                Ok(of.map(|of| Measured {
                    samples,
                    error: of.samples,
                }))
            })?;
            let most = in_time(0.0);
            let samples = wanted.samples.min(most.max(1));
            // Chance that was reckoned is no promise.
            let is_known = measured.borrow().contains(&samples);
            let error = if is_known && samples == wanted.samples {
                of_few.with_samples(wanted.error)
            } else if samples == few {
                of_few
            } else if worth_it(samples) {
                measure(samples)?
            } else {
                of_few.unmeasured()
            };
            (samples, most > 0, error)
        }
    };
    let profile = Profile {
        samples_per_pixel: samples,
        ..Profile::standard()
    };
    let mut tried = 1 + measured.borrow().len();
    let small = if in_time_at_all {
        small
    } else {
        // Of many samples a pixel takes longer than their share: what is told of a single one is looked at by itself.
        tried += 1;
        SmallPictures::to_search(picture, samples)?
    };
    let estimate = small.estimate(picture, &profile, &error);
    Ok(target.picked(estimate, tried, search.seconds()))
}

/// What chance may take of the error allowed: what the paint leaves of it. Where that is nothing, or less than the most
/// samples reach, the target is missed whatever is drawn: samples then do their part as if the paint were right.
fn for_chance(allowed: f64, paint: Option<f64>, first: Measured, most: u32) -> f64 {
    let left = allowed - paint.unwrap_or(0.0);
    if left > scaled(first, most).error {
        left
    } else {
        allowed
    }
}

/// What another number of samples leaves to chance, by the law of large numbers.
fn scaled(of: Measured, samples: u32) -> Measured {
    let error = of.error * (f64::from(of.samples) / f64::from(samples)).sqrt();
    Measured { samples, error }
}

/// About the least number of samples that leaves no more than this to chance; `most` where none does. A number that
/// `measure` does not measure is taken for what it should leave.
///
/// Beside flakes the error can stay where it is over several doublings: what is reckoned from it is at least the double of
/// a number that is too small, and lies between those that are and those that are not.
fn samples_for(
    allowed: f64,
    first: Measured,
    most: u32,
    measure: &mut impl FnMut(u32) -> Result<Option<Measured>, WorkshopError>,
) -> Result<Measured, WorkshopError> {
    let (mut short, mut enough): (Option<Measured>, Option<Measured>) = (None, None);
    let mut at = first;
    for _ in 0..GOES {
        let is_enough = at.error <= allowed;
        if is_enough && enough.is_none_or(|least| at.samples < least.samples) {
            enough = Some(at);
        }
        if !is_enough && short.is_none_or(|most| at.samples > most.samples) {
            short = Some(at);
        }
        let near = is_enough && at.error >= NEAR * allowed;
        let above = short.map_or(0, |short| short.samples);
        let below = enough.map_or(most.saturating_add(1), |enough| enough.samples);
        if near || below <= above + above / 4 + 1 {
            break;
        }
        let reckoned = f64::from(at.samples) * (at.error / (AIM * allowed)).powi(2);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let reckoned = reckoned.ceil().clamp(1.0, f64::from(most)) as u32;
        let least = if is_enough { 1 } else { 2 * at.samples };
        // Between two that are known, the middle of their ratio where the reckoning leads out.
        let middle = (f64::from(above.max(1)) * f64::from(below)).sqrt() as u32;
        let next = match reckoned.max(least) {
            next if next < below && next > above => next,
            _ => middle.clamp(above + 1, below - 1),
        };
        let Some(measured) = measure(next)? else {
            return Ok(enough.unwrap_or_else(|| scaled(at, next)));
        };
        at = measured;
    }
    match (enough, short) {
        (Some(enough), _) => Ok(enough),
        (None, Some(short)) if short.samples == most => Ok(short),
        (None, _) => Ok(measure(most)?.unwrap_or_else(|| scaled(at, most))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(allowed: f64, most: u32) -> (Measured, usize) {
        let mut asked = 0;
        // A little slower than the root, as low-discrepancy points beside flakes are not.
        let mut measure = |samples: u32| {
            asked += 1;
            Ok(Some(Measured {
                samples,
                error: 6.0 * f64::from(samples).powf(-0.45),
            }))
        };
        let first = measure(16).expect("measured").expect("measured");
        let found = samples_for(allowed, first, most, &mut measure).expect("found");
        (found, asked)
    }

    #[test]
    fn about_as_many_samples_are_found_as_are_needed() {
        for allowed in [0.5, 0.8, 1.5, 3.0, 5.9] {
            let (found, asked) = found(allowed, 4096);
            let needed = (6.0 / allowed).powf(1.0 / 0.45);
            assert!(found.error <= allowed, "{allowed} {found:?}");
            assert!(
                f64::from(found.samples) < 2.0 * needed + 2.0,
                "{allowed} {found:?} {needed}"
            );
            assert!(asked <= GOES + 2);
        }
    }

    /// As beside flakes: nothing is gained from 16 samples to 128, then the root of their number.
    #[test]
    fn a_plateau_does_not_lead_to_the_most() {
        let curve = |samples: u32| match samples {
            ..16 => 1.2 * (16.0 / f64::from(samples)).sqrt(),
            16..=128 => 1.2,
            _ => 1.2 * (128.0 / f64::from(samples)).sqrt(),
        };
        for (allowed, needed) in [(1.5, 11), (1.25, 15), (1.19, 131), (1.0, 185), (0.5, 738)] {
            let mut asked = 0;
            let mut measure = |samples| {
                asked += samples;
                let error = curve(samples);
                Ok(Some(Measured { samples, error }))
            };
            let first = measure(8).expect("measured").expect("measured");
            let found = samples_for(allowed, first, 4096, &mut measure).expect("found");
            assert!(found.error <= allowed, "{allowed} {found:?}");
            assert!(found.samples <= needed * 8 / 5, "{allowed} {found:?}");
            assert!(asked < 8 * needed + 64, "{allowed} {asked}");
        }
    }

    #[test]
    fn chance_may_take_what_the_paint_leaves_where_samples_reach_it() {
        let first = Measured {
            samples: 16,
            error: 1.0,
        };
        // 4096 samples leave a sixteenth.
        for (paint, left) in [
            (Some(0.0), 1.0),
            (Some(0.75), 0.25),
            (Some(0.9375), 1.0),
            (Some(0.999), 1.0),
            (Some(2.0), 1.0),
            (None, 1.0),
        ] {
            assert_eq!(for_chance(1.0, paint, first, 4096), left, "{paint:?}");
        }
    }

    #[test]
    fn what_there_is_no_time_to_measure_is_reckoned() {
        let first = Measured {
            samples: 16,
            error: 2.0,
        };
        let found = samples_for(1.0, first, 4096, &mut |_| Ok(None)).expect("reckoned");
        // Four times the samples halve the error; a twentieth less than is allowed is aimed at.
        assert!((64..=72).contains(&found.samples), "{found:?}");
        assert!(found.error <= 1.0, "{found:?}");
    }

    #[test]
    fn what_no_number_meets_gets_the_most() {
        let (found, _) = found(1e-6, 1024);
        assert_eq!(found.samples, 1024);
        assert!(found.error > 1e-6);
    }
}
