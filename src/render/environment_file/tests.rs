//! Skies whole, damaged, too large and too bright.

use super::*;
use crate::render::film::write_exr;
use exr::image::{
    AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, Layer, SpecificChannels,
};
use exr::math::Vec2;
use exr::meta::attribute::LineOrder;
use exr::meta::header::LayerAttributes;
use exr::prelude::WritableImage;
use half::f16;

fn hdr() -> Vec<u8> {
    let mut bytes = Vec::new();
    let pixels: Vec<image::Rgb<f32>> = (0..32_u8)
        .map(|k| image::Rgb([f32::from(k), 0.5, 2.0]))
        .collect();
    image::codecs::hdr::HdrEncoder::new(&mut bytes)
        .encode(&pixels, 8, 4)
        .expect("encodes");
    bytes
}

fn sky(bad: f32) -> Vec<u8> {
    write_exr(8, 4, |k| {
        if k == 11 {
            (bad, 1.0, 1.0)
        } else {
            (0.5_f32, 1.0, 2.0)
        }
    })
    .expect("encodes")
}

#[test]
fn both_formats_are_read() {
    let limits = Limits::default();
    let read = |bytes: &[u8]| Environment::from_bytes(bytes, &limits).expect("reads");
    let (exr, hdr) = (read(&sky(0.5)), read(&hdr()));
    assert_eq!((exr.format, exr.size), (EnvironmentFormat::Exr, [8, 4]));
    assert_eq!((hdr.format, hdr.size), (EnvironmentFormat::Hdr, [8, 4]));
    let up = exr.environment.radiance([0.0, 1.0, 0.0]);
    assert!((up[0] - 0.5).abs() < 1e-6 && (up[2] - 2.0).abs() < 1e-6);
    let somewhere = hdr.environment.radiance([0.0, 0.2, 0.9]);
    assert!((somewhere[2] - 2.0).abs() < 0.02);
}

#[test]
fn pixels_that_are_no_light_are_refused_or_held_and_counted() {
    let limits = Limits::default();
    for light in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let error = Environment::from_bytes(&sky(light), &limits).expect_err("no light");
        assert!(
            matches!(error, EnvironmentError::NotFinite { x: 3, y: 1, .. }),
            "{error}"
        );
    }
    for (light, told) in [
        (0.5, None),
        (65504.0, None),
        (-1.0, Some("1 channels below 0, down to -1, are drawn as 0")),
        (
            1e6,
            Some("1 channels above 65504, up to 1000000, are drawn as 65504"),
        ),
    ] {
        let sky = Environment::from_bytes(&sky(light), &limits);
        let sky = sky.expect("held").environment;
        let told = told.map(|what| format!("environment: {what}"));
        assert_eq!(sky.held().line(), told);
        assert!(sky.level().is_finite() && sky.level() >= 0.0);
    }
}

#[test]
fn sizes_are_checked_before_anything_is_allocated() {
    let limits = Limits {
        pixels: 31,
        ..Limits::default()
    };
    for bytes in [hdr(), sky(0.5)] {
        assert!(matches!(
            Environment::from_bytes(&bytes, &limits),
            Err(EnvironmentError::Size { .. })
        ));
    }
}

