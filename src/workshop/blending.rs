//! Blending paints: those with too many clusters are reduced first.

use super::WorkshopError;
use super::describing::blend_notes;
use crate::accuracy::{Profile, blend_deviation, left_out_w1, reduced_w1, seen_between};
use crate::blend::{Blend, BlendError, Ingredient, Origin, Reduction, Thinning};
use crate::fit::{ClusterSettings, reduce_clusters};
use crate::paint::{CarPaint, Clamp, Clustering, PaintFile};
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
    let ready: Vec<Ready> = paints
        .iter()
        .map(|file| Ready::of(file, &profile.flakes))
        .collect();
    let ingredients: Vec<Ingredient<'_>> = paints
        .iter()
        .zip(&ready)
        .map(|(file, ready)| Ingredient {
            name: &file.name,
            paint: ready.paint.as_ref().unwrap_or(&file.paint),
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
    let origins = paints.iter().zip(&ready).map(|(file, ready)| Origin {
        simulated_flakes: file.provenance.simulated_flakes,
        residuals: file.residuals.clone(),
        energy: Some(file.energy.clone()),
        clamps: clamps_of(file).to_vec(),
        warnings: file.warnings.clone(),
        reduced: ready.reduced,
        thinned: ready.thinned,
    });
    let joined = &blend.report().order;
    let deviation =
        blend_deviation(&ingredients, &profile.blend, joined).map_err(WorkshopError::internal)?;
    let clusterings: Vec<_> = ready.iter().map(|ready| ready.clustering.clone()).collect();
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

/// Every how many-th of a paint's own angles is used.
fn angle_step(file: &PaintFile, wanted: &ClusterSettings) -> usize {
    let had = file.clustering.as_ref().map_or(1, |c| c.angle_step);
    (wanted.angle_step / had).max(1)
}

/// What is to be blended of a paint.
#[derive(Default)]
struct Ready {
    /// The paint as the profile wants it, where it is not as it was: with fewer angles if it was fitted at more, and, if it
    /// came from a blend and has more clusters, with fewer of those.
    paint: Option<CarPaint>,
    thinned: Option<Thinning>,
    reduced: Option<Reduction>,
    /// How its flakes were clustered, and what leaving out angles or clusters now costs.
    clustering: Option<Clustering>,
}

impl Ready {
    fn of(file: &PaintFile, wanted: &ClusterSettings) -> Self {
        let Some(flakes) = &file.paint.flakes else {
            return Self::default();
        };
        let step = angle_step(file, wanted);
        let thinned = (step > 1).then(|| flakes.thinned(step));
        let kept = thinned.as_ref().unwrap_or(flakes);
        let fewer = (file.provenance.is_blend() && kept.widest_slice() > wanted.clusters)
            .then(|| reduce_clusters(kept, wanted.clusters));
        let mut clustering = file.clustering.clone();
        if let Some(clustering) = &mut clustering {
            clustering.angle_step *= step;
            if let Some(kept) = &thinned {
                clustering.left_out_w1 = Some(left_out_w1(flakes, step));
                clustering.left_out_seen = seen_between(&file.paint, flakes, kept);
            }
            if let Some(fewer) = &fewer {
                clustering.reduced_w1 = Some(reduced_w1(kept, fewer));
                clustering.reduced_seen = seen_between(&file.paint, kept, fewer);
            }
        }
        Self {
            thinned: thinned.as_ref().map(|kept| Thinning {
                step,
                from: flakes.slices(),
                to: kept.slices(),
            }),
            reduced: fewer.as_ref().map(|fewer| Reduction {
                from: kept.widest_slice(),
                to: fewer.widest_slice(),
            }),
            paint: fewer.or(thinned).map(|flakes| CarPaint {
                flakes: Some(flakes),
                ..file.paint.clone()
            }),
            clustering,
        }
    }
}
