//! Estimates of a picture.

use super::{
    Estimate, EstimatedError, Stage, extrapolated, keep_stage, steady, timed, write_stage,
};
use crate::accuracy::{PictureError, Profile};
use crate::blend::RealisationWeights;
use crate::paint::Limits;
use crate::workshop::previewing::{PictureFormat, PreviewOptions, picture_error, preview};
use crate::workshop::realising::Made;
use crate::workshop::{Lap, Thing, WorkshopError};

/// Pixels on a side of the samples, were they squares; the third is drawn where the second took hardly longer than the first,
/// and where it is a small part of the picture: pixels of small pictures take longer, for each sees more of the paint.
const SIDES: [u32; 3] = [20, 56, 160];

/// The same for who looks through profiles.
const SEARCHING_SIDES: [u32; 2] = [20, 96];

/// The same for angles, which take no samples to draw, and whose files grow more slowly than their pixels.
const SIDES_OF_ANGLES: [u32; 2] = [160, 320];

/// How much longer a larger sample has to take, to tell drawing from getting ready.
const LONGER: f64 = 3.0;

/// Part of the picture's work that is small.
const SMALL_PART: f64 = 1.0 / 24.0;

/// Part of a larger sample's time that is at least proportional to the work.
const LEAST_SHARE: f64 = 0.25;

/// By how many times the samples of a picture that is small itself are more, to the same end.
const MORE: u32 = 32;

/// Goes of a small picture that takes little time.
const GOES: usize = 3;

/// Samples per pixel from which on time is proportional to them.
const ENOUGH: u32 = 8;

/// A few small pictures: what each took, from which follows what a larger one will.
#[derive(Clone, Debug)]
pub struct SmallPictures {
    drawn: Vec<SmallPicture>,
}

#[derive(Clone, Debug)]
struct SmallPicture {
    work: f64,
    seconds: f64,
    pixels: f64,
    bytes: f64,
    stages: Vec<Lap>,
}

/// Work, pixels times batches of samples, up to which a picture is drawn itself to tell what it takes: that is about what
/// its samples come to, each drawn [`GOES`] times.
const LITTLE: f64 = 4.0 * 160.0 * 160.0 * 2.0;

/// Samples come in batches: up to one a pixel takes about the same.
fn batches(samples_per_pixel: u32) -> f64 {
    f64::from(samples_per_pixel.div_ceil(ENOUGH))
}

impl SmallPicture {
    fn of(
        options: &PreviewOptions,
        (seconds, made): (f64, Result<Made, WorkshopError>),
    ) -> Result<Self, WorkshopError> {
        let made = made?;
        let pixels = options.size.map(f64::from).iter().product();
        Ok(Self {
            work: pixels * batches(options.samples_per_pixel),
            seconds,
            pixels,
            bytes: made.bytes.len() as f64,
            stages: made.stages,
        })
    }
}

impl SmallPictures {
    /// Draws the fewest that tell, once: who looks for a number of samples must not take longer than the picture.
    ///
    /// # Errors
    ///
    /// What [`preview`] refuses.
    pub fn to_search(
        work: &PictureWork<'_>,
        samples_per_pixel: u32,
    ) -> Result<Self, WorkshopError> {
        let sides = &SEARCHING_SIDES;
        Self::draw(work, samples_per_pixel, sides, 0.0, |of| {
            timed(|| work.draw(&of))
        })
    }

    /// Seconds that the picture takes with so many samples per pixel.
    #[must_use]
    pub fn seconds(&self, work: &PictureWork<'_>, samples_per_pixel: u32) -> f64 {
        self.tell(work.options.size, samples_per_pixel).0
    }

    /// Seconds that the smallest of them took, most of which is getting ready.
    #[must_use]
    pub fn least_seconds(&self) -> f64 {
        self.drawn.first().map_or(0.0, |first| first.seconds)
    }

