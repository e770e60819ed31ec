//! Packages that are well formed, and all the ways in which they are not.

use std::io::{Cursor, Write as _};

use serde_json::{Value, json};
use zip::write::SimpleFileOptions;

use super::*;
use crate::measurement::picture::tests::halves;

const SIDE: usize = 6;

fn manifest() -> Value {
    json!({
        "format": "measured-paint", "version": 1, "name": "silver", "license": "CC0-1.0",
        "color_space": "linear-srgb-d65", "clear_coat": {"ior": 1.5, "thickness_um": 40.0},
        "base": {"model": {
            "diffuse": 0.08, "lobes": [{"weight": [0.1, 0.1, 0.2], "alpha": 0.3, "f0": 0.5}],
            "color_table": {"file": "color_table.exr", "theta_h_deg": [0, 30], "theta_i_deg": [0, 20, 40]}
        }},
        "flakes": {
            "slices": "flakes/{h:02}_{i:02}.exr", "theta_h_deg": [0, 10], "theta_i_deg": [0, 45],
            "texel_um": 20.0, "size_px": [SIDE, SIDE]
        },
        "multi_angle": {
            "illumination_deg": 45, "illuminant": "D65", "observer": "2",
            "columns": ["aspecular_deg", "L", "a", "b"], "rows": [[15, 120.0, 0.5, -1.0], [45, 60.0, 0.0, 0.0]]
        }
    })
}

fn slice(name: &str) -> [f32; 3] {
    let digit = |at: usize| f32::from(name.as_bytes()[at] - b'0');
    [0.25 + digit(8), 0.5, 0.125 * digit(11)]
}

/// The files of a good package, for a manifest.
fn files(manifest: &Value) -> Vec<(String, Vec<u8>)> {
    let mut files = vec![(
        "color_table.exr".to_owned(),
        halves([3, 2], |x, y| [0.5, 0.25 * x as f32, y as f32]),
    )];
    for name in [
        "flakes/00_00.exr",
        "flakes/00_01.exr",
        "flakes/01_00.exr",
        "flakes/01_01.exr",
    ] {
        files.push((name.to_owned(), halves([SIDE, SIDE], |_, _| slice(name))));
    }
    files.push((
        MANIFEST.to_owned(),
        serde_json::to_vec(manifest).expect("JSON"),
    ));
    files
}

fn zipped(files: &[(String, Vec<u8>)], method: zip::CompressionMethod) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        writer
            .start_file(
                name.as_str(),
                SimpleFileOptions::default().compression_method(method),
            )
            .expect("entry");
        writer.write_all(bytes).expect("bytes");
    }
    writer.finish().expect("archive").into_inner()
}

fn open(manifest: &Value) -> Result<Package, PackageError> {
    Package::from_bytes(
        zipped(&files(manifest), zip::CompressionMethod::Stored),
        &Limits::default(),
    )
}

/// What is said about a package whose manifest was changed at a JSON pointer; `null` removes.
fn refusal(pointer: &str, value: Value) -> String {
    let mut manifest = manifest();
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    match manifest.pointer_mut(parent).expect("parent") {
        Value::Object(map) if value.is_null() => drop(map.remove(key)),
        Value::Object(map) => drop(map.insert(key.to_owned(), value)),
        other => other[key.parse::<usize>().expect("index")] = value,
    }
    open(&manifest)
        .map(|_| ())
        .expect_err("refused")
        .to_string()
}

