//! Estimates of an ingest, and samples of paints that are still to be ingested.

use std::cell::RefCell;
use std::path::Path;

use super::machine::{fitted_stand_in, stand_in};
use super::{
    Estimate, EstimatedError, FEW_ANGLES, Sizes, Stage, cold, extrapolated, left_at, steady,
    step_for, this_machine, timed, wanted_on, write_stage,
};
use crate::accuracy::{
    Profile, clustering_error, left_out_w1, paint_error, predicted_clustering_error, seen_between,
};
use crate::fit::{ClusterSettings, FittedFlakes, Thinned, fit_flakes};
use crate::measurement::{FlakePictures, PackageBase};
use crate::paint::{CarPaint, Clustering, PaintFile, Provenance, certify};
use crate::workshop::ingest::finish;
use crate::workshop::thing::{Source, Thing, find, open};
use crate::workshop::{
    IngestOptions, Lap, Laps, Measurement, WorkshopError, ingest_in_stages, ingest_upload,
    is_paint_file, open_measurement,
};

/// A paint that may be still to be ingested, with a few of its angles.
pub(super) struct Sampled {
    /// As many angles on an axis as its `Sizes` say.
    pub paints: [PaintFile; 2],
    /// Angles of θh and θd in full; `None` for a solid color.
    pub angles: Option<[usize; 2]>,
    /// What opening it in full takes.
    pub stages: Vec<Stage>,
    /// Seconds that leaving angles out takes, and measuring what that costs, as part of blending it.
    pub thinning: f64,
}

/// What a measurement will take to ingest.
///
/// # Errors
///
/// [`WorkshopError`] for what cannot be opened, or is no measurement.
pub fn estimate_ingest(name: &str, options: &IngestOptions) -> Result<Estimate, WorkshopError> {
    if let Source::Path(path) = find(name)?
        && is_paint_file(&path)?
    {
        return of_paint_file(&path, options);
    }
    let sampled = sample(name, options, FEW_ANGLES)?;
    let whole = sampled.angles.map_or(1.0, |[h, d]| (h * d) as f64);
    let size = |paint: &PaintFile| -> Result<_, WorkshopError> {
        let flakes = paint.paint.flakes.as_ref();
        Ok((
            flakes.map_or(1.0, |f| f.slices() as f64),
            paint.to_bytes()?.len() as f64,
        ))
    };
    let [small, large] = &sampled.paints;
    let bytes = extrapolated(size(small)?, size(large)?, whole);
    let mut stages = sampled.stages;
    stages.extend(write_stage(bytes));
    let error = EstimatedError::lab(&paint_error(large));
    Ok(Estimate::new(&options.profile, stages, bytes, error))
}

/// What a `.paint` will take that is uploaded: it is taken as it is, which is soon done in full.
fn of_paint_file(path: &Path, options: &IngestOptions) -> Result<Estimate, WorkshopError> {
    let (paint, mut stages) = in_full(|ended| ingest_upload(path, options, &|_| (), ended))?;
    let bytes = paint.to_bytes()?.len() as f64;
    stages.extend(write_stage(bytes));
    let error = EstimatedError::lab(&paint_error(&paint));
    Ok(Estimate::new(&options.profile, stages, bytes, error))
}

