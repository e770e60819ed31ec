//! The textures by which clusters are drawn: cumulative probability, alias table, inverse distribution in steps.

use image::ExtendedColorType;

use super::inverse_cdf::Step;
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
        let [threshold, alias] = alias_planes(flakes, flakes.clusters().next_multiple_of(width));
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
        if flakes.widest_slice() > usize::from(u16::MAX) {
            let accepted = usize::from(u16::MAX);
            return Err(ExportError::TooMany {
                what: "clusters in a slice",
                count: flakes.widest_slice(),
                accepted,
            });
        }
        self.inverse_cdf_blocks = blocks;
        let about = "cluster within the slice at cumulative probability (s + 1/2)/500: slice k holds columns \
                     500 (k mod blocks) + s of row k div blocks";
        let texels = width * height;
        let (bytes, kind) = if flakes.widest_slice() <= 256 {
            let index: Vec<u8> = self.steps(flakes, luminances, texels);
            (png(width, height, &index, ExtendedColorType::L8)?, "uint8")
        } else {
            let index: Vec<u16> = self.steps(flakes, luminances, texels);
            // PNG's samples are big-endian, the encoder takes the machine's order.
            let bytes = bytemuck::cast_slice(&index);
            (png(width, height, bytes, ExtendedColorType::L16)?, "uint16")
        };
        let entry = Entry::plain([width, height], "R", kind, about);
        self.push("inverse_cdf", "png", bytes, entry);
        Ok(())
    }

    /// The steps of all slices, slice after slice, and what each loses.
    fn steps<T: Step>(&mut self, flakes: &Flakes, luminances: &[f64], texels: usize) -> Vec<T> {
        let mut index = vec![T::of(0); texels];
        self.slice_losses.reserve(flakes.slices());
        let rows = index.chunks_exact_mut(inverse_cdf::STEPS);
        for (row, range) in rows.zip(flakes.offsets.windows(2)) {
            let range = range[0] as usize..range[1] as usize;
            let probability = &flakes.probability[range.clone()];
            let loss = inverse_cdf::write(probability, &luminances[range], row);
            #[allow(clippy::cast_possible_truncation)] // stated to seven digits
            self.slice_losses.push(loss.map(|v| v as f32));
        }
        index
    }
}

/// Thresholds and aliases of all slices, slice after slice; whole slots beyond.
fn alias_planes(flakes: &Flakes, texels: usize) -> [Vec<f32>; 2] {
    let mut slots = alias::Slots::default();
    let mut threshold = vec![1.0; texels];
    let mut alias = Vec::with_capacity(texels);
    for range in flakes.offsets.windows(2) {
        let first = alias.len();
        let range = range[0] as usize..range[1] as usize;
        #[allow(clippy::cast_precision_loss)] // below 2^24, exact
        alias.extend((0..range.len()).map(|cluster| cluster as f32));
        let (threshold, alias) = (&mut threshold[first..], &mut alias[first..]);
        slots.share(&flakes.probability[range], |slot, share, other| {
            #[allow(clippy::cast_possible_truncation)] // texel precision
            let share = share as f32;
            threshold[slot as usize] = share;
            #[allow(clippy::cast_precision_loss)] // below 2^24, exact
            let other = other as f32;
            alias[slot as usize] = other;
        });
    }
    alias.resize(texels, 0.0);
    [threshold, alias]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::made_up::metallic;

    #[test]
    fn planes_hold_the_alias_table_of_every_slice_in_turn() {
        for clusters in [1, 20] {
            let paint = metallic(4, 3, clusters);
            let flakes = paint.flakes.expect("a metallic");
            let texels = flakes.clusters() + 3;
            let [threshold, alias] = alias_planes(&flakes, texels);
            let tables = (0..flakes.slices())
                .flat_map(|k| alias::alias_table(flakes.slice_at(k).probability));
            for (k, entry) in tables.enumerate() {
                #[allow(clippy::cast_possible_truncation)] // as the texture has it
                let wanted = entry.threshold as f32;
                assert_eq!((threshold[k], alias[k]), (wanted, entry.alias as f32));
            }
            assert_eq!(threshold[flakes.clusters()..], [1.0; 3]);
            assert_eq!(alias.len(), texels);
        }
    }
}
