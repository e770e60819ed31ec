//! The textures of a paint: what each holds, where each number stands in it, and its bytes.
//!
//! Clusters are numbered through, slice after slice (θd fastest); cluster `c` stands at column `c mod width`, row
//! `c div width` of every cluster texture. Cumulative probabilities, thresholds and indices are always 32-bit floats: a
//! half next to 1 has steps of 0.0005, and the clusters up there are the sparkle.

use std::sync::OnceLock;

use image::ExtendedColorType;
use serde::Serialize;

use super::clamp::{Clamped, Halves, finite, halves};
use super::exr_file::{Plane, exr};
use super::png_file::png;
use super::{ExportError, ExportSettings, Precision};
use crate::color::LinearRgb;
use crate::paint::{CarPaint, Flakes, RandomTexture};

/// Largest number of clusters: their numbers are exact in a 32-bit float.
pub(super) const MAX_CLUSTERS: usize = 1 << 24;
/// Rows of a texture that every WebGL2 reaches in practice.
pub(super) const MAX_ROWS: usize = 4096;

/// A texture on its way out.
#[derive(Clone, Debug)]
pub(super) struct Texture {
    /// Name in the document and of the shader's sampler.
    pub name: &'static str,
    /// File in the bundle.
    pub file: String,
    /// What it holds.
    pub entry: Entry,
    /// Bytes of the file.
    pub bytes: Vec<u8>,
}

/// What the document says about a texture.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Entry {
    pub width: usize,
    pub height: usize,
    pub channels: &'static str,
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Value = offset + scale * texel, per channel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<[f32; 3]>,
    pub about: &'static str,
}

impl Entry {
    /// Texels that are the values themselves.
    pub fn plain(
        [width, height]: [usize; 2],
        channels: &'static str,
        kind: &'static str,
        about: &'static str,
    ) -> Self {
        Self {
            width,
            height,
            channels,
            kind,
            scale: None,
            offset: None,
            about,
        }
    }
}

/// All textures of a paint, and what was lost on the way into them.
#[derive(Clone, Debug, Default)]
pub(super) struct Textures {
    pub list: Vec<Texture>,
    pub clamped: Vec<Clamped>,
    pub corner_rounding_lab: f32,
    pub slice_losses: Vec<[f32; 2]>,
    pub inverse_cdf_blocks: usize,
}

/// Three planes as a file.
pub(super) struct Planes {
    /// Its bytes and the type of its numbers.
    pub file: (Vec<u8>, &'static str),
    /// Largest difference between a number and what a reader gets back.
    pub rounding: f32,
}

impl Textures {
    /// Writes every texture of a paint.
    pub fn of(paint: &CarPaint, settings: &ExportSettings) -> Result<Self, ExportError> {
        let mut out = Self::default();
        out.color_table(paint, settings.precision)?;
        out.angles(paint);
        if let Some(flakes) = &paint.flakes {
            out.flakes(flakes, settings)?;
        }
        Ok(out)
    }

    fn color_table(&mut self, paint: &CarPaint, precision: Precision) -> Result<(), ExportError> {
        let table = &paint.color_table;
        let nodes: Vec<LinearRgb> = table.nodes().iter().map(|lab| lab.to_rgb()).collect();
        let about =
            "color of diffuse and lobes by half angle, linear sRGB; column theta_d, row theta_h";
        self.colors(
            "color_table",
            table.theta_d().len(),
            &nodes,
            precision,
            about,
        )
    }

    /// A table of linear colors. Eight bits of linear light band: such tables stay halves.
    pub(super) fn colors(
        &mut self,
        name: &'static str,
        width: usize,
        nodes: &[LinearRgb],
        precision: Precision,
        about: &'static str,
    ) -> Result<(), ExportError> {
        #[allow(clippy::cast_possible_truncation)] // texel precision
        let planes = std::array::from_fn(|k| nodes.iter().map(|c| c[k] as f32).collect());
        let height = nodes.len() / width;
        let (bytes, kind) = self.three_planes(name, width, planes, precision)?.file;
        self.push(
            name,
            "exr",
            bytes,
            Entry::plain([width, height], "RGB", kind, about),
        );
        Ok(())
    }

    /// The file of three planes of numbers, as halves unless they are to be whole.
    pub(super) fn three_planes(
        &mut self,
        name: &'static str,
        width: usize,
        mut planes: [Vec<f32>; 3],
        precision: Precision,
    ) -> Result<Planes, ExportError> {
        let file = |planes: [Plane<'_>; 3]| {
            let height = planes[0].len() / width;
            let [r, g, b] = planes;
            exr(width, height, &[("B", b), ("G", g), ("R", r)])
        };
        if precision == Precision::F32 {
            for plane in &planes {
                finite(name, plane)?;
            }
            let bytes = file(planes.each_ref().map(|plane| Plane::Float(plane)));
            return Ok(Planes {
                file: (bytes, "f32"),
                rounding: 0.0,
            });
        }
        let mut written = [const { Halves::none() }; 3];
        for (written, plane) in written.iter_mut().zip(&mut planes) {
            *written = halves(name, plane, &mut self.clamped)?;
        }
        let rounding = written
            .iter()
            .fold(0.0, |worst, own| f32::max(worst, own.rounding));
        let bytes = file(written.each_ref().map(|own| Plane::Half(&own.list)));
        Ok(Planes {
            file: (bytes, "f16"),
            rounding,
        })
    }

