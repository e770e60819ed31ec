//! Pictures of flakes to [`Flakes`]: clusters per slice, grain and lifetime, one slice at a time.
//!
//! Slices are decoded, clustered and dropped on as many threads as rayon has; what comes out is the same on any number
//! of them. For grain and lifetime the luminance of one row and one column of slices is kept: the slices of the smallest
//! θh, and those of the third θd, which lies clear of the grid's border.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::clusters::{ClusterSettings, Clusterer, NoTexel, SliceClusters};
use super::grain::{Luminance, grain_texels};
use super::lifetime::{Lifetime, comonotone, correlation, lifetime};
use super::thinned::Thinned;
use crate::color::luminance;
use crate::measurement::{FlakePictures, PackageError, SliceRoom};
use crate::paint::{Clustering, FlakeTexture, Flakes, Percentiles};

/// Most texels of a slice that grain and lifetime look at: whole rows from the top.
const PROBED_TEXELS: usize = 1 << 18;
/// Mean luminance above which a slice is lit, 1/sr.
const LIT: f64 = 1e-2;
/// Lit slices that the grain is averaged over.
const GRAIN_SLICES: usize = 6;

/// Flakes with what is known about their fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedFlakes {
    /// The flakes.
    pub flakes: Flakes,
    /// How they were clustered.
    pub clustering: Clustering,
    /// What the user should know: dead pixels, colors out of bounds.
    pub warnings: Vec<String>,
}

/// Why pictures give no flakes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FlakeFitError {
    /// A picture that cannot be read.
    #[error(transparent)]
    Picture(#[from] PackageError),
    /// A slice without a finite pixel.
    #[error("{slice}: {source}")]
    NoTexel {
        /// Name of the slice.
        slice: String,
        /// What is wrong with it.
        source: NoTexel,
    },
    /// A setting out of range.
    #[error("clusters is {0}, accepted is a whole number from 1 to 4096")]
    Clusters(usize),
    /// A recipe for simulated flakes out of range.
    #[error("the flake recipe's {field} is {value}, accepted is {low} to {high}")]
    Recipe {
        /// Field of the recipe.
        field: &'static str,
        /// The offending value.
        value: f64,
        /// Least that is accepted.
        low: f64,
        /// Most that is accepted.
        high: f64,
    },
}

/// Told after each slice: how many are done, of how many. It does not return when the work was called off.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// Fits the flakes of a paint.
///
/// # Errors
///
/// [`FlakeFitError`] for the first slice, in the order of storage, that cannot be used.
pub fn fit_flakes(
    pictures: &dyn FlakePictures,
    settings: &ClusterSettings,
    progress: Progress,
) -> Result<FittedFlakes, FlakeFitError> {
    if !(1..=4096).contains(&settings.clusters) {
        return Err(FlakeFitError::Clusters(settings.clusters));
    }
    if settings.angle_step > 1 {
        let every = ClusterSettings {
            angle_step: 1,
            ..*settings
        };
        let mut fitted = fit_flakes(
            &Thinned::new(pictures, settings.angle_step),
            &every,
            progress,
        )?;
        fitted.clustering.angle_step = settings.angle_step;
        return Ok(fitted);
    }
    let (slices, columns) = (pictures.slices(), pictures.theta_d().len());
    let column = columns.min(3) - 1;
    let done = AtomicUsize::new(0);
    let fitted: Vec<Result<FittedSlice, FlakeFitError>> = (0..slices)
        .into_par_iter()
        .map_init(<(SliceRoom, Clusterer)>::default, |(room, clusterer), k| {
            pictures.read(k, room)?;
            let planes = room.picture.planes.each_ref().map(Vec::as_slice);
            let clusters = clusterer.cluster(planes, settings);
            let clusters = clusters.map_err(|source| FlakeFitError::NoTexel {
                slice: pictures.name(k),
                source,
            })?;
            let probed = k < columns || k % columns == column;
            let light = probed.then(|| luminance_of(planes, room.picture.width));
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, slices);
            Ok(FittedSlice { clusters, light })
        })
        .collect();
    let fitted = fitted.into_iter().collect::<Result<Vec<_>, _>>()?;
    let warnings = warnings(pictures, &fitted);
    let texture = FlakeTexture {
        texel_um: pictures.texel_um(),
        grain_um: 0.5 * pictures.texel_um(),
        lifetime_deg: [90.0; 2],
        persistence_deg: [90.0; 2],
    };
    let mut flakes = gather(pictures, &fitted, texture);
    flakes.texture = texture_of(&flakes, &fitted, column);
    let clustering = Clustering {
        clusters: settings.clusters,
        box_rule: settings.box_rule.name().to_owned(),
        angle_step: 1,
        w1_bound: Some(Percentiles::of(
            fitted.iter().map(|s| s.clusters.w1_bound).collect(),
        )),
        left_out_w1: None,
        left_out_seen: None,
        error: None,
        realised_lab: None,
        realised_seen: None,
        reduced_w1: None,
        reduced_seen: None,
    };
    Ok(FittedFlakes {
        flakes,
        clustering,
        warnings,
    })
}

