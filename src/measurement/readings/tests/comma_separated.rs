use super::*;
use crate::color::{Illuminant, Observer};

fn csv(text: &str) -> ReadingsFile {
    read_as(Layout::Csv, text).expect("a table of readings")
}

#[test]
fn a_table_of_readings_is_found_out_and_read() {
    for text in [
        TABLE.to_owned(),
        format!("\u{feff}# a remark\n\n{TABLE}"),
        TABLE.replace("aspecular_deg", "\"aspecular_deg\""),
    ] {
        assert_eq!(
            sniff(text.as_bytes(), &ReadOptions::default()),
            Ok(Layout::Csv),
            "{text}"
        );
        let file = csv(&text);
        assert_eq!(angles_of(&file), [-15.0, 15.0, 45.0]);
        assert_eq!(file.readings.rows[1], [15.0, 95.25, -0.6, 0.9]);
        assert!(
            file.warnings[0].contains("illumination_deg 45, illuminant D65, observer 2"),
            "{:?}",
            file.warnings
        );
    }
}

#[test]
fn remarks_say_what_a_table_cannot() {
    let file = csv(&format!(
        "# name: my silver,,,\n#illuminant:D50\n# observer: 10\n# illumination_deg: 15.5\n# instrument: M-6\n# weather: fine\n{TABLE}"
    ));
    assert_eq!(file.name.as_deref(), Some("my silver"));
    let of = &file.readings;
    assert_eq!(
        (of.illuminant, of.observer, of.illumination_deg),
        (Illuminant::D50, Observer::Ten, 15.5)
    );
    assert_eq!(file.notes["instrument"], "M-6");
    assert!(
        file.warnings.len() == 1 && file.warnings[0].contains("\"weather\""),
        "{:?}",
        file.warnings
    );
    for (remark, said) in [
        (
            "illuminant: A",
            "line 1: illuminant is \"A\", accepted is D65 or D50",
        ),
        ("observer: 3", "observer is \"3\""),
        ("illumination_deg: 90", "illumination_deg is \"90\""),
        ("name: ", "name is \"\""),
    ] {
        let text = refused(Layout::Csv, &format!("# {remark}\n{TABLE}"));
        assert!(text.contains(said), "{text}");
    }
}

#[test]
fn european_tables_have_semicolons_and_decimal_commas() {
    let file =
        csv("aspecular_deg;L;a;b;graininess\n15;95,25;-0,6;0,9;3,1\n45;48.7;-0,9;-1,2;2\n;;;;\n");
    assert_eq!(file.readings.rows[0], [15.0, 95.25, -0.6, 0.9, 3.1]);
    assert_eq!(file.readings.rows.len(), 2);
    let text = refused(Layout::Csv, "aspecular_deg,L,a,b\n15,95,25,-0,6,0,9\n");
    assert!(
        text.contains("line 2 has 7 values, accepted are 4") && text.contains("semicolons"),
        "{text}"
    );
}

#[test]
fn columns_come_in_any_order_and_spectra_in_place_of_colors() {
    let file = csv("aspecular_deg,b,operator,a,L\n15,0.9,me,-0.6,95\n");
    assert_eq!(file.readings.columns, ["aspecular_deg", "b", "a", "L"]);
    assert!(file.warnings[0].contains("\"operator\""));
    let colors = file.readings.colors().expect("colors");
    assert_eq!(colors.rows[0].1, [95.0, -0.6, 0.9].into());
    let bands: Vec<String> = (20..=35).map(|k| format!("nm{}", 20 * k)).collect();
    let file = csv(&format!(
        "aspecular_deg,{}\n45{}\n",
        bands.join(","),
        ",0.18".repeat(16)
    ));
    assert!((file.readings.colors().expect("a spectrum").rows[0].1.l - 49.5).abs() < 0.1);
    assert!(
        !file.warnings[0].contains("observer"),
        "{:?}",
        file.warnings
    );
}

#[test]
fn a_table_that_is_wrong_is_refused_by_line_and_column() {
    for (text, said) in [
        ("", "line 1 names the columns \"\""),
        (
            "angle,L,a,b\n1,2,3,4\n",
            "line 1 names the columns \"angle, L, a, b\"",
        ),
        (
            "L,a,b,aspecular_deg\n1,2,3,4\n",
            "accepted are aspecular_deg first",
        ),
        ("aspecular_deg,L,a,b,a\n1,2,3,4,5\n", "each once"),
        ("aspecular_deg,L,a,b\n", "0 readings, accepted are 1 to 256"),
        (
            "# x\n\naspecular_deg,L,a,b\n15,50,,0\n",
            "line 4, column a: the value is \"\"",
        ),
        (
            "aspecular_deg,L,a,b\n15,50,0,0\n181,50,0,0\n",
            "line 3, column aspecular_deg: the value is \"181\"",
        ),
        (
            "aspecular_deg,L,a,b\n15,nan,0,0\n",
            "line 2, column L: the value is \"nan\"",
        ),
        ("aspecular_deg,L,a,b\n15,1e9,0,0\n", "column L"),
    ] {
        let found = refused(Layout::Csv, text);
        assert!(found.contains(said), "{text:?}: {found}");
    }
    let long = format!("aspecular_deg,L,a,b\n{}", "15,50,0,0\n".repeat(257));
    assert!(refused(Layout::Csv, &long).contains("257 readings, accepted are 1 to 256"));
    let wide: Vec<u8> = TABLE.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let wide = [b"\xff\xfe".to_vec(), wide].concat();
    let error = sniff(&wide, &ReadOptions::default())
        .expect_err("UTF-16")
        .to_string();
    assert!(error.contains("UTF-16"), "{error}");
    let error =
        ReadingsFile::read(&wide, Layout::Csv, None, &Limits::default()).expect_err("UTF-16");
    assert_eq!(error.to_string(), "the text is UTF-16, accepted is UTF-8");
    let latin = ReadingsFile::read(b"# \xb0\n", Layout::Csv, None, &Limits::default())
        .expect_err("Latin-1");
    assert!(latin.to_string().contains("no UTF-8 at byte 2"));
}

