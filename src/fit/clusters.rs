//! Color clusters of a slice: at most n boxes in CIELAB that draw like its texels.
//!
//! A slice's texels are few bright ones over a dark crowd, and the bright ones are the sparkle. The brightest two dozen
//! of 4096 texels get small clusters of their own: 1, 1 and 1, then the 3 around the 99.9th percentile, where sparkle is
//! judged, then 2, 2, 4 and 8, in proportion for other sizes. Where the cluster around the percentile holds few texels it
//! is the color of its middle one: a step of the histogram there would make the percentile of any finite drawing jump.
//! What that takes from the mean the brighter ones give back. The rest is split where the squared distance from the
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

use serde::{Deserialize, Serialize};

use super::boxes::{BoxRule, moments, reach, tight};
use super::texels::{Texel, linear, take_in};

/// How a slice is clustered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClusterSettings {
    /// Most clusters of a slice, at least 1.
    pub clusters: usize,
    /// Rule of the boxes.
    pub box_rule: BoxRule,
    /// Of the measured angles every so many-th is fitted, on either grid, and the last; at least 1.
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

/// Share of the brightest texels at which sparkle is judged: the 99.9th percentile.
const SPARKLE: f64 = 1e-3;
/// Share of the clusters that the brightest texels get.
const BRIGHT_SHARE: usize = 5;
/// Sizes of the clusters below the sparkle's, of 4096 texels.
const BELOW_SPARKLE: [usize; 4] = [2, 2, 4, 8];
/// Largest cluster that the sparkle is a single color in.
const FLAT: usize = 8;
/// Brightest texels up to which a list of them beats partial sorting.
const LISTED: usize = 64;
/// Buckets of lightness that the crowd is sorted into.
const BUCKETS: usize = 256;

/// Room for clustering, kept from slice to slice.
#[derive(Debug, Default)]
pub struct Clusterer {
    texels: Vec<Texel>,
    /// The picture's numbers, pixel by pixel.
    light: Vec<[f32; 4]>,
    sorted: Vec<Texel>,
    bucket: Vec<u8>,
    leaves: Vec<Node>,
    /// Texels that are not among the brightest.
    crowd: usize,
}

/// Sums over texels, around [`Clusterer`]'s origin.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f32,
    first: [f32; 4],
    second: [f32; 4],
}

impl Sums {
    fn of(texels: &[Texel], origin: &Texel) -> Self {
        let mut sums = Self {
            count: texels.len() as f32,
            ..Self::default()
        };
        for texel in texels {
            for k in 0..4 {
                let d = texel[k] - origin[k];
                sums.first[k] += d;
                sums.second[k] += d * d;
            }
        }
        sums
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        for k in 0..4 {
            self.first[k] += other.first[k];
            self.second[k] += other.second[k];
        }
    }

    /// The sums over the texels that `part` leaves. Rounding matters little: they only choose where to split.
    fn without(mut self, part: &Self) -> Self {
        self.count -= part.count;
        for k in 0..4 {
            self.first[k] -= part.first[k];
            self.second[k] -= part.second[k];
        }
        self
    }

    /// Squared distances from the mean, per axis.
    fn spread(&self, axis: usize) -> f32 {
        (self.second[axis] - self.first[axis] * self.first[axis] / self.count.max(1.0)).max(0.0)
    }
}

/// A run of texels that may be split further.
#[derive(Clone, Copy, Debug)]
struct Node {
    from: usize,
    to: usize,
    /// Buckets of lightness, while the texels still lie in their order.
    buckets: Option<(usize, usize)>,
    sums: Sums,
    /// Sum of squares that a split can lower; 0 when there is nothing to split.
    spread: f32,
    axis: usize,
}

