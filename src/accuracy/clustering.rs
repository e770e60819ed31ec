//! How far the clusters of a paint's flakes are from the pixels they were made of.
//!
//! Slices are read again and compared: those around the six instrument geometries, which are seen most, and
//! [`SPREAD`] spread evenly over the measured grid. A measured slice that was not fitted (every k-th angle) is compared
//! with the mixture of its fitted neighbours, so that the price of fewer angles is in the same numbers.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::geometries::{Geometry, geometries, mixed, slices_at};
use super::sparkle::{lit_from, off_by};
use crate::color::{Lab, LinearRgb, ciede2000, luminance};
use crate::fit::{ClusterSettings, Clusterer, SliceClusters, Thinned};
use crate::measurement::{FlakePictures, SliceRoom};
use crate::paint::{
    AngleGrid, CarPaint, ClusteringError, LightnessMixture, Percentiles, Slice, slices_spread_over,
};

/// Slices compared besides those around the instrument geometries.
const SPREAD: usize = 12;

/// Mean luminance (of π f) above which a slice is light enough for relative errors to mean something.
const LIGHT_ENOUGH: f64 = 2e-3 * std::f64::consts::PI;

/// Share of the texels below the sparkle.
pub(super) const SPARKLE: f64 = 0.999;

/// What one slice's comparison gives.
struct Compared {
    slice: usize,
    pixels: LinearRgb,
    clusters: LinearRgb,
    lightness_w1: f64,
    /// Relative errors of mean luminance and sparkle, where the slice is light enough.
    relative: Option<[f64; 2]>,
    /// Shares of pixels and of clusters from each geometry's lightness of lit flakes on.
    lit: [[f64; 2]; 6],
}

/// Compares the flakes of a paint with the pictures they were fitted to. `None` for a paint without flakes.
#[must_use]
pub fn clustering_error(pictures: &dyn FlakePictures, paint: &CarPaint) -> Option<ClusteringError> {
    let flakes = paint.flakes.as_ref()?;
    let fitted = |k: usize| Some(flakes.slice_at(k));
    Some(compared(
        pictures,
        paint,
        [&flakes.theta_h, &flakes.theta_d],
        &fitted,
    ))
}

/// What [`clustering_error`] will be of a paint with this base whose flakes are fitted to these pictures: exactly, for the
/// slices that are compared are fitted now, and no others.
#[must_use]
pub fn predicted_clustering_error(
    pictures: &dyn FlakePictures,
    base: &CarPaint,
    settings: &ClusterSettings,
) -> Option<ClusteringError> {
    let thinned = Thinned::new(pictures, settings.angle_step);
    let (rows, columns) = (thinned.theta_h(), thinned.theta_d());
    let mut needed: Vec<usize> = slices_to_compare(pictures, &geometries(base))
        .into_iter()
        .flat_map(|k| {
            let (h, d) = angles_of(pictures, k);
            slices_at(rows, columns, h, d)
        })
        .map(|(_, k)| k)
        .collect();
    needed.sort_unstable();
    needed.dedup();
    let fitted: BTreeMap<usize, SliceClusters> = needed
        .into_par_iter()
        .map_init(<(SliceRoom, Clusterer)>::default, |(room, clusterer), k| {
            thinned.read(k, room).ok()?;
            let planes = room.picture.planes.each_ref().map(Vec::as_slice);
            Some((k, clusterer.cluster(planes, settings).ok()?))
        })
        .flatten_iter()
        .collect();
    let slice = |k: usize| {
        fitted.get(&k).map(|clusters| Slice {
            probability: &clusters.probability,
            lower: &clusters.lower,
            upper: &clusters.upper,
        })
    };
    Some(compared(pictures, base, [rows, columns], &slice))
}

/// The slices of a fit, by number.
type Fitted<'a> = dyn Fn(usize) -> Option<Slice<'a>> + Sync + 'a;

