//! A blend at given weights becomes a file.

use serde_json::Value;

use super::{Setting, distinct, point, presets, setting, share, with_clusters};
use crate::accuracy::Profile;
use crate::accuracy::study::Front;
use crate::blend::RealisationWeights;
use crate::export::{ExportSettings, Precision};
use crate::fit::BoxRule;
use crate::paint::PaintFile;
use crate::workshop::realising::realise as realise_to;
use crate::workshop::study::material::clustered;
use crate::workshop::study::{Material, StudyOptions, Tell, shortest};
use crate::workshop::{Format, Thing, WorkshopError, blend_paints};

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

/// Clusters, precision and the way to draw turned together.
fn turned_together() -> impl Iterator<Item = Setting> {
    let standard = Profile::standard();
    let ways = || {
        ways_to_write()
            .into_iter()
            .filter(|(_, _, _, alias, inverse_cdf)| *alias && !inverse_cdf)
    };
    [12, 24, 100].into_iter().flat_map(move |n| {
        ways().map(move |(label, _, precision, alias, inverse_cdf)| {
            let profile = Profile {
                flakes: clustered(n, BoxRule::Moments, 1),
                export: ExportSettings {
                    precision,
                    alias,
                    inverse_cdf,
                },
                ..standard
            };
            setting(format!("{n} clusters, {label}"), "together", profile)
        })
    })
}

/// A blend at given weights to a bundle.
pub(in crate::workshop::study) fn realise(
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
    let counts: &[usize] = if options.quick {
        &[24]
    } else {
        &[12, 24, 100, 200]
    };
    settings.extend(with_clusters(counts));
    if !options.quick {
        settings.extend(turned_together());
    }
    let read = |profile: &Profile| (profile.flakes, profile.blend, profile.export);
    let settings = distinct(settings, read);
    let (count, goes) = (settings.len(), if options.quick { 2 } else { 7 });
    let mut points = Vec::with_capacity(count);
    for (k, of) in settings.into_iter().enumerate() {
        tell("realise", share(k, count, 0.5, 0.6));
        let paints: Vec<&PaintFile> = material.fitted(&of.profile.flakes, 2)?.iter().collect();
        let blend = blend_paints(&paints, &of.profile, &|_| ())?.blend;
        let thing = Thing::Blend(Box::new(blend));
        let (weights, profile) = (RealisationWeights::equal(2), of.profile);
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
         lost stands beside the error. The alias table loses none; the presets write both, for shaders that have nothing but \
         the steps.",
        "Lab",
        points,
    ))
}
