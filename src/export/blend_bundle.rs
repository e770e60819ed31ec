//! The bundle of a whole blend: the flakes' boxes and color tables of all its paints, mixed by the shader at any weights.
//!
//! A realisation is weighted sums of boxes and of color tables in CIELAB (`blend::realise`), and sums a shader can do:
//! whoever has this archive moves sliders without asking again. Clusters, probabilities and angles are common to all
//! paints and stand here once. Corner textures and color table hold the paints one below the other, in the order asked
//! for: paint `m` of `n` has the rows from `m · height / n`. The random tile is that of equal weights; means of slices
//! depend on the weights, so they are left to the reader (`carpaint.js` finds them in closed form, as `paint::mean_color`
//! does).

use super::blend_document::blend_document;
use super::bundle::archive;
use super::textures::{MAX_CLUSTERS, MAX_ROWS, Textures};
use super::{About, ExportError, ExportSettings};
use crate::blend::{Blend, Boxes, Part, RealisationWeights};
use crate::color::LinearRgb;
use crate::paint::CarPaint;

/// The texture bundle of a blend, for every realisation of it. The inverse distribution is never written.
///
/// # Errors
///
/// [`ExportError`] for a number that is not finite, or more clusters than textures address.
pub fn blend_bundle(
    blend: &Blend,
    about: &About,
    settings: &ExportSettings,
) -> Result<Vec<u8>, ExportError> {
    let settings = ExportSettings {
        inverse_cdf: false,
        ..*settings
    };
    let (parts, even) = (blend.parts(), at_equal_weights(blend));
    let textures = textures(&parts, &even, &settings)?;
    let json = blend_document(&parts, &even, about, &settings, &textures)?;
    archive(&json, &textures)
}

/// The paint in the middle: what it shares with every other realisation is written from it.
fn at_equal_weights(blend: &Blend) -> CarPaint {
    blend
        .realise(&RealisationWeights::equal(blend.len()))
        .expect("one finite weight a paint")
        .paint
}

fn textures(
    parts: &[Part<'_>],
    even: &CarPaint,
    settings: &ExportSettings,
) -> Result<Textures, ExportError> {
    let mut out = Textures::default();
    let nodes: Vec<LinearRgb> = parts
        .iter()
        .flat_map(|part| part.color_table.nodes().iter().map(|lab| lab.to_array()))
        .collect();
    let about = "color of diffuse and lobes by half angle, CIELAB (L, a, b in R, G, B), paints one below the other; \
                 column theta_d, row theta_h";
    let columns = even.color_table.theta_d().len();
    rows_fit("rows of color tables", nodes.len() / columns)?;
    out.colors("color_table", columns, &nodes, settings.precision, about)?;
    out.angles(even);
    if let Some(flakes) = &even.flakes {
        let boxes: Vec<&Boxes> = parts.iter().filter_map(|part| part.boxes).collect();
        let width = columns_of(flakes.clusters(), parts.len())?;
        out.slices(flakes)?;
        let (lower, upper) = stacked(&boxes, width);
        out.corners(&lower, &upper, width, settings.precision)?;
        out.draws(flakes, width, settings.alias)?;
        out.random(flakes)?;
    }
    Ok(out)
}

/// Boxes of all paints, each filled up to whole rows.
fn stacked(boxes: &[&Boxes], width: usize) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let stack = |get: fn(&Boxes) -> &Vec<[f32; 3]>| {
        let mut all = Vec::new();
        for own in boxes.iter().map(|boxes| get(boxes)) {
            all.extend_from_slice(own);
            // A corner that is there anyway, so that the range of the texture stays that of the paints.
            let filler = own.last().copied().unwrap_or_default();
            all.resize(all.len().next_multiple_of(width), filler);
        }
        all
    };
    (stack(|boxes| &boxes.lower), stack(|boxes| &boxes.upper))
}

fn rows_fit(what: &'static str, count: usize) -> Result<(), ExportError> {
    if count <= MAX_ROWS {
        return Ok(());
    }
    Err(ExportError::TooMany {
        what,
        count,
        accepted: MAX_ROWS,
    })
}

