//! Tests of `picture`.

use super::*;
use exr::prelude::{
    Blocks, Compression, Encoding, Image, LineOrder, SpecificChannels, Vec2, WritableImage,
};

/// A pixel of a picture of half floats, with everything in it that measurements have.
fn pixel(x: usize, y: usize) -> [f32; 3] {
    let wave = |k: f32| (x as f32 * 0.37 + y as f32 * k).sin() * 0.1;
    match (x * 7 + y * 3) % 23 {
        0 => [f32::NAN, 1.0, 2.0],
        1 => [-2e-4, 0.0, 65504.0],
        2 => [6e-8, -0.0, f32::INFINITY],
        _ => [wave(0.1), wave(0.7), wave(1.3)],
    }
}

/// EXR bytes of a picture, by the `exr` crate.
pub(in super::super) fn exr_of<S: exr::prelude::IntoSample>(
    size: [usize; 2],
    compression: Compression,
    blocks: Blocks,
    line_order: LineOrder,
    pixel: impl Fn(usize, usize) -> (S, S, S) + Sync,
) -> Vec<u8> {
    let encoding = Encoding {
        compression,
        blocks,
        line_order,
    };
    let channels = SpecificChannels::rgb(move |at: Vec2<usize>| pixel(at.x(), at.y()));
    let mut bytes = Vec::new();
    let image = Image::from_encoded_channels((size[0], size[1]), encoding, channels);
    image
        .write()
        .non_parallel()
        .to_buffered(std::io::Cursor::new(&mut bytes))
        .expect("a picture");
    bytes
}

pub(in super::super) fn halves(
    size: [usize; 2],
    pixel: impl Fn(usize, usize) -> [f32; 3] + Sync,
) -> Vec<u8> {
    exr_of(
        size,
        Compression::ZIP16,
        Blocks::ScanLines,
        LineOrder::Increasing,
        |x, y| {
            let [r, g, b] = pixel(x, y).map(half::f16::from_f32);
            (r, g, b)
        },
    )
}

fn read(bytes: &[u8], wanted: Option<[u32; 2]>) -> Result<Picture, PictureError> {
    Picture::read_exr(
        bytes,
        wanted,
        &Limits::default(),
        &mut PictureScratch::default(),
    )
}

