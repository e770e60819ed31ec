//! Which flakes of one paint become which of another.

use super::{
    CLUSTERS, Setting, all, distinct, measured, point, presets, setting, share, with_clusters,
    with_flakes,
};
use crate::accuracy::study::Front;
use crate::accuracy::{Profile, blend_error};
use crate::blend::BlendSettings;
use crate::fit::{BoxRule, ClusterSettings};
use crate::paint::PaintFile;
use crate::transport::{Cost, Method};
use crate::workshop::study::material::clustered;
use crate::workshop::study::{Material, StudyOptions, Tell, shortest};
use crate::workshop::{WorkshopError, blend_paints};

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
                format!("{n} clusters, {how}, 1 of {step} angles")
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
pub(in crate::workshop::study) fn blend(
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
    settings.extend(with_clusters(&CLUSTERS));
    for (label, method, cost) in [
        ("greedy transport", Method::Greedy, Cost::Distance),
        ("squared distance", Method::Exact, Cost::SquaredDistance),
        ("Sinkhorn 0.1", sinkhorn(0.1), Cost::Distance),
        ("Sinkhorn 0.02", sinkhorn(0.02), Cost::Distance),
        ("Sinkhorn 0.01", sinkhorn(0.01), Cost::Distance),
    ] {
        settings.push(setting(
            label,
            "transport",
            by(standard.flakes, method, cost),
        ));
    }
    for step in [2, 4] {
        let flakes = clustered(50, BoxRule::Moments, step);
        let label = format!("1 of {step} angles");
        settings.push(setting(label, "angle_step", with_flakes(flakes)));
    }
    if !options.quick {
        settings.extend(turned_together());
    }
    let settings = distinct(settings, |profile| (profile.flakes, profile.blend));
    let count = settings.len();
    let (mut points, mut without) = (Vec::with_capacity(count), Vec::new());
    for (k, of) in settings.into_iter().enumerate() {
        tell("blend", share(k, count, 0.25, 0.45));
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
        let mut point = point(of, seconds, measured(&blend_error(&made.blend))?);
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
