use super::*;
use crate::color::{Illuminant, Observer};
use crate::measurement::{ReadOptions, sniff};
use proptest::prelude::*;

const TABLE: &str =
    "aspecular_deg,L,a,b\r\n-15,90.5,-0.5,1\r\n15,95.25,-0.6,0.9\r\n45,48.7,-0.9,-1.2\r\n";

fn read_as(layout: Layout, text: &str) -> Result<ReadingsFile, ReadingsError> {
    ReadingsFile::read(text.as_bytes(), layout, None, &Limits::default())
}

fn csv(text: &str) -> ReadingsFile {
    read_as(Layout::Csv, text).expect("a table of readings")
}

fn refused(layout: Layout, text: &str) -> String {
    read_as(layout, text).expect_err("refused").to_string()
}

/// A document of objects and specifications.
fn document(objects: &str, specifications: &str) -> String {
    format!(
        r#"<?xml version="1.0"?><CxF xmlns="http://colorexchangeformat.com/CxF3-core"><FileInformation><Creator>A lab &amp; son</Creator></FileInformation>
<Resources><ObjectCollection>{objects}</ObjectCollection><ColorSpecificationCollection>{specifications}</ColorSpecificationCollection></Resources></CxF>"#
    )
}

fn object(id: &str, name: &str, values: &str) -> String {
    format!(
        r#"<Object ObjectType="Standard" Name="{name}" Id="{id}"><CreationDate>2026-01-02T03:04:05Z</CreationDate><ColorValues>{values}</ColorValues></Object>"#
    )
}

fn lab(specification: &str, l: f64) -> String {
    format!(
        r#"<ColorCIELab Name="n{specification}" ColorSpecification="{specification}"><L>{l}</L><A>1</A><B>-2</B></ColorCIELab>"#
    )
}

fn specification(id: &str, geometry: &str) -> String {
    format!(
        r#"<ColorSpecification Id="{id}"><TristimulusSpec><Illuminant>D65</Illuminant><Observer>10_Degree</Observer><Method>E308_Table5</Method></TristimulusSpec>
<MeasurementSpec><MeasurementType>Spectrum_Reflectance</MeasurementType><GeometryChoice>{geometry}</GeometryChoice><WavelengthRange StartWL="400" Increment="10"/>
<Device><Manufacturer>Maker</Manufacturer><Model>M-6</Model></Device></MeasurementSpec></ColorSpecification>"#
    )
}

fn angle(aspecular: &str) -> String {
    format!(
        r#"<BRDFAngle Notation="45as{aspecular}"><IlluminationAngle>45</IlluminationAngle><Aspecular>{aspecular}</Aspecular></BRDFAngle>"#
    )
}

fn at(id: &str, aspecular: &str) -> String {
    specification(
        id,
        &format!("<MultiAngle>{}</MultiAngle>", angle(aspecular)),
    )
}

fn angles_of(file: &ReadingsFile) -> Vec<f64> {
    file.readings.rows.iter().map(|row| row[0]).collect()
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
        ("aspecular_deg,L,a,b\n", "0 readings, accepted are 1 to 181"),
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
    let long = format!("aspecular_deg,L,a,b\n{}", "15,50,0,0\n".repeat(182));
    assert!(refused(Layout::Csv, &long).contains("182 readings, accepted are 1 to 181"));
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
fn an_object_with_a_value_for_each_angle_is_a_paint() {
    let text = document(
        &object(
            "o1",
            "silver",
            &(lab("s15", 90.0) + &lab("s45", 50.0) + &lab("s110", 20.0)),
        ),
        &(at("s15", "15") + &at("s45", "45.0") + &at("s110", "110")),
    );
    assert_eq!(
        sniff(text.as_bytes(), &ReadOptions::default()),
        Ok(Layout::Cxf)
    );
    let file = read_as(Layout::Cxf, &text).expect("a paint");
    assert_eq!(file.name.as_deref(), Some("silver"));
    assert_eq!(
        file.readings.rows,
        [
            [15.0, 90.0, 1.0, -2.0],
            [45.0, 50.0, 1.0, -2.0],
            [110.0, 20.0, 1.0, -2.0]
        ]
    );
    assert_eq!(
        (file.readings.observer, file.readings.illumination_deg),
        (Observer::Ten, 45.0)
    );
    let notes: Vec<(&str, &str)> = file
        .notes
        .iter()
        .map(|(k, v)| (k.as_str(), v.as_str()))
        .collect();
    assert_eq!(
        notes,
        [
            ("creator", "A lab & son"),
            ("instrument", "Maker M-6"),
            ("measured_on", "2026-01-02T03:04:05Z")
        ]
    );
    assert!(file.warnings.is_empty());
}

#[test]
fn a_value_names_its_angle_where_a_specification_lists_several() {
    let several = specification(
        "s",
        &format!("<MultiAngle>{}{}</MultiAngle>", angle("15"), angle("45")),
    );
    let value = |name: &str| lab("s", 50.0).replace("ns", name);
    let file = read_as(
        Layout::Cxf,
        &document(
            &object("o1", "silver", &(value("45as45") + &value("45as15"))),
            &several,
        ),
    );
    assert_eq!(angles_of(&file.expect("a paint")), [45.0, 15.0]);
    let text = refused(
        Layout::Cxf,
        &document(&object("o1", "silver", &value("else")), &several),
    );
    assert!(
        text.contains("\"silver\" (Id o1)")
            && text.contains("lists 2 angles and the value's Name is else"),
        "{text}"
    );
}

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
    }
    assert!(
        ReadingsFile::read(
            text.as_bytes(),
            Layout::Cxf,
            Some("red"),
            &Limits::default()
        )
        .is_err()
    );
}

