//! Color clusters of a slice: at most n boxes in CIELAB that draw like its texels.
//!
//! A slice's texels are few bright ones over a dark crowd, and the bright ones are the sparkle. The brightest two dozen
//! of 4096 texels get small clusters of their own: 1, 1 and 1, then the 3 around the 99.9th percentile, where sparkle is
//! judged, then 2, 2, 4 and 8, in proportion for other sizes. Where the cluster around the percentile holds few texels it
//! is the color of its middle one: a step of the histogram there would make the percentile of any finite drawing jump.
//! What that takes from the mean the brighter ones give back. The rest is split where the squared distance from the clusters' means is largest: at the mean of the axis that spreads most, or,
//! along lightness, where the split lowers the sum of squares most. A leaf's box then follows one of two rules:
//!
//! - [`BoxRule::Moments`]: mean ± √3 σ on each axis, the uniform box of the members' variance, shifted so that its mean
//!   in *linear light* is its members' ([`center_of_mean`]). Light adds in linear RGB: the slice's mean is kept exactly,
//!   to the rounding of `f32` corners. Boxes reach beyond their members; negative light from sensor noise is kept.
//! - [`BoxRule::Tight`]: the members' bounding box (Golla and Klein 2018, fig. 2c). Keeps the sparkle, misses the mean.
//!
//! Pixels that are not finite are left out, and so counted; colors beyond |Lab| = 2000 are held there, and so counted.
//! Clusters ascend in the lightness of their centers. Equal boxes are one cluster.

use serde::{Deserialize, Serialize};

use crate::color::{D65_2, KNEE, Lab, LinearRgb, rgb_to_xyz};
use crate::paint::{MAX_LAB, center_of_mean};

/// How a cluster's box follows from its members.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BoxRule {
    /// The bounding box.
    Tight,
    /// Mean and variance, and the exact mean in linear light.
    #[default]
    Moments,
}

impl BoxRule {
    /// Name as it stands in files and profiles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tight => "tight",
            Self::Moments => "moments",
        }
    }
}

/// How a slice is clustered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClusterSettings {
    /// Most clusters of a slice, at least 1.
    pub clusters: usize,
    /// Rule of the boxes.
    pub box_rule: BoxRule,
}

impl Default for ClusterSettings {
    fn default() -> Self {
        Self { clusters: 50, box_rule: BoxRule::Moments }
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
/// Buckets of lightness that the crowd is sorted into.
const BUCKETS: usize = 256;

/// A texel: L, a, b, and its number disguised as a small normal float, so that four lanes add at once.
type Texel = [f32; 4];

fn disguised(number: u32) -> f32 {
    f32::from_bits(0x3000_0000 + number)
}

fn number(texel: &Texel) -> usize {
    (texel[3].to_bits() - 0x3000_0000) as usize
}

/// Texels that are converted at once.
const LANES: usize = 64;

/// Lab of π f for up to 64 texels, in `f32`; whether all of them are finite and within the bounds.
///
/// Good to 2e-6 of f, a hundredth of what the half floats of a slice resolve. For the assignment of texels to
/// clusters; [`Lab::from_rgb`] is the exact one.
fn lab_of(rgb: [&[f32]; 3], out: &mut [[f32; LANES]; 3]) -> bool {
    const M: [[f32; 3]; 3] = pi_xyz_over_white();
    let bound = MAX_LAB as f32;
    let n = rgb[0].len().min(LANES);
    let (r, g, b) = (&rgb[0][..n], &rgb[1][..n], &rgb[2][..n]);
    let [light, green_red, yellow_blue] = out;
    let mut outside = 0_u32;
    for k in 0..n {
        let f = M.map(|m| compress(m[0] * r[k] + m[1] * g[k] + m[2] * b[k]));
        let lab = [116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])];
        let inside = (lab[0].abs() <= bound) & (lab[1].abs() <= bound) & (lab[2].abs() <= bound);
        outside |= u32::from(!inside);
        (light[k], green_red[k], yellow_blue[k]) = (lab[0], lab[1], lab[2]);
    }
    outside == 0
}