impl Node {
    fn new(from: usize, to: usize, buckets: Option<(usize, usize)>, sums: Sums) -> Self {
        let spreads = [sums.spread(0), sums.spread(1), sums.spread(2)];
        let axis = (0..3).fold(
            0,
            |best, k| if spreads[k] > spreads[best] { k } else { best },
        );
        let spread = if to - from > 1 {
            spreads.iter().sum()
        } else {
            0.0
        };
        Self {
            from,
            to,
            buckets,
            sums,
            spread,
            axis,
        }
    }
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
        let pixels = planes[0].len();
        let (dead, beyond) = take_in(planes, &mut self.texels, &mut self.light);
        if self.texels.is_empty() {
            return Err(NoTexel { pixels });
        }
        let most = settings.clusters.max(1);
        self.leaves.clear();
        self.crowd = self.take_brightest(most);
        self.split_crowd(self.crowd, most - self.leaves.len());
        let mut clusters = self.boxes(settings.box_rule);
        (clusters.dead, clusters.beyond) = (dead, beyond);
        Ok(clusters)
    }

    /// Moves the brightest texels behind the others, a leaf for each group; returns how many the others are.
    fn take_brightest(&mut self, most: usize) -> usize {
        let count = self.texels.len();
        let ends = bright_groups(count, most / BRIGHT_SHARE);
        let taken = ends.last().copied().unwrap_or(0);
        if taken == 0 || taken >= count {
            return count;
        }
        let crowd = count - taken;
        if taken <= LISTED {
            self.list_brightest(crowd);
        } else {
            self.texels.select_nth_unstable_by(crowd, by_lightness);
            self.texels[crowd..].sort_unstable_by(|x, y| by_lightness(y, x));
        }
        let mut from = 0;
        for to in ends {
            self.leaves
                .push(Node::new(crowd + from, crowd + to, None, Sums::default()));
            from = to;
        }
        crowd
    }

    /// Moves all but `crowd` texels, the brightest, to the end, the brightest of them first: by a short list.
    fn list_brightest(&mut self, crowd: usize) {
        let taken = self.texels.len() - crowd;
        let mut list: Vec<Texel> = Vec::with_capacity(taken + 1);
        let mut least = f32::NEG_INFINITY;
        for texel in &self.texels {
            if texel[0] >= least {
                let place = list.partition_point(|brighter| by_lightness(brighter, texel).is_gt());
                list.insert(place, *texel);
                list.truncate(taken);
                if list.len() == taken {
                    least = list[taken - 1][0];
                }
            }
        }
        let (last, mut end, mut k) = (list[taken - 1], self.texels.len(), 0);
        while end > crowd {
            if self.texels[k][0] >= least && by_lightness(&self.texels[k], &last).is_ge() {
                end -= 1;
                self.texels.swap(k, end);
            } else {
                k += 1;
            }
        }
        self.texels[crowd..].copy_from_slice(&list);
    }

    /// Splits the first `crowd` texels into at most `most` leaves.
    fn split_crowd(&mut self, crowd: usize, most: usize) {
        let (origin, starts, sums) = self.sort_into_buckets(crowd);
        let first = self.leaves.len();
        self.leaves.push(bucketed(&starts, &sums, 0, BUCKETS));
        // A run that lost its buckets is split by moving its texels.
        while self.leaves.len() - first < most {
            let widest = (first..self.leaves.len()).reduce(|best, k| {
                if self.leaves[k].spread > self.leaves[best].spread {
                    k
                } else {
                    best
                }
            });
            let Some(widest) = widest.filter(|k| self.leaves[*k].spread > 0.0) else {
                break;
            };
            let node = self.leaves[widest];
            let mean = origin[node.axis] + node.sums.first[node.axis] / node.sums.count;
            let halves = match node.buckets {
                Some((low, high)) if node.axis == 0 => split_buckets(&starts, &sums, low, high),
                _ => None,
            };
            let halves = halves.or_else(|| {
                let middle =
                    node.from + partition(&mut self.texels[node.from..node.to], node.axis, mean);
                (middle > node.from && middle < node.to).then(|| {
                    let runs = [node.from..middle, middle..node.to];
                    let fewer = usize::from(runs[1].len() < runs[0].len());
                    let sums = Sums::of(&self.texels[runs[fewer].clone()], &origin);
                    let others = node.sums.without(&sums);
                    let sums = if fewer == 0 {
                        [sums, others]
                    } else {
                        [others, sums]
                    };
                    [0, 1].map(|k| Node::new(runs[k].start, runs[k].end, None, sums[k]))
                })
            });
            match halves {
                Some([left, right]) => {
                    self.leaves[widest] = left;
                    self.leaves.push(right);
                }
                None => self.leaves[widest].spread = 0.0,
            }
        }
    }

    /// Sorts the crowd by bucket of lightness; returns the origin of the sums, the buckets' starts and sums.
    fn sort_into_buckets(&mut self, crowd: usize) -> (Texel, Vec<usize>, Vec<Sums>) {
        let texels = &self.texels[..crowd];
        let (mut low, mut high) = (texels[0], texels[0]);
        for texel in texels {
            for k in 0..4 {
                low[k] = if texel[k] < low[k] { texel[k] } else { low[k] };
                high[k] = if texel[k] > high[k] {
                    texel[k]
                } else {
                    high[k]
                };
            }
        }
        // Sums about any point in the crowd keep their digits; a sample's mean is such a point.
        let sample = texels.iter().step_by(16);
        let share = 1.0 / sample.len() as f32;
        let mut origin = [0.0; 4];
        for texel in sample {
            for k in 0..4 {
                origin[k] += texel[k] * share;
            }
        }
        let scale = if high[0] > low[0] {
            BUCKETS as f32 / (high[0] - low[0])
        } else {
            0.0
        };
        self.bucket.clear();
        self.bucket.extend(
            texels
                .iter()
                .map(|texel| (((texel[0] - low[0]) * scale) as usize).min(BUCKETS - 1) as u8),
        );
        let mut starts = vec![0_usize; BUCKETS + 1];
        for &bucket in &self.bucket {
            starts[usize::from(bucket) + 1] += 1;
        }
        for k in 0..BUCKETS {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        self.sorted.clear();
        self.sorted.resize(crowd, [0.0; 4]);
        for (texel, &bucket) in texels.iter().zip(&self.bucket) {
            let place = &mut next[usize::from(bucket)];
            self.sorted[*place] = *texel;
            *place += 1;
        }
        self.texels[..crowd].copy_from_slice(&self.sorted);
        let sums = starts
            .windows(2)
            .map(|w| Sums::of(&self.texels[w[0]..w[1]], &origin))
            .collect();
        (origin, starts, sums)
    }

    /// The leaf around the 99.9th percentile, where it is small.
    fn flat_leaf(&self) -> Option<usize> {
        let sparkle = self.crowd + (SPARKLE * self.texels.len() as f64) as usize;
        let small =
            |leaf: &Node| leaf.from <= sparkle && sparkle < leaf.to && leaf.to - leaf.from <= FLAT;
        self.leaves.iter().position(small)
    }

    /// The boxes of all leaves, lightest last.
    fn boxes(&self, rule: BoxRule) -> SliceClusters {
        let mut boxes: Vec<(usize, [f32; 3], [f32; 3])> = Vec::with_capacity(self.leaves.len());
        let (flat, light) = (self.flat_leaf(), self.light.as_slice());
        let (mut owed, mut brighter) = ([0.0; 3], 0);
        if let Some(flat) = flat {
            let members = &self.texels[self.leaves[flat].from..self.leaves[flat].to];
            let middle = linear(&members[members.len() / 2], light);
            for texel in members {
                let own = linear(texel, light);
                (0..3).for_each(|k| owed[k] += own[k] - middle[k]);
            }
            brighter = self.leaves[flat].from - self.crowd;
        }
        let mut moved = 0.0;
        for (number, leaf) in self.leaves.iter().enumerate() {
            let members = &self.texels[leaf.from..leaf.to];
            let (lower, upper) = match rule {
                BoxRule::Tight => tight(members),
                BoxRule::Moments if Some(number) == flat && brighter > 0 => {
                    moments(&members[members.len() / 2..][..1], light, [0.0; 3])
                }
                BoxRule::Moments if flat.is_some_and(|flat| number < flat) => {
                    moments(members, light, owed.map(|o| o / brighter as f64))
                }
                BoxRule::Moments => moments(members, light, [0.0; 3]),
            };
            moved += members.len() as f64 * reach(members, lower, upper);
            boxes.push((members.len(), lower, upper));
        }
        let center = |(_, l, u): &(usize, [f32; 3], [f32; 3])| [0, 1, 2].map(|k| l[k] + u[k]);
        boxes.sort_by(|x, y| {
            let (cx, cy) = (center(x), center(y));
            let order = |a: &[f32; 3], b: &[f32; 3]| {
                (0..3).map(|k| a[k].total_cmp(&b[k])).find(|o| o.is_ne())
            };
            let order = order(&cx, &cy)
                .or_else(|| order(&x.1, &y.1))
                .or_else(|| order(&x.2, &y.2));
            order.unwrap_or(Ordering::Equal)
        });
        boxes.dedup_by(|next, kept| {
            let same = (next.1, next.2) == (kept.1, kept.2);
            kept.0 += if same { next.0 } else { 0 };
            same
        });
        let whole = self.texels.len() as f64;
        SliceClusters {
            probability: boxes.iter().map(|b| b.0 as f64 / whole).collect(),
            lower: boxes.iter().map(|b| b.1).collect(),
            upper: boxes.iter().map(|b| b.2).collect(),
            dead: 0,
            beyond: 0,
            w1_bound: moved / whole,
        }
    }
}

