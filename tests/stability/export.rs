//! Numbers on their way into files: nothing that is no number, no overflow and no subnormal half is ever written.

use crate::paints::{D, H, at, blend, extreme, metallic, pairs, solid};
use carpaint::accuracy::Profile;
use carpaint::export::{About, ExportError, ExportSettings, Precision, bundle, glb};
use carpaint::paint::{CarPaint, Chi, Coat, Direction, Limits, Provenance};
use carpaint::render::{FilmError, Scene, Shape, render, texels};
use carpaint::workshop::{Pairs, Thing, bundle_blend, evaluate};
use std::io::{Cursor, Read};

fn about() -> About {
    About {
        name: "hard".into(),
        provenance: Provenance {
            source: "sample".into(),
            ..Provenance::default()
        },
        report: serde_json::Value::Null,
    }
}

fn files(paint: &CarPaint, precision: Precision) -> Vec<(String, Vec<u8>)> {
    let settings = ExportSettings {
        precision,
        ..ExportSettings::default()
    };
    unpacked(bundle(paint, &about(), &settings).expect("a bundle"))
}

fn unpacked(bytes: Vec<u8>) -> Vec<(String, Vec<u8>)> {
    let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).expect("a zip");
    (0..zip.len())
        .map(|k| {
            let mut file = zip.by_index(k).expect("a file");
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).expect("readable");
            (file.name().expect("UTF-8").into_owned(), bytes)
        })
        .collect()
}

/// The halves of an EXR file, as another reader of the format finds them; floats are only checked to be finite.
fn halves(bytes: &[u8]) -> Vec<half::f16> {
    use exr::prelude::*;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .expect("an EXR file");
    let mut found = Vec::new();
    for channel in image.layer_data.channel_data.list {
        match channel.sample_data {
            FlatSamples::F16(values) => found.extend(values),
            FlatSamples::F32(values) => assert!(values.iter().all(|v| v.is_finite())),
            FlatSamples::U32(_) => {}
        }
    }
    found
}

#[test]
fn every_half_in_a_bundle_is_zero_or_a_normal_number() {
    for paint in [extreme(), metallic(6, H, D), solid(7)] {
        let (mut pictures, mut numbers) = (0, 0);
        for (name, bytes) in files(&paint, Precision::F16) {
            if std::path::Path::new(&name)
                .extension()
                .is_some_and(|e| e == "exr")
            {
                let halves = halves(&bytes);
                pictures += 1;
                numbers += halves.len();
                for (k, half) in halves.iter().enumerate() {
                    let sound = half.is_finite() && (half.is_normal() || half.to_f32() == 0.0);
                    assert!(sound, "{name}, number {k} is {:#06x}", half.to_bits());
                }
            }
        }
        assert!(
            pictures > 0 && numbers >= 12,
            "{pictures} pictures, {numbers} halves"
        );
    }
}

#[test]
fn what_a_half_cannot_hold_is_held_at_its_largest_and_told() {
    let document = |paint: &CarPaint| {
        let files = files(paint, Precision::F16);
        let (_, bytes) = &files
            .iter()
            .find(|(name, _)| name == "material.json")
            .expect("is there");
        let json: serde_json::Value = serde_json::from_slice(bytes).expect("JSON");
        (json["clamped"].as_array().expect("a list").clone(), files)
    };
    // Boxes of L up to 1960 beside b = 1999 are bright, but Lab within ±2000 keeps light below 3e4.
    assert_eq!(document(&extreme()).0, Vec::<serde_json::Value>::new());

    // Validation refuses this paint; whoever writes it all the same is told what became of its light of 2e6.
    let mut beyond = extreme();
    let flakes = beyond.flakes.as_mut().expect("flakes");
    flakes.upper[2] = [20_000.0, 2.0, 1.0];
    flakes.lower[2] = [19_999.0, -3.0, -1.5];
    let (clamped, files) = document(&beyond);
    let means = clamped.iter().find(|of| of["what"] == "slice_means");
    let means = means.expect("the means of the slices are told");
    assert_eq!(means["count"], 3, "one slice, three channels: {means}");
    assert!(means["farthest"].as_f64() > Some(1e5), "{means}");
    assert_eq!(means["limit"], 65504.0);
    let largest = files
        .iter()
        .filter(|(name, _)| name.contains("slice_means"))
        .flat_map(|(_, bytes)| halves(bytes))
        .fold(0.0_f32, |most, half| most.max(half.to_f32()));
    assert_eq!(largest, 65504.0);
}

