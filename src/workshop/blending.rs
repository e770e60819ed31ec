//! Blending paints: those with too many clusters are reduced first.

use super::WorkshopError;
use super::describing::blend_notes;
use crate::accuracy::{Profile, blend_deviation, left_out_seen, left_out_w1};
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
    let reduced: Vec<Option<CarPaint>> = paints
        .iter()
        .map(|file| reduced(file, &profile.flakes))
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
    let notes = blend_notes(&blend, profile);
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
        left_out_seen: if step > 1 {
            left_out_seen(&file.paint, step)
        } else {
            clustering.left_out_seen
        },
        realised_lab,
        ..clustering
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
fn reduced(file: &PaintFile, wanted: &ClusterSettings) -> Option<CarPaint> {
    let flakes = file.paint.flakes.as_ref()?;
    let step = angle_step(file, wanted);
    let thinned = (step > 1).then(|| flakes.thinned(step));
    let flakes = thinned.as_ref().unwrap_or(flakes);
    let fewer = wants_fewer(file, flakes, wanted).then(|| reduce_clusters(flakes, wanted.clusters));
    fewer.or(thinned).map(|flakes| CarPaint {
        flakes: Some(flakes),
        ..file.paint.clone()
    })
}