#[test]
fn spectra_win_over_colors_of_the_same_angle() {
    let spectrum = format!(
        r#"<ReflectanceSpectrum ColorSpecification="s15" StartWL="400">{}</ReflectanceSpectrum>"#,
        "0.25 ".repeat(31)
    );
    let file = read_as(
        Layout::Cxf,
        &document(
            &object("o1", "silver", &(lab("s15", 90.0) + &spectrum)),
            &at("s15", "15"),
        ),
    )
    .expect("a paint");
    assert_eq!(
        (
            file.readings.columns.len(),
            file.readings.columns[31].as_str()
        ),
        (32, "nm700")
    );
    assert!(file.warnings.is_empty(), "{:?}", file.warnings);
    let short = spectrum.replace(&"0.25 ".repeat(10), "");
    let text = document(
        &object("o1", "silver", &(lab("s15", 90.0) + &short)),
        &at("s15", "15"),
    );
    let file = read_as(Layout::Cxf, &text).expect("a paint");
    assert_eq!(file.readings.rows, [[15.0, 90.0, 1.0, -2.0]]);
    assert!(
        file.warnings[0].contains("the spectrum goes from 400"),
        "{:?}",
        file.warnings
    );
    let xyz = r#"<ColorCIEXYZ ColorSpecification="s15"><X>94.811</X><Y>100</Y><Z>107.304</Z></ColorCIEXYZ>"#;
    let file = read_as(
        Layout::Cxf,
        &document(&object("o1", "white", xyz), &at("s15", "15")),
    )
    .expect("a paint");
    assert!(
        file.readings.rows[0]
            .iter()
            .zip([15.0, 100.0, 0.0, 0.0])
            .all(|(x, y)| (x - y).abs() < 1e-9)
    );
}

#[test]
fn other_geometries_are_refused_by_object_and_told_beside_readings() {
    let single = |a: u8, b: u8| {
        let angles = format!(
            "<IlluminationAngle>{a}</IlluminationAngle><MeasurementAngle>{b}</MeasurementAngle>"
        );
        specification(
            "s",
            &format!(
                "<SingleAngle><SingleAngleConfiguration>Annular</SingleAngleConfiguration>{angles}</SingleAngle>"
            ),
        )
    };
    for (a, b) in [(45, 0), (0, 45)] {
        let file = read_as(
            Layout::Cxf,
            &document(&object("o1", "white", &lab("s", 50.0)), &single(a, b)),
        )
        .expect("one angle");
        assert_eq!(
            (angles_of(&file), file.readings.illumination_deg),
            (vec![45.0], 45.0)
        );
    }
    let azimuth = angle("15").replace("</BRDFAngle>", "<Azimuth>90</Azimuth></BRDFAngle>");
    for (specification, said) in [
        (
            specification("s", "<SphereGeometry>Specular_Excluded</SphereGeometry>"),
            "its geometry is SphereGeometry",
        ),
        (
            specification("s", "<UnknownGeometry>?</UnknownGeometry>"),
            "its geometry is UnknownGeometry",
        ),
        (
            specification("s", &format!("<MultiAngle>{azimuth}</MultiAngle>")),
            "out of the plane",
        ),
        (specification("s", "<MultiAngle/>"), "holds no BRDFAngle"),
        (specification("s", ""), "says no geometry"),
        (single(45, 20), "its SingleAngle is of 20° and 45°"),
        (at("s", "x"), "its Aspecular is x"),
        (
            at("s", "15").replace("Spectrum_Reflectance", "Spectrum_Emissive"),
            "its measurement is Spectrum_Emissive",
        ),
        (at("s", "15").replace("D65", "A"), "its illuminant is A"),
        (
            at("other", "15"),
            "refers to ColorSpecification \"s\", which is not there",
        ),
    ] {
        let text = refused(
            Layout::Cxf,
            &document(&object("o1", "white", &lab("s", 50.0)), &specification),
        );
        assert!(
            text.contains("\"white\" (Id o1)") && text.contains(said),
            "{text}"
        );
        if !specification.contains("Id=\"other\"") {
            let both = document(
                &object("o1", "white", &(lab("s", 50.0) + &lab("t", 60.0))),
                &(specification + &at("t", "45")),
            );
            let file = read_as(Layout::Cxf, &both).expect("the other is one");
            assert!(
                angles_of(&file) == [45.0] && file.warnings[0].contains(said),
                "{:?}",
                file.warnings
            );
        }
    }
}