fn compared(
    pictures: &dyn FlakePictures,
    paint: &CarPaint,
    grid: [&AngleGrid; 2],
    fitted: &Fitted<'_>,
) -> ClusteringError {
    let seen = geometries(paint);
    let slices = slices_to_compare(pictures, &seen);
    let lit_from = lit_from_on(&seen, grid, fitted);
    let compared: Vec<Compared> = slices
        .into_par_iter()
        .map_init(SliceRoom::default, |room, k| {
            // A picture between the fitted angles may be damaged: it was not asked for.
            pictures.read(k, room).ok()?;
            compare(pictures, k, room, (grid, fitted), &lit_from)
        })
        .flatten_iter()
        .collect();
    let of = |get: &dyn Fn(&Compared) -> Option<f64>| {
        Percentiles::of(compared.iter().filter_map(get).collect())
    };
    let (mut instrument, mut lit) = ([0.0; 6], [0.0; 6]);
    for (at, geometry) in seen.iter().enumerate() {
        let here = geometry.slices(pictures.theta_h(), pictures.theta_d());
        let met = || {
            here.iter().filter_map(|&(weight, k)| {
                let compared = compared.iter().find(|c| c.slice == k)?;
                Some((weight, compared))
            })
        };
        instrument[at] = ciede2000(
            geometry.lab(mixed(met().map(|(weight, c)| (weight, c.pixels)))),
            geometry.lab(mixed(met().map(|(weight, c)| (weight, c.clusters)))),
        );
        let share = |of: usize| met().map(|(weight, c)| weight * c.lit[at][of]).sum::<f64>();
        lit[at] = off_by(share(1), share(0));
    }
    ClusteringError {
        slices: compared.len(),
        of: pictures.slices(),
        lightness_w1: of(&|c| Some(c.lightness_w1)),
        mean_luminance: of(&|c| c.relative.map(|r| r[0])),
        sparkle: of(&|c| c.relative.map(|r| r[1])),
        instrument,
        lit: Some(lit),
    }
}

/// The lightness from which on a flake is lit at each geometry, by the clusters that are seen there.
fn lit_from_on(
    seen: &[Geometry],
    [theta_h, theta_d]: [&AngleGrid; 2],
    fitted: &Fitted<'_>,
) -> [f64; 6] {
    let mut all = [f64::INFINITY; 6];
    for (from, geometry) in all.iter_mut().zip(seen) {
        let met = geometry.slices(theta_h, theta_d).into_iter();
        let means = met.filter_map(|(weight, k)| Some((weight, fitted(k)?.mean())));
        *from = lit_from(geometry, mixed(means));
    }
    all
}

/// θh and θd of a picture, degrees.
fn angles_of(pictures: &dyn FlakePictures, slice: usize) -> (f64, f64) {
    let columns = pictures.theta_d().len();
    (
        pictures.theta_h().degrees()[slice / columns],
        pictures.theta_d().degrees()[slice % columns],
    )
}

fn slices_to_compare(pictures: &dyn FlakePictures, seen: &[Geometry]) -> Vec<usize> {
    let around = seen.iter().flat_map(|geometry| {
        let met = geometry.slices(pictures.theta_h(), pictures.theta_d());
        met.into_iter().map(|(_, k)| k)
    });
    let grid = [pictures.theta_h().len(), pictures.theta_d().len()];
    let spread = slices_spread_over(grid, SPREAD);
    let mut slices: Vec<usize> = around.chain(spread).collect();
    slices.sort_unstable();
    slices.dedup();
    slices
}

