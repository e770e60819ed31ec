//! The real binary, as scripts call it.

mod arguments;
mod bundle;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of its own for each test, gone afterwards.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a temporary folder"),
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, words: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_carpaint"))
            .current_dir(self.folder.path())
            .args(words)
            .output()
            .expect("the binary starts")
    }

    fn ok(&self, words: &[&str]) -> Output {
        let output = self.run(words);
        assert!(
            output.status.success(),
            "{words:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        output
    }

    /// Runs a command that must fail with this exit code, and gives what it says.
    fn refused(&self, code: i32, words: &[&str]) -> String {
        let output = self.run(words);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{words:?}: {said}");
        assert!(
            !said.trim().is_empty() && !said.contains("panicked"),
            "{words:?}: {said}"
        );
        said
    }

    fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).expect("the file is there")
    }

    fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.folder.path())
            .expect("readable")
            .flatten()
            .map(|e| e.file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// A blend of a metallic and a solid sample, with few clusters so that it is quick.
    fn with_blend() -> Self {
        let desk = Self::new();
        desk.ok(&[
            "blend",
            "sample:bmw339",
            "sample:blue",
            "--profile",
            "draft",
            "--out",
            "b.blend",
        ]);
        desk
    }
}

fn json(bytes: &[u8]) -> serde_json::Value {
    serde_json::from_slice(bytes).expect("one JSON object")
}

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
fn a_blend_is_realised_as_everything_the_same_on_any_number_of_threads() {
    let desk = Desk::with_blend();
    for name in ["r.zip", "r.glb", "r.json", "r.paint"] {
        let mut seen = Vec::new();
        for threads in ["1", "2", "8"] {
            desk.ok(&[
                "realise",
                "b.blend",
                "--weights",
                "0.3,0.7",
                "--threads",
                threads,
                "--out",
                name,
            ]);
            seen.push(desk.read(name));
        }
        assert!(
            seen[0].len() > 500 && seen.windows(2).all(|w| w[0] == w[1]),
            "{name} differs"
        );
    }
    assert_eq!(
        json(&desk.read("r.json"))["format"]
            .as_str()
            .map(|f| f.starts_with("carpaint")),
        Some(true)
    );
    desk.ok(&[
        "blend",
        "r.paint",
        "sample:white",
        "--profile",
        "draft",
        "--out",
        "again.blend",
    ]);
}

