//! The cost model's constants: what this machine takes for steps that no part of a request tells.
//!
//! Calibrated quickly when needed (a few hundredths of a second; the service does it when it starts, and again where that
//! was a while ago, for a busy minute says little of the next), or thoroughly by a study, whose figures a service that has
//! the study in its data folder takes instead.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::{extrapolated, timed};
use crate::accuracy::study::Machine;
use crate::fit::FITTED_ANGLES;
use crate::paint::{AngleGrid, CarPaint, Chi, ColorTable, Lobe, Reflectance, instrument_pairs};

static HERE: Mutex<Option<Known>> = Mutex::new(None);

/// What is known of this machine.
struct Known {
    machine: Machine,
    /// The disk that was written to.
    folder: PathBuf,
    /// When it was calibrated; a study's figures stay.
    since: Option<Instant>,
}

/// How long a quick calibration holds.
const HOLDS: Duration = Duration::from_secs(20);

impl Known {
    fn quickly(folder: PathBuf) -> Self {
        Self {
            machine: calibrated(QUICK, &folder),
            folder,
            since: Some(Instant::now()),
        }
    }
}

/// Goes of a quick and of a thorough calibration.
const QUICK: usize = 3;
const THOROUGH: usize = 15;

/// Bytes of the files that calibration writes.
const SMALL: u16 = 1 << 12;
const LARGE: u32 = 1 << 20;

/// This machine: as it was learned, or calibrated a moment ago, or now, with the disk of the folder that was learned with
/// or of temporary files.
#[must_use]
pub fn this_machine() -> Machine {
    let mut here = HERE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = match here.take() {
        Some(known) if known.since.is_none_or(|since| since.elapsed() < HOLDS) => {
            return here.insert(known).machine;
        }
        Some(known) => known.folder,
        None => std::env::temp_dir(),
    };
    here.insert(Known::quickly(folder)).machine
}

/// Learns this machine: by a study's figures where they are times, otherwise by a quick calibration with the disk of this
/// data folder, in a folder of its own: what a kill leaves there is gone with the next start.
pub fn learn_machine(study: Option<Machine>, data: &Path) {
    let folder = data.join("calibration");
    // Where there is none, calibration finds that nothing can be written.
    let _ = std::fs::remove_dir_all(&folder);
    let _ = std::fs::create_dir(&folder);
    let known = match study.filter(Machine::is_sound) {
        Some(machine) => Known {
            machine,
            folder,
            since: None,
        },
        None => Known::quickly(folder),
    };
    *HERE.lock().unwrap_or_else(PoisonError::into_inner) = Some(known);
}

/// This machine, thoroughly, with the disk of this folder.
#[must_use]
pub fn study_machine(folder: &Path) -> Machine {
    calibrated(THOROUGH, folder)
}

fn calibrated(goes: usize, folder: &Path) -> Machine {
    let content = vec![0x5a_u8; LARGE as usize];
    Machine {
        write: writing(goes, folder, &content).ok(),
        hash_byte: hashed(goes, folder, &content) / f64::from(LARGE),
        evaluation: evaluated(goes),
    }
}

/// Seconds of writing a small file, and of each byte beside.
fn writing(goes: usize, folder: &Path, content: &[u8]) -> std::io::Result<[f64; 2]> {
    let small = &content[..usize::from(SMALL)];
    // Where it cannot be done it takes no time either.
    written(folder, small)?;
    let (small, large) = (
        usual(goes, || written(folder, small)),
        usual(goes, || written(folder, content)),
    );
    let ends = [(f64::from(SMALL), small), (f64::from(LARGE), large)];
    let fixed = extrapolated(ends[0], ends[1], 0.0);
    Ok([fixed, (large - fixed).max(0.0) / f64::from(LARGE)])
}

/// The middle of some goes: what work takes that waits for a disk.
fn usual<T>(goes: usize, mut work: impl FnMut() -> T) -> f64 {
    let mut all: Vec<f64> = (0..goes).map(|_| timed(&mut work).0).collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// Writes a file as results are written: beside its place, synced, renamed, and the folder synced.
fn written(folder: &Path, content: &[u8]) -> std::io::Result<()> {
    use std::io::Write as _;
    let folder = tempfile::tempdir_in(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder.path())?;
    file.write_all(content)?;
    file.as_file().sync_all()?;
    file.persist(folder.path().join("whole"))?;
    std::fs::File::open(folder.path())?.sync_all()
}

/// Seconds that reading and hashing a file of this content takes.
fn hashed(goes: usize, folder: &Path, content: &[u8]) -> f64 {
    let read = || -> std::io::Result<f64> {
        let file = tempfile::NamedTempFile::new_in(folder)?;
        std::fs::write(file.path(), content)?;
        let hash = || -> std::io::Result<blake3::Hash> {
            let mut hasher = blake3::Hasher::new();
            hasher.update_reader(std::fs::File::open(file.path())?)?;
            Ok(hasher.finalize())
        };
        hash()?;
        Ok(usual(goes, hash))
    };
    // Where no file can be written, memory stands in.
    read().unwrap_or_else(|_| usual(goes, || blake3::hash(content)))
}

fn evaluated(goes: usize) -> f64 {
    const EVALUATIONS: u32 = 30_000;
    let paint = stand_in();
    let reflectance = Reflectance::new(&paint);
    let pairs = instrument_pairs();
    let all = usual(goes, || {
        (0..EVALUATIONS)
            .map(|k| {
                let (wi, wo) = pairs[k as usize % pairs.len()];
                reflectance.evaluate(wi, wo, Chi::Table)[1]
            })
            .sum::<f64>()
    });
    all / f64::from(EVALUATIONS)
}

/// A paint of one color, where only the size of a paint matters.
pub(super) fn stand_in() -> CarPaint {
    CarPaint {
        coat: None,
        diffuse: [0.2; 3],
        lobes: vec![
            Lobe {
                weight: [0.05; 3],
                alpha: 0.3,
                f0: 0.5,
            };
            3
        ],
        color_table: ColorTable::white(),
        flakes: None,
    }
}

/// The same with a color table of the size that a fit has.
pub(super) fn fitted_stand_in() -> CarPaint {
    let [theta_h, theta_d] = FITTED_ANGLES.map(|count| {
        let angles = (0..count).map(|k| 90.0 * k as f64 / count as f64);
        AngleGrid::new(angles.collect()).unwrap_or_else(|_| AngleGrid::single())
    });
    let white = ColorTable::white();
    let nodes = vec![white.nodes()[0]; theta_h.len() * theta_d.len()];
    let overall = white.overall();
    CarPaint {
        color_table: ColorTable::new(theta_h, theta_d, nodes, overall).unwrap_or(white),
        ..stand_in()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibrated_machine_takes_time_for_everything() {
        let folder = tempfile::tempdir().expect("a folder");
        let machine = calibrated(3, folder.path());
        assert!(machine.is_sound());
        // A megabyte of a disk takes more than a nanosecond, and so does an evaluation.
        let written = machine.write_seconds(f64::from(LARGE)).expect("written");
        assert!(written > 1e-9 && machine.evaluation > 1e-9 && machine.hash_byte > 0.0);
        assert_eq!(std::fs::read_dir(folder.path()).expect("there").count(), 0);
    }

    #[test]
    fn where_nothing_can_be_written_the_rest_is_calibrated() {
        let folder = tempfile::tempdir().expect("a folder");
        let machine = calibrated(1, &folder.path().join("not there"));
        assert_eq!(machine.write, None);
        assert!(machine.hash_byte > 0.0 && machine.is_sound());
    }
}