#[derive(Debug)]
struct FittedSlice {
    clusters: SliceClusters,
    light: Option<Luminance>,
}

fn luminance_of(planes: [&[f32]; 3], width: usize) -> Luminance {
    let most = (PROBED_TEXELS / width.max(1)).max(1) * width;
    let texels = planes[0].iter().zip(planes[1]).zip(planes[2]).take(most);
    let value = |((r, g), b): ((&f32, &f32), &f32)| {
        let y = luminance([*r, *g, *b].map(f64::from)) as f32;
        if y.is_finite() { y } else { 0.0 }
    };
    Luminance {
        width,
        values: texels.map(value).collect(),
    }
}

fn gather(pictures: &dyn FlakePictures, fitted: &[FittedSlice], texture: FlakeTexture) -> Flakes {
    let grids = [pictures.theta_h().clone(), pictures.theta_d().clone()];
    let mut flakes = Flakes::without_slices(grids, texture);
    for FittedSlice { clusters, .. } in fitted {
        flakes.push_slice(&clusters.probability, &clusters.lower, &clusters.upper);
    }
    flakes
}

/// Grain and lifetime from the kept slices; `column` is the kept θd.
fn texture_of(flakes: &Flakes, fitted: &[FittedSlice], column: usize) -> FlakeTexture {
    let columns = flakes.theta_d.len();
    let lit: Vec<&Luminance> = fitted
        .iter()
        .filter_map(|s| s.light.as_ref())
        .filter(|l| l.mean() > LIT)
        .collect();
    // Evenly over the lit slices, or the brightest where none is.
    let step = lit.len().div_ceil(GRAIN_SLICES).max(1);
    let mut chosen: Vec<&Luminance> = lit.into_iter().step_by(step).collect();
    if chosen.is_empty() {
        let all = fitted.iter().filter_map(|s| s.light.as_ref());
        chosen.extend(all.max_by(|x, y| x.mean().total_cmp(&y.mean())));
    }
    let texel_um = flakes.texture.texel_um;
    let grain_um = grain_texels(&chosen).unwrap_or(0.5) * texel_um;
    let along = |slices: Vec<usize>, angles: &[f64]| -> Lifetime {
        let light = |k: usize| fitted[k].light.as_ref();
        let measured: Vec<Option<f64>> = slices
            .iter()
            .map(|k| correlation(light(slices[0])?, light(*k)?))
            .collect();
        lifetime(angles, &measured, |k| {
            comonotone(flakes.slice_at(slices[0]), flakes.slice_at(slices[k]))
        })
    };
    let h = along(
        (0..flakes.theta_h.len())
            .map(|h| h * columns + column)
            .collect(),
        flakes.theta_h.degrees(),
    );
    let d = along((0..columns).collect(), flakes.theta_d.degrees());
    FlakeTexture {
        texel_um,
        grain_um,
        lifetime_deg: [h.lifetime_deg, d.lifetime_deg],
        persistence_deg: [h.persistence_deg, d.persistence_deg],
    }
}

fn warnings(pictures: &dyn FlakePictures, fitted: &[FittedSlice]) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut tell = |count: fn(&SliceClusters) -> usize, what: &str| {
        let total: usize = fitted.iter().map(|s| count(&s.clusters)).sum();
        let hit = fitted.iter().filter(|s| count(&s.clusters) > 0).count();
        let worst = fitted
            .iter()
            .enumerate()
            .max_by_key(|(k, s)| (count(&s.clusters), std::cmp::Reverse(*k)));
        if let (Some((k, slice)), true) = (worst, total > 0) {
            let (name, most) = (pictures.name(k), count(&slice.clusters));
            warnings.push(format!(
                "{total} pixels in {hit} flake slices {what}; most in {name}: {most}"
            ));
        }
    };
    tell(|c| c.dead, "are not finite and were left out");
    tell(
        |c| c.beyond,
        "lie beyond 2000 in L, a or b and were held there",
    );
    warnings
}
