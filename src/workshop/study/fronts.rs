//! Error against time of the four kinds of work.

use std::collections::BTreeMap;

use serde_json::Value;

use super::material::clustered;
use super::{Material, StudyOptions, Tell, WorkshopError, shortest};
use crate::accuracy::study::{Front, Point};
use crate::accuracy::{PRESETS, Profile, ResultError, blend_error, paint_error};
use crate::blend::{BlendSettings, RealisationWeights};
use crate::export::{ExportSettings, Precision};
use crate::fit::{BoxRule, ClusterSettings};
use crate::paint::{Limits, PaintFile};
use crate::render::{self, Film, Scene, Shape};
use crate::transport::{Cost, Method};
use crate::workshop::realising::realise as realise_to;
use crate::workshop::{Format, Thing, blend_paints};

/// A profile to measure, with what is told of it.
struct Setting {
    label: String,
    knob: &'static str,
    profile: Profile,
}

fn setting(label: impl Into<String>, knob: &'static str, profile: Profile) -> Setting {
    Setting {
        label: label.into(),
        knob,
        profile,
    }
}

fn presets() -> Vec<Setting> {
    PRESETS
        .iter()
        .filter_map(|&name| Some(setting(name, "preset", Profile::named(name).ok()?)))
        .collect()
}

fn with_flakes(flakes: ClusterSettings) -> Profile {
    Profile {
        flakes,
        ..Profile::standard()
    }
}

fn point(of: Setting, seconds: f64, error: f64) -> Point {
    Point {
        label: of.label,
        knob: of.knob.to_owned(),
        knobs: of.profile,
        seconds,
        error,
        bytes: None,
        more: BTreeMap::new(),
        on_front: false,
    }
}

/// Threads that parallel work is spread over.
fn all() -> usize {
    rayon::current_num_threads()
}

/// Each profile once, under the first of its labels.
fn distinct(settings: Vec<Setting>) -> Vec<Setting> {
    let mut kept: Vec<Setting> = Vec::with_capacity(settings.len());
    for setting in settings {
        if kept.iter().all(|other| other.profile != setting.profile) {
            kept.push(setting);
        }
    }
    kept
}

fn share(k: usize, of: usize, from: f32, to: f32) -> f32 {
    #[allow(clippy::cast_precision_loss)] // a progress bar
    let done = k as f32 / of.max(1) as f32;
    from + (to - from) * done
}

const CLUSTERS: [usize; 6] = [6, 12, 24, 50, 100, 200];

