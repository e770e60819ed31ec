//! Pictures of flakes become clusters.

use super::{
    CLUSTERS, all, distinct, measured, point, presets, setting, share, with_clusters, with_flakes,
};
use crate::accuracy::paint_error;
use crate::accuracy::study::Front;
use crate::fit::BoxRule;
use crate::workshop::WorkshopError;
use crate::workshop::study::material::clustered;
use crate::workshop::study::{Material, StudyOptions, Tell, shortest};

/// Pixels to clusters.
pub(in crate::workshop::study) fn ingest(
    material: &mut Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Front, WorkshopError> {
    let mut settings = presets();
    settings.extend(with_clusters(&CLUSTERS));
    for step in [2, 4] {
        for n in if options.quick {
            vec![50]
        } else {
            vec![12, 24, 50, 100]
        } {
            let flakes = clustered(n, BoxRule::Moments, step);
            let label = format!("{n} clusters, 1 of {step} angles");
            let knob = if n == 50 { "angle_step" } else { "together" };
            settings.push(setting(label, knob, with_flakes(flakes)));
        }
    }
    let tight = clustered(50, BoxRule::Tight, 1);
    settings.push(setting("tight boxes", "box_rule", with_flakes(tight)));
    let settings = distinct(settings, |profile| profile.flakes);
    let (count, goes) = (settings.len(), if options.quick { 1 } else { 2 });
    let mut points = Vec::with_capacity(count);
    for (k, of) in settings.into_iter().enumerate() {
        tell("ingest", share(k, count, 0.0, 0.25));
        let source = &material.sources()[0];
        let (seconds, paint) = shortest(goes, all(), || source.fit(&of.profile.flakes))?;
        let mut worst = measured(&paint_error(&paint))?;
        let mut instrument: f64 = 0.0;
        for file in material.fitted(&of.profile.flakes, 2)? {
            worst = worst.max(measured(&paint_error(file))?);
            let error = file.clustering.as_ref().and_then(|c| c.error.as_ref());
            let largest = error.map_or(0.0, |e| e.instrument.iter().copied().fold(0.0, f64::max));
            instrument = instrument.max(largest);
        }
        let mut point = point(of, seconds, worst);
        point.bytes = Some(paint.to_bytes()?.len() as u64);
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
