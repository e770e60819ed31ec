//! What a blend holds of each paint, in the order asked for, with everything a realisation would have to agree on first
//! agreed on: lobes matched place by place, a coat for everyone where one is coated. For exporters of whole blends, whose
//! readers take weighted sums and decide nothing.

use super::{Blend, Boxes, base, lobes};
use crate::paint::{Coat, ColorTable, FlakeTexture, Lobe};

/// One paint of a blend.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part<'a> {
    /// What its owner calls it.
    pub name: &'a str,
    /// Content hash, hexadecimal.
    pub hash: &'a str,
    /// Coat that blends: index 1 where this paint is uncoated and another is not, `None` where no paint is coated.
    pub coat: Option<Coat>,
    /// Lambertian albedo.
    pub diffuse: [f64; 3],
    /// Lobes, as many as every other paint of the blend has, in corresponding places.
    pub lobes: Vec<Lobe>,
    /// Color table on the blend's common angles.
    pub color_table: &'a ColorTable,
    /// Boxes of the blend's clusters in this paint, `None` where no paint has flakes.
    pub boxes: Option<&'a Boxes>,
    /// Grain and lifetime.
    pub texture: Option<FlakeTexture>,
}

impl Blend {
    /// The paints, in the order asked for.
    pub(crate) fn parts(&self) -> Vec<Part<'_>> {
        let places = self.matched_lobes();
        let coats = base::coats(&self.paints);
        self.asked
            .iter()
            .map(|&k| {
                let paint = &self.paints[k];
                Part {
                    name: &paint.name,
                    hash: &paint.hash,
                    coat: coats.as_ref().map(|coats| coats[k]),
                    diffuse: paint.diffuse,
                    lobes: places.iter().map(|lobes| lobes[k]).collect(),
                    color_table: &paint.color_table,
                    boxes: self.flakes.as_ref().map(|flakes| &flakes.boxes[k]),
                    texture: self.flakes.as_ref().map(|flakes| flakes.textures[k]),
                }
            })
            .collect()
    }

    /// Lobes place by place, in each place one a paint in the order of `paints`.
    pub(super) fn matched_lobes(&self) -> Vec<Vec<Lobe>> {
        let lists: Vec<&[Lobe]> = self.paints.iter().map(|p| p.lobes.as_slice()).collect();
        lobes::matched(&lists)
    }
}
