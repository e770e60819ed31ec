//! Estimates of a picture.

use super::{Estimate, EstimatedError, Stage, extrapolated, shortest, write_seconds};
use crate::accuracy::Profile;
use crate::blend::RealisationWeights;
use crate::paint::Limits;
use crate::workshop::previewing::{PictureFormat, PreviewOptions, preview, sampling};
use crate::workshop::{Thing, WorkshopError};

/// Pixels on the longer side of the samples; the third is drawn where the second took hardly longer than the first.
const SIDES: [u32; 3] = [20, 56, 160];

/// How much longer a larger sample has to take, to tell drawing from getting ready.
const LONGER: f64 = 3.0;

/// Part of a larger sample's time that is at least proportional to the work.
const LEAST_SHARE: f64 = 0.25;

/// Samples per pixel from which on time is proportional to them.
const ENOUGH: u32 = 8;

/// What drawing a paint, or a blend at the given weights, will take; opening it not included.
///
/// # Errors
///
/// What [`preview`] refuses.
pub fn estimate_preview(
    thing: &Thing,
    weights: Option<&RealisationWeights>,
    options: &PreviewOptions,
    format: PictureFormat,
    limits: &Limits,
    profile: &Profile,
    written: bool,
) -> Result<Estimate, WorkshopError> {
    // Angles have no samples to choose, whatever the profile says.
    let options = &PreviewOptions {
        samples_per_pixel: if options.show.is_paint() {
            options.samples_per_pixel
        } else {
            1
        },
        ..options.clone()
    };
    let [width, height] = options.size.map(f64::from);
    let mut samples: Vec<(f64, f64, (f64, f64))> = Vec::new();
    let batches = |spp: u32| f64::from(spp.div_ceil(ENOUGH));
    for side in SIDES {
        if let [(_, first, _), .., (_, last, _)] = samples[..]
            && last > LONGER * first
        {
            break;
        }
        let scale = (f64::from(side) / width.max(height)).min(1.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few pixels
        let size = options
            .size
            .map(|n| ((f64::from(n) * scale).round() as u32).max(1));
        let few = PreviewOptions {
            size,
            samples_per_pixel: options.samples_per_pixel.min(2 * ENOUGH),
            ..options.clone()
        };
        let (seconds, made) = shortest(|| preview(thing, weights, &few, format, limits, &|_| ()));
        let pixels = f64::from(size[0]) * f64::from(size[1]);
        samples.push((
            pixels * batches(few.samples_per_pixel),
            seconds,
            (pixels, made?.bytes.len() as f64),
        ));
    }
    let work = width * height * batches(options.samples_per_pixel);
    // Where something else slowed the smaller sample down, the line through both is flat and promises anything: less
    // than a part of what the larger says by itself is not believed.
    let (first, last) = (samples[0], samples[samples.len() - 1]);
    let least = LEAST_SHARE * last.1 / last.0 * work;
    let seconds = extrapolated((first.0, first.1), (last.0, last.1), work).max(least);
    let bytes = extrapolated(first.2, last.2, width * height);
    let error = if options.show.is_paint() {
        sampling(thing, weights, options, limits)?.mean_delta_e
    } else {
        0.0
    };
    let mut stages = vec![Stage {
        stage: "draw",
        seconds,
    }];
    if written {
        stages.push(Stage {
            stage: "write",
            seconds: write_seconds(bytes),
        });
    }
    let error = EstimatedError {
        value: Some(error),
        unit: "CIEDE2000",
    };
    let drawn_with = Profile {
        samples_per_pixel: options.samples_per_pixel,
        ..*profile
    };
    Ok(Estimate::new(&drawn_with, stages, bytes, error))
}
