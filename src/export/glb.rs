//! The GLB: a ball with a fitted glTF material, and the paint's own statistics beside it.
//!
//! Binary glTF 2.0: a JSON chunk and one binary chunk. Viewers see [`GltfMaterial`] with baked
//! flakes; readers that know carpaint find the whole model in the material's `extras.carpaint`, its lists as accessors
//! by name, and how far material and paint are apart. Checked by the Khronos validator in `tests/browser`.

mod bake;
mod brdf;
mod fit;
mod material;
mod mesh;
mod search;

use serde_json::{Map, Value, json};

use self::bake::{Baked, bake};
pub use self::brdf::GltfMaterial;
use self::brdf::dielectric_f0;
pub use self::fit::LossReport;
use self::fit::{fit, loss};
use self::material::{extras, material_json};
use self::mesh::{Mesh, ball};
use super::{About, ExportError};
use crate::color::LinearRgb;
use crate::paint::{CarPaint, Flakes, RandomTexture, Reflectance};

/// The GLB of a paint. Its lists are 32-bit, its pictures 8-bit, whatever a bundle's textures would be.
///
/// # Errors
///
/// [`ExportError`] for a number that is not finite, or a picture that cannot be encoded.
pub fn glb(paint: &CarPaint, about: &About) -> Result<Vec<u8>, ExportError> {
    glb_and_loss(paint, about).map(|(bytes, _)| bytes)
}

/// The same, and how far its material is from the paint.
///
/// # Errors
///
/// As [`glb`].
pub fn glb_and_loss(paint: &CarPaint, about: &About) -> Result<(Vec<u8>, LossReport), ExportError> {
    let reflectance = Reflectance::new(paint);
    let (mut material, mut report) = fit(&reflectance);
    let mut file = Builder::default();
    let clusters = paint.flakes.as_ref().map_or(0, Flakes::clusters);
    file.body.reserve(clusters * 28 + (512 << 10));
    let mut baked = None;
    if let Some(flakes) = &paint.flakes {
        let f0 = dielectric_f0(material.ior, material.specular_color);
        let made = bake(&reflectance, flakes, &material, f0)?;
        material.base_color = shown_between(&material, f0, &made.texels.shades);
        report = loss(&material, &reflectance, Some(&made.texels));
        // The texture carries the color from here on; its mean times the factor is what was fitted.
        let white = dielectric_f0(material.ior, [1.0; 3])[0];
        material.specular_color = made.f0_factor.map(|f| f / white);
        baked = Some(made);
    }
    let tile_um = paint
        .flakes
        .as_ref()
        .map(|f| f.texture.texel_um * f64::from(RandomTexture::TILE));
    let mesh = ball(tile_um);
    let primitive = file.mesh(&mesh, baked.is_some())?;
    let textures = baked.as_ref().map(|baked| file.pictures(baked));
    let (mut shading, used) = material_json(&about.name, &material, textures);
    let lists = file.paint_lists(paint)?;
    shading["extras"] = json!({ "carpaint": extras(paint, about, &report, &lists, &mesh) });
    let mut document = json!({
        "asset": { "version": "2.0", "generator": "carpaint" },
        "extensionsUsed": used,
        "scene": 0,
        "scenes": [{ "name": about.name, "nodes": [0] }],
        "nodes": [{ "name": "ball", "mesh": 0 }],
        "meshes": [{ "name": "ball", "primitives": [primitive] }],
        "materials": [shading],
        "accessors": file.accessors,
        "bufferViews": file.views,
        "buffers": [{ "byteLength": file.body.len() }],
    });
    if !file.images.is_empty() {
        document["images"] = file.images.into();
        document["textures"] =
            json!([{ "sampler": 0, "source": 0 }, { "sampler": 0, "source": 1 }]);
        document["samplers"] =
            json!([{ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 }]);
    }
    let bytes = chunks(&serde_json::to_vec(&document)?, &file.body);
    Ok((bytes, report))
}

/// The base color that shows as much between texels of differing F0 as the fitted one under their mean.
///
/// A texel lets through to the base what its strongest channel leaves, and flakes of many colors leave less than their
/// mean would.
fn shown_between(material: &GltfMaterial, f0: LinearRgb, shades: &[(f64, LinearRgb)]) -> LinearRgb {
    let strongest = |f0: LinearRgb| f0[0].max(f0[1]).max(f0[2]);
    let left: f64 = shades
        .iter()
        .map(|(share, f0)| share * (1.0 - strongest(*f0)))
        .sum();
    let gain = (1.0 - strongest(f0)) / left.max(1e-6);
    let most = 1.0 / strongest(material.base_color).max(1e-6);
    material.base_color.map(|v| v * gain.min(most))
}

