//! What is told without making a file: samples, values, the selftest, help.

use std::fs;

use crate::desk::{Desk, json};

#[test]
fn samples_are_listed_and_exported() {
    let desk = Desk::new();
    let list = json(&desk.ok(&["samples", "list", "--json"]).stdout);
    assert_eq!(list["samples"].as_array().map(Vec::len), Some(8));
    desk.ok(&["samples", "export", "white", "--out", "white.paint"]);
    let about = json(&desk.ok(&["show", "white.paint", "--json"]).stdout);
    assert_eq!(about["name"], "white");
    assert!(about["flakes"].is_null() && about["energy"]["albedo"][0].is_number());
    assert!(
        desk.refused(3, &["samples", "export", "pink", "--out", "p.paint"])
            .contains("polaris_silber")
    );
    assert_eq!(desk.files(), ["white.paint"]);
}

#[test]
fn evaluation_reads_pairs_and_writes_values() {
    let desk = Desk::new();
    fs::write(
        desk.path("d.json"),
        r#"{"pairs": [[[0,0,1],[0,0,1]], [[0.6,0,0.8],[0,0.6,0.8]], [[0.6,0,0.8],[0,0.6,-0.8]]]}"#,
    )
    .expect("written");
    desk.ok(&[
        "evaluate",
        "sample:white",
        "--directions",
        "d.json",
        "--out",
        "v.json",
    ]);
    let values = json(&desk.read("v.json"));
    assert_eq!(values["f"].as_array().map(Vec::len), Some(3));
    assert!(
        values["f"][1][0]
            .as_f64()
            .is_some_and(|v| v > 0.61 / std::f64::consts::PI)
    );
    assert_eq!(values["f"][2], serde_json::json!([0.0, 0.0, 0.0]));
    for bad in ["{", r#"{"pairs": [[[0,0,2],[0,0,1]]]}"#, r#"{"pears": []}"#] {
        fs::write(desk.path("bad.json"), bad).expect("written");
        assert!(
            desk.refused(
                3,
                &[
                    "evaluate",
                    "sample:white",
                    "--directions",
                    "bad.json",
                    "--out",
                    "w.json"
                ]
            )
            .contains("bad.json")
        );
    }
    let said = desk.refused(
        3,
        &[
            "evaluate",
            "sample:white",
            "--raw",
            "--directions",
            "d.json",
            "--out",
            "w.json",
        ],
    );
    assert!(said.contains("no measurement"), "{said}");
}

#[test]
fn every_command_teaches_itself() {
    let desk = Desk::new();
    for command in [
        "serve", "ingest", "show", "blend", "realise", "preview", "texels", "evaluate", "estimate",
        "samples",
    ] {
        let help = String::from_utf8(desk.ok(&[command, "--help"]).stdout).expect("text");
        assert!(
            help.contains("Usage: carpaint") && help.len() > 300,
            "{command}: {help}"
        );
    }
}

#[test]
fn the_selftest_says_what_it_found_and_passes_on_samples() {
    let desk = Desk::new();
    let output = desk.ok(&["selftest", "sample:white", "--profile", "draft", "--json"]);
    let report = json(&output.stdout);
    assert_eq!(report["passed"], true);
    let checks = report["checks"].as_array().expect("a list");
    assert!(checks.len() >= 14, "{report}");
    for check in checks {
        let (found, limit) = (check["found"].as_f64(), check["limit"].as_f64());
        assert!(
            found.expect("a number") <= limit.expect("a number"),
            "{check}"
        );
    }
    let table = desk
        .ok(&["selftest", "sample:white", "--profile", "draft"])
        .stdout;
    let table = String::from_utf8(table).expect("text");
    assert_eq!(table.lines().count(), checks.len() + 1, "{table}");
    assert!(!table.contains("FAILED"));
    desk.refused(3, &["selftest", "no_such_paint"]);
}
