//! Estimates of a blend.

use super::ingest::{Sampled, of_paint, sample};
use super::{
    Estimate, EstimatedError, FEW_ANGLES, Sizes, Stage, cold, extrapolated, job_seconds, steady,
    this_machine, timed, write_stage,
};
use crate::accuracy::{Profile, blend_error};
use crate::blend::{Blend, Order};
use crate::paint::PaintFile;
use crate::transport::{Cost, Method};
use crate::workshop::{IngestOptions, WorkshopError, blend_paints};

/// What blending paints, measurements and samples will take, opening and ingesting them included.
///
/// # Errors
///
/// [`WorkshopError`] for what cannot be opened, and what [`blend_paints`] refuses.
pub fn estimate_blend(
    names: &[String],
    options: &IngestOptions,
) -> Result<Estimate, WorkshopError> {
    let sizes = sizes(names.len(), &options.profile);
    let sampled = names
        .iter()
        .map(|name| sample(name, options, sizes))
        .collect::<Result<Vec<_>, _>>()?;
    of_samples(&sampled, &options.profile, Kept::InFile)
}

/// The same of paints that are there already, for a store that keeps the blend.
///
/// # Errors
///
/// What [`blend_paints`] refuses.
pub fn estimate_blend_of(
    paints: &[&PaintFile],
    profile: &Profile,
) -> Result<Estimate, WorkshopError> {
    let sizes = sizes(paints.len(), profile);
    let sampled: Vec<Sampled> = paints
        .iter()
        .map(|&paint| of_paint(paint.clone(), profile, sizes, 0.0))
        .collect();
    of_samples(&sampled, profile, Kept::InStore)
}

/// Angles of the samples. Where a blend is compared with what each pair could have alone, or with exact transport, that
/// is done on some slices of a large grid and on all of a small one: samples have to be beyond that.
fn sizes(paints: usize, profile: &Profile) -> Sizes {
    let alike = profile.blend.method == Method::Exact && profile.blend.cost == Cost::Distance;
    if paints == 2 && alike {
        FEW_ANGLES
    } else {
        MANY_ANGLES
    }
}

/// Goes of a sample that takes little time.
const GOES: usize = 3;

/// Angles of samples of more slices than are compared.
const MANY_ANGLES: Sizes = [9, 14];

const CANONICAL: &str = "three and more paints are joined in the order of their contents' hashes, which a sample of them does not have: \
                         it is measured when they are blended, or estimated with order=sampled or order=cheapest";

/// Where a blend goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kept {
    InFile,
    InStore,
}

fn of_samples(
    sampled: &[Sampled],
    profile: &Profile,
    kept: Kept,
) -> Result<Estimate, WorkshopError> {
    let go = |which: usize| -> Result<(f64, Blend), WorkshopError> {
        let paints: Vec<&PaintFile> = sampled.iter().map(|s| &s.paints[which]).collect();
        let (seconds, made) = steady(GOES, || blend_paints(&paints, profile, &|_| ()));
        Ok((seconds, made?.blend))
    };
    let (small, large) = (go(0)?, go(1)?);
    // Paints of one grid blend on it; of several, on what their angles make together.
    let axis = |k: usize| {
        let own = sampled.iter().filter_map(|s| s.angles).map(|a| a[k]);
        let most = own.clone().max().unwrap_or(1);
        let together = |blend: &Blend| blend.angles().map_or(1, |a| a[k]);
        let of_one = sampled
            .iter()
            .filter_map(|s| s.paints[1].paint.flakes.as_ref())
            .map(|f| [f.theta_h.len(), f.theta_d.len()][k])
            .max()
            .unwrap_or(1);
        most as f64 * together(&large.1) as f64 / of_one as f64
    };
    let whole = axis(0) * axis(1);
    let slices = |blend: &Blend| blend.report().slices.max(1) as f64;
    let at = |small_value: f64, large_value: f64| {
        extrapolated(
            (slices(&small.1), small_value),
            (slices(&large.1), large_value),
            whole,
        )
    };
    let (encode_small, bytes_small) = timed(|| small.1.to_bytes().map(|file| file.len() as f64));
    let (encode_large, bytes_large) = timed(|| large.1.to_bytes().map(|file| file.len() as f64));
    let bytes = at(bytes_small?, bytes_large?);
    let mut stages: Vec<Stage> = sampled.iter().flat_map(|s| s.stages.clone()).collect();
    stages.push(Stage {
        stage: "blend",
        // Whoever blends once does not find memory and threads warm.
        seconds: cold(large.0) * at(small.0, large.0)
            + sampled.iter().map(|s| s.thinning).sum::<f64>(),
    });
    let encode = at(encode_small, encode_large);
    let write = |bytes| this_machine().write_seconds(bytes).unwrap_or(0.0);
    match kept {
        Kept::InFile => {
            stages.push(Stage {
                stage: "encode",
                seconds: encode,
            });
            stages.extend(write_stage(bytes));
        }
        Kept::InStore => stages.push(Stage {
            stage: "store",
            seconds: encode + write(bytes) + job_seconds(),
        }),
    }
    let error = blend_error(&large.1);
    // Clusters were compared on the very slices that they will be compared on; the other terms are of a sample.
    let clusters = error.terms.iter().find(|term| term.what == "clusters");
    // The canonical order is that of the whole paints' hashes, which samples of them do not have.
    let with_flakes = sampled.iter().filter(|own| own.angles.is_some()).count();
    let joined_otherwise = sampled.len() > 2
        && with_flakes > 1
        && error.lab.is_some()
        && profile.blend.order == Order::Canonical;
    let known = if joined_otherwise {
        EstimatedError::not_known("Lab", CANONICAL)
    } else {
        EstimatedError::lab(&error)
    };
    let error = EstimatedError {
        at_least: clusters.and_then(|term| term.lab),
        ..known
    };
    Ok(Estimate::new(profile, stages, bytes, error))
}
