//! Numbers on their way into files: nothing that is no number, no overflow and no subnormal half is ever written.

use crate::paints::{D, H, flakes, metallic, solid};
use carpaint::color::Lab;
use carpaint::export::{About, ExportError, ExportSettings, Precision, bundle, glb};
use carpaint::paint::{CarPaint, ColorTable, Limits, Provenance};
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
    let bytes = bundle(paint, &about(), &settings).expect("a bundle");
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

/// Lightness of a gray whose linear light is `y`.
fn gray(y: f64) -> Lab {
    Lab::from_rgb([y; 3])
}

/// A paint whose table and slices go from far below a half's smallest number to far above its largest.
fn extreme() -> CarPaint {
    let mut paint = metallic(5, &[0.0, 20.0, 40.0], &[0.0, 30.0]);
    let light = [0.0, 1e-9, 3e-8, 5e-5, 6.2e-5, -4e-5, 1.0, 5000.0];
    let nodes: Vec<Lab> = light.iter().map(|y| gray(*y)).collect();
    let angles = crate::paints::grid(&[0.0, 10.0, 30.0, 60.0]);
    paint.color_table =
        ColorTable::new(angles, crate::paints::grid(&[0.0, 45.0]), nodes, gray(0.5))
            .expect("eight nodes");
    let point = |k: u8| {
        let tiny = 1e-6 * 10.0_f32.powi(i32::from(k % 6));
        (
            0.125,
            [tiny, -tiny, 3e-7],
            [tiny + f32::from(k) * 280.0, tiny, 1999.0],
        )
    };
    let boxes: Vec<_> = (0..8).map(point).collect();
    paint.flakes = Some(flakes(&[0.0, 20.0, 40.0], &[0.0, 30.0], &boxes));
    paint.validate(&Limits::default()).expect("within bounds");
    paint
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

#[test]
fn what_f16_would_have_done_to_cumulative_probabilities_is_why_they_are_f32() {
    // Below 1 halves stand 2^-11 apart: a sparkle cluster of one texel in 4096 vanishes, in f32 it does not.
    let rare = 1.0 / 4096.0;
    assert_eq!(half::f16::from_f64(1.0 - rare).to_f64(), 1.0);
    assert!(1.0_f32 - rare as f32 != 1.0);
}