#[test]
fn everything_in_a_good_package_is_found() {
    for method in [
        zip::CompressionMethod::Stored,
        zip::CompressionMethod::Deflated,
    ] {
        let package = Package::from_bytes(zipped(&files(&manifest()), method), &Limits::default())
            .expect("good");
        assert_eq!(
            (package.name.as_str(), package.notes["license"].as_str()),
            ("silver", "CC0-1.0")
        );
        assert_eq!(
            package.coat,
            Some(Coat {
                thickness_um: Some(40.0),
                ..Coat::smooth(1.5)
            })
        );
        let Some(PackageBase::Model {
            diffuse,
            lobes,
            color_table,
        }) = &package.base
        else {
            panic!("a model")
        };
        assert_eq!((*diffuse, lobes[0].weight), ([0.08; 3], [0.1, 0.1, 0.2]));
        let node = color_table.nodes()[5].to_rgb();
        assert!(
            node.iter()
                .zip([0.5, 0.5, 1.0])
                .all(|(x, y)| (x - y).abs() < 1e-12),
            "{node:?}"
        );
        let flakes = package.flakes.expect("flakes");
        let mut room = SliceRoom::default();
        for k in (0..4).rev() {
            flakes.read(k, &mut room).expect("a slice");
            let name = flakes.name(k);
            assert_eq!(
                room.picture.planes.each_ref().map(|p| p[7]),
                slice(&name),
                "{name}"
            );
        }
        let readings = package.multi_angle.expect("readings");
        assert_eq!(readings.rows[1], [45.0, 60.0, 0.0, 0.0]);
        assert!(package.warnings.is_empty(), "{:?}", package.warnings);
    }
}

#[test]
fn a_folder_is_a_package_too() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("flakes")).expect("a folder");
    for (name, bytes) in files(&manifest()) {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    let package = Package::open(folder.path(), &Limits::default()).expect("good");
    let flakes = package.flakes.expect("flakes");
    flakes.read(3, &mut SliceRoom::default()).expect("a slice");
    std::fs::remove_file(folder.path().join("flakes/01_01.exr")).expect("removed");
    let error = flakes
        .read(3, &mut SliceRoom::default())
        .expect_err("gone")
        .to_string();
    assert!(
        error.contains("flakes/01_01.exr is not in the package"),
        "{error}"
    );
    let missing = Package::open(folder.path(), &Limits::default())
        .map(|_| ())
        .expect_err("missing")
        .to_string();
    assert!(missing.contains("flakes/01_01.exr"), "{missing}");
}

#[test]
fn a_field_is_refused_by_path_value_and_what_is_accepted() {
    for (pointer, value, parts) in [
        (
            "/format",
            json!("paint"),
            vec!["format", "\"paint\"", "measured-paint"],
        ),
        (
            "/version",
            json!(2),
            vec!["version is 2", "up to version 1", "update"],
        ),
        ("/version", json!("1"), vec!["version is \"1\""]),
        ("/name", json!(""), vec!["name", "1 to 200"]),
        ("/name", json!(null), vec!["name is missing"]),
        (
            "/color_space",
            json!("rec2020"),
            vec!["color_space", "rec2020", "linear-srgb-d65"],
        ),
        (
            "/clear_coat/ior",
            json!(0.9),
            vec!["clear_coat.ior is 0.9", "1 to 4"],
        ),
        ("/base", json!({}), vec!["base", "exactly one"]),
        (
            "/base/model/lobes/0/alpha",
            json!(-0.1),
            vec!["base.model.lobes[0].alpha is -0.1", "above 0"],
        ),
        (
            "/base/model/lobes/0/weight",
            json!([1, 2]),
            vec!["base.model.lobes[0].weight is [1,2]"],
        ),
        (
            "/base/model/lobes",
            json!([]),
            vec!["base.model.lobes", "1 to 8"],
        ),
        (
            "/base/model/color_table/theta_h_deg",
            json!([30, 30]),
            vec![
                "color_table.theta_h_deg[1] is 30 after 30",
                "above the angle",
            ],
        ),
        (
            "/flakes/theta_h_deg",
            json!([10, 0]),
            vec!["flakes.theta_h_deg[1] is 0 after 10", "above the angle"],
        ),
        (
            "/flakes/theta_i_deg",
            json!([0, 91]),
            vec!["flakes.theta_i_deg[1] is 91", "0 to 90"],
        ),
        (
            "/flakes/slices",
            json!("flakes/{h:02}.exr"),
            vec!["flakes.slices", "{i:02}"],
        ),
        (
            "/flakes/size_px",
            json!([6]),
            vec!["flakes.size_px", "[width, height]"],
        ),
        (
            "/flakes/size_px",
            json!([60000, 60000]),
            vec!["flakes.size_px", "pixels"],
        ),
        (
            "/flakes/texel_um",
            json!(0),
            vec!["flakes.texel_um is 0", "above 0"],
        ),
        (
            "/multi_angle/rows/0",
            json!([15, 1]),
            vec!["multi_angle.rows[0]", "4 numbers"],
        ),
        (
            "/multi_angle/illuminant",
            json!("A"),
            vec!["multi_angle.illuminant is \"A\"", "D65"],
        ),
    ] {
        let text = refusal(pointer, value);
        assert!(text.starts_with("paint.json: "), "{text}");
        assert!(
            parts.iter().all(|part| text.contains(part)),
            "{pointer}: {text}"
        );
    }
}

