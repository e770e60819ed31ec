//! The cost model's constants: what this machine takes for steps that no part of a request tells.
//!
//! Calibrated quickly when first needed (a few hundredths of a second; the service does it when it starts), or thoroughly
//! by a study, whose figures a service that has the study in its data folder takes instead.

use std::sync::OnceLock;

use super::{extrapolated, timed};
use crate::accuracy::study::Machine;
use crate::paint::{CarPaint, Chi, ColorTable, Lobe, Reflectance, instrument_pairs};

static HERE: OnceLock<Machine> = OnceLock::new();

/// Goes of a quick and of a thorough calibration.
const QUICK: usize = 3;
const THOROUGH: usize = 15;

/// Bytes of the files that calibration writes.
const SMALL: u16 = 1 << 12;
const LARGE: u32 = 1 << 20;

/// This machine: as a study found it, otherwise calibrated at the first call.
#[must_use]
pub fn this_machine() -> &'static Machine {
    HERE.get_or_init(|| calibrated(QUICK))
}

/// Takes a study's figures for this machine's; `false` when it was calibrated already, or one of them is no time.
#[must_use]
pub fn known_machine(machine: Machine) -> bool {
    machine.is_sound() && HERE.set(machine).is_ok()
}

/// This machine, thoroughly.
#[must_use]
pub fn study_machine() -> Machine {
    calibrated(THOROUGH)
}

fn calibrated(goes: usize) -> Machine {
    let content = vec![0x5a_u8; LARGE as usize];
    let small = usual(goes, || written(&content[..usize::from(SMALL)]));
    let large = usual(goes, || written(&content));
    let (small, large) = ((f64::from(SMALL), small), (f64::from(LARGE), large));
    let write = extrapolated(small, large, 0.0);
    Machine {
        write,
        write_byte: (large.1 - write).max(0.0) / large.0,
        hash_byte: hashed(goes, &content) / large.0,
        evaluation: evaluated(goes),
    }
}

/// The middle of some goes: what work takes that waits for a disk.
fn usual<T>(goes: usize, mut work: impl FnMut() -> T) -> f64 {
    let mut all: Vec<f64> = (0..goes).map(|_| timed(&mut work).0).collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

/// Writes a file as results are written: beside its place, synced, renamed, and the folder synced.
fn written(content: &[u8]) -> std::io::Result<()> {
    use std::io::Write as _;
    let folder = tempfile::tempdir()?;
    let mut file = tempfile::NamedTempFile::new_in(folder.path())?;
    file.write_all(content)?;
    file.as_file().sync_all()?;
    file.persist(folder.path().join("whole"))?;
    std::fs::File::open(folder.path())?.sync_all()
}

/// Seconds that reading and hashing a file of this content takes.
fn hashed(goes: usize, content: &[u8]) -> f64 {
    let read = || -> std::io::Result<f64> {
        let file = tempfile::NamedTempFile::new()?;
        std::fs::write(file.path(), content)?;
        Ok(usual(goes, || {
            blake3::Hasher::new()
                .update_reader(std::fs::File::open(file.path())?)
                .map(|hasher| hasher.finalize())
        }))
    };
    // Where there is no room for a file, memory stands in.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibrated_machine_takes_time_for_everything_and_longer_for_more() {
        let machine = calibrated(3);
        assert!(machine.is_sound());
        assert!(machine.write > 0.0 && machine.hash_byte > 0.0 && machine.evaluation > 0.0);
        assert!(machine.write_seconds(1e9) >= machine.write_seconds(1.0));
    }

    #[test]
    fn figures_that_are_no_times_are_not_taken() {
        let machine = calibrated(1);
        for write in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(!known_machine(Machine { write, ..machine }));
        }
    }
}
