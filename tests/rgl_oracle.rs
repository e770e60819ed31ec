//! Real `.bsdf` files against an independent evaluator.
//!
//! `rgl/expected.json` in the data folder holds what Mitsuba 3.9.1's `measured` plugin (`scalar_rgb`) gives for four
//! CC0 materials at 60 direction pairs. Data is looked for in `CARPAINT_DATA`, by default `../shared`; without it the
//! test says so and passes, except where `CI` is set.

use std::io::Write as _;
use std::path::PathBuf;

use carpaint::measurement::{BrdfMeasurement, MeasuredBrdf, ReadOptions};
use carpaint::paint::Limits;

fn data() -> Option<PathBuf> {
    let folder =
        std::env::var_os("CARPAINT_DATA").map_or_else(|| PathBuf::from("../shared"), PathBuf::from);
    let rgl = folder.join("data/rgl");
    if rgl.join("expected.json").exists() {
        return Some(rgl);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "no test data in {}, set CARPAINT_DATA",
        rgl.display()
    );
    // Not by macro: the harness keeps to itself what passing tests print so.
    let _ = writeln!(
        std::io::stderr(),
        "SKIPPED: no test data in {}, set CARPAINT_DATA",
        rgl.display()
    );
    None
}

#[test]
fn tensor_files_evaluate_as_an_independent_renderer_does() {
    let Some(folder) = data() else { return };
    let text = std::fs::read_to_string(folder.join("expected.json")).expect("readable");
    let expected: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let numbers = |v: &serde_json::Value| -> [f64; 3] {
        serde_json::from_value(v.clone()).expect("three numbers")
    };
    let pairs = expected["dirs_wi_wo"].as_array().expect("pairs");
    let materials = expected["materials"].as_object().expect("materials");
    assert!(materials.len() >= 4);
    for (name, material) in materials {
        let bytes = std::fs::read(folder.join(name)).expect("readable");
        let measured = BrdfMeasurement::read(&bytes, &ReadOptions::default(), &Limits::default())
            .expect("whole");
        let mut worst: f64 = 0.0;
        for (pair, want) in pairs.iter().zip(material["fr"].as_array().expect("values")) {
            let got = measured
                .reflectance(numbers(&pair[0]), numbers(&pair[1]))
                .expect("above the horizon");
            for (g, w) in got.iter().zip(numbers(want)) {
                if w.abs() > 1e-3 {
                    worst = worst.max((g - w).abs() / w.abs());
                }
            }
        }
        // The other evaluator computes in f32: some 10 operations of 6e-8 on cancelling colors.
        assert!(worst < 2e-5, "{name}: {worst:e}");
    }
}