#[test]
fn readings_need_light_from_above_the_horizon() {
    let text = refusal("/multi_angle/illumination_deg", json!(90));
    let wanted =
        "paint.json: multi_angle.illumination_deg is 90, accepted is degrees from 0 to below 90";
    assert_eq!(text, wanted);
}

#[test]
fn a_column_named_twice_is_refused() {
    let columns = json!(["aspecular_deg", "L", "a", "b", "L"]);
    let text = refusal("/multi_angle/columns", columns);
    let wanted =
        "paint.json: multi_angle.columns[4] is \"L\", accepted is a name that no other column has";
    assert_eq!(text, wanted);
}

#[test]
fn a_manifest_may_begin_with_a_byte_order_mark() {
    let marked = [
        "\u{feff}".as_bytes(),
        &serde_json::to_vec(&manifest()).expect("JSON"),
    ]
    .concat();
    all_of_it(&with_file(MANIFEST, Some(marked))).expect("read");
}

/// A good package with one file replaced; `None` leaves it out.
fn with_file(name: &str, bytes: Option<Vec<u8>>) -> Vec<(String, Vec<u8>)> {
    let mut files = files(&manifest());
    match bytes {
        Some(bytes) => files
            .iter_mut()
            .filter(|(n, _)| n == name)
            .for_each(|(_, b)| b.clone_from(&bytes)),
        None => files.retain(|(n, _)| n != name),
    }
    files
}

/// Everything that is wrong with a package, its slices included.
fn all_of_it(files: &[(String, Vec<u8>)]) -> Result<(), PackageError> {
    let bytes = zipped(files, zip::CompressionMethod::Stored);
    let package = Package::from_bytes(bytes, &Limits::default())?;
    let flakes = package.flakes.expect("flakes");
    (0..flakes.slices()).try_for_each(|k| flakes.read(k, &mut SliceRoom::default()))
}

#[test]
fn a_file_that_is_wrong_is_refused_by_name() {
    let says = |name: &str, bytes: Option<Vec<u8>>, part: &str| {
        let text = all_of_it(&with_file(name, bytes))
            .expect_err("refused")
            .to_string();
        assert!(text.starts_with(name) && text.contains(part), "{text}");
    };
    says("flakes/01_00.exr", None, "not in the package");
    says("color_table.exr", None, "not in the package");
    says(MANIFEST, None, "not in the package");
    says(MANIFEST, Some(b"{\"format\": ".to_vec()), "no JSON");
    says(
        "flakes/01_00.exr",
        Some(halves([6, 7], |_, _| [0.1; 3])),
        "6 x 7",
    );
    says("flakes/01_00.exr", Some(b"no picture".to_vec()), "EXR");
    says(
        "color_table.exr",
        Some(halves([2, 3], |_, _| [0.1; 3])),
        "2 x 3",
    );
    says(
        "color_table.exr",
        Some(halves([3, 2], |_, _| [f32::NAN; 3])),
        "not finite",
    );
    says(
        "color_table.exr",
        Some(halves([3, 2], |_, _| [60000.0; 3])),
        "beyond 2000",
    );
    // One dead pixel of 36 is 2.8 %, two are 5.6 %.
    let dying = |most: usize| {
        halves([SIDE, SIDE], move |x, y| {
            if y == 0 && x < most {
                [f32::NAN; 3]
            } else {
                [0.1; 3]
            }
        })
    };
    assert!(all_of_it(&with_file("flakes/01_00.exr", Some(dying(1)))).is_ok());
    says("flakes/01_00.exr", Some(dying(2)), "2 pixels of 36");
}

