//! The correspondence of several paints' flakes, slice by slice, by optimal transport.
//!
//! Two paints are transported onto each other; of their blend the realisation at equal weights is transported onto the
//! third, and so on in the order of content hashes (Golla and Klein 2018, 4.3). Every entry of a plan becomes a cluster
//! with one probability and one box per paint. Clusters are kept in the order of their lightness at equal weights: that
//! order never depends on the weights of a realisation, so nothing flickers when they change.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};

use super::base::common_grid;
use super::mixture::{Cluster, clusters_at};
use super::{BlendError, BlendedFlakes, Boxes};
use crate::paint::{CarPaint, FlakeTexture};
use crate::transport::{Cost, Method, Plan, Problem, Solver, TransportError, Workspace};

/// How correspondences are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlendSettings {
    /// Solver of each slice.
    pub method: Method,
    /// Cost of moving between two cluster centers in Lab.
    pub cost: Cost,
}

/// How good a correspondence is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CorrespondenceReport {
    /// Slices of the common grid, 0 when no paint has flakes.
    pub slices: usize,
    /// Clusters in all slices.
    pub clusters: usize,
    /// Mean transport cost of a slice: Lab units for the distance, their square otherwise; summed over the paints.
    pub mean_cost: f64,
    /// Largest gap of a slice between its plan and the dual bound: no plan is further from optimal.
    pub largest_gap: f64,
    /// Paints whose slices were mixed because their angles differ from the common grid's, by place in hash order.
    pub mixed: Vec<usize>,
    /// Paints without flakes, by place in hash order.
    pub without_flakes: Vec<usize>,
}

/// One slice's corresponding clusters: probabilities, and boxes paint by paint.
struct SliceBlend {
    probability: Vec<f64>,
    boxes: Vec<Vec<([f32; 3], [f32; 3])>>,
    cost: f64,
    gap: f64,
}

/// Memory of one thread.
#[derive(Default)]
struct Bench {
    problem: Problem,
    workspace: Workspace,
    plan: Plan,
    clusters: Vec<Cluster>,
}