#[test]
fn a_number_that_is_none_is_refused_by_texture_and_place_in_every_precision() {
    for precision in [Precision::F32, Precision::F16, Precision::Eight] {
        for wrong in [f32::NAN, f32::INFINITY] {
            let mut paint = metallic(8, H, D);
            paint.flakes.as_mut().expect("has flakes").upper[3][1] = wrong;
            let settings = ExportSettings {
                precision,
                ..ExportSettings::default()
            };
            let error = bundle(&paint, &about(), &settings).expect_err("refused");
            assert!(
                matches!(error, ExportError::NotFinite { .. }),
                "{precision:?}, {wrong}: {error}"
            );
        }
    }
}

#[test]
fn a_glb_of_an_extreme_paint_holds_finite_numbers_only() {
    let bytes = glb(&extreme(), &about()).expect("a GLB");
    let length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    // JSON has no NaN: serde writes it as null, which no number of a glTF may be.
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).expect("JSON");
    let mut open = vec![&json["materials"], &json["accessors"], &json["nodes"]];
    let mut numbers = 0;
    while let Some(value) = open.pop() {
        assert!(!value.is_null(), "a number was lost: {}", json["materials"]);
        numbers += usize::from(value.is_number());
        open.extend(value.as_array().into_iter().flatten());
        // What the paint says about itself may say nothing: a paint without a coat has none.
        let fields = value.as_object().into_iter().flatten();
        open.extend(fields.filter(|(key, _)| *key != "extras").map(|(_, v)| v));
    }
    assert!(numbers > 10, "{numbers}");
}

/// Fails unless every half of an EXR file is 0 or a normal number and every float is finite; counts them.
fn assert_sound_exr(bytes: &[u8], what: &str) -> usize {
    use exr::prelude::*;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .expect("an EXR file");
    let mut count = 0;
    for channel in image.layer_data.channel_data.list {
        match channel.sample_data {
            FlatSamples::F16(values) => {
                count += values.len();
                let sound = |v: &half::f16| v.is_normal() || v.to_f32() == 0.0;
                assert!(values.iter().all(sound), "{what}: {}", channel.name);
            }
            FlatSamples::F32(values) => {
                count += values.len();
                assert!(
                    values.iter().all(|v| v.is_finite()),
                    "{what}: {}",
                    channel.name
                );
            }
            FlatSamples::U32(values) => count += values.len(),
        }
    }
    count
}

#[test]
fn pictures_of_an_extreme_paint_hold_finite_numbers_only() {
    let limits = Limits::default();
    let mut coated = extreme();
    coated.coat = Some(Coat::smooth(4.0));
    for (k, paint) in [extreme(), coated].iter().enumerate() {
        for shape in [Shape::Sphere, Shape::Capsule, Shape::Panel] {
            let mut scene = Scene::new(shape, [48, 40]);
            scene.samples_per_pixel = 4;
            let drawn = render(paint, &scene, &limits, &|_| ()).expect("a picture");
            let pixels = drawn.film.pixels();
            assert!(
                pixels.iter().flatten().all(|v| v.is_finite()),
                "{k}, {shape:?}"
            );
            // Light of flakes up to 2e4 under a key light reaches the file: the picture is not black.
            assert!(
                pixels.iter().flatten().any(|v| *v > 10.0),
                "{k}, {shape:?} shows no extreme"
            );
            let bytes = drawn.film.to_exr().expect("an EXR");
            assert_eq!(
                assert_sound_exr(&bytes, "a preview"),
                3 * 48 * 40,
                "{k}, {shape:?}"
            );
            drawn.film.to_png().expect("a PNG");
            let told = serde_json::to_value(&drawn.report).expect("JSON");
            let sampling = told["sampling"]
                .as_object()
                .expect("what is left to chance");
            assert!(sampling.values().any(serde_json::Value::is_number));
        }
        for angles in [[0.0, 0.0], [90.0, 90.0], [20.0, 15.0]] {
            let bytes = texels(paint, angles[0], angles[1], [64, 48], 3, &limits).expect("texels");
            assert_eq!(
                assert_sound_exr(&bytes, "texels"),
                3 * 64 * 48,
                "{angles:?}"
            );
        }
    }
}

