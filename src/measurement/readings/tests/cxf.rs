use super::*;
use crate::color::Observer;

/// A document of objects and specifications.
pub(super) fn document(objects: &str, specifications: &str) -> String {
    format!(
        r#"<?xml version="1.0"?><CxF xmlns="http://colorexchangeformat.com/CxF3-core"><FileInformation><Creator>A lab &amp; son</Creator></FileInformation>
<Resources><ObjectCollection>{objects}</ObjectCollection><ColorSpecificationCollection>{specifications}</ColorSpecificationCollection></Resources></CxF>"#
    )
}

pub(super) fn object(id: &str, name: &str, values: &str) -> String {
    format!(
        r#"<Object ObjectType="Standard" Name="{name}" Id="{id}"><CreationDate>2026-01-02T03:04:05Z</CreationDate><ColorValues>{values}</ColorValues></Object>"#
    )
}

pub(super) fn lab(specification: &str, l: f64) -> String {
    format!(
        r#"<ColorCIELab Name="n{specification}" ColorSpecification="{specification}"><L>{l}</L><A>1</A><B>-2</B></ColorCIELab>"#
    )
}

pub(super) fn specification(id: &str, geometry: &str) -> String {
    format!(
        r#"<ColorSpecification Id="{id}"><TristimulusSpec><Illuminant>D65</Illuminant><Observer>10_Degree</Observer><Method>E308_Table5</Method></TristimulusSpec>
<MeasurementSpec><MeasurementType>Spectrum_Reflectance</MeasurementType><GeometryChoice>{geometry}</GeometryChoice><WavelengthRange StartWL="400" Increment="10"/>
<Device><Manufacturer>Maker</Manufacturer><Model>M-6</Model></Device></MeasurementSpec></ColorSpecification>"#
    )
}

pub(super) fn angle(aspecular: &str) -> String {
    format!(
        r#"<BRDFAngle Notation="45as{aspecular}"><IlluminationAngle>45</IlluminationAngle><Aspecular>{aspecular}</Aspecular></BRDFAngle>"#
    )
}

pub(super) fn at(id: &str, aspecular: &str) -> String {
    specification(
        id,
        &format!("<MultiAngle>{}</MultiAngle>", angle(aspecular)),
    )
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

#[test]
fn most_angles_are_counted_and_not_values() {
    let spectrum = format!(
        r#"<ReflectanceSpectrum ColorSpecification="s15">{}</ReflectanceSpectrum>"#,
        "0.25 ".repeat(31)
    );
    let values = spectrum.repeat(3) + &lab("s15", 90.0) + &lab("s45", 50.0);
    let text = document(
        &object("o1", "silver", &values),
        &(at("s15", "15") + &at("s45", "45")),
    );
    let file = read_as(Layout::Cxf, &text).expect("a paint");
    assert_eq!(angles_of(&file), [15.0, 45.0]);
}

#[test]
fn what_a_document_says_twice_or_too_often_is_refused() {
    let fine = document(&object("o1", "silver", &lab("s15", 90.0)), &at("s15", "15"));
    let twice = document(
        &object("o1", "silver", &lab("s15", 90.0)),
        &(at("s15", "15") + &at("s15", "45")),
    );
    let many = document(
        &object("o1", "silver", &"<ColorCIELab/>".repeat(10_001)),
        &at("s15", "15"),
    );
    let angles = format!("<MultiAngle>{}</MultiAngle>", angle("15").repeat(257));
    let angles = document(
        &object("o1", "silver", &lab("s", 90.0)),
        &specification("s", &angles),
    );
    let spectrum =
        r#"<ReflectanceSpectrum ColorSpecification="s15" StartWL="-100">1</ReflectanceSpectrum>"#;
    let below = document(&object("o1", "silver", spectrum), &at("s15", "15"));
    let declared = |name: &str| fine.replace("\"1.0\"?", &format!("\"1.0\" encoding=\"{name}\"?"));
    for (text, said) in [
        (twice, "several ColorSpecifications have the Id \"s15\""),
        (many, "have 10001 colors, accepted are 10000"),
        (angles, "it lists 257 angles, accepted are 256"),
        (below, "StartWL is \"-100\", accepted is a wavelength in nm"),
        (
            fine.clone() + "and more",
            "the text \"and more\" stands outside the root element",
        ),
        (
            fine.replace("Id=\"o1\"", "Id=\"o1\" Id=\"o2\""),
            "the attribute Id stands twice",
        ),
        (
            declared("ISO-8859-1"),
            "declares the encoding ISO-8859-1, accepted is UTF-8",
        ),
    ] {
        let found = refused(Layout::Cxf, &text);
        assert!(found.contains(said), "{said}: {found}");
    }
    for name in ["utf-8", "US-ASCII"] {
        assert!(read_as(Layout::Cxf, &declared(name)).is_ok());
    }
    assert!(read_as(Layout::Cxf, &(fine + "\n<!-- made by hand -->\n")).is_ok());
}
