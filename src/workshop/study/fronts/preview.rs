//! A blend at given weights becomes a picture.

use super::{all, distinct, point, presets, setting, share, with_flakes};
use crate::accuracy::Profile;
use crate::accuracy::study::Front;
use crate::blend::RealisationWeights;
use crate::fit::BoxRule;
use crate::paint::{Limits, PaintFile};
use crate::render::{self, Film, Scene, Shape};
use crate::workshop::study::material::clustered;
use crate::workshop::study::{Material, StudyOptions, Tell, shortest};
use crate::workshop::{WorkshopError, blend_paints};

/// Clusters and samples turned together.
const CLUSTERS_AND_SAMPLES: [(usize, u32); 8] = [
    (6, 64),
    (24, 64),
    (6, 16),
    (12, 32),
    (24, 16),
    (12, 128),
    (100, 32),
    (24, 256),
];

/// A blend at given weights to a picture.
pub(in crate::workshop::study) fn preview(
    material: &mut Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Front, WorkshopError> {
    let side = if options.quick { 64 } else { 128 };
    let samples: &[u32] = if options.quick {
        &[1, 4, 16, 64]
    } else {
        &[1, 2, 4, 8, 16, 32, 64, 128, 256, 512]
    };
    let finest = 16 * samples[samples.len() - 1].min(if options.quick { 64 } else { 128 });
    let standard = Profile::standard();
    let mut settings = presets();
    for &n in samples {
        let profile = Profile {
            samples_per_pixel: n,
            ..standard
        };
        settings.push(setting(
            format!("{n} samples"),
            "samples_per_pixel",
            profile,
        ));
    }
    for (n, samples_per_pixel) in CLUSTERS_AND_SAMPLES {
        if options.quick && samples_per_pixel != 64 {
            continue;
        }
        let profile = Profile {
            samples_per_pixel,
            ..with_flakes(clustered(n, BoxRule::Moments, 1))
        };
        let knob = if samples_per_pixel == standard.samples_per_pixel {
            "clusters"
        } else {
            "together"
        };
        let label = format!("{n} clusters, {samples_per_pixel} samples");
        settings.push(setting(label, knob, profile));
    }
    tell("preview", 0.6);
    let reference = Profile {
        samples_per_pixel: finest,
        ..Profile::reference()
    };
    let (_, truth) = draw(material, &reference, side, 1, 7)?;
    let read = |profile: &Profile| (profile.flakes, profile.blend, profile.samples_per_pixel);
    let settings = distinct(settings, read);
    let count = settings.len();
    let mut points = Vec::with_capacity(count);
    for (k, of) in settings.into_iter().enumerate() {
        tell("preview", share(k, count, 0.75, 0.92));
        let goes = if options.quick || of.profile.samples_per_pixel > 64 {
            1
        } else {
            3
        };
        let (seconds, film) = draw(material, &of.profile, side, goes, 1)?;
        let difference = render::difference(&film, &truth);
        let mut point = point(of, seconds, difference.mean_delta_e);
        point
            .more
            .insert("95 % of pixels within".to_owned(), difference.p95_delta_e);
        point.more.insert("FLIP".to_owned(), difference.flip);
        points.push(point);
    }
    let about = format!("Preview: a ball of {side} x {side} pixels");
    let error_is = format!(
        "The error is the mean CIEDE2000 over all pixels from a picture with {finest} samples a pixel by the `reference` \
         profile. Beside it stand the difference that 95 % of the pixels keep within, and FLIP (0 to 1). A larger \
         picture shows finer flakes and is farther off at the same samples, and it takes longer: \
         `carpaint estimate preview` tells both for yours."
    );
    Ok(Front::new(
        "preview",
        &about,
        &error_is,
        "CIEDE2000",
        points,
    ))
}

fn draw(
    material: &mut Material,
    profile: &Profile,
    side: u32,
    goes: usize,
    seed: u32,
) -> Result<(f64, Film), WorkshopError> {
    let paints: Vec<&PaintFile> = material.fitted(&profile.flakes, 2)?.iter().collect();
    let blend = blend_paints(&paints, profile, &|_| ())?.blend;
    let paint = blend.realise(&RealisationWeights::equal(2))?.paint;
    let scene = Scene {
        samples_per_pixel: profile.samples_per_pixel,
        seed,
        ..Scene::new(Shape::Sphere, [side; 2])
    };
    let go = || {
        render::render(&paint, &scene, &Limits::default(), &|_| ()).map_err(WorkshopError::internal)
    };
    let (seconds, rendering) = shortest(goes, all(), go)?;
    Ok((seconds, rendering.film))
}