/// Does what is soon done, and says what each stage took.
fn in_full(
    work: impl FnOnce(&dyn Fn(&'static str)) -> Result<PaintFile, WorkshopError>,
) -> Result<(PaintFile, Vec<Stage>), WorkshopError> {
    let laps = RefCell::new(Laps::begin());
    let paint = work(&|stage| laps.borrow_mut().end(stage))?;
    let stages = laps.into_inner().into_stages().into_iter();
    let stage = |(stage, time): Lap| Stage {
        stage,
        seconds: time.as_secs_f64(),
    };
    Ok((paint, stages.map(stage).collect()))
}

/// Goes of a sample that takes little time.
const GOES: usize = 6;

/// What a name means, to estimate work on it: files that are paints or blends as they are, of measurements and samples a
/// few angles, with what opening them in full will take.
///
/// # Errors
///
/// [`WorkshopError`] for what cannot be opened.
pub fn sample_to_estimate(
    name: &str,
    options: &IngestOptions,
) -> Result<(Vec<Stage>, Thing), WorkshopError> {
    if let Source::Path(path) = find(name)?
        && !is_measurement(&path)?
    {
        let (seconds, thing) = timed(|| open(name, options, &|_| ()));
        let read = Stage {
            stage: "read",
            seconds,
        };
        return Ok((vec![read], thing?));
    }
    let Sampled { paints, stages, .. } = sample(name, options, FEW_ANGLES)?;
    let [_, paint] = paints;
    Ok((stages, Thing::Paint(Box::new(paint))))
}

/// Opens what a name means, of a measurement or of a sample only some angles.
pub(super) fn sample(
    name: &str,
    options: &IngestOptions,
    sizes: Sizes,
) -> Result<Sampled, WorkshopError> {
    match find(name)? {
        Source::Sample(sample) => {
            let paint = sample.base();
            let (seconds, patch) = timed(|| sample.patch());
            let mut stages = vec![Stage {
                stage: "simulate",
                seconds,
            }];
            let Some(patch) = patch? else {
                return Ok(Sampled::solid(finished(sample.name, paint, None), stages));
            };
            let (paints, angles) = fitted(
                &patch,
                &paint,
                sample.name,
                &options.profile,
                sizes,
                &mut stages,
            )?;
            Ok(Sampled {
                paints,
                angles: Some(angles),
                stages,
                thinning: 0.0,
            })
        }
        Source::Path(path) if is_measurement(&path)? => of_measurement(&path, name, options, sizes),
        Source::Path(_) => {
            let (seconds, thing) = timed(|| open(name, options, &|_| ()));
            let Thing::Paint(paint) = thing? else {
                return Err(WorkshopError::input(name, "this is a blend, not a paint"));
            };
            Ok(of_paint(*paint, &options.profile, sizes, seconds))
        }
    }
}

/// Samples of a paint that is there.
pub(super) fn of_paint(paint: PaintFile, profile: &Profile, sizes: Sizes, seconds: f64) -> Sampled {
    let stages = vec![Stage {
        stage: "read",
        seconds,
    }];
    let Some(flakes) = &paint.paint.flakes else {
        return Sampled::solid(paint, stages);
    };
    let had = paint.clustering.as_ref().map_or(1, |c| c.angle_step).max(1);
    let step = (profile.flakes.angle_step / had).max(1);
    let angles = [flakes.theta_h.len(), flakes.theta_d.len()].map(|n| left_at(n, step));
    let (thinning, left_out) = timed(|| {
        (step > 1).then(|| {
            let kept = flakes.thinned(step);
            (
                left_out_w1(flakes, step),
                seen_between(&paint.paint, flakes, &kept),
            )
        })
    });
    let paints = sizes.map(|wanted| {
        let [wanted_h, wanted_d] = wanted_on(angles, wanted);
        let axes = [(&flakes.theta_h, wanted_h), (&flakes.theta_d, wanted_d)];
        let [rows, columns] = axes.map(|(grid, wanted)| {
            let left = grid.every(step);
            let every = step_for(left.len(), wanted);
            let mut kept: Vec<usize> = left.iter().copied().step_by(every).collect();
            if kept.last() != left.last() {
                kept.extend(left.last());
            }
            kept
        });
        PaintFile {
            paint: CarPaint {
                flakes: Some(flakes.only(&rows, &columns)),
                ..paint.paint.clone()
            },
            // As many angles as the profile wants: blending is not to thin them again.
            clustering: paint.clustering.clone().map(|c| Clustering {
                angle_step: c.angle_step.max(profile.flakes.angle_step),
                left_out_w1: left_out.map(|(w1, _)| w1),
                left_out_seen: left_out.and_then(|(_, seen)| seen),
                ..c
            }),
            ..paint.clone()
        }
    });
    Sampled {
        paints,
        angles: Some(angles),
        stages,
        thinning,
    }
}

impl Sampled {
    fn solid(paint: PaintFile, stages: Vec<Stage>) -> Self {
        Self {
            paints: [paint.clone(), paint],
            angles: None,
            stages,
            thinning: 0.0,
        }
    }
}

fn is_measurement(path: &Path) -> Result<bool, WorkshopError> {
    let head = crate::workshop::thing::first_bytes(path)?;
    Ok(!PaintFile::recognises(&head) && !crate::blend::Blend::recognises(&head))
}

fn of_measurement(
    path: &Path,
    name: &str,
    options: &IngestOptions,
    sizes: Sizes,
) -> Result<Sampled, WorkshopError> {
    let (seconds, measurement) = timed(|| open_measurement(path, options));
    let mut stages = vec![Stage {
        stage: "open",
        seconds,
    }];
    let package = match measurement? {
        Measurement::Package(package) => {
            stages.push(hash_stage(path));
            package
        }
        Measurement::Brdf(..) => {
            stages.push(base_stage(options.coat_ior.is_some()));
            let (seconds, paint) = timed(|| finished(name, fitted_stand_in(), None));
            stages.push(Stage {
                stage: "certificate",
                seconds,
            });
            return Ok(Sampled::solid(paint, stages));
        }
        // A few readings are fitted at once.
        Measurement::Readings(..) => {
            let (paint, stages) = in_full(|ended| ingest_in_stages(path, options, &|_| (), ended))?;
            return Ok(Sampled::solid(paint, stages));
        }
    };
    let mut paint = stand_in();
    paint.coat = package.coat;
    match &package.base {
        Some(PackageBase::Model {
            diffuse,
            lobes,
            color_table,
        }) => {
            paint.diffuse = *diffuse;
            paint.lobes.clone_from(lobes);
            paint.color_table = color_table.clone();
        }
        Some(PackageBase::Table { .. }) => {
            stages.push(base_stage(true));
            paint.color_table = fitted_stand_in().color_table;
        }
        None => {}
    }
    let Some(pictures) = &package.flakes else {
        return Ok(Sampled::solid(finished(name, paint, None), stages));
    };
    let (paints, angles) = fitted(pictures, &paint, name, &options.profile, sizes, &mut stages)?;
    Ok(Sampled {
        paints,
        angles: Some(angles),
        stages,
        thinning: 0.0,
    })
}

/// Fits a few angles of pictures, twice, and what all of them will take.
fn fitted(
    pictures: &dyn FlakePictures,
    base: &CarPaint,
    name: &str,
    profile: &Profile,
    sizes: Sizes,
    stages: &mut Vec<Stage>,
) -> Result<([PaintFile; 2], [usize; 2]), WorkshopError> {
    let settings = ClusterSettings {
        angle_step: 1,
        ..profile.flakes
    };
    let every = profile.flakes.angle_step;
    let angles = [pictures.theta_h(), pictures.theta_d()].map(|grid| left_at(grid.len(), every));
    let go = |wanted: usize| -> Result<(f64, FittedFlakes), WorkshopError> {
        let wanted = wanted_on(angles, wanted);
        let steps = [0, 1].map(|axis| every * step_for(angles[axis], wanted[axis]));
        let thinned = Thinned::by_steps(pictures, steps);
        let (seconds, fitted) = steady(GOES, || fit_flakes(&thinned, &settings, &|_, _| ()));
        Ok((seconds, fitted.map_err(|e| WorkshopError::input(name, e))?))
    };
    let (small, large) = (go(sizes[0])?, go(sizes[1])?);
    let size = |fitted: &FittedFlakes| fitted.flakes.slices() as f64;
    let whole = (angles[0] * angles[1]) as f64;
    stages.push(Stage {
        stage: "flakes",
        seconds: cold(large.0)
            * extrapolated((size(&small.1), small.0), (size(&large.1), large.0), whole),
    });
    let mut paints = [small.1, large.1].map(|fitted| {
        let paint = CarPaint {
            flakes: Some(fitted.flakes),
            ..base.clone()
        };
        finished(
            name,
            paint,
            Some(Clustering {
                angle_step: every,
                ..fitted.clustering
            }),
        )
    });
    // The very slices that the ingest will be compared on.
    let (seconds, _) = timed(|| clustering_error(pictures, &paints[1].paint));
    stages.push(Stage {
        stage: "error",
        seconds,
    });
    // It hardly depends on the number of slices.
    let (seconds, _) = timed(|| certify(&paints[1].paint));
    stages.push(Stage {
        stage: "certificate",
        seconds,
    });
    let error = predicted_clustering_error(pictures, base, &profile.flakes);
    for paint in &mut paints {
        if let Some(clustering) = &mut paint.clustering {
            clustering.error.clone_from(&error);
        }
    }
    Ok((paints, angles))
}

fn finished(name: &str, paint: CarPaint, clustering: Option<Clustering>) -> PaintFile {
    let nothing = Vec::new();
    finish(
        name.to_owned(),
        Provenance::default(),
        paint,
        None,
        clustering,
        nothing,
    )
}

/// What reading and hashing a package takes.
fn hash_stage(path: &Path) -> Stage {
    let length = std::fs::metadata(path).map_or(0, |about| about.len());
    Stage {
        stage: "hash",
        seconds: this_machine().hash_seconds(length as f64),
    }
}

/// What fitting a reflectance table takes.
fn base_stage(coat_is_known: bool) -> Stage {
    Stage {
        stage: "base",
        seconds: this_machine().fit_seconds(coat_is_known),
    }
}
