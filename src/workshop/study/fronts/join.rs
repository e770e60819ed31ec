//! In which order several paints are joined.

use super::{all, distinct, measured, point, presets, setting, share};
use crate::accuracy::blend_error;
use crate::accuracy::study::Front;
use crate::accuracy::{Profile, Term};
use crate::blend::{BlendSettings, Order};
use crate::fit::BoxRule;
use crate::paint::PaintFile;
use crate::workshop::study::material::clustered;
use crate::workshop::study::{Material, StudyOptions, Tell, shortest};
use crate::workshop::{WorkshopError, blend_paints};

/// Paints that are joined: the fewest of which there is more than one order.
const PAINTS: usize = 3;

/// Clusters of three paints to one another; nothing, where the study has only two.
pub(in crate::workshop::study) fn join(
    material: &mut Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Option<Front>, WorkshopError> {
    if material.sources().len() < PAINTS {
        return Ok(None);
    }
    let standard = Profile::standard();
    let mut settings = presets();
    for n in [12, 24, 50, 100] {
        for (order, called) in [
            (Order::Canonical, "canonical"),
            (Order::Sampled, "sampled"),
            (Order::Cheapest, "cheapest"),
        ] {
            let profile = Profile {
                flakes: clustered(n, BoxRule::Moments, 1),
                blend: BlendSettings {
                    order,
                    ..standard.blend
                },
                ..standard
            };
            let knob = if n == 50 { "order" } else { "together" };
            settings.push(setting(
                format!("{n} clusters, {called} order"),
                knob,
                profile,
            ));
        }
    }
    let settings = distinct(settings, |profile| (profile.flakes, profile.blend));
    let (count, goes) = (settings.len(), if options.quick { 1 } else { 3 });
    let mut points = Vec::with_capacity(count);
    for (k, of) in settings.into_iter().enumerate() {
        tell("join", share(k, count, 0.45, 0.5));
        let paints = material.fitted(&of.profile.flakes, PAINTS)?;
        let paints: Vec<&PaintFile> = paints.iter().collect();
        let profile = of.profile;
        let go = || blend_paints(&paints, &profile, &|_| ());
        let (seconds, made) = shortest(goes, all(), go)?;
        let error = blend_error(&made.blend);
        let mut point = point(of, seconds, measured(&error)?);
        let transport = |term: &&Term| term.what == "transport";
        let detours = error.terms.iter().find(transport).and_then(|term| term.lab);
        let unknown = || WorkshopError::internal("a blend of the study tells no transport");
        let pairs = made.blend.report().pairs.iter();
        let apart: f64 = pairs.map(|pair| pair.mean_cost).sum();
        point.more.extend([
            ("of it transport".to_owned(), detours.ok_or_else(unknown)?),
            ("way of all pairs".to_owned(), apart),
        ]);
        points.push(point);
    }
    Ok(Some(Front::new(
        "join",
        "Join: the flakes of three paints",
        "The third paint is joined to the blend of the first two, so that its way to either is longer than it would be alone: \
         the error is that of the clusters plus the mean of that excess, of the three pairs the worst. Beside it stand the \
         excess, and the mean ways of all pairs, which the cheapest of all orders makes least, in Lab.",
        "Lab",
        points,
    )))
}
