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
