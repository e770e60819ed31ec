//! What a written file loses of the paint: rounding of its corners, and steps of its distribution.

use serde::Serialize;

use super::geometries::geometries;
use super::seen::Seen;
use crate::blend::{Blend, Boxes};
use crate::color::luminance;
use crate::export::{ExportSettings, Rounding, inverse_cdf};
use crate::paint::{CarPaint, Slice, mean_color};

/// How far a file is from the paint that it was written from, over the slices of the six instrument geometries.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WritingError {
    /// Distance W1 in Lab between the paint's flakes and those of the file is at most this in any of the slices: what
    /// moving every box to where its rounded corners are costs.
    pub rounding_w1: f64,
    /// CIEDE2000 of the mean color at each geometry.
    pub instrument: Vec<f64>,
    /// Relative change of the 99.9th percentile of luminance at each geometry.
    pub sparkle: Vec<f64>,
    /// Relative change of how many flakes are lit at each geometry, fewer than one texel in a thousand counted as that many.
    pub lit: Vec<f64>,
    /// Largest share of draws that show another cluster than they should, where flakes are drawn by the 500 steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inverse_cdf_loss: Option<f64>,
}

/// Corners of smallest and largest L, a, b of some boxes.
type Corners = (Vec<[f32; 3]>, Vec<[f32; 3]>);