/// Order of lightness, of the place in the picture among equals.
fn by_lightness(x: &Texel, y: &Texel) -> Ordering {
    x[0].total_cmp(&y[0]).then(x[3].total_cmp(&y[3]))
}

/// Ends of the groups of the brightest of `count` texels, brightest first, in at most `groups` groups.
fn bright_groups(count: usize, groups: usize) -> Vec<usize> {
    let rank = SPARKLE * (count as f64 - 1.0);
    let (middle, reach) = (rank.round() as usize, (0.3 * rank).round() as usize);
    let (from, to) = (middle - reach, middle + reach + 1);
    let mut ends = match groups {
        0..3 => Vec::new(),
        3..6 => vec![from, to],
        _ => vec![from / 3, from * 2 / 3, from, to],
    };
    for size in BELOW_SPARKLE
        .into_iter()
        .take(groups.saturating_sub(ends.len()))
    {
        if let Some(end) = ends.last().copied() {
            ends.push(end + (count * size + 2048) / 4096);
        }
    }
    ends.retain(|end| *end > 0);
    ends.dedup();
    ends
}

/// The node of a run of buckets.
fn bucketed(starts: &[usize], sums: &[Sums], low: usize, high: usize) -> Node {
    let mut sum = Sums::default();
    for bucket in &sums[low..high] {
        sum.add(bucket);
    }
    Node::new(starts[low], starts[high], Some((low, high)), sum)
}