/// The matrix from linear sRGB in 1/sr to XYZ of π f over white.
const fn pi_xyz_over_white() -> [[f32; 3]; 3] {
    let white = [D65_2.x, D65_2.y, D65_2.z];
    let columns = [rgb_to_xyz([1.0, 0.0, 0.0]), rgb_to_xyz([0.0, 1.0, 0.0]), rgb_to_xyz([0.0, 0.0, 1.0])];
    let mut m = [[0.0; 3]; 3];
    let mut k = 0;
    while k < 9 {
        let (row, column) = (k / 3, k % 3);
        m[row][column] = (std::f64::consts::PI * columns[column][row] / white[row]) as f32;
        k += 1;
    }
    m
}

/// The CIELAB compression in `f32`: a cube root by Halley's method from a guess by the exponent.
#[inline(always)]
fn compress(t: f32) -> f32 {
    const KNEE_LIGHT: f32 = (KNEE * KNEE * KNEE) as f32;
    const SLOPE: f32 = (1.0 / (3.0 * KNEE * KNEE)) as f32;
    let x = t.max(KNEE_LIGHT);
    // A third of the exponent, by shifts that vectorise: 1/4 + 1/16 + ... (Warren, Hacker's Delight, 11-2).
    let mut third = (x.to_bits() >> 2) + (x.to_bits() >> 4);
    third += third >> 4;
    third += third >> 8;
    let mut y = f32::from_bits(third + 0x2a51_37a0);
    for _ in 0..2 {
        let cube = y * y * y;
        y *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    if t > KNEE_LIGHT { y } else { t * SLOPE + (4.0 / 29.0) as f32 }
}

/// Room for clustering, kept from slice to slice.
#[derive(Debug, Default)]
pub struct Clusterer {
    texels: Vec<Texel>,
    sorted: Vec<Texel>,
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
        let mut sums = Self { count: texels.len() as f32, ..Self::default() };
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
        let axis = (0..3).fold(0, |best, k| if spreads[k] > spreads[best] { k } else { best });
        let spread = if to - from > 1 { spreads.iter().sum() } else { 0.0 };
        Self { from, to, buckets, sums, spread, axis }
    }
}

impl Clusterer {
    /// Clusters the texels of a slice: red, green and blue planes of BRDF in 1/sr.
    ///
    /// # Errors
    ///
    /// [`NoTexel`] when no pixel is finite.
    pub fn cluster(&mut self, planes: [&[f32]; 3], settings: &ClusterSettings) -> Result<SliceClusters, NoTexel> {
        let pixels = planes[0].len();
        let (dead, beyond) = self.take_in(planes);
        if self.texels.is_empty() {
            return Err(NoTexel { pixels });
        }
        let most = settings.clusters.max(1);
        self.leaves.clear();
        self.crowd = self.take_brightest(most);
        self.split_crowd(self.crowd, most - self.leaves.len());
        let mut clusters = self.boxes(planes, settings.box_rule);
        (clusters.dead, clusters.beyond) = (dead, beyond);
        Ok(clusters)
    }

    /// Fills `texels` with the finite pixels; returns how many were not, and how many lay beyond the bounds.
    fn take_in(&mut self, planes: [&[f32]; 3]) -> (usize, usize) {
        let [red, green, blue] = planes;
        self.texels.clear();
        self.texels.resize(red.len(), [0.0; 4]);
        let mut lab = [[0.0_f32; LANES]; 3];
        let mut within = true;
        let chunks = red.chunks(LANES).zip(green.chunks(LANES)).zip(blue.chunks(LANES));
        for (((r, g), b), out) in chunks.zip(self.texels.chunks_mut(LANES)) {
            within &= lab_of([r, g, b], &mut lab);
            for (k, texel) in out.iter_mut().enumerate() {
                *texel = [lab[0][k], lab[1][k], lab[2][k], 0.0];
            }
        }
        for (number, texel) in (0_u32..).zip(&mut self.texels) {
            texel[3] = disguised(number);
        }
        if within {
            return (0, 0);
        }
        let bound = MAX_LAB as f32;
        let finite = |t: &Texel| {
            let k = number(t);
            red[k].is_finite() && green[k].is_finite() && blue[k].is_finite()
        };
        self.texels.retain(finite);
        let mut beyond = 0;
        for texel in &mut self.texels {
            // A finite color so bright that its own arithmetic overflowed is as far out as can be.
            let held = [0, 1, 2].map(|k| if texel[k].is_nan() { 0.0 } else { texel[k].clamp(-bound, bound) });
            beyond += usize::from(held != texel[..3]);
            texel[..3].copy_from_slice(&held);
        }
        (red.len() - self.texels.len(), beyond)
    }