/// Pixels to clusters.
pub(super) fn ingest(
    material: &mut Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Front, WorkshopError> {
    let mut settings = presets();
    for n in CLUSTERS {
        let flakes = clustered(n, BoxRule::Moments, 1);
        settings.push(setting(
            format!("{n} clusters"),
            "clusters",
            with_flakes(flakes),
        ));
    }
    for step in [2, 4] {
        for n in if options.quick {
            vec![50]
        } else {
            vec![12, 24, 50, 100]
        } {
            let flakes = clustered(n, BoxRule::Moments, step);
            let label = format!("{n} clusters, every {step}. angle");
            let knob = if n == 50 { "angle_step" } else { "together" };
            settings.push(setting(label, knob, with_flakes(flakes)));
        }
    }
    let tight = clustered(50, BoxRule::Tight, 1);
    settings.push(setting("tight boxes", "box_rule", with_flakes(tight)));
    let settings = distinct(settings);
    let (count, goes) = (settings.len(), if options.quick { 1 } else { 2 });
    let mut points = Vec::with_capacity(count);
    for (k, of) in settings.into_iter().enumerate() {
        tell("ingest", share(k, count, 0.0, 0.25));
        let source = &material.sources()[0];
        let (seconds, paint) = shortest(goes, all(), || source.fit(&of.profile.flakes))?;
        let mut worst = measured(paint_error(&paint))?;
        let mut instrument: f64 = 0.0;
        for file in material.fitted(&of.profile.flakes, 2)? {
            worst = worst.max(measured(paint_error(file))?);
            let error = file.clustering.as_ref().and_then(|c| c.error.as_ref());
            let largest = error.map_or(0.0, |e| e.instrument.iter().copied().fold(0.0, f64::max));
            instrument = instrument.max(largest);
        }
        let mut point = point(of, seconds, worst);
        point.bytes = Some(paint.to_bytes().len() as u64);
        point
            .more
            .insert("ΔE2000 at an instrument".to_owned(), instrument);
        points.push(point);
    }
    Ok(Front::new(
        "ingest",
        "Ingest: pictures of flakes become clusters",
        "The error is the distance W1 of lightness between pixels and clusters, in Lab: nine of ten of the compared slices are \
         within, the worst of the paints counts. The time is of one paint, without reading its files. Beside it stands the \
         largest color error of the mean at the six instrument geometries.",
        "Lab",
        points,
    ))
}

/// Clusters, transport and angles turned together.
fn turned_together() -> Vec<Setting> {
    let standard = Profile::standard();
    let mut settings = Vec::new();
    for n in [12, 24, 50, 100] {
        for (step, method, how) in [
            (2, Method::Exact, "exact"),
            (2, Method::Greedy, "greedy"),
            (1, Method::Greedy, "greedy"),
        ] {
            let label = if step == 1 {
                format!("{n} clusters, {how}")
            } else {
                format!("{n} clusters, {how}, every {step}. angle")
            };
            let profile = Profile {
                flakes: clustered(n, BoxRule::Moments, step),
                blend: BlendSettings {
                    method,
                    cost: Cost::Distance,
                    ..standard.blend
                },
                ..standard
            };
            settings.push(setting(label, "together", profile));
        }
    }
    settings
}

/// Clusters of two paints to one another.
pub(super) fn blend(
    material: &mut Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Front, WorkshopError> {
    let standard = Profile::standard();
    let by = |flakes: ClusterSettings, method: Method, cost: Cost| Profile {
        flakes,
        blend: BlendSettings {
            method,
            cost,
            ..standard.blend
        },
        ..standard
    };
    let sinkhorn = |epsilon| Method::Sinkhorn { epsilon };
    let mut settings = presets();
    for n in CLUSTERS {
        let flakes = clustered(n, BoxRule::Moments, 1);
        settings.push(setting(
            format!("{n} clusters"),
            "clusters",
            with_flakes(flakes),
        ));
    }
    for (label, method, cost) in [
        ("greedy transport", Method::Greedy, Cost::Distance),
        ("squared distance", Method::Exact, Cost::SquaredDistance),
        ("Sinkhorn 0.1", sinkhorn(0.1), Cost::Distance),
        ("Sinkhorn 0.02", sinkhorn(0.02), Cost::Distance),
    ] {
        settings.push(setting(
            label,
            "transport",
            by(standard.flakes, method, cost),
        ));
    }
    for step in [2, 4] {
        let flakes = clustered(50, BoxRule::Moments, step);
        let label = format!("every {step}. angle");
        settings.push(setting(label, "angle_step", with_flakes(flakes)));
    }
    if !options.quick {
        settings.extend(turned_together());
    }
    let settings = distinct(settings);
    let count = settings.len();
    let (mut points, mut without) = (Vec::with_capacity(count), Vec::new());
    for (k, of) in settings.into_iter().enumerate() {
        tell("blend", share(k, count, 0.25, 0.5));
        let paints: Vec<&PaintFile> = material.fitted(&of.profile.flakes, 2)?.iter().collect();
        let slow = matches!(of.profile.blend.method, Method::Sinkhorn { .. });
        let goes = if slow || options.quick { 1 } else { 5 };
        let profile = of.profile;
        let go = || blend_paints(&paints, &profile, &|_| ());
        let (seconds, made) = match shortest(goes, all(), go) {
            // Smoothing that does not end on these paints is a finding, and says nothing about the other settings.
            Err(error) if slow => {
                without.push(format!("{}: {error}", of.label));
                continue;
            }
            made => made?,
        };
        let mut point = point(of, seconds, measured(blend_error(&made.blend))?);
        let report = made.blend.report();
        let gap = report.pairs.iter().map(|p| p.mean_gap).fold(0.0, f64::max);
        point.more.insert("of it transport".to_owned(), gap);
        let seen = report.against_exact.iter().map(|d| d.delta_e_2000);
        point.more.insert(
            "ΔE2000 at an instrument".to_owned(),
            seen.fold(0.0, f64::max),
        );
        points.push(point);
    }
    let mut about = "The error is that of the clusters, plus how much further than needed flakes travel between the paints: the plan's \
         cost less its dual bound. The time is of two paints that are ingested already. Beside it stand the part of the \
         error that is transport, and the largest color difference at the six instrument geometries between this blend and \
         the exact one of the same clusters, at equal weights."
        .to_owned();
    if !without.is_empty() {
        about.push_str(" Without an answer on these paints: ");
        about.push_str(&without.join("; "));
        about.push('.');
    }
    Ok(Front::new(
        "blend",
        "Blend: which flakes of one paint become which of another",
        &about,
        "Lab",
        points,
    ))
}

fn even(paints: usize) -> RealisationWeights {
    RealisationWeights::even(vec![1.0 / paints as f64; paints])
}

/// Precisions and ways to draw: label, knob, precision, alias table, inverse CDF.
fn ways_to_write() -> Vec<(String, &'static str, Precision, bool, bool)> {
    let mut all = Vec::new();
    for (name, precision) in [
        ("8 bit", Precision::Eight),
        ("16 bit", Precision::F16),
        ("32 bit", Precision::F32),
    ] {
        for (draw, alias, inverse_cdf) in [
            ("alias", true, false),
            ("inverse CDF", false, true),
            ("both", true, true),
        ] {
            let knob = if draw == "both" { "precision" } else { "draw" };
            all.push((
                format!("{name}, {draw}"),
                knob,
                precision,
                alias,
                inverse_cdf,
            ));
        }
    }
    all
}

/// A blend at given weights to a bundle.
pub(super) fn realise(
    material: &mut Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Front, WorkshopError> {
    let standard = Profile::standard();
    let mut settings = presets();
    for (label, knob, precision, alias, inverse_cdf) in ways_to_write() {
        let export = ExportSettings {
            precision,
            alias,
            inverse_cdf,
        };
        settings.push(setting(label, knob, Profile { export, ..standard }));
    }
    for n in if options.quick {
        vec![24]
    } else {
        vec![12, 24, 100, 200]
    } {
        let flakes = clustered(n, BoxRule::Moments, 1);
        settings.push(setting(
            format!("{n} clusters"),
            "clusters",
            with_flakes(flakes),
        ));
    }
    let settings = distinct(settings);
    let (count, goes) = (settings.len(), if options.quick { 2 } else { 7 });
    let mut points = Vec::with_capacity(count);
    for (k, of) in settings.into_iter().enumerate() {
        tell("realise", share(k, count, 0.5, 0.6));
        let paints: Vec<&PaintFile> = material.fitted(&of.profile.flakes, 2)?.iter().collect();
        let blend = blend_paints(&paints, &of.profile, &|_| ())?.blend;
        let thing = Thing::Blend(Box::new(blend));
        let (weights, profile) = (even(2), of.profile);
        let go = || realise_to(&thing, Some(&weights), Format::Zip, &profile);
        // One file is written by one thread.
        let (seconds, made) = shortest(goes, 1, go)?;
        let number = |path: &str| made.report.pointer(path).and_then(Value::as_f64);
        let mut point = point(of, seconds, number("/accuracy/error/lab").unwrap_or(0.0));
        point.bytes = Some(made.bytes.len() as u64);
        if let Some(loss) = number("/accuracy/writing/inverse_cdf_loss") {
            point
                .more
                .insert("draws lost by the 500 steps".to_owned(), loss);
        }
        points.push(point);
    }
    Ok(Front::new(
        "realise",
        "Realise: a blend at given weights becomes a texture bundle",
        "The error is that of the blend plus the rounding of the corners in the file. The time is from a blend in memory to \
         the bytes of the bundle. Flakes drawn by the 500-step inverse CDF lose rare clusters; the share of draws that are \
         lost stands beside the error. The alias table loses none.",
        "Lab",
        points,
    ))
}

/// A blend at given weights to a picture.
pub(super) fn preview(
    material: &mut Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Front, WorkshopError> {
    let side = if options.quick { 64 } else { 128 };
    let samples: &[u32] = if options.quick {
        &[1, 4, 16, 64]
    } else {
        &[1, 2, 4, 8, 16, 32, 64, 128, 256]
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
    for n in [6, 24] {
        let profile = Profile {
            samples_per_pixel: 64,
            ..with_flakes(clustered(n, BoxRule::Moments, 1))
        };
        settings.push(setting(
            format!("{n} clusters, 64 samples"),
            "clusters",
            profile,
        ));
    }
    tell("preview", 0.6);
    let reference = Profile {
        samples_per_pixel: finest,
        ..Profile::reference()
    };
    let (_, truth) = draw(material, &reference, side, 1, 7)?;
    let settings = distinct(settings);
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
         profile. Beside it stand the difference that 95 % of the pixels keep within, and FLIP (0 to 1). Time grows in \
         proportion to the number of pixels; a website's picture has 16 times as many."
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
    let paint = blend.realise(&even(2))?.paint;
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
/// The error of what a study clustered itself is known.
fn measured(error: ResultError) -> Result<f64, WorkshopError> {
    let unknown =
        || WorkshopError::internal("a paint of the study was not compared with its pictures");
    error.lab.ok_or_else(unknown)
}