/// Splits a run of buckets where the sum of squares of lightness falls most.
fn split_buckets(starts: &[usize], sums: &[Sums], low: usize, high: usize) -> Option<[Node; 2]> {
    let (mut count, mut light) = (0.0_f32, 0.0_f32);
    for bucket in &sums[low..high] {
        count += bucket.count;
        light += bucket.first[0];
    }
    let (mut left, mut left_light, mut best) = (0.0_f32, 0.0_f32, (0.0_f32, None));
    for k in low..high - 1 {
        left += sums[k].count;
        left_light += sums[k].first[0];
        if left == 0.0 || sums[k].count == 0.0 || left == count {
            continue;
        }
        let right_light = light - left_light;
        let between = left_light / left - right_light / (count - left);
        let gain = left * (count - left) * between * between;
        if gain > best.0 {
            best = (gain, Some(k + 1));
        }
    }
    best.1.map(|k| {
        [
            bucketed(starts, sums, low, k),
            bucketed(starts, sums, k, high),
        ]
    })
}

/// Moves the texels below `pivot` on an axis to the front; returns how many they are.
///
/// Without a branch to guess, and with the comparison before the exchange: through memory it would wait for the stores.
#[allow(clippy::manual_swap)]
fn partition(texels: &mut [Texel], axis: usize, pivot: f32) -> usize {
    let mut below = 0;
    for k in 0..texels.len() {
        let goes = usize::from(texels[k][axis] < pivot);
        let texel = texels[k];
        texels[k] = texels[below];
        texels[below] = texel;
        below += goes;
    }
    below
}

#[cfg(test)]
mod tests;