    /// Moves the brightest texels behind the others, a leaf for each group; returns how many the others are.
    fn take_brightest(&mut self, most: usize) -> usize {
        let count = self.texels.len();
        let ends = bright_groups(count, most / BRIGHT_SHARE);
        let taken = ends.last().copied().unwrap_or(0);
        if taken == 0 || taken >= count {
            return count;
        }
        let by_lightness = |x: &Texel, y: &Texel| x[0].total_cmp(&y[0]).then(x[3].total_cmp(&y[3]));
        let crowd = count - taken;
        self.texels.select_nth_unstable_by(crowd, by_lightness);
        self.texels[crowd..].sort_unstable_by(|x, y| by_lightness(y, x));
        let mut from = 0;
        for to in ends {
            self.leaves.push(Node::new(crowd + from, crowd + to, None, Sums::default()));
            from = to;
        }
        crowd
    }

    /// Splits the first `crowd` texels into at most `most` leaves.
    fn split_crowd(&mut self, crowd: usize, most: usize) {
        let (origin, starts, sums) = self.sort_into_buckets(crowd);
        let first = self.leaves.len();
        self.leaves.push(bucketed(&starts, &sums, 0, BUCKETS));
        // A run that lost its buckets is split by moving its texels.
        while self.leaves.len() - first < most {
            let widest = (first..self.leaves.len())
                .reduce(|best, k| if self.leaves[k].spread > self.leaves[best].spread { k } else { best });
            let Some(widest) = widest.filter(|k| self.leaves[*k].spread > 0.0) else { break };
            let node = self.leaves[widest];
            let mean = origin[node.axis] + node.sums.first[node.axis] / node.sums.count;
            let halves = match node.buckets {
                Some((low, high)) if node.axis == 0 => split_buckets(&starts, &sums, low, high),
                _ => None,
            };
            let halves = halves.or_else(|| {
                let middle = node.from + partition(&mut self.texels[node.from..node.to], node.axis, mean);
                (middle > node.from && middle < node.to).then(|| {
                    [(node.from, middle), (middle, node.to)]
                        .map(|(from, to)| Node::new(from, to, None, Sums::of(&self.texels[from..to], &origin)))
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
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let mut mean = [0.0_f32; 4];
        for texel in texels {
            (low, high) = (low.min(texel[0]), high.max(texel[0]));
            for k in 0..4 {
                mean[k] += texel[k];
            }
        }
        let origin = mean.map(|m| m / crowd.max(1) as f32);
        let scale = if high > low { BUCKETS as f32 / (high - low) } else { 0.0 };
        let bucket = |texel: &Texel| (((texel[0] - low) * scale) as usize).min(BUCKETS - 1);
        let mut starts = vec![0_usize; BUCKETS + 1];
        for texel in texels {
            starts[bucket(texel) + 1] += 1;
        }
        for k in 0..BUCKETS {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        self.sorted.clear();
        self.sorted.resize(crowd, [0.0; 4]);
        for texel in texels {
            let place = &mut next[bucket(texel)];
            self.sorted[*place] = *texel;
            *place += 1;
        }
        self.texels[..crowd].copy_from_slice(&self.sorted);
        let sums = starts.windows(2).map(|w| Sums::of(&self.texels[w[0]..w[1]], &origin)).collect();
        (origin, starts, sums)
    }

    /// The leaf around the 99.9th percentile, where it is small.
    fn flat_leaf(&self) -> Option<usize> {
        let sparkle = self.crowd + (SPARKLE * self.texels.len() as f64) as usize;
        let small = |leaf: &Node| leaf.from <= sparkle && sparkle < leaf.to && leaf.to - leaf.from <= FLAT;
        self.leaves.iter().position(small)
    }

    /// The boxes of all leaves, lightest last.
    fn boxes(&self, planes: [&[f32]; 3], rule: BoxRule) -> SliceClusters {
        let mut boxes: Vec<(usize, [f32; 3], [f32; 3])> = Vec::with_capacity(self.leaves.len());
        let flat = self.flat_leaf();
        let (mut owed, mut brighter) = ([0.0; 3], 0);
        if let Some(flat) = flat {
            let members = &self.texels[self.leaves[flat].from..self.leaves[flat].to];
            let middle = linear(&members[members.len() / 2], planes);
            for texel in members {
                let own = linear(texel, planes);
                (0..3).for_each(|k| owed[k] += own[k] - middle[k]);
            }
            brighter = self.leaves[flat].from - self.crowd;
        }
        for (number, leaf) in self.leaves.iter().enumerate() {
            let members = &self.texels[leaf.from..leaf.to];
            let (lower, upper) = match rule {
                BoxRule::Tight => tight(members),
                BoxRule::Moments if Some(number) == flat && brighter > 0 => {
                    moments(&members[members.len() / 2..][..1], planes, [0.0; 3])
                }
                BoxRule::Moments if flat.is_some_and(|flat| number < flat) => {
                    moments(members, planes, owed.map(|o| o / brighter as f64))
                }
                BoxRule::Moments => moments(members, planes, [0.0; 3]),
            };
            boxes.push((members.len(), lower, upper));
        }
        let center = |(_, l, u): &(usize, [f32; 3], [f32; 3])| [0, 1, 2].map(|k| l[k] + u[k]);
        boxes.sort_by(|x, y| {
            let (cx, cy) = (center(x), center(y));
            let order = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|k| a[k].total_cmp(&b[k])).find(|o| o.is_ne());
            let order = order(&cx, &cy).or_else(|| order(&x.1, &y.1)).or_else(|| order(&x.2, &y.2));
            order.unwrap_or(std::cmp::Ordering::Equal)
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
        }
    }
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
    for size in BELOW_SPARKLE.into_iter().take(groups.saturating_sub(ends.len())) {
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
    best.1.map(|k| [bucketed(starts, sums, low, k), bucketed(starts, sums, k, high)])
}

/// Moves the texels below `pivot` on an axis to the front; returns how many they are. Without a branch to guess.
fn partition(texels: &mut [Texel], axis: usize, pivot: f32) -> usize {
    let mut below = 0;
    for k in 0..texels.len() {
        texels.swap(k, below);
        below += usize::from(texels[below][axis] < pivot);
    }
    below
}

fn tight(members: &[Texel]) -> ([f32; 3], [f32; 3]) {
    let (mut lower, mut upper) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for texel in members {
        for k in 0..3 {
            (lower[k], upper[k]) = (lower[k].min(texel[k]), upper[k].max(texel[k]));
        }
    }
    (lower, upper)
}

/// The box of the members' mean and variance, and of their mean in linear light plus `more`.
fn moments(members: &[Texel], planes: [&[f32]; 3], more: LinearRgb) -> ([f32; 3], [f32; 3]) {
    let origin = members[0].map(f64::from);
    let (mut first, mut second, mut light) = ([0.0_f64; 3], [0.0_f64; 3], [0.0_f64; 3]);
    for texel in members {
        for k in 0..3 {
            let d = f64::from(texel[k]) - origin[k];
            first[k] += d;
            second[k] += d * d;
        }
        let rgb = linear(texel, planes);
        for k in 0..3 {
            light[k] += rgb[k];
        }
    }
    let count = members.len() as f64;
    let mean: [f64; 3] = std::array::from_fn(|k| origin[k] + first[k] / count);
    let half = std::array::from_fn(|k| {
        let variance = (second[k] / count - (first[k] / count).powi(2)).max(0.0);
        // A box must not reach beyond the bounds, wherever its mean moves it.
        (3.0 * variance).sqrt().min((MAX_LAB - mean[k].abs()).max(0.0))
    });
    let light: LinearRgb = std::array::from_fn(|k| light[k] / count + more[k]);
    let center = center_of_mean(half, light, mean);
    let bound = MAX_LAB as f32;
    let corner = |sign: f64| std::array::from_fn(|k| ((center[k] + sign * half[k]) as f32).clamp(-bound, bound));
    (corner(-1.0), corner(1.0))
}

/// Linear reflectance factor of a texel: from the picture, or from its Lab where that was held at the bounds.
fn linear(texel: &Texel, planes: [&[f32]; 3]) -> LinearRgb {
    let k = number(texel);
    let bound = MAX_LAB as f32;
    if texel[0].abs() < bound && texel[1].abs() < bound && texel[2].abs() < bound {
        planes.map(|plane| f64::from(plane[k]) * std::f64::consts::PI)
    } else {
        Lab::from([0, 1, 2].map(|c| f64::from(texel[c]))).to_rgb()
    }
}
