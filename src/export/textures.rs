//! The textures of a paint: what each holds, where each number stands in it, and its bytes.
//!
//! Clusters are numbered through, slice after slice (θd fastest); cluster `c` stands at column `c mod width`, row
//! `c div width` of every cluster texture. Cumulative probabilities, thresholds and indices are always 32-bit floats: a
//! half next to 1 has steps of 0.0005, and the clusters up there are the sparkle.

use std::sync::OnceLock;

use half::f16;
use half::slice::HalfFloatSliceExt;
use image::ExtendedColorType;
use serde::Serialize;

use super::clamp::{Clamped, finite, halves};
use super::exr_file::{Plane, exr};
use super::png_file::png;
use super::{ExportError, ExportSettings, Precision, alias, inverse_cdf};
use crate::color::{LinearRgb, luminance};
use crate::paint::{CarPaint, Flakes, RandomTexture, cumulative, mean_color};

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

/// All textures of a paint, and what was lost on the way into them.
#[derive(Clone, Debug, Default)]
pub(super) struct Textures {
    pub list: Vec<Texture>,
    pub clamped: Vec<Clamped>,
    pub corner_rounding_lab: f32,
    pub slice_losses: Vec<[f32; 2]>,
    pub inverse_cdf_blocks: usize,
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
        let mut planes: [Vec<f32>; 3] =
            std::array::from_fn(|k| nodes.iter().map(|c| c[k] as f32).collect());
        let height = nodes.len() / width;
        let (bytes, kind) = if precision == Precision::F32 {
            for plane in &planes {
                finite(name, plane)?;
            }
            let [r, g, b] = &planes;
            (
                exr(
                    width,
                    height,
                    &[
                        ("B", Plane::Float(b)),
                        ("G", Plane::Float(g)),
                        ("R", Plane::Float(r)),
                    ],
                ),
                "f32",
            )
        } else {
            let mut half = [const { Vec::new() }; 3];
            for (half, plane) in half.iter_mut().zip(&mut planes) {
                *half = halves(name, plane, &mut self.clamped)?;
            }
            let [r, g, b] = &half;
            (
                exr(
                    width,
                    height,
                    &[
                        ("B", Plane::Half(b)),
                        ("G", Plane::Half(g)),
                        ("R", Plane::Half(r)),
                    ],
                ),
                "f16",
            )
        };
        self.push(
            name,
            "exr",
            bytes,
            Entry {
                width,
                height,
                channels: "RGB",
                kind,
                scale: None,
                offset: None,
                about,
            },
        );
        Ok(())
    }

    fn push(&mut self, name: &'static str, extension: &str, bytes: Vec<u8>, entry: Entry) {
        self.list.push(Texture {
            name,
            file: format!("{name}.{extension}"),
            entry,
            bytes,
        });
    }

    fn floats(
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
        let entry = Entry {
            width,
            height,
            channels,
            kind: "f32",
            scale: None,
            offset: None,
            about,
        };
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
        let (means, luminances) = means(flakes);
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
        self.probability(flakes, width, settings.alias)?;
        if settings.inverse_cdf {
            self.inverse_cdf(flakes, &luminances)?;
        }
        self.random(flakes)
    }

    /// How clusters are drawn: cumulative probability, and the alias table where it is wanted.
    pub(super) fn probability(
        &mut self,
        flakes: &Flakes,
        width: usize,
        alias: bool,
    ) -> Result<(), ExportError> {
        let mut cumulative = cumulative(flakes);
        cumulative.resize(flakes.clusters().div_ceil(width) * width, 1.0);
        let about = "cumulative probability of every cluster within its slice";
        self.floats("cumulative", width, &[("R", &cumulative)], about)?;
        if alias {
            self.alias(flakes, width)?;
        }
        Ok(())
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

    /// Boxes in rows of `width`.
    pub(super) fn corners(
        &mut self,
        lower: &[[f32; 3]],
        upper: &[[f32; 3]],
        width: usize,
        precision: Precision,
    ) -> Result<(), ExportError> {
        let about_lower =
            "corner of smallest L, a, b (R, G, B) of every cluster's box, CIELAB of pi f";
        let about_upper =
            "corner of largest L, a, b (R, G, B) of every cluster's box, CIELAB of pi f";
        let texels = lower.len().div_ceil(width) * width;
        let height = texels / width;
        let range = Range8::of(lower, upper);
        let both = [
            ("corners_lower", lower, about_lower),
            ("corners_upper", upper, about_upper),
        ];
        for (name, corners, about) in both {
            let entry = |kind| Entry {
                width,
                height,
                channels: "RGB",
                kind,
                scale: None,
                offset: None,
                about,
            };
            if precision == Precision::Eight {
                finite(name, corners.as_flattened())?;
                let (pixels, rounding) = range.quantise(corners, texels);
                self.corner_rounding_lab = self.corner_rounding_lab.max(rounding);
                let bytes = png(width, height, &pixels, ExtendedColorType::Rgb8)?;
                let (scale, offset) = (Some(range.scale), Some(range.offset));
                self.push(
                    name,
                    "png",
                    bytes,
                    Entry {
                        scale,
                        offset,
                        ..entry("unorm8")
                    },
                );
                continue;
            }
            let mut planes: [Vec<f32>; 3] = std::array::from_fn(|k| {
                let mut plane: Vec<f32> = Vec::with_capacity(texels);
                plane.extend(corners.iter().map(|c| c[k]));
                plane.resize(texels, 0.0);
                plane
            });
            if precision == Precision::F32 {
                for plane in &planes {
                    finite(name, plane)?;
                }
                let [l, a, b] = &planes;
                let channels = [
                    ("B", Plane::Float(b)),
                    ("G", Plane::Float(a)),
                    ("R", Plane::Float(l)),
                ];
                self.push(name, "exr", exr(width, height, &channels), entry("f32"));
                continue;
            }
            let mut half = [const { Vec::new() }; 3];
            for (half, plane) in half.iter_mut().zip(&mut planes) {
                *half = halves(name, plane, &mut self.clamped)?;
                self.corner_rounding_lab = self.corner_rounding_lab.max(rounding(half, plane));
            }
            let [l, a, b] = &half;
            let channels = [
                ("B", Plane::Half(b)),
                ("G", Plane::Half(a)),
                ("R", Plane::Half(l)),
            ];
            self.push(name, "exr", exr(width, height, &channels), entry("f16"));
        }
        Ok(())
    }

    fn alias(&mut self, flakes: &Flakes, width: usize) -> Result<(), ExportError> {
        let mut builder = alias::Builder::default();
        let mut table = Vec::with_capacity(flakes.clusters());
        for k in 0..flakes.slices() {
            builder.build(flakes.slice_at(k).probability, &mut table);
        }
        let texels = table.len().div_ceil(width) * width;
        #[allow(clippy::cast_possible_truncation)] // texel precision
        let mut threshold: Vec<f32> = table.iter().map(|entry| entry.threshold as f32).collect();
        #[allow(clippy::cast_precision_loss)] // below 2^24, exact
        let mut alias: Vec<f32> = table.iter().map(|entry| entry.alias as f32).collect();
        threshold.resize(texels, 1.0);
        alias.resize(texels, 0.0);
        let about = "alias table of every slice: threshold (R, 0 to 1) and alias (G, cluster within the slice)";
        self.floats("alias", width, &[("R", &threshold), ("G", &alias)], about)
    }

    fn inverse_cdf(&mut self, flakes: &Flakes, luminances: &[f64]) -> Result<(), ExportError> {
        let (slices, steps) = (flakes.slices(), inverse_cdf::STEPS);
        let blocks = slices.div_ceil(MAX_ROWS);
        let (width, height) = (steps * blocks, slices.div_ceil(blocks));
        let mut index = vec![0_u16; width * height];
        if flakes.widest_slice() > usize::from(u16::MAX) {
            let accepted = usize::from(u16::MAX);
            return Err(ExportError::TooMany {
                what: "clusters in a slice",
                count: flakes.widest_slice(),
                accepted,
            });
        }
        self.inverse_cdf_blocks = blocks;
        self.slice_losses.reserve(slices);
        for k in 0..slices {
            let range = flakes.offsets[k] as usize..flakes.offsets[k + 1] as usize;
            let first = k / blocks * width + k % blocks * steps;
            let loss = inverse_cdf::write(
                &flakes.probability[range.clone()],
                &luminances[range],
                &mut index[first..first + steps],
            );
            #[allow(clippy::cast_possible_truncation)] // stated to seven digits
            self.slice_losses.push(loss.map(|v| v as f32));
        }
        let narrow = flakes.widest_slice() <= 256;
        let about = "cluster within the slice at cumulative probability (s + 1/2)/500: slice k holds columns \
                     500 (k mod blocks) + s of row k div blocks";
        let (bytes, kind) = if narrow {
            #[allow(clippy::cast_possible_truncation)] // at most 255
            let pixels: Vec<u8> = index.iter().map(|&cluster| cluster as u8).collect();
            (png(width, height, &pixels, ExtendedColorType::L8)?, "uint8")
        } else {
            // PNG's samples are big-endian, the encoder takes the machine's order.
            (
                png(
                    width,
                    height,
                    bytemuck::cast_slice(&index),
                    ExtendedColorType::L16,
                )?,
                "uint16",
            )
        };
        let entry = Entry {
            width,
            height,
            channels: "R",
            kind,
            scale: None,
            offset: None,
            about,
        };
        self.push("inverse_cdf", "png", bytes, entry);
        Ok(())
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
        let entry = Entry {
            width,
            height,
            channels: "RGBA",
            kind: "uint8",
            scale: None,
            offset: None,
            about,
        };
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

/// Mean color of every slice in 1/sr, and mean luminance of every cluster (of π f).
pub(super) fn means(flakes: &Flakes) -> (Vec<LinearRgb>, Vec<f64>) {
    let mut luminances = Vec::with_capacity(flakes.clusters());
    let means = (0..flakes.slices())
        .map(|k| {
            let slice = flakes.slice_at(k);
            let mut sum = [0.0; 3];
            for ((p, &lower), &upper) in slice.probability.iter().zip(slice.lower).zip(slice.upper)
            {
                let color = mean_color(lower, upper);
                luminances.push(luminance(color));
                for c in 0..3 {
                    sum[c] += p * color[c];
                }
            }
            sum.map(|s| s / std::f64::consts::PI)
        })
        .collect();
    (means, luminances)
}

/// Largest difference between halves and what they stand for.
fn rounding(half: &[f16], exact: &[f32]) -> f32 {
    let mut back = vec![0.0_f32; half.len()];
    half.convert_to_f32_slice(&mut back);
    back.iter()
        .zip(exact)
        .fold(0.0, |worst, (x, y)| f32::max(worst, (x - y).abs()))
}

/// The range of all corners, in 255 steps an axis.
pub(super) struct Range8 {
    pub(super) scale: [f32; 3],
    pub(super) offset: [f32; 3],
}

impl Range8 {
    pub(super) fn of(lower: &[[f32; 3]], upper: &[[f32; 3]]) -> Self {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for corner in lower.iter().chain(upper) {
            for k in 0..3 {
                low[k] = low[k].min(corner[k]);
                high[k] = high[k].max(corner[k]);
            }
        }
        Self {
            scale: std::array::from_fn(|k| high[k] - low[k]),
            offset: low,
        }
    }

    fn quantise(&self, corners: &[[f32; 3]], texels: usize) -> (Vec<u8>, f32) {
        let mut worst = 0.0_f32;
        let mut pixels = Vec::with_capacity(texels * 3);
        for corner in corners {
            for k in 0..3 {
                let share = if self.scale[k] > 0.0 {
                    (corner[k] - self.offset[k]) / self.scale[k]
                } else {
                    0.0
                };
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within 0..=255
                let byte = (share * 255.0).round().clamp(0.0, 255.0) as u8;
                worst = worst.max(
                    (self.offset[k] + self.scale[k] * f32::from(byte) / 255.0 - corner[k]).abs(),
                );
                pixels.push(byte);
            }
        }
        pixels.resize(texels * 3, 0);
        (pixels, worst)
    }
}
