use super::cxf::{at, document, lab, object};
use super::*;

#[test]
fn objects_of_one_angle_each_are_one_paint() {
    let specifications = at("s15", "15") + &at("s45", "45");
    let of = |names: [&str; 2]| {
        document(
            &(object("o1", names[0], &lab("s15", 90.0))
                + &object("o2", names[1], &lab("s45", 50.0))),
            &specifications,
        )
    };
    for (names, name) in [
        (["silver", "silver"], "silver"),
        (["silver 15°", "silver 45°"], "silver"),
    ] {
        let file = read_as(Layout::Cxf, &of(names)).expect("a paint");
        assert_eq!(
            (angles_of(&file), file.name.as_deref()),
            (vec![15.0, 45.0], Some(name))
        );
        assert!(
            file.warnings[0].contains("2 objects were joined as one paint, \"silver\""),
            "{:?}",
            file.warnings
        );
    }
}

#[test]
fn of_several_paints_one_must_be_asked_for() {
    let specifications = at("s15", "15") + &at("s45", "45");
    let values = |l| lab("s15", l) + &lab("s45", l);
    let text = document(
        &(object("o1", "silver", &values(80.0)) + &object("o2", "blue", &values(20.0))),
        &specifications,
    );
    let said = refused(Layout::Cxf, &text);
    assert!(
        said.contains("holds 2 paints") && said.contains("\"silver\" (Id o1), \"blue\" (Id o2)"),
        "{said}"
    );
    for wanted in ["blue", "o2"] {
        let file = ReadingsFile::read(
            text.as_bytes(),
            Layout::Cxf,
            Some(wanted),
            &Limits::default(),
        )
        .expect("one of them");
        assert_eq!(
            (file.readings.rows[0][1], file.name.as_deref()),
            (20.0, Some("blue"))
        );
        assert_eq!(file.asked_by_id, wanted == "o2");
    }
    let said = refused_of(&text, Some("red"));
    assert!(
        said.contains("no paint of the document has the name or Id \"red\"")
            && said.contains("\"blue\" (Id o2)")
            && said.contains("--name"),
        "{said}"
    );
}

fn refused_of(text: &str, wanted: Option<&str>) -> String {
    ReadingsFile::read(text.as_bytes(), Layout::Cxf, wanted, &Limits::default())
        .expect_err("refused")
        .to_string()
}

fn wanted(text: &str, wanted: &str) -> ReadingsFile {
    ReadingsFile::read(
        text.as_bytes(),
        Layout::Cxf,
        Some(wanted),
        &Limits::default(),
    )
    .expect("one of them")
}

#[test]
fn paints_of_an_angle_each_are_not_joined() {
    let specifications = at("s15", "15") + &at("s45", "45");
    for names in [
        ["red", "blue"],
        ["red 15", "blue 45"],
        ["red 101", "red 102"],
    ] {
        let text = document(
            &(object("o1", names[0], &lab("s15", 90.0))
                + &object("o2", names[1], &lab("s45", 50.0))),
            &specifications,
        );
        assert!(refused_of(&text, None).contains("holds 2 paints"));
        let file = wanted(&text, names[1]);
        assert_eq!(
            (angles_of(&file), file.name.as_deref()),
            (vec![45.0], Some(names[1]))
        );
    }
    let text = document(
        &(object("o1", "red 15", &lab("s15", 90.0))
            + &object("o2", "red 45", &lab("s45", 50.0)).replace("Standard", "Trial")),
        &specifications,
    );
    assert!(refused_of(&text, None).contains("holds 2 paints"));
}

#[test]
fn objects_of_one_name_that_share_an_angle_are_several_paints() {
    let specifications = at("s15", "15") + &at("s45", "45");
    let values = |l| lab("s15", l) + &lab("s45", l);
    let text = document(
        &(object("1", "P", &values(80.0)) + &object("2", "P", &values(20.0))),
        &specifications,
    );
    for asked in [None, Some("P")] {
        let said = refused_of(&text, asked);
        assert!(said.contains("\"P\" (Id 1), \"P\" (Id 2)"), "{said}");
    }
    assert!(refused_of(&text, Some("P")).starts_with("CxF: 2 paints of the document have"));
    let file = wanted(&text, "2");
    assert_eq!(
        (file.readings.rows[0][1], file.name.as_deref()),
        (20.0, Some("P"))
    );
    let nameless = text.replace(" Name=\"P\"", "");
    assert!(refused_of(&nameless, None).contains("\"\" (Id 1), \"\" (Id 2)"));
    assert_eq!(wanted(&nameless, "1").readings.rows[0][1], 80.0);
}

#[test]
fn only_the_paint_that_is_taken_is_told_about() {
    let values = |l| lab("s15", l) + &lab("none", l);
    let text = document(
        &(object("o1", "silver", &(values(80.0) + &lab("none", 1.0)))
            + &object("o2", "blue", &values(20.0))
            + &object("o3", "bad", &lab("none", 1.0))),
        &at("s15", "15"),
    );
    let file = wanted(&text, "blue");
    assert_eq!(file.warnings.len(), 1, "{:?}", file.warnings);
    assert!(
        file.warnings[0].starts_with("1 value is no reading and was not read, that of \"blue\""),
        "{:?}",
        file.warnings
    );
    let said = refused_of(&text, Some("bad"));
    assert!(
        said.contains("\"bad\" (Id o3) was asked for and holds no reading"),
        "{said}"
    );
}
