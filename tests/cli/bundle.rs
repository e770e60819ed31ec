//! The bundle of a whole blend.

use crate::desk::{Desk, json};

#[test]
fn a_blend_is_bundled_the_same_on_any_number_of_threads() {
    let desk = Desk::with_blend();
    let mut seen = Vec::new();
    for threads in ["1", "8"] {
        desk.ok(&["bundle", "b.blend", "--threads", threads, "--out", "b.zip"]);
        seen.push(desk.read("b.zip"));
    }
    assert!(seen[0].starts_with(b"PK") && seen[0] == seen[1]);
    let said = json(
        &desk
            .ok(&["bundle", "b.blend", "--json", "--out", "b.zip"])
            .stdout,
    );
    assert_eq!(said["report"]["paints"][1], "blue");
    assert_eq!(said["bytes"].as_u64(), u64::try_from(seen[0].len()).ok());
}

#[test]
fn a_bundle_meets_a_target_and_tells_its_seconds_and_its_error() {
    let desk = Desk::with_blend();
    let told = desk.ok(&["bundle", "b.blend", "--out", "b.zip"]).stderr;
    let told = String::from_utf8(told).expect("text");
    assert!(
        told.contains(" bytes, error ") && told.contains(" Lab"),
        "{told}"
    );
    let words = "bundle b.blend --max-error 1000 --timings t.json --json --out b.zip";
    let said = json(&desk.ok(&words.split(' ').collect::<Vec<_>>()).stdout);
    assert_eq!(said["picked"]["met"], true, "{said}");
    assert_eq!(said["picked"]["estimate"]["knobs"]["precision"], "8bit");
    let finer = json(
        &desk
            .ok(&[
                "bundle",
                "b.blend",
                "--knob",
                "precision=f32",
                "--json",
                "--out",
                "f.zip",
            ])
            .stdout,
    );
    let lab_of = |said: &serde_json::Value| {
        said["report"]["accuracy"]["error"]["lab"]
            .as_f64()
            .expect("known")
    };
    let (coarse, fine) = (lab_of(&said), lab_of(&finer));
    assert!(fine < coarse, "{fine} {coarse}");
    for (share, met) in [(0.999, true), (0.001, true), (-0.001, false)] {
        let most = (fine + share * (coarse - fine)).to_string();
        let words = [
            "bundle",
            "b.blend",
            "--max-error",
            &most,
            "--json",
            "--out",
            "m.zip",
        ];
        let aimed = json(&desk.ok(&words).stdout);
        assert_eq!(aimed["picked"]["met"], met, "{most}: {aimed}");
        assert_eq!(
            lab_of(&aimed) <= fine + share * (coarse - fine),
            met,
            "{most}: {aimed}"
        );
        assert_ne!(aimed["picked"]["estimate"]["knobs"]["precision"], "8bit");
    }
    let error = &said["report"]["accuracy"]["error"];
    let terms = error["terms"].as_array().expect("a list");
    let rounding = terms.iter().find(|term| term["what"] == "rounding");
    let rounding = rounding.and_then(|term| term["lab"].as_f64());
    assert!(rounding.is_some_and(|lab| lab > 0.01), "{error}");
    let seconds = json(&desk.read("t.json"));
    for stage in ["open", "search", "error", "encode", "write", "total"] {
        assert!(
            seconds[stage].as_f64().is_some_and(|s| s > 0.0),
            "{seconds}"
        );
    }
    // The range of the whole blend says how coarsely it is rounded.
    let of = |work: &str| {
        let words = format!("{work} b.blend --knob precision=8bit --json");
        json(&desk.ok(&words.split(' ').collect::<Vec<_>>()).stdout)
    };
    assert_eq!(of("estimate bundle")["error"]["value"], coarse);
    let realised = desk.ok(&[
        "realise",
        "b.blend",
        "--weights",
        "0.4,0.6",
        "--knob",
        "precision=8bit",
        "--json",
        "--out",
        "r.zip",
    ]);
    let estimate = of("estimate realise --weights 0.4,0.6");
    assert_eq!(estimate["error"]["value"], lab_of(&json(&realised.stdout)));
    let estimate = json(&desk.ok(&["estimate", "bundle", "b.blend", "--json"]).stdout);
    assert!(
        estimate["bytes"]
            .as_u64()
            .is_some_and(|bytes| bytes > 10_000)
    );
}

#[test]
fn what_is_no_blend_or_no_zip_is_refused() {
    let desk = Desk::with_blend();
    let said = desk.refused(2, &["bundle", "sample:white", "--out", "w.zip"]);
    assert!(
        said.contains("one paint") && said.contains("realise"),
        "{said}"
    );
    let said = desk.refused(2, &["bundle", "b.blend", "--out", "b.json"]);
    assert!(said.contains(".zip"), "{said}");
    assert_eq!(desk.files(), ["b.blend"]);
}
