//! The correspondence of one slice: plan after plan, each of which splits the clusters that are there.

use super::BlendSettings;
use super::mixture::{Cluster, clusters_at};
use crate::paint::CarPaint;
use crate::transport::{Method, Plan, Problem, Solver, TransportError, Workspace};

/// One slice's corresponding clusters: probabilities, and boxes paint by paint.
pub(super) struct SliceBlend {
    pub probability: Vec<f64>,
    pub boxes: Vec<Vec<([f32; 3], [f32; 3])>>,
    pub cost: f64,
    pub gap: f64,
    pub smoothed_more: bool,
}

/// Memory of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    pub problem: Problem,
    pub workspace: Workspace,
    pub plan: Plan,
    pub clusters: Vec<Cluster>,
}

/// Joins the paints of one slice in this order; boxes stay in the paints' own order.
pub(super) fn blend_slice(
    paints: &[&CarPaint],
    order: &[usize],
    (theta_h_deg, theta_d_deg): (f64, f64),
    settings: &BlendSettings,
    scratch: &mut Scratch,
) -> Result<SliceBlend, TransportError> {
    let clusters_of = |place: usize, out: &mut Vec<Cluster>| {
        clusters_at(paints[place].flakes.as_ref(), theta_h_deg, theta_d_deg, out);
    };
    clusters_of(order[0], &mut scratch.clusters);
    let mut slice = SliceBlend {
        probability: scratch.clusters.iter().map(|c| c.probability).collect(),
        boxes: vec![
            scratch
                .clusters
                .iter()
                .map(|c| (c.lower, c.upper))
                .collect(),
        ],
        cost: 0.0,
        gap: 0.0,
        smoothed_more: false,
    };
    for (joined, &place) in order.iter().enumerate().skip(1) {
        // The same paint once more moves nothing: whatever share it has, its flakes go where they went before.
        let same = |&before: &usize| std::ptr::eq(paints[before], paints[place]);
        if let Some(before) = order[..joined].iter().position(same) {
            let boxes = slice.boxes[before].clone();
            slice.boxes.push(boxes);
            continue;
        }
        clusters_of(place, &mut scratch.clusters);
        let source =
            (0..slice.probability.len()).map(|k| (slice.even_center(k), slice.probability[k]));
        let target = scratch.clusters.iter().map(|c| (c.center(), c.probability));
        scratch.problem.refill(source, target)?;
        slice.smoothed_more |= solve_somehow(settings, scratch)?;
        slice.join(&scratch.plan, &scratch.clusters);
    }
    slice.sort_by_lightness();
    slice.put_back(order);
    Ok(slice)
}

/// By how much more a slice is smoothed that does not converge.
const SMOOTHER: f64 = 4.0;

/// Solves the problem at hand; says whether it had to be smoothed more than asked. How far that is from the optimum the
/// plan's gap tells.
fn solve_somehow(settings: &BlendSettings, scratch: &mut Scratch) -> Result<bool, TransportError> {
    let mut method = settings.method;
    loop {
        let solved = method.solve_into(
            &scratch.problem,
            settings.cost,
            &mut scratch.workspace,
            &mut scratch.plan,
        );
        match (solved, &mut method) {
            (Err(TransportError::NotConverged { .. }), Method::Sinkhorn { epsilon })
                if *epsilon < 1.0 =>
            {
                *epsilon *= SMOOTHER;
            }
            (solved, _) => return solved.map(|()| method != settings.method),
        }
    }
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

    /// Brings the boxes from the order of joining to the paints' own.
    fn put_back(&mut self, order: &[usize]) {
        let mut boxes = vec![Vec::new(); order.len()];
        for (own, &place) in std::mem::take(&mut self.boxes).into_iter().zip(order) {
            boxes[place] = own;
        }
        self.boxes = boxes;
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