#[test]
fn weights_are_asked_for_and_checked() {
    let desk = Desk::with_blend();
    let out = ["--out", "x.json"];
    let with = |words: &[&'static str]| [&["realise", "b.blend"], words, &out].concat();
    let said = desk.refused(2, &with(&[]));
    assert!(
        said.contains("2 numbers") && said.contains("bmw339, blue"),
        "{said}"
    );
    for weights in ["nan,1", "inf,0", "1", "a,b", "1,2,3", ""] {
        desk.refused(
            2,
            &[
                "realise",
                "b.blend",
                "--weights",
                weights,
                "--out",
                "x.json",
            ],
        );
    }
    assert_eq!(desk.files(), ["b.blend"]);
    for weights in ["-2,3", "0,0", "1e6,-1e6"] {
        desk.ok(&[
            "realise",
            "b.blend",
            "--weights",
            weights,
            "--out",
            "x.json",
        ]);
    }
    desk.refused(
        2,
        &[
            "preview",
            "sample:white",
            "--weights",
            "1,0",
            "--out",
            "x.png",
        ],
    );
}

#[test]
fn previews_are_drawn_in_the_size_asked_for() {
    let desk = Desk::with_blend();
    desk.ok(&[
        "preview",
        "b.blend",
        "--weights",
        "0.5,0.5",
        "--size",
        "40x30",
        "--spp",
        "2",
        "--out",
        "p.png",
    ]);
    let png = desk.read("p.png");
    assert_eq!(
        (&png[..4], &png[16..24]),
        (&b"\x89PNG"[..], &[0, 0, 0, 40, 0, 0, 0, 30][..])
    );
    desk.ok(&[
        "preview",
        "sample:white",
        "--scene",
        "panel",
        "--size",
        "16x16",
        "--spp",
        "1",
        "--out",
        "p.exr",
    ]);
    assert_eq!(desk.read("p.exr")[..4], [0x76, 0x2f, 0x31, 0x01]);
    assert!(
        desk.refused(
            2,
            &[
                "preview",
                "sample:white",
                "--scene",
                "cube",
                "--out",
                "p.png"
            ]
        )
        .contains("capsule")
    );
    desk.refused(
        2,
        &["preview", "sample:white", "--size", "0x5", "--out", "p.png"],
    );
    desk.refused(2, &["preview", "sample:white", "--out", "p.gif"]);
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
fn texels_are_flakes_at_one_angle_pair() {
    let desk = Desk::with_blend();
    let words = [
        "texels",
        "b.blend",
        "--weights",
        "1,0",
        "--theta-h",
        "3",
        "--theta-d",
        "10",
        "--size",
        "32x16",
    ];
    desk.ok(&[&words[..], &["--seed", "4", "--out", "t.exr"]].concat());
    desk.ok(&[&words[..], &["--seed", "5", "--out", "u.exr"]].concat());
    assert_ne!(desk.read("t.exr"), desk.read("u.exr"));
    desk.refused(
        2,
        &[
            "texels",
            "b.blend",
            "--weights",
            "1,0",
            "--theta-h",
            "95",
            "--theta-d",
            "0",
            "--out",
            "t.exr",
        ],
    );
}

#[test]
fn mistakes_are_told_with_their_own_exit_codes() {
    let desk = Desk::new();
    desk.refused(2, &["frobnicate"]);
    desk.refused(2, &["blend", "sample:white", "--out", "b.blend"]);
    desk.refused(
        2,
        &[
            "blend",
            "sample:white",
            "sample:blue",
            "--threads",
            "0",
            "--out",
            "b.blend",
        ],
    );
    desk.refused(
        2,
        &[
            "blend",
            "sample:white",
            "sample:blue",
            "--profile",
            "best",
            "--out",
            "b.blend",
        ],
    );
    desk.refused(3, &["show", "nothing-here"]);
    desk.refused(
        4,
        &[
            "samples",
            "export",
            "white",
            "--out",
            "no/such/folder/w.paint",
        ],
    );
    fs::write(desk.path("white"), b"not a paint").expect("written");
    assert!(
        desk.refused(3, &["show", "white"]).contains("white"),
        "an existing path wins over a sample's name"
    );
    desk.ok(&["show", "sample:white"]);
    desk.ok(&["samples", "export", "white", "--out", "w.paint"]);
    let mut bytes = desk.read("w.paint");
    bytes[16] = 9;
    fs::write(desk.path("newer.paint"), &bytes).expect("written");
    assert!(
        desk.refused(3, &["show", "newer.paint"])
            .contains("version 9")
    );
    bytes.truncate(200);
    fs::write(desk.path("cut.paint"), &bytes).expect("written");
    desk.refused(3, &["show", "cut.paint"]);
    assert_eq!(
        desk.files(),
        ["cut.paint", "newer.paint", "w.paint", "white"],
        "nothing half-written is left"
    );
}

#[test]
fn clusters_other_than_a_paint_has_are_refused() {
    let desk = Desk::new();
    desk.ok(&[
        "samples",
        "export",
        "bmw339",
        "--clusters",
        "12",
        "--out",
        "p.paint",
    ]);
    desk.ok(&["show", "p.paint"]);
    let said = desk.refused(
        2,
        &[
            "blend",
            "p.paint",
            "sample:blue",
            "--clusters",
            "30",
            "--out",
            "b.blend",
        ],
    );
    assert!(said.contains("12") && said.contains("30"), "{said}");
    assert!(!Path::new(&desk.path("b.blend")).exists());
}

#[test]
fn knobs_are_turned_by_name_and_unknown_ones_are_refused_with_what_there_is() {
    let desk = Desk::new();
    let export = |more: &[&'static str]| {
        [
            &["samples", "export", "bmw339"],
            more,
            &["--out", "p.paint"],
        ]
        .concat()
    };
    let few = [
        "--profile",
        "draft",
        "--knob",
        "clusters=9",
        "--knob",
        "angle_step=4",
    ];
    desk.ok(&export(&few));
    let about = json(&desk.ok(&["show", "p.paint", "--json"]).stdout);
    let clustering = &about["flakes"]["clustering"];
    assert_eq!(
        (&clustering["clusters"], &clustering["angle_step"]),
        (&9.into(), &4.into())
    );
    assert_eq!(about["flakes"]["slices"], 49);
    let error = clustering["error"]["lightness_w1"]["p90"]
        .as_f64()
        .expect("measured");
    assert_eq!(about["error"]["lab"].as_f64(), Some(error));
    fs::write(
        desk.path("k.json"),
        r#"{"preset": "draft", "clusters": 9, "angle_step": 4}"#,
    )
    .expect("written");
    let first = desk.read("p.paint");
    desk.ok(&export(&["--profile", "k.json"]));
    assert_eq!(desk.read("p.paint"), first, "a file of knobs says the same");
    let said = desk.refused(2, &export(&["--knob", "cluster=9"]));
    assert!(
        said.contains("cluster") && said.contains("samples_per_pixel"),
        "{said}"
    );
    assert!(
        desk.refused(2, &export(&["--knob", "clusters=0"]))
            .contains("1 to 4096")
    );
    fs::write(
        desk.path("bad.json"),
        r#"{"preset": "draft", "samples": 9}"#,
    )
    .expect("written");
    assert!(
        desk.refused(3, &export(&["--profile", "bad.json"]))
            .contains("samples_per_pixel")
    );
}

#[test]
fn a_target_names_the_profile_that_was_picked_for_it() {
    let desk = Desk::with_blend();
    let realise = |error: &'static str| {
        let words = [
            "realise",
            "b.blend",
            "--weights",
            "0.5,0.5",
            "--json",
            "--max-error",
            error,
        ];
        [&words[..], &["--out", "r.json"]].concat()
    };
    let met = json(&desk.ok(&realise("1000")).stdout);
    assert_eq!(met["picked"]["met"], true);
    let missed = json(&desk.ok(&realise("1e-9")).stdout);
    assert_eq!(missed["picked"]["met"], false);
    assert_eq!(
        missed["picked"]["estimate"]["knobs"]["precision"], "f32",
        "the best there is"
    );
    let made = json(&desk.read("r.json"));
    assert_eq!(made["settings"]["precision"], "f32");
    let stated = &missed["picked"]["estimate"]["error"]["value"];
    assert_eq!(&made["report"]["accuracy"]["error"]["lab"], stated);
    let knobs = ["--max-seconds", "1", "--profile", "draft"];
    desk.refused(2, &[&realise("1")[..], &knobs].concat());
    assert!(desk.refused(2, &realise("0")).contains("--max-error"));
}

/// Coarse, since other tests run beside it; `tests/bench/estimates.rs` is the fine one.
#[test]
fn an_estimate_is_of_the_order_of_what_then_happens() {
    let desk = Desk::new();
    let asked = ["blend", "sample:bmw339", "sample:ford_f8"];
    let estimate = [&["estimate"], &asked[..], &["--json"]].concat();
    let estimate = json(&desk.ok(&estimate).stdout);
    let begun = std::time::Instant::now();
    let made = [&asked[..], &["--json", "--out", "x.blend"]].concat();
    let made = json(&desk.ok(&made).stdout);
    let took = begun.elapsed().as_secs_f64();
    let ratio = estimate["seconds"].as_f64().expect("seconds") / took;
    assert!((0.2..5.0).contains(&ratio), "{estimate} {took}");
    let bytes = desk.read("x.blend").len() as f64;
    let ratio = estimate["bytes"].as_f64().expect("bytes") / bytes;
    assert!((0.8..1.25).contains(&ratio), "{estimate} {bytes}");
    // Of the same slices, so the same but for the transport's gap.
    let stated = estimate["error"]["value"].as_f64().expect("a number");
    let lab = made["error"]["lab"].as_f64().expect("a number");
    assert!((stated - lab).abs() < 1e-6, "{stated} {lab}");
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
fn a_blend_names_the_paints_it_speaks_of_whatever_their_order() {
    let desk = Desk::new();
    for pair in [["blue", "bmw339"], ["bmw339", "blue"]] {
        let words = ["blend", pair[0], pair[1], "--profile", "draft", "--json"];
        let told = json(
            &desk
                .ok(&[&words[..], &["--out", "b.blend"]].concat())
                .stdout,
        );
        let shown = json(&desk.ok(&["show", "b.blend", "--json"]).stdout);
        for correspondence in [&told["correspondence"], &shown["correspondence"]] {
            assert_eq!(
                correspondence["without_flakes"][0]["name"], "blue",
                "{correspondence}"
            );
            let place = correspondence["without_flakes"][0]["place"].as_u64();
            assert_eq!(
                place.and_then(|k| usize::try_from(k).ok()).map(|k| pair[k]),
                Some("blue")
            );
        }
    }
}

#[test]
fn a_realised_paint_remembers_its_weights_and_that_its_flakes_were_simulated() {
    let desk = Desk::with_blend();
    let own = ["--base", "3,-2", "--flake-lightness", "0.5,0.5"];
    let color = ["--flake-color", "1,0", "--out", "r.paint"];
    desk.ok(&[&["realise", "b.blend"][..], &own, &color].concat());
    let about = json(&desk.ok(&["show", "r.paint", "--json"]).stdout);
    let provenance = &about["provenance"];
    assert_eq!(provenance["simulated_flakes"], true);
    let realisation = &provenance["realisation"];
    assert_eq!(
        (&realisation["base"], &realisation["flake_color"]),
        (
            &serde_json::json!([3.0, -2.0]),
            &serde_json::json!([1.0, 0.0])
        )
    );
    let clamps = about["clamps"].as_array().expect("a list");
    assert!(!clamps.is_empty() && about["clamps"] == realisation["clamps"]);
    let text = String::from_utf8(desk.ok(&["show", "r.paint"]).stdout).expect("text");
    assert!(text.contains("\nclamped        "), "{text}");

    // Blended again its clusters are reduced, which the blend keeps.
    let again = ["blend", "sample:white", "r.paint", "--clusters", "5"];
    desk.ok(&[&again[..], &["--out", "again.blend"]].concat());
    let shown = json(&desk.ok(&["show", "again.blend", "--json"]).stdout);
    let reduced = &shown["correspondence"]["reduced"][0];
    assert_eq!((&reduced["place"], &reduced["to"]), (&1.into(), &5.into()));
    assert!(reduced["from"].as_u64() > Some(5), "{reduced}");
    assert_eq!(shown["paints"][1]["simulated_flakes"], true);
}

#[test]
fn options_that_would_be_ignored_are_refused_and_defaults_are_defaults() {
    let desk = Desk::with_blend();
    let preview = ["preview", "b.blend", "--weights", "1,0", "--clusters", "7"];
    let said = desk.refused(2, &[&preview[..], &["--out", "p.png"]].concat());
    assert!(said.contains("--clusters 7"), "{said}");
    let said = desk.refused(2, &["blend", "no-such-file", "--out", "c.blend"]);
    assert!(said.contains("1 paints given"), "counted first: {said}");
    for threads in ["0", ""] {
        let list = Command::new(env!("CARGO_BIN_EXE_carpaint"))
            .env("RAYON_NUM_THREADS", threads)
            .args(["samples", "list"])
            .output();
        assert!(list.expect("the binary starts").status.success());
    }
}

#[cfg(unix)]
#[test]
fn out_replaces_files_and_writes_through_everything_else() {
    use std::io::Read as _;
    use std::os::unix::fs::{FileTypeExt as _, PermissionsExt as _, symlink};
    let desk = Desk::new();
    let export = |out: &str| desk.ok(&["samples", "export", "white", "--out", out]);
    export("new.paint");
    let white = desk.read("new.paint");

    let mode = |name: &str| {
        let about = fs::metadata(desk.path(name)).expect("is there");
        about.permissions().mode() & 0o777
    };
    fs::write(desk.path("plain"), b"").expect("written");
    assert_eq!(mode("new.paint"), mode("plain"), "the umask decides");
    fs::write(desk.path("old.paint"), b"old").expect("written");
    fs::set_permissions(desk.path("old.paint"), fs::Permissions::from_mode(0o640)).expect("is set");
    export("old.paint");
    assert_eq!(
        (mode("old.paint"), desk.read("old.paint")),
        (0o640, white.clone())
    );

    fs::create_dir(desk.path("there")).expect("made");
    symlink("there/real.paint", desk.path("link.paint")).expect("linked");
    for _ in 0..2 {
        export("link.paint");
        assert!(desk.path("link.paint").is_symlink());
        assert_eq!(desk.read("there/real.paint"), white);
    }

    let pipe = desk.path("pipe");
    assert!(
        Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .expect("runs")
            .success()
    );
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || {
            let mut bytes = Vec::new();
            fs::File::open(pipe)
                .and_then(|mut file| file.read_to_end(&mut bytes))
                .map(|_| bytes)
        }
    });
    export("pipe");
    assert_eq!(reader.join().expect("reads").expect("reads"), white);
    let still = fs::symlink_metadata(&pipe).expect("is there");
    assert!(still.file_type().is_fifo(), "a pipe stays a pipe");
}

#[test]
fn a_reader_who_has_heard_enough_is_no_error() {
    use std::process::Stdio;
    let desk = Desk::with_blend();
    for words in [
        &["show", "b.blend"][..],
        &["samples", "list"],
        &["samples", "list", "--json"],
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_carpaint"))
            .current_dir(desk.folder.path())
            .args(words)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("ends");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.success() && said.is_empty(),
            "{words:?}: {said}"
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
