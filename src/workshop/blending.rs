//! Blending paints: those with too many clusters are reduced first.

use super::WorkshopError;
use crate::accuracy::{Profile, blend_deviation, left_out_w1};
use crate::blend::{Blend, BlendError, Ingredient, Origin, Reduction};
use crate::fit::{ClusterSettings, reduce_clusters};
use crate::paint::{CarPaint, Clamp, Clustering, Flakes, PaintFile};
use crate::transport::TransportError;

/// A new blend and what was done on the way.
#[derive(Clone, Debug)]
pub struct Blended {
    /// The blend.
    pub blend: Blend,
    /// What the caller should know: reduced clusters, mixed slices.
    pub notes: Vec<String>,
}

/// Finds the correspondence of two to five paints.
///
/// # Errors
///
/// [`WorkshopError`] for too few or too many paints, or flakes that cannot be transported.
pub fn blend_paints(
    paints: &[&PaintFile],
    profile: &Profile,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Blended, WorkshopError> {
    let mut notes: Vec<String> = (paints.iter())
        .filter_map(|file| clustered_otherwise(file, &profile.flakes))
        .collect();
    let reduced: Vec<Option<CarPaint>> = paints
        .iter()
        .map(|file| reduced(file, &profile.flakes, &mut notes))
        .collect();
    let ingredients: Vec<Ingredient<'_>> = paints
        .iter()
        .zip(&reduced)
        .map(|(file, reduced)| Ingredient {
            name: &file.name,
            paint: reduced.as_ref().unwrap_or(&file.paint),
        })
        .collect();
    let blend =
        Blend::new(&ingredients, &profile.blend, progress).map_err(|error| match error {
            BlendError::Paints(_) | BlendError::Angles { .. } => {
                WorkshopError::usage("paints", error)
            }
            BlendError::Transport {
                source: TransportError::TooManyPoints { .. },
                ..
            } => WorkshopError::usage(
                "clusters",
                format!("{error}: blend paints with fewer clusters, or fewer paints"),
            ),
            _ => WorkshopError::internal(error),
        })?;
    let origins = paints.iter().zip(&reduced).map(|(file, reduced)| Origin {
        simulated_flakes: file.provenance.simulated_flakes,
        residuals: file.residuals.clone(),
        energy: Some(file.energy.clone()),
        clamps: clamps_of(file).to_vec(),
        warnings: file.warnings.clone(),
        reduced: (reduced.as_ref())
            .map(|fewer| Reduction {
                from: widest(&file.paint),
                to: widest(fewer),
            })
            .filter(|by| by.to < by.from),
    });
    let deviation =
        blend_deviation(&ingredients, &profile.blend).map_err(WorkshopError::internal)?;
    let clusterings: Vec<_> = paints
        .iter()
        .map(|file| clustering_of(file, &profile.flakes))
        .collect();
    let blend = blend
        .with_origins(origins)
        .with_accuracy(deviation, &clusterings);
    let report = blend.report();
    let named = |place: usize| {
        let asked = blend.asked_at(place).and_then(|k| paints.get(k));
        asked.map_or("", |file| file.name.as_str())
    };
    if report.smoothed_more > 0 {
        notes.push(format!(
            "{} of {} slices were smoothed more than epsilon says, to converge; the gap tells what that costs",
            report.smoothed_more, report.slices
        ));
    }
    for &place in &report.mixed {
        notes.push(format!(
            "{}: its angles differ from the common grid of {} slices; slices in between are mixtures of their neighbours",
            named(place), report.slices
        ));
    }
    for &place in &report.without_flakes {
        notes.push(format!(
            "{}: has no flakes and counts as black ones",
            named(place)
        ));
    }
    Ok(Blended { blend, notes })
}

fn clamps_of(file: &PaintFile) -> &[Clamp] {
    let realisation = file.provenance.realisation.as_ref();
    realisation.map_or(&[], |of| &of.clamps)
}

fn widest(paint: &CarPaint) -> usize {
    paint.flakes.as_ref().map_or(0, Flakes::widest_slice)
}

/// How a paint's flakes were clustered, and what leaving out angles now costs.
fn clustering_of(file: &PaintFile, wanted: &ClusterSettings) -> Option<Clustering> {
    let clustering = file.clustering.clone()?;
    let flakes = file.paint.flakes.as_ref()?;
    // What taking several clusters for one misplaces is not measured.
    let realised_lab = clustering
        .realised_lab
        .filter(|_| !wants_fewer(file, flakes, wanted));
    let step = angle_step(file, wanted);
    Some(Clustering {
        angle_step: clustering.angle_step * step,
        left_out_w1: (step > 1)
            .then(|| left_out_w1(flakes, step))
            .or(clustering.left_out_w1),
        realised_lab,
        ..clustering
    })
}

/// Says so of a paint that was clustered otherwise than the profile would: clusters are made when it is ingested.
fn clustered_otherwise(file: &PaintFile, wanted: &ClusterSettings) -> Option<String> {
    let had = file.clustering.as_ref()?;
    let rule = wanted.box_rule.name();
    let other = had.clusters != wanted.clusters || had.box_rule != rule;
    (other && !file.provenance.is_blend()).then(|| {
        format!(
            "{}: is clustered as it was ingested, with {} clusters a slice and {} boxes; the profile's {} and {rule} are for \
             measurements",
            file.name, had.clusters, had.box_rule, wanted.clusters
        )
    })
}

/// Every how many-th of a paint's own angles is used.
fn angle_step(file: &PaintFile, wanted: &ClusterSettings) -> usize {
    let had = file.clustering.as_ref().map_or(1, |c| c.angle_step);
    (wanted.angle_step / had).max(1)
}

/// Whether a paint came from a blend, with more clusters than the profile has.
fn wants_fewer(file: &PaintFile, flakes: &Flakes, wanted: &ClusterSettings) -> bool {
    file.provenance.is_blend() && flakes.widest_slice() > wanted.clusters
}

/// The paint as the profile wants it: with fewer angles if it was fitted at more, and, if it came from a blend and has
/// more clusters, with fewer of those.
fn reduced(
    file: &PaintFile,
    wanted: &ClusterSettings,
    notes: &mut Vec<String>,
) -> Option<CarPaint> {
    let flakes = file.paint.flakes.as_ref()?;
    let step = angle_step(file, wanted);
    let thinned = (step > 1).then(|| {
        let thinned = flakes.thinned(step);
        notes.push(format!(
            "{}: {} of {} flake slices were used, one angle in {step} on either grid",
            file.name,
            thinned.slices(),
            flakes.slices(),
        ));
        thinned
    });
    let flakes = thinned.as_ref().unwrap_or(flakes);
    let fewer = wants_fewer(file, flakes, wanted).then(|| {
        notes.push(format!(
            "{}: up to {} clusters a slice were reduced to {}",
            file.name,
            flakes.widest_slice(),
            wanted.clusters
        ));
        reduce_clusters(flakes, wanted.clusters)
    });
    fewer.or(thinned).map(|flakes| CarPaint {
        flakes: Some(flakes),
        ..file.paint.clone()
    })
}
