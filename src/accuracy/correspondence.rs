//! How far a blend is from the one that exact transport would have given.
//!
//! The gap to the dual bound, which every blend carries, bounds what a correspondence costs too much; it says nothing of
//! what is seen. Here the paints are joined again, as they were and exactly, at the angles of the six instrument
//! geometries alone, and both blends are read at equal weights: six slices, whatever the size of the paints.

use super::clustering::luminance_of;
use super::geometries::{Geometry, geometries, mixed};
use crate::blend::{
    Blend, BlendDeviation, BlendError, BlendSettings, Ingredient, RealisationWeights,
};
use crate::color::{Lab, ciede2000};
use crate::paint::{AngleGrid, CarPaint, LightnessMixture, Slice};
use crate::transport::{Cost, Method};

/// A blend at equal weights beside the blend by exact transport of the distance, at the six instrument geometries.
///
/// Empty for solid colors, and for a blend that was found by exact transport of the distance.
///
/// # Errors
///
/// [`BlendError`] as for the blend itself.
pub fn blend_deviation(
    ingredients: &[Ingredient<'_>],
    settings: &BlendSettings,
) -> Result<Vec<BlendDeviation>, BlendError> {
    let exact = BlendSettings {
        method: Method::Exact,
        cost: Cost::Distance,
        ..*settings
    };
    let with_flakes = ingredients.iter().any(|i| i.paint.flakes.is_some());
    if *settings == exact || !with_flakes {
        return Ok(Vec::new());
    }
    let anywhere = Some((AngleGrid::single(), AngleGrid::single()));
    let Some(base) = even(ingredients, settings, anywhere)? else {
        return Ok(Vec::new());
    };
    let mut deviations = Vec::new();
    for geometry in geometries(&base) {
        let here = || {
            let near = |angle: f64| AngleGrid::new(vec![angle.to_degrees().clamp(0.0, 90.0)]).ok();
            Some((
                near(geometry.half().theta_h)?,
                near(geometry.half().theta_d)?,
            ))
        };
        let (Some(found), Some(best)) = (
            even(ingredients, settings, here())?,
            even(ingredients, &exact, here())?,
        ) else {
            continue;
        };
        let ((color, top), (best_color, best_top)) =
            (seen(&geometry, &found), seen(&geometry, &best));
        deviations.push(BlendDeviation {
            aspecular_deg: geometry.aspecular_deg,
            delta_e_2000: ciede2000(color, best_color),
            sparkle: if best_top.abs() > 1e-9 {
                (top / best_top - 1.0).abs()
            } else {
                0.0
            },
        });
    }
    Ok(deviations)
}

/// The paint at equal weights, on these angles.
fn even(
    ingredients: &[Ingredient<'_>],
    settings: &BlendSettings,
    angles: Option<(AngleGrid, AngleGrid)>,
) -> Result<Option<CarPaint>, BlendError> {
    let blend = Blend::on(ingredients, settings, angles, &|_| ())?;
    let weights = RealisationWeights::equal(ingredients.len());
    Ok(blend.realise(&weights).ok().map(|realised| realised.paint))
}

/// Reading and sparkle of a paint whose only slice is the one here.
fn seen(geometry: &Geometry, paint: &CarPaint) -> (Lab, f64) {
    let Some(flakes) = &paint.flakes else {
        return (geometry.lab([0.0; 3]), 0.0);
    };
    let parts: Vec<(f64, Slice<'_>)> = vec![(1.0, flakes.slice_at(0))];
    let mean = mixed(parts.iter().map(|(w, slice)| (*w, slice.mean())));
    let top = LightnessMixture::of(&parts).quantile(super::clustering::SPARKLE);
    (geometry.lab(mean), luminance_of(top))
}
