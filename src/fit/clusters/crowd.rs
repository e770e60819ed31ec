//! The texels below the brightest, split where their color spreads most.
//!
//! They are sorted into buckets of lightness once; a run of buckets is split between two of them, where the sum of squares
//! of lightness falls most, without touching a texel. A run that spreads most along another axis is split at its mean, by
//! moving its texels, and so are its halves from then on.

use std::ops::Range;

use super::super::texels::Texel;

/// Buckets of lightness that the crowd is sorted into.
pub(super) const BUCKETS: usize = 256;

/// Room to split a crowd in, and how the last one was split.
#[derive(Debug, Default)]
pub(super) struct Crowd {
    sorted: Vec<Texel>,
    bucket: Vec<u8>,
    origin: Texel,
    runs: Vec<Run>,
    /// The questions that lead a texel to its run, the first of all first.
    pub questions: Vec<Question>,
    /// Lightness where the buckets begin, and how many there are to a unit.
    pub buckets: (f32, f32),
}

/// Which of two halves a texel belongs to: the second where its value is not below the pivot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Question {
    pub of: Of,
    pub pivot: f32,
    /// What to ask next; the run's own number twice where there is nothing left to ask.
    pub next: [u32; 2],
}

/// What a [`Question`] is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    Bucket,
    Axis(usize),
}

/// Sums over texels, around the crowd's origin.
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
struct Run {
    from: usize,
    to: usize,
    /// Buckets of lightness, while the texels still lie in their order.
    buckets: Option<(usize, usize)>,
    sums: Sums,
    /// Sum of squares that a split can lower; 0 when there is nothing to split.
    spread: f32,
    axis: usize,
    /// Number of the question that leads here.
    question: u32,
}

impl Run {
    fn new(at: Range<usize>, buckets: Option<(usize, usize)>, sums: Sums) -> Self {
        let spreads = [sums.spread(0), sums.spread(1), sums.spread(2)];
        let axis = (0..3).fold(
            0,
            |best, k| if spreads[k] > spreads[best] { k } else { best },
        );
        let spread = if at.len() > 1 {
            spreads.iter().sum()
        } else {
            0.0
        };
        Self {
            from: at.start,
            to: at.end,
            buckets,
            sums,
            spread,
            axis,
            question: 0,
        }
    }
}

impl Crowd {
    /// Splits these texels, at least one, into at most `most` runs, at least one, and orders them run by run.
    pub(super) fn split(&mut self, texels: &mut [Texel], most: usize) {
        let (starts, sums) = self.sort_into_buckets(texels);
        let origin = self.origin;
        self.runs.clear();
        self.questions.clear();
        let whole = bucketed(&starts, &sums, 0, BUCKETS);
        self.ask_nothing();
        self.runs.push(whole);
        while self.runs.len() < most {
            let widest = (0..self.runs.len()).reduce(|best, k| {
                if self.runs[k].spread > self.runs[best].spread {
                    k
                } else {
                    best
                }
            });
            let Some(widest) = widest.filter(|k| self.runs[*k].spread > 0.0) else {
                break;
            };
            let run = self.runs[widest];
            let mean = origin[run.axis] + run.sums.first[run.axis] / run.sums.count;
            let halves = match run.buckets {
                Some((low, high)) if run.axis == 0 => split_buckets(&starts, &sums, low, high),
                _ => None,
            };
            let halves = halves.or_else(|| {
                let middle = run.from + partition(&mut texels[run.from..run.to], run.axis, mean);
                (middle > run.from && middle < run.to).then(|| {
                    let parts = [run.from..middle, middle..run.to];
                    let fewer = usize::from(parts[1].len() < parts[0].len());
                    let sums = Sums::of(&texels[parts[fewer].clone()], &origin);
                    let others = run.sums.without(&sums);
                    let sums = if fewer == 0 {
                        [sums, others]
                    } else {
                        [others, sums]
                    };
                    let [left, right] = parts;
                    let halves = [
                        Run::new(left, None, sums[0]),
                        Run::new(right, None, sums[1]),
                    ];
                    (Of::Axis(run.axis), mean, halves)
                })
            });
            let Some((of, pivot, [left, right])) = halves else {
                self.runs[widest].spread = 0.0;
                continue;
            };
            let next = [self.ask_nothing(), self.ask_nothing()];
            self.questions[run.question as usize] = Question { of, pivot, next };
            let [left, right] = [(left, next[0]), (right, next[1])]
                .map(|(half, question)| Run { question, ..half });
            self.runs[widest] = left;
            self.runs.push(right);
        }
    }

    /// Adds a question that leads nowhere, for a new run; returns its number.
    fn ask_nothing(&mut self) -> u32 {
        let number = self.questions.len() as u32;
        self.questions.push(Question {
            of: Of::Axis(0),
            pivot: 0.0,
            next: [number; 2],
        });
        number
    }

    /// Where the texels of each run are.
    pub(super) fn runs(&self) -> impl Iterator<Item = Range<usize>> {
        self.runs.iter().map(|run| run.from..run.to)
    }

    /// Number of the question that leads to each run, and a color amid the run.
    pub(super) fn places(&self) -> impl Iterator<Item = (u32, Texel)> {
        self.runs.iter().map(|run| {
            let count = run.sums.count.max(1.0);
            let middle = std::array::from_fn(|k| self.origin[k] + run.sums.first[k] / count);
            (run.question, middle)
        })
    }

    /// Sorts the crowd by bucket of lightness; returns the buckets' starts and sums.
    fn sort_into_buckets(&mut self, texels: &mut [Texel]) -> (Vec<usize>, Vec<Sums>) {
        let (mut low, mut high) = (texels[0], texels[0]);
        for texel in texels.iter() {
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
                .map(|texel| bucket_of(texel[0], (low[0], scale)) as u8),
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
        self.sorted.resize(texels.len(), [0.0; 4]);
        for (texel, &bucket) in texels.iter().zip(&self.bucket) {
            let place = &mut next[usize::from(bucket)];
            self.sorted[*place] = *texel;
            *place += 1;
        }
        texels.copy_from_slice(&self.sorted);
        self.origin = origin;
        self.buckets = (low[0], scale);
        let sums = starts
            .windows(2)
            .map(|w| Sums::of(&texels[w[0]..w[1]], &origin))
            .collect();
        (starts, sums)
    }
}

/// Bucket of a lightness.
#[inline(always)]
pub(super) fn bucket_of(lightness: f32, (low, scale): (f32, f32)) -> usize {
    (((lightness - low) * scale) as usize).min(BUCKETS - 1)
}

/// The run of some buckets.
fn bucketed(starts: &[usize], sums: &[Sums], low: usize, high: usize) -> Run {
    let mut sum = Sums::default();
    for bucket in &sums[low..high] {
        sum.add(bucket);
    }
    Run::new(starts[low]..starts[high], Some((low, high)), sum)
}

/// Splits a run of buckets where the sum of squares of lightness falls most.
fn split_buckets(
    starts: &[usize],
    sums: &[Sums],
    low: usize,
    high: usize,
) -> Option<(Of, f32, [Run; 2])> {
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
        let halves = [
            bucketed(starts, sums, low, k),
            bucketed(starts, sums, k, high),
        ];
        (Of::Bucket, k as f32, halves)
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
