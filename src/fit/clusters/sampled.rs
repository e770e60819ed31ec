//! Large pictures: the borders between clusters come from a sample of the texels, everything else from all of them.
//!
//! Where a crowd of texels is best split shows in some ten thousand of them as well as in a million. All texels then pass
//! once, 64 at a time: to Lab, to their cluster, into its sums. Mean, variance and share of each cluster, and the brightest
//! texels, are those of all texels, exactly; nothing is kept of a texel that is not among the brightest.

use super::super::boxes::{BoxRule, Corners, Members};
use super::super::texels::{LANES, Lot, Texel, light_of, lots, push, push_one};
use super::brightest::{bright_groups, brightest_last};
use super::crowd::{BUCKETS, Crowd, Of, bucket_of};
use super::{BRIGHT_SHARE, ClusterSettings, Clusterer, SliceClusters, gathered, groups};

/// Texels of a sample, and of it for each cluster.
const SAMPLE: usize = 1 << 14;
const SAMPLE_OF_CLUSTER: usize = 128;
/// A picture is worth sampling from so many times the sample's texels on.
const WORTH: usize = 3;
/// Neighbouring texels that are sampled together.
const RUN: usize = 16;
/// Lots after which sums go from `f32` to `f64`.
const LOTS_OF_SUM: usize = 16;

/// Room for the texels of a picture that pass, kept from picture to picture.
#[derive(Debug, Default)]
pub(super) struct Passage {
    /// The brightest texels, and some more.
    aside: Vec<Texel>,
    aside_light: Vec<[f32; 4]>,
    sums: Vec<Sums>,
    dead: usize,
    beyond: usize,
}

/// Sums over the members of a cluster, around a color amid them.
#[derive(Clone, Copy, Debug)]
struct Sums {
    /// L, a, b of the color; 0.
    amid: Texel,
    /// Of the lots since the last [`Sums::settle`]: distances, and how many.
    first: [f32; 4],
    second: [f32; 4],
    light: [f64; 4],
    settled_first: [f64; 4],
    settled_second: [f64; 4],
    hull: Corners,
}

impl Sums {
    const fn around(amid: Texel) -> Self {
        Self {
            amid: [amid[0], amid[1], amid[2], 0.0],
            first: [0.0; 4],
            second: [0.0; 4],
            light: [0.0; 4],
            settled_first: [0.0; 4],
            settled_second: [0.0; 4],
            hull: ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]),
        }
    }

    #[inline(always)]
    fn add(&mut self, lab: [f32; 3], rgb: [f32; 3]) {
        let texel = [lab[0], lab[1], lab[2], 1.0];
        let light = [rgb[0], rgb[1], rgb[2], 0.0];
        for k in 0..4 {
            let d = texel[k] - self.amid[k];
            self.first[k] += d;
            self.second[k] += d * d;
            self.light[k] += f64::from(light[k]);
        }
    }

    #[inline(always)]
    fn widen(&mut self, lab: [f32; 3]) {
        let (lower, upper) = &mut self.hull;
        for k in 0..3 {
            lower[k] = lower[k].min(lab[k]);
            upper[k] = upper[k].max(lab[k]);
        }
    }

    #[inline(always)]
    fn settle(&mut self) {
        for k in 0..4 {
            self.settled_first[k] += f64::from(self.first[k]);
            self.settled_second[k] += f64::from(self.second[k]);
        }
        (self.first, self.second) = ([0.0; 4], [0.0; 4]);
    }

    /// Of the settled sums; `None` where nobody came.
    fn members(&self) -> Option<Members> {
        let count = self.settled_first[3];
        let off = self.settled_first.map(|s| s / count);
        (count > 0.0).then(|| Members {
            count,
            mean: std::array::from_fn(|k| f64::from(self.amid[k]) + off[k]),
            variance: std::array::from_fn(|k| {
                (self.settled_second[k] / count - off[k] * off[k]).max(0.0)
            }),
            light: std::array::from_fn(|k| self.light[k] * std::f64::consts::PI / count),
            hull: self.hull,
        })
    }
}

/// A [`super::crowd::Question`] as it is asked of 64 texels at once.
#[derive(Clone, Copy, Debug)]
struct Step {
    axis: usize,
    pivot: f32,
    next: [u32; 2],
}

/// Leads a texel to its cluster: by its bucket of lightness first, then question by question.
#[derive(Debug)]
struct Ways {
    buckets: (f32, f32),
    first: [u32; BUCKETS],
    steps: Vec<Step>,
    /// Most questions after the first.
    depth: usize,
    /// Cluster at each question that leads no further.
    clusters: Vec<u32>,
}