#[test]
fn documents_that_are_none_or_never_end_are_refused() {
    let fine = document(&object("o1", "silver", &lab("s15", 90.0)), &at("s15", "15"));
    let bomb = fine.replace(
        "<CxF",
        "<!DOCTYPE CxF [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><CxF",
    );
    let deep = fine.replace("<ObjectCollection>", &"<ObjectCollection>".repeat(100));
    let many = fine.replace(
        "<ObjectCollection>",
        &format!("<ObjectCollection>{}", "<a/>".repeat(200_001)),
    );
    let long = fine.replace("Id=\"o1\"", &format!("Id=\"{}\"", "o".repeat(70_000)));
    let foreign = fine.replace("<FileInformation>", &"<x:y xmlns:x=\"other\">".repeat(100));
    for (text, said) in [
        (bomb, "declares a document type"),
        (fine.replace("A lab &amp; son", "&lab;"), "the entity &lab;"),
        (deep, "more than 64 deep"),
        (foreign, "more than 64 deep"),
        (many, "more than 200000 elements"),
        (long, "a tag of"),
        (fine.replace("</Resources>", ""), "damaged near byte"),
        (fine.replace("</CxF>", ""), "ends before"),
        (fine.replace("CxF3-core", "cxf2"), "the root is <CxF>"),
        (
            fine.replace("CxF ", "Else ").replace("</CxF>", "</Else>"),
            "the root is <Else>",
        ),
        (
            format!("{fine}<CxF xmlns=\"http://colorexchangeformat.com/CxF3-core\"/>"),
            "the root is <CxF>",
        ),
        (
            fine.replace("<L>90</L>", "<L>ninety</L>"),
            "L is \"ninety\"",
        ),
        (document("", ""), "holds no Object"),
        (String::new(), "ends before"),
    ] {
        let found = refused(Layout::Cxf, &text);
        assert!(found.contains(said), "{said}: {found}");
    }
    assert!(
        read_as(
            Layout::Cxf,
            &fine.replace("A lab", "A &#x6c;ab &lt;<![CDATA[<]]>")
        )
        .is_ok()
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]
    /// Bytes changed, cut and doubled anywhere make readings or an error, never a panic.
    #[test]
    fn damage_is_an_error_at_worst(
        is_table in any::<bool>(), at_share in 0.0..1.0_f64, length in 0..40_usize,
        put in prop::collection::vec(prop_oneof![any::<u8>(), prop::sample::select(b"<>&\"'/=,;#.\n -9e".to_vec())], 0..12),
    ) {
        let several = specification("s", &format!("<MultiAngle>{}{}</MultiAngle>", angle("15"), angle("45")));
        let (layout, mut bytes) = if is_table {
            (Layout::Csv, format!("# name: x\n# observer: 10\n{TABLE}").into_bytes())
        } else {
            let values = lab("s15", 90.0) + &lab("s", 5.0).replace("ns", "45as45");
            (Layout::Cxf, document(&object("o1", "silver", &values), &(at("s15", "15") + &several)).into_bytes())
        };
        let from = (at_share * bytes.len() as f64) as usize;
        let to = (from + length).min(bytes.len());
        bytes.splice(from..to, put);
        let _ = sniff(&bytes, &ReadOptions::default());
        if let Ok(file) = ReadingsFile::read(&bytes, layout, None, &Limits::default()) {
            let _ = file.readings.colors();
            let _ = file.readings.texture_notes();
        }
    }
}
