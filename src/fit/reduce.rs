//! Fewer clusters: what a blended paint needs before it is blended again.
//!
//! A realisation carries the sum of its paints' clusters per slice. Pairs are merged, each time the two whose merging
//! moves the least mass the least far (Ward's criterion, `p q / (p + q) · |c − d|²` in Lab), until `n` are left. A merged
//! box keeps the members' mean and variance per axis, then is shifted until its mean in linear light is its members'.

use rayon::prelude::*;

use super::boxes::of_moments;
use crate::color::LinearRgb;
use crate::paint::{Flakes, Slice, mean_color};

/// Probability and corners of a finished cluster.
type Boxed = (f64, [f32; 3], [f32; 3]);

/// A cluster on its way: mass, moments in Lab, mean in linear light.
#[derive(Clone, Copy, Debug)]
struct Merged {
    mass: f64,
    center: [f64; 3],
    variance: [f64; 3],
    linear: LinearRgb,
    /// The box itself while nothing was merged into it.
    own: Option<([f32; 3], [f32; 3])>,
}

/// The same flakes with at most `most` clusters in each slice. Slices that have no more stay as they are.
#[must_use]
pub fn reduce_clusters(flakes: &Flakes, most: usize) -> Flakes {
    let slices: Vec<Vec<Boxed>> = (0..flakes.slices())
        .into_par_iter()
        .map(|k| reduce_slice(&flakes.slice_at(k), most.max(1)))
        .collect();
    let grids = [flakes.theta_h.clone(), flakes.theta_d.clone()];
    let mut reduced = Flakes::without_slices(grids, flakes.texture);
    for slice in slices {
        let probability: Vec<f64> = slice.iter().map(|of| of.0).collect();
        let lower: Vec<[f32; 3]> = slice.iter().map(|of| of.1).collect();
        let upper: Vec<[f32; 3]> = slice.iter().map(|of| of.2).collect();
        reduced.push_slice(&probability, &lower, &upper);
    }
    reduced
}

fn reduce_slice(slice: &Slice<'_>, most: usize) -> Vec<Boxed> {
    let mut clusters: Vec<Merged> = (0..slice.probability.len())
        .map(|k| Merged::of(slice, k))
        .collect();
    merge_nearest(&mut clusters, most);
    clusters.sort_by(|x, y| x.center[0].total_cmp(&y.center[0]));
    clusters.iter().map(Merged::boxed).collect()
}

impl Merged {
    fn of(slice: &Slice<'_>, k: usize) -> Self {
        let (lower, upper) = (slice.lower[k], slice.upper[k]);
        let half: [f64; 3] =
            std::array::from_fn(|a| (f64::from(upper[a]) - f64::from(lower[a])) / 2.0);
        Self {
            mass: slice.probability[k],
            center: slice.center(k),
            variance: half.map(|h| h * h / 3.0),
            linear: mean_color(lower, upper),
            own: Some((lower, upper)),
        }
    }

    /// How much mass moves how far when two become one.
    fn distance(&self, other: &Self) -> f64 {
        let squared: f64 = self
            .center
            .iter()
            .zip(other.center)
            .map(|(c, d)| (c - d) * (c - d))
            .sum();
        self.mass * other.mass / (self.mass + other.mass).max(f64::MIN_POSITIVE) * squared
    }

    fn with(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        let share = if mass > 0.0 { other.mass / mass } else { 0.5 };
        let mix = |x: f64, y: f64| x + (y - x) * share;
        let center: [f64; 3] = std::array::from_fn(|a| mix(self.center[a], other.center[a]));
        let spread = |cluster: &Self, a: usize| {
            cluster.variance[a] + (cluster.center[a] - center[a]).powi(2)
        };
        Self {
            mass,
            center,
            variance: std::array::from_fn(|a| mix(spread(self, a), spread(other, a))),
            linear: std::array::from_fn(|c| mix(self.linear[c], other.linear[c])),
            own: None,
        }
    }

    fn boxed(&self) -> Boxed {
        if let Some((lower, upper)) = self.own {
            return (self.mass, lower, upper);
        }
        let (lower, upper) = of_moments(self.center, self.variance, self.linear);
        (self.mass, lower, upper)
    }
}