/// An 8 x 4 picture of so many channels of 32-bit floats, B, G and R among them.
fn of_channels(count: usize) -> Vec<u8> {
    let name = |k: usize| match k {
        0..3 => ["B", "G", "R"][k].to_owned(),
        _ => format!("of {k}"),
    };
    let channel = |k| AnyChannel::new(&*name(k), FlatSamples::F32(vec![1.0; 32]));
    let channels = AnyChannels::sort((0..count).map(channel).collect());
    let layer = Layer::new(
        (8, 4),
        LayerAttributes::named("sky"),
        Encoding::FAST_LOSSLESS,
        channels,
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .expect("encodes");
    bytes.into_inner()
}

/// The same file with other corners in its windows.
fn with_windows(mut bytes: Vec<u8>, data: [i32; 4], display: [i32; 4]) -> Vec<u8> {
    for (name, corners) in [("dataWindow", data), ("displayWindow", display)] {
        let head = format!("{name}\0box2i\0\x10\0\0\0");
        let places = bytes
            .windows(head.len())
            .position(|at| at == head.as_bytes());
        let place = places.expect("a window") + head.len();
        for (k, corner) in corners.into_iter().enumerate() {
            bytes[place + 4 * k..][..4].copy_from_slice(&corner.to_le_bytes());
        }
    }
    bytes
}

#[test]
fn a_header_that_claims_more_memory_than_a_table_may_have_is_refused() {
    let claimed = [0, 0, 11583, 5791];
    let hungry = with_windows(of_channels(64), claimed, claimed);
    let limits = Limits::default();
    let error = Environment::from_bytes(&hungry, &limits).expect_err("17 GB");
    let told = error.to_string();
    let bytes: u64 = 11584 * 5792 * 64 * 4;
    assert!(
        told.contains(&bytes.to_string()) && told.contains(&limits.table_bytes.to_string()),
        "{told}"
    );
    // At the limit it is read, a byte below it is not.
    let small = of_channels(40);
    let enough = Limits {
        table_bytes: 8 * 4 * 40 * 4,
        ..Limits::default()
    };
    assert!(Environment::from_bytes(&small, &enough).is_ok());
    let short = Limits {
        table_bytes: enough.table_bytes - 1,
        ..enough
    };
    let error = Environment::from_bytes(&small, &short).expect_err("a byte short");
    assert!(matches!(error, EnvironmentError::Bytes { .. }), "{error}");

    let error = Environment::from_bytes(&of_channels(65), &limits).expect_err("too many");
    assert_eq!(
        error.to_string(),
        "65 channels are more than the 64 accepted"
    );
}

#[test]
fn what_is_not_a_whole_panorama_is_refused_by_its_name() {
    let limits = Limits::default();
    let of = |width: u32, height: u32| {
        let light = (1.0_f32, 1.0_f32, 1.0_f32);
        let bytes = write_exr(width, height, |_| light).expect("encodes");
        Environment::from_bytes(&bytes, &limits)
    };
    for (width, height) in [(8, 4), (9, 4), (7, 4), (1, 1), (2, 1)] {
        let read = of(width, height).expect("a panorama within a pixel");
        assert_eq!(read.size, [width, height]);
    }
    for (width, height) in [(8, 8), (10, 4), (6, 4), (4, 8)] {
        let told = of(width, height).expect_err("no panorama").to_string();
        let accepted = format!("{} x {height}", 2 * height);
        assert!(
            told.starts_with(&format!("{width} x {height} ")) && told.contains(&accepted),
            "{told}"
        );
    }
    let whole = of_channels(3);
    let shifted = with_windows(whole.clone(), [4, 2, 11, 5], [4, 2, 11, 5]);
    assert!(Environment::from_bytes(&shifted, &limits).is_ok());
    let part = with_windows(whole, [4, 2, 11, 5], [0, 0, 15, 7]);
    let told = Environment::from_bytes(&part, &limits).expect_err("a part");
    assert_eq!(
        told.to_string(),
        "the data window 8 x 4 at 4, 2 is not the display window 16 x 8 at 0, 0: a panorama has all its pixels and no others"
    );
}

#[test]
fn light_too_dim_to_expose_for_is_refused_and_none_is_not() {
    let limits = Limits::default();
    let of = |light: f32| {
        let bytes = write_exr(8, 4, |_| (light, light, light)).expect("encodes");
        Environment::from_bytes(&bytes, &limits)
    };
    for light in [0.0, 1e-29] {
        assert!(of(light).is_ok(), "{light}");
    }
    for light in [1e-31, 1e-42] {
        let error = of(light).expect_err("too dim");
        assert!(matches!(error, EnvironmentError::Dark { .. }), "{error}");
    }
}

#[test]
fn cut_and_damaged_files_are_errors_or_pictures_never_panics() {
    let limits = Limits {
        pixels: 1 << 20,
        ..Limits::default()
    };
    for whole in [hdr(), sky(0.5)] {
        for cut in 0..whole.len() {
            assert!(
                Environment::from_bytes(&whole[..cut], &limits).is_err(),
                "cut to {cut} of {}",
                whole.len()
            );
        }
        for k in 0..whole.len() {
            for bit in 0..8 {
                let mut damaged = whole.clone();
                damaged[k] ^= 1 << bit;
                let _ = Environment::from_bytes(&damaged, &limits);
            }
        }
    }
}

/// The same 34 x 17 sky in every way of storing that is read: compression, and blocks as lines or as tiles.
fn stored() -> Vec<(String, Vec<u8>)> {
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
    ];
    let blocks = [
        Blocks::ScanLines,
        Blocks::Tiles(Vec2(8, 8)),
        Blocks::Tiles(Vec2(7, 5)),
    ];
    let pixel = |at: Vec2<usize>| {
        let light =
            |k: usize| f16::from_f32(0.5 + ((at.x() * 7 + at.y() * 3 + k) % 11) as f32 / 22.0);
        (light(0), light(1), light(2))
    };
    let mut all = Vec::new();
    for compression in compressions {
        for blocks in blocks {
            let encoding = Encoding {
                compression,
                blocks,
                line_order: LineOrder::Increasing,
            };
            let channels = SpecificChannels::rgb(pixel);
            let layer = Layer::new((34, 17), LayerAttributes::named("sky"), encoding, channels);
            let mut bytes = Cursor::new(Vec::new());
            Image::from_layer(layer)
                .write()
                .non_parallel()
                .to_buffered(&mut bytes)
                .expect("encodes");
            all.push((format!("{compression:?} {blocks:?}"), bytes.into_inner()));
        }
    }
    all
}