#[test]
fn every_way_of_packing_gives_the_same_pixels() {
    let size = [37, 41];
    let tiles = Blocks::Tiles(Vec2(16, 16));
    let (none, zips, zip, piz) = (
        Compression::Uncompressed,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
    );
    for (compression, blocks) in [
        (none, Blocks::ScanLines),
        (zips, Blocks::ScanLines),
        (zip, Blocks::ScanLines),
        (Compression::RLE, Blocks::ScanLines),
        (piz, Blocks::ScanLines),
        (zip, tiles),
    ] {
        for order in [LineOrder::Increasing, LineOrder::Decreasing] {
            let float = |x, y| {
                let [r, g, b] = pixel(x, y);
                (r, g, b)
            };
            let half = |x, y| {
                let [r, g, b] = pixel(x, y).map(half::f16::from_f32);
                (r, g, b)
            };
            let order = if blocks == tiles {
                LineOrder::Increasing
            } else {
                order
            };
            let (floats, halves) = (
                exr_of(size, compression, blocks, order, float),
                exr_of(size, compression, blocks, order, half),
            );
            for (bytes, is_half) in [(floats, false), (halves, true)] {
                let picture = read(&bytes, Some([37, 41])).expect("whole");
                for k in 0..37 * 41 {
                    let want = pixel(k % 37, k / 37);
                    for c in 0..3 {
                        let want = if is_half {
                            half::f16::from_f32(want[c]).to_f32()
                        } else {
                            want[c]
                        };
                        let got = picture.planes[c][k];
                        assert!(
                            got == want || got.is_nan() && want.is_nan(),
                            "{compression:?} {k}: {got} {want}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn the_size_is_held_against_what_was_promised() {
    let bytes = halves([8, 4], |_, _| [0.5; 3]);
    assert_eq!(read(&bytes, None).expect("whole").pixels(), 32);
    let error = read(&bytes, Some([4, 8]))
        .expect_err("another size")
        .to_string();
    assert!(
        error.contains("8 x 4") && error.contains("4 x 8"),
        "{error}"
    );
    let limits = Limits {
        pixels: 31,
        ..Limits::default()
    };
    let error = Picture::read_exr(&bytes, None, &limits, &mut PictureScratch::default());
    assert_eq!(
        error,
        Err(PictureError::TooLarge {
            width: 8,
            height: 4,
            accepted: 31
        })
    );
}

/// A header of `channels` float channels that promises `width x 4` pixels, and one block of ten bytes.
fn promise(width: i32, channels: u8) -> Vec<u8> {
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        bytes.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0"].concat());
        bytes.extend(u32::try_from(value.len()).expect("short").to_le_bytes());
        bytes.extend(value);
    };
    let mut list = Vec::new();
    for k in 0..channels {
        list.push(
            [b'R', b'G', b'B']
                .get(usize::from(k))
                .copied()
                .unwrap_or(b'a' + k),
        );
        list.extend([0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    }
    list.push(0);
    attribute("channels", "chlist", &list);
    attribute("compression", "compression", &[3]);
    let window = [0, 0, width - 1, 3].map(i32::to_le_bytes).concat();
    attribute("dataWindow", "box2i", &window);
    bytes.push(0);
    let block = bytes.len() as u64 + 8;
    bytes.extend(block.to_le_bytes());
    bytes.extend([0, 0, 0, 0, 10, 0, 0, 0]);
    bytes.extend([0; 10]);
    bytes
}

#[test]
fn no_memory_is_taken_for_what_the_bytes_cannot_hold() {
    for (width, channels) in [(16_777_215, 16), (16_777_215, 3), (4096, 16)] {
        let bytes = promise(width, channels);
        let mut scratch = PictureScratch::default();
        let error = Picture::read_exr(&bytes, None, &Limits::default(), &mut scratch)
            .expect_err("an empty promise");
        assert!(error.to_string().contains("bytes can hold"), "{error}");
        assert!(scratch.packed.is_empty());
    }
    // A file long enough for the picture, a block far too short for its rows.
    let mut bytes = promise(16_384, 16);
    bytes.resize(bytes.len() + (4 << 20), 0);
    let error = read(&bytes, None).expect_err("an empty promise");
    assert!(
        matches!(error, PictureError::Block { block: 0, .. }),
        "{error}"
    );
    let error = read(&promise(16, 17), None).expect_err("many channels");
    assert!(matches!(error, PictureError::Kind { .. }), "{error}");
}

#[test]
fn other_files_are_told_apart() {
    assert_eq!(read(b"not a picture", None), Err(PictureError::Magic));
    assert_eq!(read(b"", None), Err(PictureError::Magic));
    let mut multi = halves([2, 2], |_, _| [0.5; 3]);
    multi[5] |= 0x10;
    assert!(
        read(&multi, None)
            .expect_err("multi-part")
            .to_string()
            .contains("multi-part")
    );
}

#[test]
fn every_cut_is_refused() {
    let bytes = halves([20, 20], pixel);
    for length in 0..bytes.len() {
        assert!(
            read(&bytes[..length], Some([20, 20])).is_err(),
            "cut at {length}"
        );
    }
}

/// Damage may go unnoticed in a pixel that is stored plainly; it must never be more than that.
#[test]
fn no_changed_byte_is_more_than_an_error() {
    for compression in [Compression::Uncompressed, Compression::ZIP16] {
        let half = |x, y| {
            let [r, g, b] = pixel(x, y).map(half::f16::from_f32);
            (r, g, b)
        };
        let bytes = exr_of(
            [20, 20],
            compression,
            Blocks::ScanLines,
            LineOrder::Increasing,
            half,
        );
        for k in 0..bytes.len() {
            for value in [0, 0x7f, 0xff, bytes[k] ^ 1] {
                let mut changed = bytes.clone();
                changed[k] = value;
                if let Ok(picture) = read(&changed, Some([20, 20])) {
                    assert_eq!(picture.planes.each_ref().map(Vec::len), [400; 3]);
                }
            }
        }
    }
}

#[test]
fn an_empty_promise_of_many_pixels_reserves_nothing() {
    let mut bytes = halves([2, 2], |_, _| [0.5; 3]);
    let at = bytes
        .windows(10)
        .position(|w| w == b"dataWindow")
        .expect("attribute")
        + 10
        + 1
        + 6
        + 4;
    bytes[at + 8..at + 12].copy_from_slice(&8191_i32.to_le_bytes());
    bytes[at + 12..at + 16].copy_from_slice(&8191_i32.to_le_bytes());
    let error = read(&bytes, Some([8192, 8192])).expect_err("empty");
    assert!(
        error.to_string().contains("more pixels than its bytes"),
        "{error}"
    );
}

#[test]
fn differences_are_undone_byte_by_byte() {
    let plain: Vec<u8> = (0..1003_u32).map(|k| (k * k % 251) as u8).collect();
    let mut stored = plain.clone();
    for k in (1..stored.len()).rev() {
        stored[k] = plain[k].wrapping_sub(plain[k - 1]).wrapping_add(128);
    }
    undo_differences(&mut stored);
    assert_eq!(stored, plain);
}