    /// What the picture takes, with its error.
    #[must_use]
    pub fn estimate(
        &self,
        work: &PictureWork<'_>,
        profile: &Profile,
        error: &PictureError,
    ) -> Estimate {
        let options = work.with(profile.samples_per_pixel);
        let (seconds, bytes) = self.tell(options.size, options.samples_per_pixel);
        let mut stages = self.stages(seconds);
        if work.written {
            stages.extend(write_stage(bytes));
        } else {
            stages.push(keep_stage(bytes));
        }
        let error = EstimatedError::of_picture(error);
        let drawn_with = Profile {
            samples_per_pixel: options.samples_per_pixel,
            ..*profile
        };
        Estimate::new(&drawn_with, stages, bytes, error)
    }

    /// So many seconds, as the largest of them spent its own.
    fn stages(&self, seconds: f64) -> Vec<Stage> {
        let own = self.drawn.last().map_or(&[][..], |last| &last.stages);
        let all: f64 = own.iter().map(|(_, time)| time.as_secs_f64()).sum();
        own.iter()
            .map(|&(stage, time)| Stage {
                stage,
                seconds: seconds * time.as_secs_f64() / all.max(f64::MIN_POSITIVE),
            })
            .collect()
    }

    /// Draws them of as many pixels as squares of these sides, in the shape of the picture; `time` says how often, and which
    /// go counts, and `whole` is the work of the picture. By its longer side a strip would be of so few pixels that getting ready is all that they tell.
    fn draw(
        work: &PictureWork<'_>,
        samples_per_pixel: u32,
        sides: &[u32],
        whole: f64,
        time: impl Fn(PreviewOptions) -> (f64, Result<Made, WorkshopError>),
    ) -> Result<Self, WorkshopError> {
        let options = work.options;
        let [across, down] = options.size.map(f64::from);
        let as_square = (across * down).sqrt();
        let mut drawn: Vec<SmallPicture> = Vec::new();
        for &side in sides {
            let part = f64::from(side * side) * batches(samples_per_pixel) / whole;
            if let [first, .., last] = &drawn[..]
                && last.seconds > LONGER * first.seconds
                && part > SMALL_PART
            {
                break;
            }
            let scale = (f64::from(side) / as_square).min(1.0);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few pixels
            let size = (options.size).map(|n| ((f64::from(n) * scale).round() as u32).max(1));
            let pixels = f64::from(size[0]) * f64::from(size[1]);
            // A picture that is small itself tells drawing from getting ready by more samples of the same pixels.
            let again = drawn.iter().any(|smaller| smaller.pixels >= pixels);
            let samples_per_pixel = if again {
                samples_per_pixel
                    .saturating_mul(MORE)
                    .min(work.limits.samples)
            } else {
                samples_per_pixel
            };
            let of = PreviewOptions {
                size,
                ..work.with(samples_per_pixel)
            };
            drawn.push(SmallPicture::of(&of, time(of.clone()))?);
        }
        Ok(Self { drawn })
    }

    /// One picture, which is the whole of the work.
    fn of(
        options: &PreviewOptions,
        timed: (f64, Result<Made, WorkshopError>),
    ) -> Result<Self, WorkshopError> {
        let drawn = vec![SmallPicture::of(options, timed)?];
        Ok(Self { drawn })
    }

    /// Seconds and bytes of a picture of this size.
    fn tell(&self, size: [u32; 2], samples_per_pixel: u32) -> (f64, f64) {
        let [first, ..] = &self.drawn[..] else {
            return (0.0, 0.0);
        };
        let last = self.drawn.last().unwrap_or(first);
        let pixels = f64::from(size[0]) * f64::from(size[1]);
        let work = pixels * batches(samples_per_pixel);
        // Where something else slowed the smaller sample down, the line through both is flat and promises anything: less
        // than a part of what the larger says by itself is not believed.
        let least = LEAST_SHARE * last.seconds / last.work * work;
        let times = [first, last].map(|of| (of.work, of.seconds));
        let sizes = [first, last].map(|of| (of.pixels, of.bytes));
        (
            extrapolated(times[0], times[1], work).max(least),
            extrapolated(sizes[0], sizes[1], pixels),
        )
    }
}

/// A paint, or a blend at some weights, that is to become a picture.
#[derive(Clone, Copy, Debug)]
pub struct PictureWork<'a> {
    /// The paint or blend.
    pub thing: &'a Thing,
    /// Weights of a blend.
    pub weights: Option<&'a RealisationWeights>,
    /// What it shows; the profile says how many samples.
    pub options: &'a PreviewOptions,
    /// What it is written as.
    pub format: PictureFormat,
    /// Limits of pictures.
    pub limits: &'a Limits,
    /// Whether it is written to disk.
    pub written: bool,
}