fn compare(
    pictures: &dyn FlakePictures,
    slice: usize,
    room: &SliceRoom,
    ([theta_h, theta_d], fitted): ([&AngleGrid; 2], &Fitted<'_>),
    lit_from: &[f64; 6],
) -> Option<Compared> {
    let [red, green, blue] = room.picture.planes.each_ref();
    let (mut lightness, mut sum) = (Vec::with_capacity(red.len()), [0.0; 3]);
    for ((&r, &g), &b) in red.iter().zip(green).zip(blue) {
        let color = [r, g, b].map(f64::from);
        if color.iter().all(|v| v.is_finite()) {
            sum = std::array::from_fn(|k| sum[k] + color[k]);
            lightness.push(lightness_of(std::f64::consts::PI * luminance(color)));
        }
    }
    if lightness.is_empty() {
        return None;
    }
    lightness.sort_unstable_by(f64::total_cmp);
    #[allow(clippy::cast_precision_loss)] // a count of pixels
    let pixels = sum.map(|s| s / lightness.len() as f64);

    let (h, d) = angles_of(pictures, slice);
    let parts = slices_at(theta_h, theta_d, h, d)
        .into_iter()
        .map(|(weight, k)| Some((weight, fitted(k)?)))
        .collect::<Option<Vec<_>>>()?;
    let clusters = mixed(parts.iter().map(|(weight, slice)| (*weight, slice.mean())));
    let mixture = LightnessMixture::of(&parts);
    let mean = std::f64::consts::PI * luminance(pixels);
    let relative = (mean > LIGHT_ENOUGH).then(|| {
        let sparkle = luminance_of(percentile(&lightness, SPARKLE));
        [
            (std::f64::consts::PI * luminance(clusters) / mean - 1.0).abs(),
            (luminance_of(mixture.quantile(SPARKLE)) / sparkle - 1.0).abs(),
        ]
    });
    let lit = lit_from.map(|from| {
        let below = lightness.partition_point(|&l| l < from);
        #[allow(clippy::cast_precision_loss)] // a count of pixels
        let pixels = (lightness.len() - below) as f64 / lightness.len() as f64;
        [pixels, mixture.above(from)]
    });
    Some(Compared {
        slice,
        pixels,
        clusters,
        lightness_w1: mixture.distance_to(&lightness),
        relative,
        lit,
    })
}

/// Lightness of a luminance factor.
pub(super) fn lightness_of(y: f64) -> f64 {
    Lab::from_rgb([y; 3]).l
}

/// Luminance factor of a lightness.
pub(super) fn luminance_of(l: f64) -> f64 {
    luminance(Lab { l, a: 0.0, b: 0.0 }.to_rgb())
}

/// Percentile of ascending values, linear between ranks.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss
    )] // ranks in a list
    let (rank, place) = {
        let rank = share * (sorted.len() - 1) as f64;
        (rank, rank as usize)
    };
    #[allow(clippy::cast_precision_loss)]
    let part = rank - place as f64;
    let above = sorted[(place + 1).min(sorted.len() - 1)];
    sorted[place] + (above - sorted[place]) * part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{BoxRule, ClusterSettings, FlakeRecipe, SimulatedPatch, fit_flakes};
    use crate::paint::{ColorTable, Lobe};

    fn error_of(settings: &ClusterSettings) -> ClusteringError {
        let lobes = vec![
            Lobe {
                weight: [0.06; 3],
                alpha: 0.4,
                f0: 1.0,
            },
            Lobe {
                weight: [0.11; 3],
                alpha: 0.17,
                f0: 0.9,
            },
        ];
        let mut paint = CarPaint {
            coat: None,
            diffuse: [0.05; 3],
            lobes,
            color_table: ColorTable::white(),
            flakes: None,
        };
        let recipe = FlakeRecipe {
            angles: 9,
            texels: 48,
            ..FlakeRecipe::default()
        };
        let patch = SimulatedPatch::new(&paint, &recipe).expect("in range");
        let fitted = fit_flakes(&patch, settings, &|_, _| ()).expect("fits");
        paint.flakes = Some(fitted.flakes);
        let predicted = predicted_clustering_error(&patch, &paint, settings);
        let error = clustering_error(&patch, &paint).expect("flakes");
        assert_eq!(predicted.as_ref(), Some(&error), "what is predicted comes");
        let bound = fitted.clustering.w1_bound.expect("bounded");
        if settings.angle_step == 1 {
            assert!(
                error.lightness_w1.worst <= bound.worst,
                "{error:?} {bound:?}"
            );
        }
        error
    }

    #[test]
    fn more_clusters_are_nearer_to_the_pixels() {
        let by = |clusters| {
            error_of(&ClusterSettings {
                clusters,
                ..ClusterSettings::default()
            })
        };
        let (few, some, many) = (by(4), by(24), by(150));
        assert!(few.lightness_w1.p90 > some.lightness_w1.p90);
        assert!(some.lightness_w1.p90 > many.lightness_w1.p90);
        assert_eq!((few.of, few.slices > 12), (81, true));
    }

    #[test]
    fn lit_flakes_are_counted_better_by_more_clusters() {
        let mean = |clusters| {
            let error = error_of(&ClusterSettings {
                clusters,
                ..ClusterSettings::default()
            });
            error.lit.expect("counted").iter().sum::<f64>() / 6.0
        };
        let (one, few, many) = (mean(1), mean(8), mean(150));
        assert!(one > 4.0 * few && one > 4.0 * many, "{one} {few} {many}");
    }

    #[test]
    fn tight_boxes_and_skipped_angles_have_a_price() {
        let standard = error_of(&ClusterSettings::default());
        let worst = |e: &ClusteringError| e.instrument.iter().copied().fold(0.0, f64::max);
        let tight = error_of(&ClusterSettings {
            box_rule: BoxRule::Tight,
            ..ClusterSettings::default()
        });
        assert!(
            worst(&tight) > 10.0 * worst(&standard),
            "{tight:?} {standard:?}"
        );
        let coarse = error_of(&ClusterSettings {
            angle_step: 2,
            ..ClusterSettings::default()
        });
        assert!(coarse.lightness_w1.p90 > 2.0 * standard.lightness_w1.p90);
        assert_eq!(coarse.of, standard.of);
    }
}
