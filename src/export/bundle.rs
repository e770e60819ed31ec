//! The texture bundle: a `.zip` of `material.json`, textures, the shader that reads them, and how to use it in three.js.
//!
//! Entries are stored, not deflated: halves of noise shrink by a tenth and cost more than everything else here. Dates
//! are 1980-01-01 and the order is fixed, so that equal paints give equal bytes.

use std::io::{Cursor, Write};
use std::sync::OnceLock;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::document::{Carrier, document};
use super::textures::Textures;
use super::{About, ExportError, ExportSettings, SHADER};
use crate::paint::CarPaint;

/// Files that are the same in every bundle.
const COMPANIONS: [(&str, &str); 5] = [
    ("carpaint.glsl", SHADER),
    ("carpaint.js", include_str!("shader/carpaint.js")),
    ("three_example.js", include_str!("shader/three_example.js")),
    ("index.html", include_str!("shader/index.html")),
    ("README.txt", include_str!("shader/README.txt")),
];

/// Hash of the files that are the same in every bundle, in hexadecimal digits.
#[must_use]
pub fn companions_hash() -> &'static str {
    static HASH: OnceLock<String> = OnceLock::new();
    HASH.get_or_init(|| {
        let mut hasher = blake3::Hasher::new();
        for part in COMPANIONS.iter().flat_map(|(name, text)| [name, text]) {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
        hasher.finalize().to_hex().to_string()
    })
}

/// The texture bundle of a paint.
///
/// # Errors
///
/// [`ExportError`] for a number that is not finite, or more clusters than textures address.
pub fn bundle(
    paint: &CarPaint,
    about: &About,
    settings: &ExportSettings,
) -> Result<Vec<u8>, ExportError> {
    let textures = Textures::of(paint, settings)?;
    let json = document(paint, about, settings, &textures, &Carrier::Files)?;
    archive(&json, &textures)
}

/// The archive of a document, its textures, and the files that are the same in every bundle.
pub(super) fn archive(json: &[u8], textures: &Textures) -> Result<Vec<u8>, ExportError> {
    let size: usize =
        textures.list.iter().map(|t| t.bytes.len()).sum::<usize>() + json.len() + (64 << 10);
    let mut zip = ZipWriter::new(Cursor::new(Vec::with_capacity(size)));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .unix_permissions(0o644);
    let mut entry = |name: &str, bytes: &[u8]| -> Result<(), ExportError> {
        zip.start_file(name, options)?;
        Ok(zip.write_all(bytes)?)
    };
    entry("material.json", json)?;
    for texture in &textures.list {
        entry(&texture.file, &texture.bytes)?;
    }
    for (name, text) in COMPANIONS {
        entry(name, text.as_bytes())?;
    }
    Ok(zip.finish()?.into_inner())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::export::made_up::{about, metallic};
    use crate::export::{Precision, assert_documented, material_json};
    use serde_json::Value;
    use std::io::Read;

    pub(in crate::export) fn files(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).expect("an archive");
        (0..archive.len())
            .map(|k| {
                let mut file = archive.by_index(k).expect("an entry");
                let mut content = Vec::new();
                file.read_to_end(&mut content).expect("whole");
                (file.name().expect("a name").into_owned(), content)
            })
            .collect()
    }

    #[test]
    fn the_same_paint_gives_the_same_bytes() {
        let paint = metallic(4, 3, 20);
        let write = || bundle(&paint, &about(), &ExportSettings::default()).expect("written");
        assert_eq!(write(), write());
    }

    #[test]
    fn every_texture_of_the_document_is_in_the_archive() {
        for precision in [Precision::F32, Precision::F16, Precision::Eight] {
            let settings = ExportSettings {
                precision,
                ..ExportSettings::default()
            };
            let files = files(&bundle(&metallic(4, 3, 20), &about(), &settings).expect("written"));
            let document: Value = serde_json::from_slice(&files[0].1).expect("JSON");
            for (name, entry) in document["textures"].as_object().expect("a map") {
                assert!(
                    files.iter().any(|(file, _)| entry["file"] == **file),
                    "{name}"
                );
            }
        }
    }

    #[test]
    fn every_number_of_the_document_is_explained() {
        let mut paint = metallic(4, 3, 20);
        paint.coat = paint.coat.map(|coat| crate::paint::Coat {
            thickness_um: Some(40.0),
            ..coat
        });
        let settings = ExportSettings {
            precision: Precision::Eight,
            ..ExportSettings::default()
        };
        let json = material_json(&paint, &about(), &settings).expect("written");
        assert_documented(&serde_json::from_slice(&json).expect("JSON"));
    }

    #[test]
    fn a_solid_color_has_no_flake_textures() {
        let paint = CarPaint {
            flakes: None,
            ..metallic(1, 1, 1)
        };
        let names: Vec<String> =
            files(&bundle(&paint, &about(), &ExportSettings::default()).expect("written"))
                .into_iter()
                .map(|(name, _)| name)
                .collect();
        assert_eq!(
            names[..3],
            ["material.json", "color_table.exr", "angles.exr"]
        );
        assert!(!names.iter().any(|name| name.starts_with("corners")));
    }

    #[test]
    fn a_color_too_bright_for_a_half_is_clamped_and_told() {
        let mut paint = metallic(2, 2, 3);
        let flakes = paint.flakes.as_mut().expect("flakes");
        // Beyond what validation lets in: nothing else reaches a half's end.
        flakes.upper[2] = [20000.0, 2.0, 1.0];
        flakes.lower[2] = [19999.0, -3.0, -1.5];
        let files = files(&bundle(&paint, &about(), &ExportSettings::default()).expect("written"));
        let document: Value = serde_json::from_slice(&files[0].1).expect("JSON");
        assert_eq!(document["clamped"][0]["what"], "slice_means");
        assert!(
            document["clamped"][0]["farthest"]
                .as_f64()
                .expect("a number")
                > 65504.0
        );
    }

    #[test]
    fn a_number_that_is_not_finite_is_refused() {
        let mut paint = metallic(2, 2, 3);
        paint.flakes.as_mut().expect("flakes").upper[1][2] = f32::NAN;
        for precision in [Precision::F32, Precision::F16, Precision::Eight] {
            let settings = ExportSettings {
                precision,
                ..ExportSettings::default()
            };
            assert!(
                bundle(&paint, &about(), &settings).is_err(),
                "{precision:?}"
            );
        }
    }
}