#[test]
fn a_picture_with_a_pixel_that_is_no_number_is_refused_or_never_made() {
    // A box that is no number is refused when the paint is validated; drawn all the same, it must not become a file.
    let mut paint = metallic(8, H, D);
    let made = paint.flakes.as_mut().expect("has flakes");
    for corner in made.upper.iter_mut().chain(&mut made.lower) {
        corner[0] = f32::NAN;
    }
    paint.validate(&Limits::default()).expect_err("no paint");
    let mut scene = Scene::new(Shape::Sphere, [16, 16]);
    scene.samples_per_pixel = 1;
    let drawn = render(&paint, &scene, &Limits::default(), &|_| ()).expect("a picture");
    match drawn.film.to_exr() {
        Ok(bytes) => assert_eq!(assert_sound_exr(&bytes, "a preview"), 3 * 16 * 16),
        Err(error) => assert!(matches!(error, FilmError::NotANumber { .. }), "{error}"),
    }
}

#[test]
fn the_bundle_of_a_blend_of_extreme_paints_holds_finite_numbers_only() {
    let blend = blend(&[&extreme(), &metallic(9, &[0.0, 20.0], &[0.0, 30.0])]);
    for precision in [Precision::F16, Precision::F32] {
        let mut profile = Profile::standard();
        profile.export.precision = precision;
        let thing = Thing::Blend(Box::new(blend.clone()));
        let made = bundle_blend(&thing, &profile).expect("a bundle");
        let (mut pictures, mut documents) = (0, 0);
        for (name, bytes) in unpacked(made.bytes) {
            let ending = std::path::Path::new(&name).extension();
            if ending.is_some_and(|e| e == "exr") {
                pictures += usize::from(assert_sound_exr(&bytes, &name) > 0);
            } else if ending.is_some_and(|e| e == "json") {
                documents += usize::from(numbers_of(&bytes, &name) > 10);
            }
        }
        assert!(
            pictures >= 4 && documents >= 1,
            "{pictures} pictures, {documents} documents"
        );
    }
}

/// Fails where a JSON document holds a `null` in a list of numbers, which is how a number that is none is written; counts
/// the numbers.
fn numbers_of(bytes: &[u8], what: &str) -> usize {
    let json: serde_json::Value = serde_json::from_slice(bytes).expect("JSON");
    let (mut open, mut numbers) = (vec![&json], 0);
    while let Some(value) = open.pop() {
        numbers += usize::from(value.is_number());
        let list = value.as_array().into_iter().flatten();
        for entry in list {
            assert!(!entry.is_null(), "{what}: a number was lost in {value}");
            open.push(entry);
        }
        // An end of a documented range that is open is `null` on purpose.
        let fields = value.as_object().into_iter().flatten();
        open.extend(fields.filter(|(key, _)| *key != "range").map(|(_, v)| v));
    }
    numbers
}

#[test]
fn values_of_an_extreme_paint_are_numbers_in_json() {
    let grazing = [1.0, 1e-3, 1e-8, 1e-160, 1e-300, 0.0];
    let list: Vec<[Direction; 2]> = grazing
        .iter()
        .flat_map(|&z| grazing.map(|w| [at(z, 0.0), at(w, std::f64::consts::PI)]))
        .chain(pairs(40).into_iter().map(|(wi, wo)| [wi, wo]))
        .collect();
    let text = serde_json::to_vec(&serde_json::json!({ "pairs": list })).expect("JSON");
    let asked = Pairs::from_json("pairs", &text, &Limits::default()).expect("unit vectors");
    for coat in [None, Some(Coat::smooth(1.5)), Some(Coat::smooth(1.0))] {
        for chi in [Chi::Table, Chi::Overall] {
            let values = evaluate(&CarPaint { coat, ..extreme() }, &asked, chi);
            let json = serde_json::to_vec(&values).expect("JSON");
            let mirrors = usize::from(coat.is_some());
            assert_eq!(
                numbers_of(&json, "values"),
                (3 + mirrors) * list.len(),
                "{coat:?}"
            );
        }
    }
}

#[test]
fn what_f16_would_have_done_to_cumulative_probabilities_is_why_they_are_f32() {
    // Below 1 halves stand 2^-11 apart: a sparkle cluster of one texel in 4096 vanishes, in f32 it does not.
    let rare = 1.0 / 4096.0;
    assert_eq!(half::f16::from_f64(1.0 - rare).to_f64(), 1.0);
    assert!(1.0_f32 - rare as f32 != 1.0);
}