impl Ways {
    fn of(crowd: &Crowd) -> Self {
        let questions = &crowd.questions;
        let mut first = [0; BUCKETS];
        for (bucket, first) in first.iter_mut().enumerate() {
            let mut at = 0;
            while let Of::Bucket = questions[at].of {
                let above = bucket as f32 >= questions[at].pivot;
                at = questions[at].next[usize::from(above)] as usize;
            }
            *first = at as u32;
        }
        let depth_at = |from: u32| {
            let mut deepest = 0;
            let mut open = vec![(from, 0)];
            while let Some((at, depth)) = open.pop() {
                deepest = deepest.max(depth);
                let next = questions[at as usize].next;
                open.extend(
                    next.into_iter()
                        .filter(|to| *to != at)
                        .map(|to| (to, depth + 1)),
                );
            }
            deepest
        };
        let steps = questions.iter().map(|question| Step {
            axis: if let Of::Axis(axis) = question.of {
                axis
            } else {
                0
            },
            pivot: question.pivot,
            next: question.next,
        });
        let mut clusters = vec![0; questions.len()];
        for (cluster, (question, _)) in crowd.places().enumerate() {
            clusters[question as usize] = cluster as u32;
        }
        Self {
            buckets: crowd.buckets,
            first,
            steps: steps.collect(),
            depth: first.into_iter().map(depth_at).max().unwrap_or(0),
            clusters,
        }
    }

    /// Clusters of a lot's texels.
    #[inline(always)]
    fn lead(&self, lab: &[[f32; LANES]; 3], to: &mut [u32; LANES]) {
        for (to, lightness) in to.iter_mut().zip(&lab[0]) {
            *to = self.first[bucket_of(*lightness, self.buckets)];
        }
        for _ in 0..self.depth {
            let mut moved = 0;
            for (k, to) in to.iter_mut().enumerate() {
                let step = &self.steps[*to as usize];
                let above = lab[step.axis][k] >= step.pivot;
                let next = step.next[usize::from(above)];
                moved |= next ^ *to;
                *to = next;
            }
            // Where all have arrived, what is left of the deepest way leads nowhere.
            if moved == 0 {
                break;
            }
        }
        for to in to {
            *to = self.clusters[*to as usize];
        }
    }
}

impl Clusterer {
    /// Clusters a large picture; `None` where it is not worth sampling, or where the sample misleads.
    pub(super) fn cluster_by_sample(
        &mut self,
        planes: [&[f32]; 3],
        settings: &ClusterSettings,
    ) -> Option<SliceClusters> {
        let most = settings.clusters.max(1);
        let (pixels, wanted) = (planes[0].len(), SAMPLE.max(SAMPLE_OF_CLUSTER * most));
        if pixels < WORTH * wanted {
            return None;
        }
        self.sample(planes, wanted);
        let sampled = self.texels.len();
        if sampled < wanted / 2 {
            return None;
        }
        // The brightest texels get clusters of their own; the sample tells how bright they may be, with some to spare.
        let bright = most / BRIGHT_SHARE;
        let taken = bright_groups(pixels, bright);
        let of_sample = |count: usize| count * sampled / pixels;
        let (crowd, least) = match taken.last() {
            None => (sampled, f32::INFINITY),
            Some(taken) => {
                let set_aside = of_sample(taken + taken / 2) + 8;
                brightest_last(&mut self.texels, set_aside);
                self.texels[sampled - set_aside..].reverse();
                (
                    sampled - of_sample(*taken),
                    self.texels[sampled - set_aside][0],
                )
            }
        };
        self.crowd
            .split(&mut self.texels[..crowd], most - taken.len());
        let ways = Ways::of(&self.crowd);
        self.passage.begin(&self.crowd);
        pulp::Arch::new().dispatch(Pass {
            passage: &mut self.passage,
            planes,
            ways: &ways,
            least,
            rule: settings.box_rule,
        });
        let passage = &mut self.passage;

        let ends = bright_groups(pixels - passage.dead, bright);
        let taken = ends.last().copied().unwrap_or(0);
        let crowd = passage.aside.len().checked_sub(taken)?;
        if taken > 0 && crowd > 0 {
            brightest_last(&mut passage.aside, taken);
        }
        passage.return_to_crowd(crowd, &ways);
        let texels = groups(crowd, &ends).map(|group| &passage.aside[group]);
        let bright = texels.map(|texels| Members::of(texels, &passage.aside_light));
        let members = bright.chain(passage.sums.iter().filter_map(Sums::members));
        let boxed = members.map(|members| match settings.box_rule {
            BoxRule::Tight => (members, members.hull),
            BoxRule::Moments => (members, members.moments([0.0; 3])),
        });
        Some(SliceClusters {
            dead: passage.dead,
            beyond: passage.beyond,
            ..gathered(boxed.collect())
        })
    }

