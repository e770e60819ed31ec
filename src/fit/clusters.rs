//! Color clusters of a slice: at most n boxes in CIELAB that draw like its texels.
//!
//! A slice's texels are few bright ones over a dark crowd, and the bright ones are the sparkle. The brightest two dozen
//! of 4096 texels get small clusters of their own: 1, 1 and 1, then the 3 around the 99.9th percentile, where sparkle is
//! judged, then 2, 2, 4 and 8, in proportion for other sizes. Where the cluster around the percentile holds few texels it
//! is the color there, between those of two texels as a percentile is read: a step of the histogram would make the
//! percentile of any finite drawing jump. What that takes from the mean the brighter ones give back. The rest is split where the squared distance from the
//! clusters' means is largest: at the mean of the axis that spreads most, or, along lightness, where the split lowers the
//! sum of squares most. A leaf's box then follows one of two rules:
//!
//! - [`BoxRule::Moments`]: mean ± √3 σ on each axis, the uniform box of the members' variance, shifted so that its mean
//!   in *linear light* is its members' ([`center_of_mean`](crate::paint::center_of_mean)). Light adds in linear RGB: the
//!   slice's mean is kept exactly, to the rounding of `f32` corners. Boxes reach beyond their members; negative light
//!   from sensor noise is kept.
//! - [`BoxRule::Tight`]: the members' bounding box (Golla and Klein 2018, fig. 2c). Keeps the sparkle, misses the mean.
//!
//! Pixels that are not finite are left out, and so counted; colors beyond |Lab| = 2000 are held there, and so counted.
//! Clusters ascend in the lightness of their centers. Equal boxes are one cluster.

use std::cmp::Ordering;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::boxes::{BoxRule, Corners, Members, of_moments};
use super::texels::{Texel, linear, take_in};
use crate::color::Lab;
use brightest::{SPARKLE, bright_groups, brightest_last};
use crowd::Crowd;

mod brightest;
mod crowd;
mod sampled;

/// How a slice is clustered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClusterSettings {
    /// Most clusters of a slice, at least 1.
    pub clusters: usize,
    /// Rule of the boxes.
    pub box_rule: BoxRule,
    /// Of the measured angles every n-th is fitted, on either grid, and the last; at least 1.
    pub angle_step: usize,
}

impl Default for ClusterSettings {
    fn default() -> Self {
        Self {
            clusters: 50,
            box_rule: BoxRule::Moments,
            angle_step: 1,
        }
    }
}

/// Clusters of one slice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SliceClusters {
    /// Share of the texels, sums to 1.
    pub probability: Vec<f64>,
    /// Corner of smallest L, a, b.
    pub lower: Vec<[f32; 3]>,
    /// Corner of largest L, a, b.
    pub upper: Vec<[f32; 3]>,
    /// Pixels that were not finite.
    pub dead: usize,
    /// Pixels beyond |Lab| = 2000.
    pub beyond: usize,
    /// What W1 between the texels and the boxes is at most, Lab units: each texel moved to a color of its own
    /// cluster's box, drawn independently. `E|x − u| ≤ √(Σ_axis σ² + h²/3 + (m − c)²)` in each cluster of mean m and
    /// spread σ with a box of center c and half width h.
    pub w1_bound: f64,
}

/// A slice without a single finite pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("none of its {pixels} pixels is finite")]
pub struct NoTexel {
    /// Pixels in all.
    pub pixels: usize,
}

/// Share of the clusters that the brightest texels get.
const BRIGHT_SHARE: usize = 5;
/// Largest cluster that the sparkle is a single color in.
const FLAT: usize = 8;

/// Room for clustering, kept from slice to slice.
#[derive(Debug, Default)]
pub struct Clusterer {
    texels: Vec<Texel>,
    /// The picture's numbers, pixel by pixel.
    light: Vec<[f32; 4]>,
    crowd: Crowd,
    passage: sampled::Passage,
}

impl Clusterer {
    /// Clusters the texels of a slice: red, green and blue planes of BRDF in 1/sr.
    ///
    /// # Errors
    ///
    /// [`NoTexel`] when no pixel is finite.
    pub fn cluster(
        &mut self,
        planes: [&[f32]; 3],
        settings: &ClusterSettings,
    ) -> Result<SliceClusters, NoTexel> {
        self.cluster_by_sample(planes, settings)
            .map_or_else(|| self.cluster_all(planes, settings), Ok)
    }

