//! The textures by which clusters are drawn: cumulative probability, alias table, inverse distribution in steps.

use image::ExtendedColorType;

use super::png_file::png;
use super::textures::{Entry, MAX_ROWS, Textures};
use super::{ExportError, alias, inverse_cdf};
use crate::paint::{Flakes, cumulative};

impl Textures {
    /// How clusters are drawn: cumulative probability, and the alias table where it is wanted.
    pub(super) fn draws(
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

    fn alias(&mut self, flakes: &Flakes, width: usize) -> Result<(), ExportError> {
        let mut builder = alias::Builder::default();
        let mut table = Vec::with_capacity(flakes.widest_slice());
        let texels = flakes.clusters().next_multiple_of(width);
        let (mut threshold, mut alias) = (Vec::with_capacity(texels), Vec::with_capacity(texels));
        for k in 0..flakes.slices() {
            table.clear();
            builder.build(flakes.slice_at(k).probability, &mut table);
            #[allow(clippy::cast_possible_truncation)] // texel precision
            threshold.extend(table.iter().map(|entry| entry.threshold as f32));
            #[allow(clippy::cast_precision_loss)] // below 2^24, exact
            alias.extend(table.iter().map(|entry| entry.alias as f32));
        }
        threshold.resize(texels, 1.0);
        alias.resize(texels, 0.0);
        let about = "alias table of every slice: threshold (R, 0 to 1) and alias (G, cluster within the slice)";
        self.floats("alias", width, &[("R", &threshold), ("G", &alias)], about)
    }

    pub(super) fn inverse_cdf(
        &mut self,
        flakes: &Flakes,
        luminances: &[f64],
    ) -> Result<(), ExportError> {
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
        let entry = Entry::plain([width, height], "R", kind, about);
        self.push("inverse_cdf", "png", bytes, entry);
        Ok(())
    }
}
