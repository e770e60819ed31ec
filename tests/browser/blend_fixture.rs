//! Bundles of whole blends, and what their shader must find at some weights.
//!
//! Two paints whose angles differ; and three, one of them uncoated, without flakes and with a single lobe.

use std::path::Path;

use carpaint::blend::{Blend, BlendSettings, Ingredient, RealisationWeights};
use carpaint::color::Lab;
use carpaint::export::blend_bundle;
use carpaint::paint::{AngleGrid, CarPaint, Coat, ColorTable, Lobe};
use serde_json::{Value, json};

use super::{Anything, about, checked, expected, silver, solid, tile_of, write_each_precision};

pub fn write(folder: &Path) -> Result<(), Anything> {
    let (silver, copper, solid) = (silver()?, copper()?, solid()?);
    let duo = [("silver", &silver), ("copper", &copper)];
    let trio = [("copper", &copper), ("solid", &solid), ("silver", &silver)];
    for (name, paints, cases) in [
        ("duo", duo.as_slice(), duo_weights()),
        ("trio", trio.as_slice(), trio_weights()),
    ] {
        let ingredients: Vec<Ingredient<'_>> = paints
            .iter()
            .map(|&(name, paint)| Ingredient { name, paint })
            .collect();
        let blend = Blend::new(&ingredients, &BlendSettings::default(), &|_| ())?;
        write_each_precision(folder, name, |settings| {
            Ok(blend_bundle(&blend, &about(name), settings)?)
        })?;
        let cases = cases
            .iter()
            .map(|weights| case(&blend, weights))
            .collect::<Result<Vec<_>, _>>()?;
        std::fs::write(
            folder.join(format!("{name}_expected.json")),
            serde_json::to_vec(&cases)?,
        )?;
    }
    Ok(())
}

/// A realisation, drawn with the random tile of equal weights, which is the bundle's.
fn case(blend: &Blend, weights: &RealisationWeights) -> Result<Value, Anything> {
    #[allow(clippy::cast_precision_loss)] // two or three paints
    let equal = vec![1.0 / blend.len() as f64; blend.len()];
    let even = blend.realise(&RealisationWeights::uniform(equal))?.paint;
    let paint = blend.realise(weights)?.paint;
    let own = |list: &Option<Vec<f64>>| list.as_ref().unwrap_or(&weights.weights).clone();
    let mut case = expected(&paint, tile_of(&even));
    case["weights"] = json!({
        "weights": weights.weights,
        "base": own(&weights.base),
        "flakeLightness": own(&weights.flake_lightness),
        "flakeColor": own(&weights.flake_color),
        "flakeSaturation": weights.flake_saturation,
    });
    let texture = paint.flakes.map(|flakes| flakes.texture);
    case["paint"] = json!({
        "coat": paint.coat, "diffuse": paint.diffuse, "lobes": paint.lobes, "texture": texture,
    });
    Ok(case)
}

fn duo_weights() -> Vec<RealisationWeights> {
    vec![
        RealisationWeights::uniform(vec![0.5, 0.5]),
        RealisationWeights::uniform(vec![0.3, 0.7]),
        RealisationWeights::uniform(vec![1.0, 0.0]),
        RealisationWeights::uniform(vec![-0.4, 1.4]),
        RealisationWeights::uniform(vec![1.8, -0.8]),
        RealisationWeights::uniform(vec![0.55, -0.5]),
        RealisationWeights {
            base: Some(vec![0.2, 0.8]),
            flake_lightness: Some(vec![0.9, 0.1]),
            flake_color: Some(vec![0.0, 1.0]),
            flake_saturation: 0.6,
            ..RealisationWeights::uniform(vec![0.5, 0.5])
        },
    ]
}

fn trio_weights() -> Vec<RealisationWeights> {
    vec![
        RealisationWeights::uniform(vec![0.2, 0.3, 0.5]),
        RealisationWeights::uniform(vec![0.0, 1.0, 0.0]),
        RealisationWeights::uniform(vec![0.9, -0.5, 0.6]),
        RealisationWeights {
            flake_lightness: Some(vec![1.2, 0.1, -0.3]),
            flake_color: Some(vec![0.1, 0.2, 0.7]),
            flake_saturation: 1.5,
            ..RealisationWeights::uniform(vec![0.6, 0.3, 0.1])
        },
    ]
}

/// The silver's flakes turned to copper on fewer angles of color table and flakes, under another coat, one lobe more.
fn copper() -> Result<CarPaint, Anything> {
    let mut paint = silver()?;
    let nodes = (0..6)
        .map(|k| Lab {
            l: 88.0 - 4.0 * f64::from(k),
            a: 22.0,
            b: 30.0 + f64::from(k),
        })
        .collect();
    let angles = |degrees: &[f64]| AngleGrid::new(degrees.to_vec());
    paint.color_table = ColorTable::new(
        angles(&[0.0, 9.0, 40.0])?,
        angles(&[0.0, 35.0])?,
        nodes,
        Lab {
            l: 75.0,
            a: 20.0,
            b: 30.0,
        },
    )?;
    paint.coat = Some(Coat {
        ior: 1.6,
        roughness: 0.05,
        thickness_um: Some(40.0),
    });
    paint.lobes.push(Lobe {
        weight: [0.02, 0.015, 0.01],
        alpha: 0.03,
        f0: 0.2,
    });
    paint.lobes[0].alpha = 0.5;
    let flakes = paint.flakes.as_mut().ok_or("the silver has flakes")?;
    let columns = flakes.theta_d.len();
    // Every other row and column of slices.
    let kept: Vec<usize> = (0..flakes.slices())
        .filter(|k| k / columns % 2 == 0 && k % columns % 2 == 0)
        .collect();
    let old = flakes.clone();
    (flakes.offsets, flakes.probability) = (vec![0].into(), vec![].into());
    (flakes.lower, flakes.upper) = (Vec::new(), Vec::new());
    for k in kept {
        let slice = old.slice_at(k);
        let tinted = |corner: &[f32; 3]| [0.8 * corner[0], corner[1] + 15.0, corner[2] + 20.0];
        flakes.probability.extend_from_slice(slice.probability);
        flakes.lower.extend(slice.lower.iter().map(tinted));
        flakes.upper.extend(slice.upper.iter().map(tinted));
        flakes
            .offsets
            .push(u32::try_from(flakes.probability.len())?);
    }
    let half = |grid: &AngleGrid| {
        angles(
            &grid
                .degrees()
                .iter()
                .step_by(2)
                .copied()
                .collect::<Vec<_>>(),
        )
    };
    (flakes.theta_h, flakes.theta_d) = (half(&old.theta_h)?, half(&old.theta_d)?);
    flakes.texture.grain_um = 60.0;
    flakes.texture.persistence_deg = [9.0, 20.0];
    checked(paint)
}
