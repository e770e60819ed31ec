//! What is refused, and with which exit code.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::desk::Desk;

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
    fs::write(desk.path("file"), b"").expect("written");
    let said = desk.refused(2, &["study", "--out", "file"]);
    assert!(
        said.contains("file is a file, accepted is a folder"),
        "{said}"
    );
    fs::remove_file(desk.path("file")).expect("removed");
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
