//! The study: turning the knobs, one at a time and together, with a stopwatch.
//!
//! Every figure is of the functions that requests run, on all threads of the current pool, as they are: the shortest of a
//! few goes, since what comes between makes work longer and never shorter. Where the system keeps account of it, time is
//! processor time over the threads that the work is spread over, so that a busy machine gives the figures of an idle one.

mod clock;
mod fronts;
mod growth;
mod material;

use std::time::Instant;

pub use material::Material;

use super::WorkshopError;
use super::estimate::study_machine;
use crate::accuracy::study::Study;

/// How thorough a study is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StudyOptions {
    /// Fewer settings, smaller pictures, one go each.
    pub quick: bool,
}

/// Tells what is being measured and the share done.
pub type Tell<'a> = &'a (dyn Fn(&str, f32) + Sync);

/// Measures what accuracy costs on these paints, which must be measurements or samples with flakes.
///
/// # Errors
///
/// [`WorkshopError`] for fewer than two paints with pictures of flakes, and what the work itself refuses.
pub fn study(
    names: &[String],
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Study, WorkshopError> {
    of_material(Material::open(names)?, options, tell)
}

fn of_material(
    mut material: Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Study, WorkshopError> {
    let begun = Instant::now();
    let ingest = fronts::ingest(&mut material, options, tell)?;
    let blend = fronts::blend(&mut material, options, tell)?;
    let join = fronts::join(&mut material, options, tell)?;
    let realise = fronts::realise(&mut material, options, tell)?;
    let preview = fronts::preview(&mut material, options, tell)?;
    let growth = growth::measure(&mut material, options, tell)?;
    Ok(Study {
        format: "carpaint study".to_owned(),
        version: 1,
        program: env!("CARGO_PKG_VERSION").to_owned(),
        threads: rayon::current_num_threads(),
        clock: clock::name().to_owned(),
        paints: material.names(),
        quick: options.quick,
        seconds: begun.elapsed().as_secs_f64(),
        machine: Some(study_machine(&std::env::temp_dir())),
        fronts: [ingest, blend]
            .into_iter()
            .chain(join)
            .chain([realise, preview])
            .collect(),
        growth,
    })
}

/// Seconds below which a go is of many times the work: no account is kept that finely.
const SHORT: f64 = 4e-3;
const MANY: u32 = 16;

/// The shortest of some goes, of work that is spread over so many threads: seconds, and what the last one gave.
fn shortest<T>(
    goes: usize,
    threads: usize,
    mut work: impl FnMut() -> Result<T, WorkshopError>,
) -> Result<(f64, T), WorkshopError> {
    let mut least = f64::INFINITY;
    let mut made = None;
    for _ in 0..goes.max(1) {
        let clock = clock::Clock::start();
        made = Some(work()?);
        let mut seconds = clock.seconds(threads);
        if seconds < SHORT {
            let clock = clock::Clock::start();
            for _ in 0..MANY {
                made = Some(work()?);
            }
            seconds = clock.seconds(threads) / f64::from(MANY);
        }
        least = least.min(seconds);
    }
    let made = made.ok_or_else(|| WorkshopError::internal("no go at all"))?;
    Ok((least, made))
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUICK: StudyOptions = StudyOptions { quick: true };

    #[test]
    fn two_paints_are_joined_in_one_order_only() {
        let joined = fronts::join(&mut Material::tiny(2), &QUICK, &|_, _| ());
        assert_eq!(joined, Ok(None));
    }

    #[test]
    fn a_study_measures_every_kind_of_work_and_this_machine() {
        let study = of_material(Material::tiny(3), &QUICK, &|_, _| ()).expect("measured");
        let works: Vec<&str> = study
            .fronts
            .iter()
            .map(|front| front.work.as_str())
            .collect();
        assert_eq!(works, ["ingest", "blend", "join", "realise", "preview"]);
        for front in &study.fronts {
            assert_eq!(front.presets().count(), 3, "{}", front.work);
            assert!(front.points.iter().any(|point| point.on_front));
            let told = |point: &crate::accuracy::study::Point| {
                point.seconds > 0.0 && point.error >= 0.0 && point.error.is_finite()
            };
            assert!(front.points.iter().all(told), "{}", front.work);
        }
        assert!(study.machine.is_some_and(|machine| machine.is_sound()));
        let page = crate::accuracy::study::page(&study);
        assert!(page.contains("12 clusters, cheapest order"), "{page}");
    }
}