/// Component types of the format.
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// The binary chunk, and the lists that say what stands where in it.
#[derive(Default)]
struct Builder {
    body: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
}

impl Builder {
    /// Appends bytes on a four-byte boundary and returns their view.
    fn view(&mut self, name: &str, bytes: &[u8], target: Option<u32>) -> usize {
        self.body.resize(self.body.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.body.len(), "byteLength": bytes.len(), "name": name });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.body.extend_from_slice(bytes);
        self.body.resize(self.body.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(
        &mut self,
        view: usize,
        component: u32,
        kind: &str,
        count: usize,
        name: &str,
    ) -> usize {
        let (component, kind) = (json!(component), json!(kind));
        let accessor = json!({ "bufferView": view, "componentType": component, "type": kind, "count": count, "name": name });
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(
        &mut self,
        name: &'static str,
        values: &[[f32; N]],
        target: Option<u32>,
    ) -> Result<usize, ExportError>
    where
        [f32; N]: bytemuck::Pod,
    {
        super::clamp::finite(name, values.as_flattened())?;
        let view = self.view(name, bytemuck::cast_slice(values), target);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        Ok(self.accessor(view, F32, kind, values.len(), name))
    }

    fn mesh(&mut self, mesh: &Mesh, textured: bool) -> Result<Value, ExportError> {
        const VERTICES: Option<u32> = Some(34962);
        const ELEMENTS: Option<u32> = Some(34963);
        let mut attributes = Map::new();
        let positions = self.floats("positions", &mesh.positions, VERTICES)?;
        self.accessors[positions]["min"] = bounds(&mesh.positions, f32::min).into();
        self.accessors[positions]["max"] = bounds(&mesh.positions, f32::max).into();
        attributes.insert("POSITION".into(), positions.into());
        attributes.insert(
            "NORMAL".into(),
            self.floats("normals", &mesh.normals, VERTICES)?.into(),
        );
        if textured {
            attributes.insert(
                "TANGENT".into(),
                self.floats("tangents", &mesh.tangents, VERTICES)?.into(),
            );
            attributes.insert(
                "TEXCOORD_0".into(),
                self.floats("uv", &mesh.uv, VERTICES)?.into(),
            );
        }
        let view = self.view("triangles", bytemuck::cast_slice(&mesh.triangles), ELEMENTS);
        let indices = self.accessor(view, U16, "SCALAR", mesh.triangles.len(), "triangles");
        Ok(json!({ "attributes": attributes, "indices": indices, "material": 0 }))
    }

    /// The baked pictures, as textures 0 and 1.
    fn pictures(&mut self, baked: &Baked) -> [usize; 2] {
        for (name, bytes) in [
            ("carpaint.baked.f0", &baked.f0),
            ("carpaint.baked.normals", &baked.normals),
        ] {
            let view = self.view(name, bytes, None);
            self.images
                .push(json!({ "name": name, "mimeType": "image/png", "bufferView": view }));
        }
        [0, 1]
    }

    /// The paint's lists; the accessors by what they hold.
    fn paint_lists(&mut self, paint: &CarPaint) -> Result<Map<String, Value>, ExportError> {
        #[allow(clippy::cast_possible_truncation)] // glTF's precision
        let narrow = |v: f64| v as f32;
        let mut lists = Map::new();
        let nodes: Vec<[f32; 3]> = paint
            .color_table
            .nodes()
            .iter()
            .map(|lab| lab.to_rgb().map(narrow))
            .collect();
        lists.insert(
            "color_table".into(),
            self.floats("carpaint.color_table", &nodes, None)?.into(),
        );
        let Some(flakes) = &paint.flakes else {
            return Ok(lists);
        };
        let view = self.view(
            "carpaint.flakes.offsets",
            bytemuck::cast_slice(&flakes.offsets),
            None,
        );
        let offsets = self.accessor(
            view,
            U32,
            "SCALAR",
            flakes.offsets.len(),
            "carpaint.flakes.offsets",
        );
        lists.insert("offsets".into(), offsets.into());
        let probability: Vec<[f32; 1]> = flakes.probability.iter().map(|&p| [narrow(p)]).collect();
        lists.insert(
            "probability".into(),
            self.floats("carpaint.flakes.probability", &probability, None)?
                .into(),
        );
        lists.insert(
            "lower".into(),
            self.floats("carpaint.flakes.lower", &flakes.lower, None)?
                .into(),
        );
        lists.insert(
            "upper".into(),
            self.floats("carpaint.flakes.upper", &flakes.upper, None)?
                .into(),
        );
        Ok(lists)
    }
}

fn bounds(positions: &[[f32; 3]], pick: fn(f32, f32) -> f32) -> Vec<f32> {
    (0..3)
        .filter_map(|k| positions.iter().map(|p| p[k]).reduce(pick))
        .collect()
}

/// The two chunks behind their header; JSON is padded with spaces, the body with zeros.
fn chunks(document: &[u8], body: &[u8]) -> Vec<u8> {
    let (json_length, body_length) = (
        document.len().next_multiple_of(4),
        body.len().next_multiple_of(4),
    );
    let total = 12 + 8 + json_length + 8 + body_length;
    let word = |n: usize| u32::try_from(n).unwrap_or(u32::MAX).to_le_bytes();
    let mut out = Vec::with_capacity(total);
    out.extend_from_slice(b"glTF");
    out.extend_from_slice(&2_u32.to_le_bytes());
    out.extend_from_slice(&word(total));
    out.extend_from_slice(&word(json_length));
    out.extend_from_slice(b"JSON");
    out.extend_from_slice(document);
    out.resize(20 + json_length, b' ');
    out.extend_from_slice(&word(body_length));
    out.extend_from_slice(b"BIN\0");
    out.extend_from_slice(body);
    out.resize(total, 0);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::assert_documented;
    use crate::export::made_up::{about, metallic};

    fn parse(bytes: &[u8]) -> (Value, &[u8]) {
        let word = |at: usize| {
            u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")) as usize
        };
        assert_eq!(&bytes[..4], b"glTF");
        assert_eq!((word(4), word(8)), (2, bytes.len()));
        let length = word(12);
        assert_eq!(&bytes[16..20], b"JSON");
        let document = serde_json::from_slice(&bytes[20..20 + length]).expect("JSON");
        assert_eq!(word(20 + length) + 28 + length, bytes.len());
        assert_eq!(&bytes[24 + length..28 + length], b"BIN\0");
        (document, &bytes[28 + length..])
    }

    #[test]
    fn the_chunks_are_whole_and_the_same_every_time() {
        let paint = metallic(6, 5, 20);
        let write = || glb(&paint, &about()).expect("written");
        let bytes = write();
        let (document, body) = parse(&bytes);
        assert_eq!(document["buffers"][0]["byteLength"], body.len());
        assert_eq!(bytes, write());
    }

    #[test]
    fn the_flakes_can_be_read_back_from_the_extras() {
        let paint = metallic(6, 5, 20);
        let bytes = glb(&paint, &about()).expect("written");
        let (document, body) = parse(&bytes);
        let carpaint = &document["materials"][0]["extras"]["carpaint"];
        let index =
            |value: &Value| usize::try_from(value.as_u64().expect("an index")).expect("small");
        let accessor = &document["accessors"][index(&carpaint["flakes"]["upper"])];
        assert_eq!(accessor["name"], "carpaint.flakes.upper");
        let view = &document["bufferViews"][index(&accessor["bufferView"])];
        let at = index(&view["byteOffset"]);
        let upper: Vec<[f32; 3]> =
            bytemuck::pod_collect_to_vec(&body[at..at + index(&view["byteLength"])]);
        assert_eq!(upper, paint.flakes.as_ref().expect("flakes").upper);
        assert_eq!(carpaint["report"]["weights"]["weights"][0], 1.0);
        assert!(carpaint["loss"]["median"].as_f64().expect("a number") < 5.0);
    }

    #[test]
    fn every_number_of_the_extras_is_explained() {
        let paint = metallic(6, 5, 20);
        for paint in [
            paint.clone(),
            CarPaint {
                flakes: None,
                ..paint
            },
        ] {
            let bytes = glb(&paint, &about()).expect("written");
            let (document, _) = parse(&bytes);
            assert_documented(&document["materials"][0]["extras"]["carpaint"]);
        }
    }

    #[test]
    fn a_solid_color_is_a_material_without_textures() {
        let paint = CarPaint {
            flakes: None,
            ..metallic(1, 1, 1)
        };
        let bytes = glb(&paint, &about()).expect("written");
        let (document, _) = parse(&bytes);
        assert!(
            document.get("images").is_none()
                && document["materials"][0].get("normalTexture").is_none()
        );
    }

    #[test]
    fn a_number_that_is_not_finite_is_refused() {
        let mut paint = metallic(2, 2, 3);
        paint.flakes.as_mut().expect("flakes").upper[1][2] = f32::INFINITY;
        assert!(glb(&paint, &about()).is_err());
    }
}