/// Columns of the cluster textures: as few as leave all paints' rows above each other about square.
fn columns_of(clusters: usize, paints: usize) -> Result<usize, ExportError> {
    let rows = |width: &usize| clusters.div_ceil(*width) * paints;
    [256, 512, 1024, 2048, 4096]
        .into_iter()
        .find(|width| clusters <= MAX_CLUSTERS && rows(width) <= MAX_ROWS.min(*width))
        .ok_or(ExportError::TooMany {
            what: "clusters of a blend",
            count: clusters,
            accepted: MAX_ROWS / paints * 4096,
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blend::{BlendSettings, Ingredient};
    use crate::export::bundle::tests::files;
    use crate::export::made_up::{about, metallic};
    use crate::export::{Precision, assert_documented};
    use crate::paint::Coat;
    use serde_json::Value;

    fn two(first: &CarPaint, second: &CarPaint) -> Blend {
        let ingredients =
            [("first", first), ("second", second)].map(|(name, paint)| Ingredient { name, paint });
        Blend::new(&ingredients, &BlendSettings::default(), &|_| ()).expect("blends")
    }

    fn document(blend: &Blend, settings: &ExportSettings) -> (Value, Vec<(String, Vec<u8>)>) {
        let files = files(&blend_bundle(blend, &about(), settings).expect("written"));
        (serde_json::from_slice(&files[0].1).expect("JSON"), files)
    }

    #[test]
    fn every_number_of_the_document_is_explained_and_every_texture_there() {
        let mut coated = metallic(4, 3, 20);
        coated.coat = Some(Coat {
            ior: 1.5,
            roughness: 0.02,
            thickness_um: Some(40.0),
        });
        let bare = CarPaint {
            coat: None,
            ..metallic(3, 3, 12)
        };
        let blend = two(&coated, &bare);
        for precision in [Precision::F32, Precision::F16, Precision::Eight] {
            let settings = ExportSettings {
                precision,
                ..ExportSettings::default()
            };
            let (document, files) = document(&blend, &settings);
            assert_documented(&document);
            assert_eq!(document["format"], "carpaint blend");
            assert_eq!(document["settings"]["inverse_cdf"], false);
            for (name, entry) in document["textures"].as_object().expect("a map") {
                assert!(
                    files.iter().any(|(file, _)| entry["file"] == **file),
                    "{name}"
                );
            }
            assert!(document["textures"].get("slice_means").is_none());
            let corners = &document["textures"]["corners_upper"];
            assert_eq!(corners["height"].as_u64().map(|rows| rows % 2), Some(0));
        }
    }

    #[test]
    fn paints_stand_in_the_order_asked_for() {
        let (light, mut dark) = (metallic(4, 3, 20), metallic(4, 3, 20));
        dark.diffuse = [0.001; 3];
        for (first, second) in [(&light, &dark), (&dark, &light)] {
            let (document, _) = document(&two(first, second), &ExportSettings::default());
            for (paint, entry) in [first, second].iter().zip(0..) {
                assert_eq!(document["paints"][entry]["diffuse"][0], paint.diffuse[0]);
            }
        }
    }

    #[test]
    fn corners_are_those_of_each_paint() {
        let (light, dark) = (metallic(2, 2, 5), metallic(3, 2, 9));
        let blend = two(&light, &dark);
        let boxes: Vec<&Boxes> = blend.parts().iter().filter_map(|part| part.boxes).collect();
        let (lower, upper) = stacked(&boxes, 256);
        for (m, own) in boxes.iter().enumerate() {
            let first = m * lower.len() / 2;
            assert_eq!(lower[first..][..own.lower.len()], own.lower);
            assert_eq!(upper[first..][..own.upper.len()], own.upper);
        }
    }

    #[test]
    fn textures_stay_within_what_a_browser_takes() {
        for (clusters, paints) in [(1, 2), (23_000, 5), (400_000, 3), (3_000_000, 5)] {
            let width = columns_of(clusters, paints).expect("fits");
            assert!(width <= 4096 && clusters.div_ceil(width) * paints <= 4096);
        }
        assert!(columns_of(5_000_000, 5).is_err());
    }

    #[test]
    fn a_blend_of_solid_colors_has_a_color_table_alone() {
        let solid = |diffuse: f64| CarPaint {
            diffuse: [diffuse; 3],
            flakes: None,
            ..metallic(1, 1, 1)
        };
        let (document, _) = document(&two(&solid(0.1), &solid(0.4)), &ExportSettings::default());
        let names: Vec<&String> = document["textures"]
            .as_object()
            .expect("a map")
            .keys()
            .collect();
        assert_eq!(names, ["angles", "color_table"]);
        assert!(document["flakes"].is_null());
    }

    #[test]
    fn the_same_blend_gives_the_same_bytes() {
        let write = || {
            let blend = two(&metallic(4, 3, 20), &metallic(3, 2, 9));
            blend_bundle(&blend, &about(), &ExportSettings::default()).expect("written")
        };
        assert_eq!(write(), write());
    }
}
