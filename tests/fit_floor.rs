//! The fit of real files against the floor: what a free function of (θh, θd) reaches on the same file.
//!
//! Data is looked for in `CARPAINT_DATA`, by default `../shared`; without it the test says so and passes, except where
//! `CI` is set.

use std::io::Write as _;
use std::path::PathBuf;

use carpaint::fit::{CoatChoice, fit_base};
use carpaint::measurement::{BrdfMeasurement, ReadOptions};
use carpaint::paint::Limits;

fn files() -> Vec<PathBuf> {
    let folder =
        std::env::var_os("CARPAINT_DATA").map_or_else(|| PathBuf::from("../shared"), PathBuf::from);
    let rgl = folder.join("data/rgl");
    let mut files: Vec<PathBuf> = std::fs::read_dir(&rgl).map_or_else(
        |_| Vec::new(),
        |entries| {
            let paths = entries.filter_map(|e| e.ok().map(|e| e.path()));
            paths
                .filter(|p| p.extension().is_some_and(|e| e == "bsdf"))
                .collect()
        },
    );
    files.sort();
    if files.is_empty() {
        assert!(
            std::env::var_os("CI").is_none(),
            "no .bsdf in {}, set CARPAINT_DATA",
            rgl.display()
        );
        // Not by macro: the harness keeps to itself what passing tests print so.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: no .bsdf in {}, set CARPAINT_DATA",
            rgl.display()
        );
    }
    files
}

#[test]
fn real_files_are_fitted_to_their_floor() {
    for file in files() {
        let name = file.display();
        let bytes = std::fs::read(&file).expect("readable");
        let measured = BrdfMeasurement::read(&bytes, &ReadOptions::default(), &Limits::default())
            .expect("whole");
        let base = fit_base(&measured, CoatChoice::ByResidual).expect("a fit");
        let r = &base.residuals;
        for (region, e) in [("all", r.all), ("near the mirror", r.near_mirror)] {
            assert!(e.median <= 1.3 * e.floor_median, "{name} {region}: {e:?}");
            assert!(e.p90 <= 1.3 * e.floor_p90, "{name} {region}: {e:?}");
        }
        for i in &r.instrument {
            assert!(i.fit <= i.floor + 1.0, "{name}: {i:?}");
        }
        assert!(
            base.lobes.is_sorted_by(|a, b| a.alpha <= b.alpha),
            "{name}: {:?}",
            base.lobes
        );
    }
}
