//! The correspondence of several paints' flakes, slice by slice, by optimal transport.
//!
//! Two paints are transported onto each other; of their blend the realisation at equal weights is transported onto the
//! third, and so on (Golla and Klein 2018, 4.3), in the order of content hashes or in the cheapest of all orders, told by
//! all slices or by a few ([`Order`]). Every entry of a plan becomes a cluster with one probability and one box per paint.
//! Clusters are kept in the order of their lightness at equal weights: that order never depends on the weights of a
//! realisation, so nothing flickers when they change.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};

use super::base::common_grid;
use super::order::{Order, orders};
use super::pairs::pair_reports;
use super::report::CorrespondenceReport;
use super::slice::{Scratch, SliceBlend, blend_slice};
use super::{BlendError, BlendedFlakes, Boxes};
use crate::paint::{AngleGrid, CarPaint, FlakeTexture};
use crate::transport::{Cost, Method, TransportError};

/// How correspondences are found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlendSettings {
    /// Solver of each slice.
    pub method: Method,
    /// Cost of moving between two cluster centers in Lab.
    pub cost: Cost,
    /// Order in which more than two paints are joined.
    #[serde(default = "of_older_files")]
    pub order: Order,
}

impl Default for BlendSettings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            cost: Cost::default(),
            order: Order::Sampled,
        }
    }
}

/// Blends from before there was a choice.
fn of_older_files() -> Order {
    Order::Canonical
}

/// The common angles, θd fastest.
#[derive(Clone, Copy)]
pub(super) struct Grid<'a> {
    theta_h: &'a AngleGrid,
    theta_d: &'a AngleGrid,
}

impl Grid<'_> {
    pub fn slices(&self) -> usize {
        self.theta_h.len() * self.theta_d.len()
    }

    /// θh and θd of slice `k`, degrees.
    pub fn angles(&self, k: usize) -> (f64, f64) {
        let columns = self.theta_d.len();
        (
            self.theta_h.degrees()[k / columns],
            self.theta_d.degrees()[k % columns],
        )
    }

    /// What a solver says of slice `k`.
    pub fn refused(&self, k: usize, source: TransportError) -> BlendError {
        let (theta_h_deg, theta_d_deg) = self.angles(k);
        BlendError::Transport {
            theta_h_deg,
            theta_d_deg,
            source,
        }
    }
}

/// A look at other angles than the paints' common ones.
#[derive(Clone, Debug)]
pub struct Look<'a> {
    /// The angles, θh and θd.
    pub angles: [AngleGrid; 2],
    /// The order in which the paints were joined, by place in hash order.
    pub joined: &'a [usize],
}