#[test]
fn remarks_are_read_wherever_they_stand_and_may_not_contradict() {
    let file = csv(
        "aspecular_deg,L,a,b\n# illuminant: D50\n15,90,0,0\n# observer: 10\n# observer: 10°\n45,50,0,0\n# name: x\n",
    );
    assert_eq!(
        (file.readings.illuminant, file.readings.observer),
        (Illuminant::D50, Observer::Ten)
    );
    assert_eq!(
        (file.readings.rows.len(), file.name.as_deref()),
        (2, Some("x"))
    );
    let text = refused(
        Layout::Csv,
        &format!("# illuminant: D50\n{TABLE}# illuminant: D65\n"),
    );
    assert!(
        text.contains("line 6: illuminant is \"D65\", line 1 says \"D50\", accepted is one"),
        "{text}"
    );
}

#[test]
fn lines_end_in_any_way() {
    for end in ["\r", "\n", "\r\n"] {
        let text = format!("# name: x\n\n{}", TABLE.replace("\r\n", "\n")).replace('\n', end);
        assert_eq!(
            sniff(text.as_bytes(), &ReadOptions::default()),
            Ok(Layout::Csv)
        );
        let file = csv(&text);
        assert_eq!(
            (file.readings.rows.len(), file.name.as_deref()),
            (3, Some("x"))
        );
        let text = refused(Layout::Csv, &text.replace("48.7", "x"));
        assert!(text.contains("line 6, column L"), "{text}");
    }
}

#[test]
fn names_of_columns_have_letters_of_any_case_where_that_is_clear() {
    let text = "Aspecular_deg,l,A,B,NM400\n15,1,2,3,4\n";
    assert_eq!(
        sniff(text.as_bytes(), &ReadOptions::default()),
        Ok(Layout::Csv)
    );
    assert_eq!(
        csv(text).readings.columns,
        ["aspecular_deg", "L", "a", "b", "nm400"]
    );
    let file = csv("aspecular_deg,L,a,b,R,G,B\n15,1,2,3,4,5,6\n");
    assert_eq!(file.readings.rows, [[15.0, 1.0, 2.0, 3.0]]);
}

#[test]
fn a_table_without_names_is_told_that_it_lacks_them() {
    let text = "15,90,0,0\n45,30,0,0\n";
    assert_eq!(
        sniff(text.as_bytes(), &ReadOptions::default()),
        Ok(Layout::Csv)
    );
    let said = refused(Layout::Csv, text);
    assert!(
        said.contains("line 1 is \"15,90,0,0\", accepted is a first line that names the columns"),
        "{said}"
    );
}

#[test]
fn lines_of_more_than_a_table_has_are_refused_before_they_are_read() {
    for (text, said) in [
        (
            format!("{TABLE}{}\n", "1,".repeat(20_000)),
            "line 5 has 20001 values, accepted are 4",
        ),
        (
            format!("{TABLE}{}\n", "1".repeat(70_000)),
            "line 5 has 70000 bytes, accepted are 65536",
        ),
        (
            format!("aspecular_deg{}\n", ",x".repeat(1000)),
            "line 1 names the columns",
        ),
        (
            format!("{TABLE}15,\"1,2,3\n"),
            "line 5 begins a quote that does not end, accepted are",
        ),
    ] {
        let found = refused(Layout::Csv, &text);
        assert!(found.contains(said), "{found}");
    }
}

#[test]
fn texture_may_be_empty_at_some_angles_and_color_may_not() {
    let file = csv("aspecular_deg,L,a,b,graininess\n15,90,0,0,\n45,50,0,0,3\n110,30,0,0,\n,,,,\n");
    assert_eq!(file.readings.texture_notes()["graininess"], "45°: 3");
    assert!(
        refused(Layout::Csv, "aspecular_deg,L,a,b,graininess\n15,,0,0,3\n").contains("column L")
    );
}

#[test]
fn a_spectrum_that_is_not_usable_leaves_lab_with_a_warning() {
    let file = csv("aspecular_deg,L,a,b,nm550\n15,90,0,0,.5\n45,50,0,0,.2\n");
    let warning = file.warnings.last().expect("a warning");
    assert!(
        warning.starts_with("L, a, b were taken, the spectra are not usable"),
        "{warning}"
    );
    let assumed = |text: &str| csv(text).warnings.join("; ").contains("illuminant D65");
    assert!(assumed("aspecular_deg,L,a,b,nm550\n15,90,0,0,.5\n"));
    let spectra: Vec<String> = (40..=70).map(|tens| format!("nm{tens}0")).collect();
    let values = [".5"; 31].join(",");
    assert!(!assumed(&format!(
        "aspecular_deg,{}\n15,{values}\n",
        spectra.join(",")
    )));
}