/// What writing a paint with these settings loses. `None` for a solid color.
#[must_use]
pub fn writing_error(paint: &CarPaint, settings: &ExportSettings) -> Option<WritingError> {
    let flakes = paint.flakes.as_ref()?;
    let corners = flakes.lower.iter().chain(&flakes.upper);
    let rounding = Rounding::of(corners, settings.precision);
    let mut error = WritingError::default();
    let mut loss: f64 = 0.0;
    for geometry in geometries(paint) {
        let met = geometry.slices(&flakes.theta_h, &flakes.theta_d);
        let slices: Vec<(f64, Slice<'_>)> =
            met.iter().map(|&(w, k)| (w, flakes.slice_at(k))).collect();
        let written: Vec<Corners> = slices
            .iter()
            .map(|(_, slice)| read_back(&rounding, slice))
            .collect();
        let rounded: Vec<(f64, Slice<'_>)> = slices
            .iter()
            .zip(&written)
            .map(|((weight, slice), (lower, upper))| {
                let probability = slice.probability;
                (
                    *weight,
                    Slice {
                        probability,
                        lower,
                        upper,
                    },
                )
            })
            .collect();
        for ((_, slice), (_, other)) in slices.iter().zip(&rounded) {
            error.rounding_w1 = error.rounding_w1.max(moved(slice, other));
            if settings.inverse_cdf {
                let light: Vec<f64> = (0..slice.probability.len())
                    .map(|k| luminance(mean_color(slice.lower[k], slice.upper[k])))
                    .collect();
                loss = loss.max(inverse_cdf(slice.probability, &light).probability_loss);
            }
        }
        let noticed = Seen::of(&geometry, &rounded).beside(&Seen::of(&geometry, &slices));
        error.instrument.push(noticed.delta_e_2000);
        error.sparkle.push(noticed.sparkle);
        error.lit.push(noticed.lit);
    }
    error.inverse_cdf_loss = settings.inverse_cdf.then_some(loss);
    Some(error)
}

/// Distance W1 in Lab between the flakes of a blend at weights between 0 and 1 that sum to 1 and those of its bundle is at
/// most this: that of the worst slice of the worst paint, for a mixture's corners are off by the mixture of its paints'.
/// `None` for solid colors.
#[must_use]
pub fn bundle_rounding_w1(blend: &Blend, settings: &ExportSettings) -> Option<f64> {
    let flakes = blend.flakes.as_ref()?;
    let corners = flakes
        .boxes
        .iter()
        .flat_map(|own| own.lower.iter().chain(&own.upper));
    let rounding = Rounding::of(corners, settings.precision);
    let moved_in = |own: &Boxes, ends: &[u32]| {
        let range = ends[0] as usize..ends[1] as usize;
        let slice = Slice {
            probability: &flakes.probability[range.clone()],
            lower: &own.lower[range.clone()],
            upper: &own.upper[range],
        };
        let (lower, upper) = read_back(&rounding, &slice);
        let written = Slice {
            lower: &lower,
            upper: &upper,
            ..slice
        };
        moved(&slice, &written)
    };
    let each = flakes.boxes.iter().flat_map(|own| {
        flakes
            .offsets
            .windows(2)
            .map(move |ends| moved_in(own, ends))
    });
    Some(each.fold(0.0, f64::max))
}

fn read_back(rounding: &Rounding, slice: &Slice<'_>) -> Corners {
    let back = |c: &[[f32; 3]]| c.iter().map(|&c| rounding.read_back(c)).collect();
    (back(slice.lower), back(slice.upper))
}

/// What moving every box's colors along with its corners costs: no color moves further than the farther corner per axis.
fn moved(from: &Slice<'_>, to: &Slice<'_>) -> f64 {
    (0..from.probability.len())
        .map(|k| {
            let squared: f64 = (0..3)
                .map(|axis| {
                    let low = f64::from(to.lower[k][axis]) - f64::from(from.lower[k][axis]);
                    let high = f64::from(to.upper[k][axis]) - f64::from(from.upper[k][axis]);
                    low.abs().max(high.abs()).powi(2)
                })
                .sum();
            from.probability[k] * squared.sqrt()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blend::{BlendSettings, Ingredient, RealisationWeights};
    use crate::export::Precision;
    use crate::paint::{AngleGrid, ColorTable, FlakeTexture, Flakes};

    /// Two slices of three boxes, shifted.
    fn paint(shift: f32) -> CarPaint {
        let light = [3.3, 17.7, 61.1, 5.5, 29.9, 88.3].map(|l| l + shift);
        CarPaint {
            coat: None,
            diffuse: [0.1; 3],
            lobes: Vec::new(),
            color_table: ColorTable::white(),
            flakes: Some(Flakes {
                theta_h: AngleGrid::new(vec![0.0, 10.0]).expect("ascends"),
                theta_d: AngleGrid::single(),
                offsets: vec![0, 3, 6].into(),
                probability: vec![0.5, 0.3, 0.2, 0.6, 0.3, 0.1].into(),
                lower: light.map(|l| [l, -shift, 0.7]).to_vec(),
                upper: light.map(|l| [l + 2.0 + shift, 3.1, 4.3]).to_vec(),
                texture: FlakeTexture {
                    texel_um: 20.0,
                    grain_um: 15.0,
                    lifetime_deg: [5.0; 2],
                    persistence_deg: [9.0; 2],
                },
            }),
        }
    }

    #[test]
    fn no_mixture_of_a_bundle_is_off_by_more_than_is_stated() {
        let (first, second) = (paint(0.37), paint(9.13));
        let ingredients = [("first", &first), ("second", &second)]
            .map(|(name, paint)| Ingredient { name, paint });
        let blend = Blend::new(&ingredients, &BlendSettings::default(), &|_| ()).expect("blends");
        for precision in [Precision::F16, Precision::Eight] {
            let settings = ExportSettings {
                precision,
                ..ExportSettings::default()
            };
            let stated = bundle_rounding_w1(&blend, &settings).expect("flakes");
            let mut written = blend.clone();
            let flakes = written.flakes.as_mut().expect("flakes");
            let all = flakes.boxes.clone();
            let corners = all
                .iter()
                .flat_map(|own| own.lower.iter().chain(&own.upper));
            let rounding = Rounding::of(corners, precision);
            for own in &mut flakes.boxes {
                for corner in own.lower.iter_mut().chain(&mut own.upper) {
                    *corner = rounding.read_back(*corner);
                }
            }
            let mut worst: f64 = 0.0;
            for alpha in [0.0, 0.2, 0.5, 0.9, 1.0] {
                let weights = RealisationWeights::uniform(vec![alpha, 1.0 - alpha]);
                let [exact, rounded] = [&blend, &written]
                    .map(|blend| blend.realise(&weights).expect("two weights").paint);
                let (exact, rounded) = (
                    exact.flakes.expect("flakes"),
                    rounded.flakes.expect("flakes"),
                );
                for k in 0..exact.slices() {
                    worst = worst.max(moved(&exact.slice_at(k), &rounded.slice_at(k)));
                }
            }
            assert!(
                worst > 0.3 * stated && worst <= stated * (1.0 + 1e-5),
                "{worst} {stated}"
            );
        }
        let exact = ExportSettings {
            precision: Precision::F32,
            ..ExportSettings::default()
        };
        assert_eq!(bundle_rounding_w1(&blend, &exact), Some(0.0));
    }
}