    /// Takes about so many texels: short runs, one somewhere in each stretch of the picture.
    fn sample(&mut self, planes: [&[f32]; 3], wanted: usize) {
        self.texels.clear();
        self.light.clear();
        let runs = wanted / RUN;
        let stretch = planes[0].len() / runs;
        let mut lot = Lot::EMPTY;
        let mut together = [[0.0_f32; LANES]; 3];
        for (number, place) in (0..runs).step_by(LANES / RUN).zip(0_u64..) {
            for part in 0..LANES / RUN {
                let run = (number + part).min(runs - 1);
                // Not every n-th: the picture's width may be a multiple of that.
                let shift = (place * 4 + part as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
                let from = run * stretch + shift as usize % (stretch - RUN);
                for (together, plane) in together.iter_mut().zip(planes) {
                    together[part * RUN..][..RUN].copy_from_slice(&plane[from..from + RUN]);
                }
            }
            lot.take(together.each_ref().map(<[f32; LANES]>::as_slice));
            push(&lot, &mut self.texels, &mut self.light);
        }
    }
}

/// [`Passage::pass`] with the widest instructions of the machine, which give the same bits as any others.
struct Pass<'a> {
    passage: &'a mut Passage,
    planes: [&'a [f32]; 3],
    ways: &'a Ways,
    least: f32,
    rule: BoxRule,
}

impl pulp::NullaryFnOnce for Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.passage
            .pass(self.planes, self.ways, self.least, self.rule);
    }
}

impl Passage {
    fn begin(&mut self, crowd: &Crowd) {
        self.aside.clear();
        self.aside_light.clear();
        self.sums.clear();
        self.sums
            .extend(crowd.places().map(|(_, amid)| Sums::around(amid)));
        (self.dead, self.beyond) = (0, 0);
    }

    /// Lets all texels pass: those at least so light are set aside, the others join their clusters.
    #[inline(always)]
    fn pass(&mut self, planes: [&[f32]; 3], ways: &Ways, least: f32, rule: BoxRule) {
        let mut lot = Lot::EMPTY;
        let mut clusters = [0; LANES];
        for (number, planes) in lots(planes).enumerate() {
            lot.take(planes);
            self.beyond += lot.beyond;
            self.dead += lot.count - lot.live.count_ones() as usize;
            ways.lead(&lot.lab, &mut clusters);
            let ([l, a, b], [red, green, blue]) = (&lot.lab, &lot.rgb);
            for k in 0..lot.count {
                if l[k] >= least || !lot.lives(k) {
                    if lot.lives(k) {
                        push_one(&lot, k, &mut self.aside, &mut self.aside_light);
                    }
                    continue;
                }
                let sums = &mut self.sums[clusters[k] as usize];
                sums.add([l[k], a[k], b[k]], [red[k], green[k], blue[k]]);
            }
            if rule == BoxRule::Tight {
                for k in (0..lot.count).filter(|k| lot.lives(*k) && l[*k] < least) {
                    self.sums[clusters[k] as usize].widen([l[k], a[k], b[k]]);
                }
            }
            if number % LOTS_OF_SUM == LOTS_OF_SUM - 1 {
                self.sums.iter_mut().for_each(Sums::settle);
            }
        }
    }

    /// Lets the first `count` texels that were set aside join their clusters after all.
    fn return_to_crowd(&mut self, count: usize, ways: &Ways) {
        let mut lab = [[0.0; LANES]; 3];
        let mut clusters = [0; LANES];
        for texels in self.aside[..count].chunks(LANES) {
            for (k, texel) in texels.iter().enumerate() {
                (0..3).for_each(|axis| lab[axis][k] = texel[axis]);
            }
            ways.lead(&lab, &mut clusters);
            for (texel, cluster) in texels.iter().zip(clusters) {
                let [l, a, b, _] = *texel;
                let sums = &mut self.sums[cluster as usize];
                sums.add([l, a, b], light_of(texel, &self.aside_light));
                sums.widen([l, a, b]);
            }
            self.sums.iter_mut().for_each(Sums::settle);
        }
        self.sums.iter_mut().for_each(Sums::settle);
    }
}
