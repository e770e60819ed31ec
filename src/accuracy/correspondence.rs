//! How far a blend is from the one that exact transport would have given.
//!
//! The gap to the dual bound, which every blend carries, bounds what a correspondence costs too much; it says nothing of
//! what is seen. Here the paints are joined again, as they were and exactly, at the angles of the six instrument
//! geometries alone, and both blends are read at equal weights: six slices, whatever the size of the paints.

use super::geometries::{Geometry, geometries};
use super::seen::Seen;
use crate::blend::{
    Blend, BlendDeviation, BlendError, BlendSettings, Ingredient, Look, RealisationWeights,
};
use crate::paint::{AngleGrid, CarPaint};
use crate::transport::{Cost, Method};

/// A blend at equal weights beside the blend by exact transport of the distance, at the six instrument geometries; `joined`
/// is the order in which its paints were joined, by place in hash order.
///
/// Empty for solid colors, and for a blend that was found by exact transport of the distance.
///
/// # Errors
///
/// [`BlendError`] as for the blend itself.
pub fn blend_deviation(
    ingredients: &[Ingredient<'_>],
    settings: &BlendSettings,
    joined: &[usize],
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
    let even = |settings: &BlendSettings, angles: [AngleGrid; 2]| {
        let look = Look { angles, joined };
        let blend = Blend::on(ingredients, settings, Some(look), &|_| ())?;
        let weights = RealisationWeights::equal(ingredients.len());
        Ok(blend.realise(&weights).ok().map(|realised| realised.paint))
    };
    let anywhere = [AngleGrid::single(), AngleGrid::single()];
    let Some(base) = even(settings, anywhere)? else {
        return Ok(Vec::new());
    };
    let mut deviations = Vec::new();
    for geometry in geometries(&base) {
        let near = |angle: f64| AngleGrid::new(vec![angle.to_degrees().clamp(0.0, 90.0)]).ok();
        let half = geometry.half();
        let (Some(theta_h), Some(theta_d)) = (near(half.theta_h), near(half.theta_d)) else {
            continue;
        };
        let here = [theta_h, theta_d];
        let (Some(found), Some(best)) = (even(settings, here.clone())?, even(&exact, here)?) else {
            continue;
        };
        let noticed = seen(&geometry, &found).beside(&seen(&geometry, &best));
        deviations.push(BlendDeviation {
            aspecular_deg: geometry.aspecular_deg,
            delta_e_2000: noticed.delta_e_2000,
            sparkle: noticed.sparkle,
            lit: Some(noticed.lit),
        });
    }
    Ok(deviations)
}

/// What is seen of a paint whose only slice is the one here.
fn seen(geometry: &Geometry, paint: &CarPaint) -> Seen {
    let slice = paint
        .flakes
        .as_ref()
        .map(|flakes| (1.0, flakes.slice_at(0)));
    Seen::of(geometry, slice.as_slice())
}