/// Corresponding clusters of paints in the order given, and how good they are.
pub(super) fn correspond(
    paints: &[&CarPaint],
    settings: &BlendSettings,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<(Option<BlendedFlakes>, CorrespondenceReport), BlendError> {
    let grids = paints
        .iter()
        .filter_map(|p| p.flakes.as_ref())
        .map(|f| (&f.theta_h, &f.theta_d));
    let Some((theta_h, theta_d)) = common_grid(grids)? else {
        return Ok((None, CorrespondenceReport::default()));
    };
    let count = theta_h.len() * theta_d.len();
    let done = AtomicUsize::new(0);
    let slices: Vec<SliceBlend> = (0..count)
        .into_par_iter()
        .map_init(Bench::default, |bench, k| {
            let (h, d) = (
                theta_h.degrees()[k / theta_d.len()],
                theta_d.degrees()[k % theta_d.len()],
            );
            let slice = blend_slice(paints, h, d, settings, bench).map_err(|source| {
                BlendError::Transport {
                    theta_h_deg: h,
                    theta_d_deg: d,
                    source,
                }
            });
            let so_far = done.fetch_add(1, Ordering::Relaxed) + 1;
            if so_far.is_multiple_of(64) || so_far == count {
                #[allow(clippy::cast_precision_loss)] // a progress bar
                progress(so_far as f32 / count as f32);
            }
            slice
        })
        .collect::<Result<_, _>>()?;

    let total: usize = slices.iter().map(|s| s.probability.len()).sum();
    let with_room = || Boxes {
        lower: Vec::with_capacity(total),
        upper: Vec::with_capacity(total),
    };
    let mut offsets = Vec::with_capacity(count + 1);
    offsets.push(0);
    let mut probability = Vec::with_capacity(total);
    let mut boxes: Vec<Boxes> = paints.iter().map(|_| with_room()).collect();
    let mut report = CorrespondenceReport {
        slices: count,
        clusters: total,
        ..Default::default()
    };
    for slice in slices {
        probability.extend_from_slice(&slice.probability);
        for (all, own) in boxes.iter_mut().zip(&slice.boxes) {
            all.lower.extend(own.iter().map(|b| b.0));
            all.upper.extend(own.iter().map(|b| b.1));
        }
        offsets.push(u32::try_from(probability.len()).unwrap_or(u32::MAX));
        report.mean_cost += slice.cost;
        report.largest_gap = report.largest_gap.max(slice.gap);
    }
    #[allow(clippy::cast_precision_loss)] // a count of slices
    let slices = count as f64;
    report.mean_cost /= slices;
    for (place, paint) in paints.iter().enumerate() {
        match &paint.flakes {
            None => report.without_flakes.push(place),
            Some(f) if (&f.theta_h, &f.theta_d) != (&theta_h, &theta_d) => report.mixed.push(place),
            Some(_) => {}
        }
    }
    let textures = textures(paints);
    Ok((
        Some(BlendedFlakes {
            theta_h,
            theta_d,
            offsets,
            probability,
            boxes,
            textures,
        }),
        report,
    ))
}

/// Grain and lifetime of each paint; one without flakes has the mean of those that have.
fn textures(paints: &[&CarPaint]) -> Vec<FlakeTexture> {
    let own: Vec<Option<FlakeTexture>> = paints
        .iter()
        .map(|p| p.flakes.as_ref().map(|f| f.texture))
        .collect();
    let known: Vec<&FlakeTexture> = own.iter().flatten().collect();
    if known.is_empty() {
        return Vec::new();
    }
    let mean = |get: &dyn Fn(&FlakeTexture) -> f64| {
        known.iter().map(|t| get(t)).sum::<f64>() / known.len() as f64
    };
    let stand_in = FlakeTexture {
        texel_um: mean(&|t| t.texel_um),
        grain_um: mean(&|t| t.grain_um),
        lifetime_deg: [mean(&|t| t.lifetime_deg[0]), mean(&|t| t.lifetime_deg[1])],
        persistence_deg: [
            mean(&|t| t.persistence_deg[0]),
            mean(&|t| t.persistence_deg[1]),
        ],
    };
    own.into_iter().map(|t| t.unwrap_or(stand_in)).collect()
}

fn blend_slice(
    paints: &[&CarPaint],
    theta_h_deg: f64,
    theta_d_deg: f64,
    settings: &BlendSettings,
    bench: &mut Bench,
) -> Result<SliceBlend, TransportError> {
    clusters_at(
        paints[0].flakes.as_ref(),
        theta_h_deg,
        theta_d_deg,
        &mut bench.clusters,
    );
    let mut slice = SliceBlend {
        probability: bench.clusters.iter().map(|c| c.probability).collect(),
        boxes: vec![bench.clusters.iter().map(|c| (c.lower, c.upper)).collect()],
        cost: 0.0,
        gap: 0.0,
    };
    for paint in &paints[1..] {
        clusters_at(
            paint.flakes.as_ref(),
            theta_h_deg,
            theta_d_deg,
            &mut bench.clusters,
        );
        let source =
            (0..slice.probability.len()).map(|k| (slice.even_center(k), slice.probability[k]));
        let target = bench.clusters.iter().map(|c| (c.center(), c.probability));
        bench.problem.refill(source, target)?;
        settings.method.solve_into(
            &bench.problem,
            settings.cost,
            &mut bench.workspace,
            &mut bench.plan,
        )?;
        slice.join(&bench.plan, &bench.clusters);
    }
    slice.sort_by_lightness();
    Ok(slice)
}

impl SliceBlend {
    /// Center of cluster `k` with all paints so far at equal weights.
    fn even_center(&self, k: usize) -> [f64; 3] {
        #[allow(clippy::cast_precision_loss)] // at most five paints
        let twice = 2.0 * self.boxes.len() as f64;
        std::array::from_fn(|axis| {
            let corner =
                |b: &Vec<([f32; 3], [f32; 3])>| f64::from(b[k].0[axis]) + f64::from(b[k].1[axis]);
            self.boxes.iter().map(corner).sum::<f64>() / twice
        })
    }

    /// Splits the clusters along a plan and adds the target paint's boxes.
    fn join(&mut self, plan: &Plan, target: &[Cluster]) {
        for own in &mut self.boxes {
            *own = plan.entries.iter().map(|e| own[e.source]).collect();
        }
        self.boxes.push(
            plan.entries
                .iter()
                .map(|e| (target[e.target].lower, target[e.target].upper))
                .collect(),
        );
        self.probability = plan.entries.iter().map(|e| e.mass).collect();
        self.cost += plan.cost;
        self.gap = self.gap.max(plan.gap);
    }

    fn sort_by_lightness(&mut self) {
        let lightness: Vec<f64> = (0..self.probability.len())
            .map(|k| self.even_center(k)[0])
            .collect();
        let mut order: Vec<usize> = (0..lightness.len()).collect();
        order.sort_by(|&x, &y| lightness[x].total_cmp(&lightness[y]));
        self.probability = order.iter().map(|&k| self.probability[k]).collect();
        for own in &mut self.boxes {
            *own = order.iter().map(|&k| own[k]).collect();
        }
    }
}