#[test]
fn every_compression_in_lines_and_tiles_reads_as_the_same_sky() {
    let limits = Limits::default();
    let level = |bytes: &[u8]| {
        Environment::from_bytes(bytes, &limits)
            .expect("reads")
            .environment
            .level()
    };
    let all = stored();
    let whole = level(&all[0].1);
    for (name, bytes) in &all {
        // B44 keeps six bits of the differences among sixteen pixels. Within one octave they have up to ten, so four
        // are lost: 16/1024 of a pixel. The others keep halves as they are.
        let loss = if name.starts_with("B44") { 0.02 } else { 0.0 };
        let told = level(bytes);
        assert!(
            (told - whole).abs() <= loss * whole,
            "{name}: {told}, not {whole}"
        );
    }
}

#[test]
fn every_compression_cut_or_swapped_is_an_error_or_a_picture_never_a_panic() {
    let limits = Limits {
        pixels: 1 << 20,
        ..Limits::default()
    };
    let all = stored();
    for (k, (name, whole)) in all.iter().enumerate() {
        let header = whole.len() - whole.len() / 2;
        for cut in (0..header)
            .step_by(29)
            .chain((header..whole.len()).step_by(5))
        {
            assert!(
                Environment::from_bytes(&whole[..cut], &limits).is_err(),
                "{name} cut to {cut} of {}",
                whole.len()
            );
        }
        // Bytes all over the file turned over, and the data of one put under the head of another.
        for at in (k % 7..whole.len()).step_by(7) {
            let mut damaged = whole.clone();
            damaged[at] ^= [0x01, 0x80, 0xff][at % 3];
            let _ = Environment::from_bytes(&damaged, &limits);
        }
        let other = &all[(k + 5) % all.len()].1;
        for share in 1..8 {
            let (head, tail) = (whole.len() * share / 8, other.len() * share / 8);
            let swapped = [&whole[..head], &other[tail..]].concat();
            let _ = Environment::from_bytes(&swapped, &limits);
        }
    }
}