    /// Clusters with every texel at hand.
    fn cluster_all(
        &mut self,
        planes: [&[f32]; 3],
        settings: &ClusterSettings,
    ) -> Result<SliceClusters, NoTexel> {
        let pixels = planes[0].len();
        let (dead, beyond) = take_in(planes, &mut self.texels, &mut self.light);
        if self.texels.is_empty() {
            return Err(NoTexel { pixels });
        }
        let most = settings.clusters.max(1);
        let count = self.texels.len();
        let mut ends = bright_groups(count, most / BRIGHT_SHARE);
        let taken = ends.last().copied().unwrap_or(0);
        let crowd = if taken == 0 || taken >= count {
            ends.clear();
            count
        } else {
            brightest_last(&mut self.texels, taken);
            count - taken
        };
        self.crowd
            .split(&mut self.texels[..crowd], most - ends.len());
        let mut leaves: Vec<Range<usize>> = groups(crowd, &ends).collect();
        leaves.extend(self.crowd.runs());
        Ok(SliceClusters {
            dead,
            beyond,
            ..gathered(self.boxes(crowd, &leaves, settings.box_rule))
        })
    }

    /// The leaves with their boxes.
    fn boxes(
        &self,
        crowd: usize,
        leaves: &[Range<usize>],
        rule: BoxRule,
    ) -> Vec<(Members, Corners)> {
        let light = self.light.as_slice();
        // The leaf around the 99.9th percentile, where it is small: the texels before and after it.
        let rank = SPARKLE * (self.texels.len() as f64 - 1.0);
        let [before, after] = [rank.floor(), rank.ceil()].map(|k| crowd + k as usize);
        let flat = leaves
            .iter()
            .position(|leaf| leaf.contains(&before) && leaf.contains(&after) && leaf.len() <= FLAT);
        let (mut sparkle, mut owed, mut brighter) = ([0.0; 3], [0.0; 3], 0);
        if let Some(flat) = flat {
            let [more, less] = [before, after].map(|k| linear(&self.texels[k], light));
            sparkle = std::array::from_fn(|k| more[k] + (less[k] - more[k]) * rank.fract());
            for texel in &self.texels[leaves[flat].clone()] {
                let own = linear(texel, light);
                (0..3).for_each(|k| owed[k] += own[k] - sparkle[k]);
            }
            brighter = leaves[flat].start - crowd;
        }
        let leaves = leaves.iter().enumerate().map(|(number, leaf)| {
            let texels = &self.texels[leaf.clone()];
            let members = Members::of(texels, light);
            let corners = match rule {
                BoxRule::Tight => members.hull,
                BoxRule::Moments if Some(number) == flat && brighter > 0 => {
                    of_moments(Lab::from_rgb(sparkle).to_array(), [0.0; 3], sparkle)
                }
                BoxRule::Moments if flat.is_some_and(|flat| number < flat) => {
                    members.moments(owed.map(|o| o / brighter as f64))
                }
                BoxRule::Moments => members.moments([0.0; 3]),
            };
            (members, corners)
        });
        leaves.collect()
    }
}

/// Where the groups of the brightest texels are that begin at `crowd`.
fn groups(crowd: usize, ends: &[usize]) -> impl Iterator<Item = Range<usize>> {
    let starts = std::iter::once(0).chain(ends.iter().copied());
    starts
        .zip(ends)
        .map(move |(from, to)| crowd + from..crowd + to)
}

/// Leaves and their boxes as clusters, lightest last.
fn gathered(leaves: Vec<(Members, Corners)>) -> SliceClusters {
    let (mut moved, mut whole) = (0.0, 0.0);
    for (members, corners) in &leaves {
        moved += members.count * members.reach(*corners);
        whole += members.count;
    }
    let mut boxes: Vec<(f64, [f32; 3], [f32; 3])> = leaves
        .into_iter()
        .map(|(members, (lower, upper))| (members.count, lower, upper))
        .collect();
    let center = |(_, l, u): &(f64, [f32; 3], [f32; 3])| [0, 1, 2].map(|k| l[k] + u[k]);
    boxes.sort_by(|x, y| {
        let (cx, cy) = (center(x), center(y));
        let order =
            |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|k| a[k].total_cmp(&b[k])).find(|o| o.is_ne());
        let order = order(&cx, &cy)
            .or_else(|| order(&x.1, &y.1))
            .or_else(|| order(&x.2, &y.2));
        order.unwrap_or(Ordering::Equal)
    });
    boxes.dedup_by(|next, kept| {
        let same = (next.1, next.2) == (kept.1, kept.2);
        kept.0 += if same { next.0 } else { 0.0 };
        same
    });
    SliceClusters {
        probability: boxes.iter().map(|b| b.0 / whole).collect(),
        lower: boxes.iter().map(|b| b.1).collect(),
        upper: boxes.iter().map(|b| b.2).collect(),
        dead: 0,
        beyond: 0,
        w1_bound: moved / whole,
    }
}

#[cfg(test)]
mod tests;