/// Corresponding clusters of paints in the order given, and how good they are; on their common angles, or as another look
/// has it.
pub(super) fn correspond(
    paints: &[&CarPaint],
    settings: &BlendSettings,
    look: Option<Look<'_>>,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<(Option<BlendedFlakes>, CorrespondenceReport), BlendError> {
    let grids = paints
        .iter()
        .filter_map(|p| p.flakes.as_ref())
        .map(|f| (&f.theta_h, &f.theta_d));
    let Some(common) = common_grid(grids)? else {
        return Ok((None, CorrespondenceReport::default()));
    };
    let (theta_h, theta_d, tried) = match look {
        Some(Look {
            angles: [theta_h, theta_d],
            joined,
        }) => (theta_h, theta_d, vec![joined.to_vec()]),
        None => (common.0, common.1, orders(paints.len(), settings.order)),
    };
    let grid = Grid {
        theta_h: &theta_h,
        theta_d: &theta_d,
    };
    let count = grid.slices();
    let whole: Vec<usize> = (0..count).collect();
    let telling = match tried.len() {
        1 => Vec::new(),
        several => (settings.order).telling([theta_h.len(), theta_d.len()], several),
    };
    let all = match telling.len() {
        few if few < count => few * tried.len() + count,
        _ => count * tried.len(),
    };
    let done = AtomicUsize::new(0);
    let tell = || {
        let so_far = done.fetch_add(1, Ordering::Relaxed) + 1;
        if so_far.is_multiple_of(64) || so_far == all {
            #[allow(clippy::cast_precision_loss)] // a progress bar
            progress(so_far as f32 / all as f32);
        }
    };
    let join = |order: &[usize], on: &[usize]| join(paints, order, (grid, on), settings, &tell);
    let (order, slices) = match tried.as_slice() {
        [only] => (only.clone(), join(only, &whole)?),
        several => {
            let (order, told) = cheapest(several, settings.cost, |order| join(order, &telling))?;
            let few = telling.len() < count;
            let slices = if few { join(&order, &whole)? } else { told };
            (order, slices)
        }
    };
    let pairs = pair_reports(paints, &slices, grid, settings, &order)?;

    let total: usize = slices.iter().map(|s| s.probability.len()).sum();
    let boxes: Vec<Boxes> = (0..paints.len())
        .into_par_iter()
        .map(|place| boxes_of(place, &slices, total))
        .collect();
    let mut offsets = Vec::with_capacity(count + 1);
    offsets.push(0);
    let mut probability = Vec::with_capacity(total);
    let mut report = CorrespondenceReport {
        slices: count,
        clusters: total,
        order,
        pairs,
        ..Default::default()
    };
    for slice in slices {
        probability.extend_from_slice(&slice.probability);
        offsets.push(u32::try_from(probability.len()).unwrap_or(u32::MAX));
        report.mean_cost += slice.cost;
        report.largest_gap = report.largest_gap.max(slice.gap);
        report.smoothed_more += usize::from(slice.smoothed_more);
    }
    #[allow(clippy::cast_precision_loss)] // a count of slices
    let slices = count as f64;
    report.mean_cost /= slices;
    for (place, paint) in paints.iter().enumerate() {
        match &paint.flakes {
            None => report.without_flakes.push(place),
            Some(f) if f.theta_h.is_near(&theta_h) && f.theta_d.is_near(&theta_d) => {}
            Some(_) => report.mixed.push(place),
        }
    }
    let textures = textures(paints);
    Ok((
        Some(BlendedFlakes::new(
            [theta_h, theta_d],
            offsets.into(),
            probability.into(),
            boxes,
            textures,
        )),
        report,
    ))
}

/// The boxes of one paint in all slices, so many together.
fn boxes_of(place: usize, slices: &[SliceBlend], total: usize) -> Boxes {
    let mut all = Boxes {
        lower: Vec::with_capacity(total),
        upper: Vec::with_capacity(total),
    };
    for slice in slices {
        all.lower.extend(slice.boxes[place].iter().map(|b| b.0));
        all.upper.extend(slice.boxes[place].iter().map(|b| b.1));
    }
    all
}

/// The order whose slices cost least, and those; of equals the first.
fn cheapest(
    orders: &[Vec<usize>],
    cost: Cost,
    join: impl Fn(&[usize]) -> Result<Vec<SliceBlend>, BlendError>,
) -> Result<(Vec<usize>, Vec<SliceBlend>), BlendError> {
    let mut best: Option<(f64, Vec<usize>, Vec<SliceBlend>)> = None;
    for order in orders {
        let slices = join(order)?;
        let cost = slices.iter().map(|s| s.pairwise_cost(cost)).sum();
        if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
            best = Some((cost, order.clone(), slices));
        }
    }
    let (_, order, slices) = best.unwrap_or_default();
    Ok((order, slices))
}

/// The slices at these places, with the paints joined in this order; boxes stay in the paints' own order.
fn join(
    paints: &[&CarPaint],
    order: &[usize],
    (grid, places): (Grid<'_>, &[usize]),
    settings: &BlendSettings,
    tell: &(dyn Fn() + Sync),
) -> Result<Vec<SliceBlend>, BlendError> {
    let slices: Vec<_> = places
        .par_iter()
        .map_init(Scratch::default, |scratch, &k| {
            let slice = blend_slice(paints, order, grid.angles(k), settings, scratch);
            tell();
            slice.map_err(|source| grid.refused(k, source))
        })
        .collect();
    // The first that was refused, on any number of threads.
    slices.into_iter().collect()
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
