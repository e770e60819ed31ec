//! Blending paints: those with too many clusters are reduced first.

use super::WorkshopError;
use crate::accuracy::Profile;
use crate::blend::{Blend, BlendError, Ingredient, Origin, Reduction};
use crate::fit::reduce_clusters;
use crate::paint::{CarPaint, Flakes, PaintFile};
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
    let mut notes = Vec::new();
    let reduced: Vec<Option<CarPaint>> = paints
        .iter()
        .map(|file| reduced(file, profile.flakes.clusters, &mut notes))
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
        reduced: reduced.as_ref().map(|fewer| Reduction {
            from: widest(&file.paint),
            to: widest(fewer),
        }),
    });
    let blend = blend.with_origins(origins);
    let report = blend.report();
    let named = |place: usize| {
        let asked = blend.asked_at(place).and_then(|k| paints.get(k));
        asked.map_or("", |file| file.name.as_str())
    };
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

fn widest(paint: &CarPaint) -> usize {
    paint.flakes.as_ref().map_or(0, Flakes::widest_slice)
}

/// The paint with at most `most` clusters a slice, if it came from a blend and has more.
fn reduced(file: &PaintFile, most: usize, notes: &mut Vec<String>) -> Option<CarPaint> {
    let flakes = file
        .paint
        .flakes
        .as_ref()
        .filter(|f| file.provenance.source == "blend" && f.widest_slice() > most)?;
    notes.push(format!(
        "{}: up to {} clusters a slice were reduced to {most}",
        file.name,
        flakes.widest_slice()
    ));
    Some(CarPaint {
        flakes: Some(reduce_clusters(flakes, most)),
        ..file.paint.clone()
    })
}