impl PictureWork<'_> {
    /// What it shows with so many samples per pixel; angles have none to choose.
    fn with(&self, samples_per_pixel: u32) -> PreviewOptions {
        PreviewOptions {
            samples_per_pixel: if self.options.show.is_paint() {
                samples_per_pixel
            } else {
                1
            },
            ..self.options.clone()
        }
    }

    /// Error of the picture with so many samples per pixel; angles have none.
    ///
    /// # Errors
    ///
    /// What [`preview`] refuses.
    pub fn error_of(&self, samples_per_pixel: u32) -> Result<PictureError, WorkshopError> {
        if !self.options.show.is_paint() {
            return Ok(PictureError::none());
        }
        let options = self.with(samples_per_pixel);
        picture_error(self.thing, self.weights, &options, self.limits)
    }

    fn draw(&self, options: &PreviewOptions) -> Result<Made, WorkshopError> {
        let (thing, weights) = (self.thing, self.weights);
        preview(thing, weights, options, self.format, self.limits, &|_| ())
    }
}

/// What drawing a picture will take; opening its paint not included.
///
/// # Errors
///
/// What [`preview`] refuses.
pub fn estimate_preview(
    work: &PictureWork<'_>,
    profile: &Profile,
) -> Result<Estimate, WorkshopError> {
    let samples = work.with(profile.samples_per_pixel).samples_per_pixel;
    let few = samples.min(2 * ENOUGH);
    let itself = work.with(samples);
    let [across, down] = itself.size.map(f64::from);
    let whole = across * down * batches(samples);
    let small = if whole <= LITTLE {
        SmallPictures::of(&itself, timed(|| work.draw(&itself)))?
    } else if work.options.show.is_paint() {
        SmallPictures::draw(work, few, &SIDES, whole, |of| {
            steady(GOES, || work.draw(&of))
        })?
    } else {
        SmallPictures::draw(work, 1, &SIDES_OF_ANGLES, whole, |of| {
            timed(|| work.draw(&of))
        })?
    };
    let error = work.error_of(samples)?;
    Ok(small.estimate(work, profile, &error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Shape;
    use crate::workshop::{Show, sample_by_name};

    /// Getting ready takes a hundredth of a second here, a sample a microsecond.
    fn seconds(of: &PreviewOptions) -> f64 {
        let samples = of.size.iter().product::<u32>() * of.samples_per_pixel;
        0.01 + 1e-6 * f64::from(samples)
    }

    #[test]
    fn a_tiny_picture_of_many_samples_is_not_taken_for_a_large_one() {
        let sample = sample_by_name("white").expect("a sample");
        let paint = sample.build(&Profile::draft(), &|_| ()).expect("builds");
        let (thing, limits) = (Thing::Paint(Box::new(paint)), Limits::default());
        for (size, samples_per_pixel) in [
            ([8, 8], 4096),
            ([64, 64], 64),
            ([512, 384], 64),
            ([4096, 64], 64),
        ] {
            let options = PreviewOptions {
                show: Show::Paint,
                scene: Shape::Sphere,
                size,
                samples_per_pixel,
                environment: None,
                lights: None,
            };
            let work = PictureWork {
                thing: &thing,
                weights: None,
                options: &options,
                format: PictureFormat::Png,
                limits: &limits,
                written: false,
            };
            let few = samples_per_pixel.min(2 * ENOUGH);
            let made = |of: &PreviewOptions| {
                let one = PreviewOptions {
                    size: [1, 1],
                    ..of.clone()
                };
                (seconds(of), work.draw(&one))
            };
            let small =
                SmallPictures::draw(&work, few, &SIDES, 0.0, |of| made(&of)).expect("drawn");
            let told = small.tell(size, samples_per_pixel).0;
            let wanted = seconds(&options);
            assert!(
                (told / wanted - 1.0).abs() < 0.01,
                "{size:?}: {told} {wanted}"
            );
        }
    }
}