/// Merges pairs, nearest first, until `most` are left. Each cluster remembers its nearest later one.
fn merge_nearest(clusters: &mut Vec<Merged>, most: usize) {
    let nearest_after = |clusters: &[Merged], i: usize| {
        let mut best = (usize::MAX, f64::INFINITY);
        for j in i + 1..clusters.len() {
            let distance = clusters[i].distance(&clusters[j]);
            if distance < best.1 {
                best = (j, distance);
            }
        }
        best
    };
    let mut nearest: Vec<(usize, f64)> = (0..clusters.len())
        .map(|i| nearest_after(clusters, i))
        .collect();
    while clusters.len() > most {
        let Some(i) =
            (0..clusters.len() - 1).min_by(|&x, &y| nearest[x].1.total_cmp(&nearest[y].1))
        else {
            return;
        };
        let j = nearest[i].0.min(clusters.len() - 1);
        let merged = clusters[i].with(&clusters[j]);
        clusters[i] = merged;
        // Later clusters move down by one place, so every index beyond j does too.
        clusters.remove(j);
        nearest.remove(j);
        for k in 0..clusters.len() {
            let known = nearest[k].0;
            if k == i || known == i || known == j {
                nearest[k] = nearest_after(clusters, k);
                continue;
            }
            if known != usize::MAX && known > j {
                nearest[k].0 = known - 1;
            }
            if k < i {
                let distance = clusters[k].distance(&clusters[i]);
                if distance < nearest[k].1 {
                    nearest[k] = (i, distance);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{AngleGrid, FlakeTexture};

    fn flakes(count: u32) -> Flakes {
        let spread = |k: u32, step: u32| f64::from(k * step % 97) as f32;
        let lower: Vec<[f32; 3]> = (0..count)
            .map(|k| [spread(k, 31), spread(k, 17) - 48.0, spread(k, 53) - 48.0])
            .collect();
        Flakes {
            theta_h: AngleGrid::single(),
            theta_d: AngleGrid::single(),
            offsets: vec![0, count].into(),
            probability: vec![1.0 / f64::from(count); count as usize].into(),
            upper: lower.iter().map(|l| l.map(|v| v + 3.0)).collect(),
            lower,
            texture: FlakeTexture {
                texel_um: 20.0,
                grain_um: 12.0,
                lifetime_deg: [4.0; 2],
                persistence_deg: [8.0; 2],
            },
        }
    }

    #[test]
    fn mass_and_mean_light_are_kept() {
        let many = flakes(99);
        let few = reduce_clusters(&many, 50);
        assert_eq!(few.widest_slice(), 50);
        assert!((few.probability.iter().sum::<f64>() - 1.0).abs() < 1e-13);
        let (want, got) = (many.slice_at(0).mean(), few.slice_at(0).mean());
        for (x, y) in want.iter().zip(got) {
            assert!((x - y).abs() < 1e-5 * x.abs(), "{x} {y}");
        }
        let middle: Vec<f64> = (0..50).map(|k| few.slice_at(0).center(k)[0]).collect();
        // Boxes are ordered before their middles move to keep the mean in linear light: by a few Lab at most.
        assert!(middle.windows(2).all(|w| w[0] <= w[1] + 6.0), "{middle:?}");
    }

    #[test]
    fn merged_boxes_stay_within_the_bounds_of_a_paint() {
        // Boxes as far extrapolation leaves them: at the bounds, and wide.
        let mut many = flakes(40);
        for k in 0..40 {
            let end = if k % 2 == 0 { 2000.0 } else { -2000.0 };
            (many.lower[k], many.upper[k]) = ([end; 3], [end; 3]);
            if k % 5 == 0 {
                many.lower[k] = [-2000.0; 3];
                many.upper[k] = [2000.0; 3];
            }
        }
        for most in [1, 2, 7] {
            let few = reduce_clusters(&many, most);
            let corners = few.lower.iter().chain(&few.upper).flatten();
            assert!(corners.into_iter().all(|v| v.abs() <= 2000.0));
        }
    }

    #[test]
    fn few_enough_clusters_stay_as_they_are() {
        let mut few = flakes(20);
        let reduced = reduce_clusters(&few, 50);
        assert_eq!(reduced.probability, few.probability);
        few.lower.sort_by(|x, y| x[0].total_cmp(&y[0]));
        assert_eq!(
            reduced.lower.iter().map(|l| l[0]).collect::<Vec<_>>(),
            few.lower.iter().map(|l| l[0]).collect::<Vec<_>>()
        );
    }
}