    pub(super) fn push(
        &mut self,
        name: &'static str,
        extension: &str,
        bytes: Vec<u8>,
        entry: Entry,
    ) {
        self.list.push(Texture {
            name,
            file: format!("{name}.{extension}"),
            entry,
            bytes,
        });
    }

    pub(super) fn floats(
        &mut self,
        name: &'static str,
        width: usize,
        planes: &[(&'static str, &[f32])],
        about: &'static str,
    ) -> Result<(), ExportError> {
        for (_, plane) in planes {
            finite(name, plane)?;
        }
        let mut channels: Vec<(&str, Plane<'_>)> = planes
            .iter()
            .map(|&(c, plane)| (c, Plane::Float(plane)))
            .collect();
        channels.sort_by_key(|(name, _)| *name);
        let height = planes[0].1.len() / width;
        let bytes = exr(width, height, &channels);
        let channels = if planes.len() == 1 { "R" } else { "RG" };
        let entry = Entry::plain([width, height], channels, "f32", about);
        self.push(name, "exr", bytes, entry);
        Ok(())
    }

    pub(super) fn angles(&mut self, paint: &CarPaint) {
        let table = &paint.color_table;
        let mut rows = vec![table.theta_h().degrees(), table.theta_d().degrees()];
        if let Some(flakes) = &paint.flakes {
            rows.extend([flakes.theta_h.degrees(), flakes.theta_d.degrees()]);
        }
        let width = rows.iter().map(|row| row.len()).max().unwrap_or(1);
        let mut values = Vec::with_capacity(width * rows.len());
        for row in &rows {
            #[allow(clippy::cast_possible_truncation)] // angles at texel precision
            values.extend((0..width).map(|k| row.get(k).copied().unwrap_or(90.0) as f32));
        }
        let about = "angles in degrees: rows 0, 1 theta_h and theta_d of the color table, 2, 3 of the flakes; \
                     the rest of a row is 90";
        // Angle grids are finite by construction.
        let _ = self.floats("angles", width, &[("R", &values)], about);
    }

    fn flakes(&mut self, flakes: &Flakes, settings: &ExportSettings) -> Result<(), ExportError> {
        let clusters = flakes.clusters();
        if clusters > MAX_CLUSTERS {
            return Err(ExportError::TooMany {
                what: "clusters",
                count: clusters,
                accepted: MAX_CLUSTERS,
            });
        }
        let width = cluster_width(clusters);
        let mut luminances = Vec::with_capacity(clusters);
        let means: Vec<LinearRgb> = (0..flakes.slices())
            .map(|k| flakes.slice_at(k).mean_of_boxes(|y| luminances.push(y)))
            .collect();
        let about = "mean of every slice in 1/sr, linear sRGB; column theta_d, row theta_h";
        self.colors(
            "slice_means",
            flakes.theta_d.len(),
            &means,
            settings.precision,
            about,
        )?;
        self.slices(flakes)?;
        self.corners(&flakes.lower, &flakes.upper, width, settings.precision)?;
        self.draws(flakes, width, settings.alias)?;
        if settings.inverse_cdf {
            self.inverse_cdf(flakes, &luminances)?;
        }
        self.random(flakes)
    }

    pub(super) fn slices(&mut self, flakes: &Flakes) -> Result<(), ExportError> {
        #[allow(clippy::cast_precision_loss)] // below 2^24, exact
        let exact = |n: u32| n as f32;
        let first: Vec<f32> = flakes.offsets[..flakes.slices()]
            .iter()
            .map(|&o| exact(o))
            .collect();
        let count: Vec<f32> = flakes
            .offsets
            .windows(2)
            .map(|w| exact(w[1] - w[0]))
            .collect();
        let about = "first cluster (R) and number of clusters (G) of every slice; column theta_d, row theta_h";
        self.floats(
            "slices",
            flakes.theta_d.len(),
            &[("R", &first), ("G", &count)],
            about,
        )
    }

    pub(super) fn random(&mut self, flakes: &Flakes) -> Result<(), ExportError> {
        static KNOWN: [OnceLock<Vec<u8>>; RandomTexture::KINDS] =
            [const { OnceLock::new() }; RandomTexture::KINDS];
        let tile = RandomTexture::of(&flakes.texture);
        let (width, height) = (tile.width() as usize, tile.height() as usize);
        let known = &KNOWN[RandomTexture::kind(&flakes.texture)];
        let bytes = if let Some(bytes) = known.get() {
            bytes.clone()
        } else {
            let pixels: Vec<u8> = tile
                .cells()
                .iter()
                .flat_map(|cell| cell.to_le_bytes())
                .collect();
            let bytes = png(width, height, &pixels, ExtendedColorType::Rgba8)?;
            known.get_or_init(|| bytes).clone()
        };
        let about = "32-bit number of every texel's cell, lowest byte in R, highest in A (read it without \
                     premultiplication or color management); the tile repeats, see carpaint_cell in the shader";
        let entry = Entry::plain([width, height], "RGBA", "uint8", about);
        self.push("random", "png", bytes, entry);
        Ok(())
    }
}

/// Columns of the cluster textures: as few as rows allow, so that small paints stay small.
fn cluster_width(clusters: usize) -> usize {
    let mut width = 256;
    while clusters.div_ceil(width) > MAX_ROWS.min(width) && width < 4096 {
        width *= 2;
    }
    width
}
