//! How far a blend is from the one that exact transport would have given.
//!
//! The gap to the dual bound, which every blend carries, bounds what a correspondence costs too much; it says nothing of
//! what is seen. Here the paints are joined again, as they were and exactly, at the angles of the six instrument
//! geometries alone, and both blends are read at equal weights: six slices, whatever the size of the paints.

use super::clustering::luminance_of;
use super::geometries::{Geometry, geometries, mixed};
use super::sparkle::{lit_from, off_by};
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
        let (found, best) = (seen(&geometry, &found), seen(&geometry, &best));
        deviations.push(BlendDeviation {
            aspecular_deg: geometry.aspecular_deg,
            delta_e_2000: ciede2000(found.color, best.color),
            sparkle: if best.top.abs() > 1e-9 {
                (found.top / best.top - 1.0).abs()
            } else {
                0.0
            },
            lit: Some(off_by(found.lit, best.lit)),
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

/// What is seen of a paint at a geometry.
struct Seen {
    color: Lab,
    /// Luminance that one texel in a thousand exceeds.
    top: f64,
    /// Share of lit texels.
    lit: f64,
}

/// What is seen of a paint whose only slice is the one here.
fn seen(geometry: &Geometry, paint: &CarPaint) -> Seen {
    let Some(flakes) = &paint.flakes else {
        return Seen {
            color: geometry.lab([0.0; 3]),
            top: 0.0,
            lit: 0.0,
        };
    };
    let parts: Vec<(f64, Slice<'_>)> = vec![(1.0, flakes.slice_at(0))];
    let mean = mixed(parts.iter().map(|(w, slice)| (*w, slice.mean())));
    let mixture = LightnessMixture::of(&parts);
    Seen {
        color: geometry.lab(mean),
        top: luminance_of(mixture.quantile(super::clustering::SPARKLE)),
        lit: mixture.above(lit_from(geometry, mean)),
    }
}
