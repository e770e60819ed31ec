//! How many samples per pixel meet a target: any number will do, so it is reckoned and then checked.
//!
//! Time follows from a few small pictures. The error of chance falls about as one over the root of the samples: it is
//! measured on a lattice of pixels, the number that should do follows, and is measured in turn.

use super::{Picked, Search, Target};
use crate::accuracy::Profile;
use crate::workshop::estimate::{PictureWork, SmallPictures};
use crate::workshop::{MOST_SAMPLES, WorkshopError};

/// Samples per pixel that the error is measured with first.
const FIRST: u32 = 16;
/// Most samples per pixel.
const MOST_OF_PIXEL: u32 = 4096;
/// How often a number is reckoned and measured.
const GOES: usize = 4;
/// Share of the error allowed that is aimed at, and that is near enough.
const AIM: f64 = 0.95;
const NEAR: f64 = 0.8;

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
    let most = (MOST_SAMPLES / (width * height).max(1)).clamp(1, u64::from(MOST_OF_PIXEL));
    #[allow(clippy::cast_possible_truncation)] // at most 4096
    let most = most as u32;
    let few = FIRST.min(most);
    let small = SmallPictures::to_search(picture, few)?;
    let mut tried = 1;
    let mut measure = |samples: u32| {
        tried += 1;
        let error = picture.error_of(samples)?;
        Ok::<_, WorkshopError>(Measured { samples, error })
    };
    let first = measure(few)?;
    let wanted = match target.max_error {
        Some(allowed) => samples_for(allowed, first, most, &mut measure)?,
        None => scaled(first, most),
    };
    // What is left when all this has been found out.
    let in_time = |samples: u32| {
        let seconds = small.seconds(picture, samples);
        target
            .max_seconds
            .is_none_or(|most| search.seconds() + MARGIN * seconds <= most)
    };
    let chosen = if in_time(wanted.samples) {
        wanted
    } else {
        let (mut fits, mut too_many) = (0, wanted.samples);
        while too_many - fits > 1 {
            let middle = fits.midpoint(too_many);
            if in_time(middle) {
                fits = middle;
            } else {
                too_many = middle;
            }
        }
        scaled(first, fits.max(1))
    };
    let profile = Profile {
        samples_per_pixel: chosen.samples,
        ..Profile::standard()
    };
    let estimate = small.estimate(picture, &profile, chosen.error);
    Ok(target.picked(estimate, tried, search.seconds()))
}

/// What another number of samples leaves to chance, by the law of large numbers.
fn scaled(of: Measured, samples: u32) -> Measured {
    let error = of.error * (f64::from(of.samples) / f64::from(samples)).sqrt();
    Measured { samples, error }
}

/// About the least number of samples that leaves no more than this to chance; `most` where none does.
fn samples_for(
    allowed: f64,
    first: Measured,
    most: u32,
    measure: &mut impl FnMut(u32) -> Result<Measured, WorkshopError>,
) -> Result<Measured, WorkshopError> {
    let mut at = first;
    let mut enough: Option<Measured> = None;
    for _ in 0..GOES {
        if at.error <= allowed && enough.is_none_or(|least| at.samples < least.samples) {
            enough = Some(at);
        }
        let near = (NEAR * allowed..=allowed).contains(&at.error);
        let reckoned = f64::from(at.samples) * (at.error / (AIM * allowed)).powi(2);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let next = reckoned.ceil().clamp(1.0, f64::from(most)) as u32;
        let worse = enough.is_some_and(|least| next >= least.samples);
        if near || next == at.samples || worse {
            break;
        }
        at = measure(next)?;
    }
    if at.error <= allowed && enough.is_none_or(|least| at.samples < least.samples) {
        enough = Some(at);
    }
    match enough {
        Some(enough) => Ok(enough),
        None if at.samples == most => Ok(at),
        None => measure(most),
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
            Ok(Measured {
                samples,
                error: 6.0 * f64::from(samples).powf(-0.45),
            })
        };
        let first = measure(16).expect("measured");
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

    #[test]
    fn what_no_number_meets_gets_the_most() {
        let (found, _) = found(1e-6, 1024);
        assert_eq!(found.samples, 1024);
        assert!(found.error > 1e-6);
    }
}