#[test]
fn a_cut_archive_is_refused_and_a_changed_one_never_more_than_that() {
    let bytes = zipped(&files(&manifest()), zip::CompressionMethod::Deflated);
    for length in (0..bytes.len()).step_by(7) {
        let cut = Package::from_bytes(bytes[..length].to_vec(), &Limits::default());
        assert!(cut.is_err(), "cut at {length}");
    }
    for k in (0..bytes.len()).step_by(3) {
        let mut changed = bytes.clone();
        changed[k] ^= 0x55;
        if let Ok(Package {
            flakes: Some(flakes),
            ..
        }) = Package::from_bytes(changed, &Limits::default())
        {
            let mut room = SliceRoom::default();
            for slice in 0..flakes.slices().min(4) {
                let _ = flakes.read(slice, &mut room);
            }
        }
    }
}

#[test]
fn limits_hold_for_what_an_archive_unpacks_to() {
    let bytes = zipped(&files(&manifest()), zip::CompressionMethod::Deflated);
    let small = Limits {
        entries: 5,
        ..Limits::default()
    };
    let text = Package::from_bytes(bytes.clone(), &small)
        .map(|_| ())
        .expect_err("too many")
        .to_string();
    assert!(text.contains("6 files") && text.contains('5'), "{text}");
    // A bomb: a color table's name on sixteen megabytes of zeros.
    let bomb = zipped(
        &with_file("color_table.exr", Some(vec![0; 16 << 20])),
        zip::CompressionMethod::Deflated,
    );
    assert!(bomb.len() < 100_000);
    let text = Package::from_bytes(bomb, &Limits::default())
        .map(|_| ())
        .expect_err("a bomb")
        .to_string();
    assert!(
        text.contains("color_table.exr") && text.contains("bytes"),
        "{text}"
    );
}

#[test]
fn a_key_that_nobody_knows_is_told_but_not_refused() {
    let mut manifest = manifest();
    manifest["flake"] = json!({});
    manifest["flakes"]["texel_mm"] = json!(1);
    let package = open(&manifest).expect("good all the same");
    assert_eq!(package.warnings.len(), 2);
    assert!(package.warnings[0].contains("\"flake\"") && package.warnings[1].contains("texel_mm"));
}

#[test]
fn a_key_that_stands_twice_is_refused_by_name() {
    let text = manifest().to_string();
    for (once, twice, key) in [
        (r#""version":1"#, r#""version":1,"version":1"#, "version"),
        (r#""ior":1.5"#, r#""ior":1.5,"ior":1.4"#, "ior"),
        (r#""alpha":0.3"#, r#""alpha":0.3,"\u0061lpha":0.3"#, "alpha"),
    ] {
        assert!(text.contains(once), "{once}");
        let mut files = files(&manifest());
        let written = text.replacen(once, twice, 1).into_bytes();
        files.last_mut().expect("the manifest").1 = written;
        let archive = zipped(&files, zip::CompressionMethod::Stored);
        let refused = Package::from_bytes(archive, &Limits::default()).expect_err("twice");
        let told = refused.to_string();
        let want = format!("{MANIFEST} is damaged: the key {key:?} stands twice");
        assert!(told.starts_with(&want), "{told}");
    }
}
