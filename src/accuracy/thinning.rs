//! What a paint loses when every k-th angle of its slices is kept.

use rayon::prelude::*;

use super::geometries::slices_at;
use crate::paint::{Flakes, LightnessMixture, Percentiles};

/// Most slices that are compared.
const CHECKED: usize = 64;

/// Distance W1 of the lightnesses between slices that are left out and the mixtures of the kept ones that stand in for
/// them, Lab units, on at most 64 slices spread evenly over those left out.
#[must_use]
pub fn left_out_w1(flakes: &Flakes, step: usize) -> Percentiles {
    let (rows, columns) = (flakes.theta_h.every(step), flakes.theta_d.every(step));
    let (kept_h, kept_d) = (flakes.theta_h.at(&rows), flakes.theta_d.at(&columns));
    let width = flakes.theta_d.len();
    let left_out: Vec<usize> = (0..flakes.slices())
        .filter(|k| !rows.contains(&(k / width)) || !columns.contains(&(k % width)))
        .collect();
    let stride = left_out.len().div_ceil(CHECKED).max(1);
    let distances = left_out
        .into_par_iter()
        .step_by(stride)
        .map(|k| {
            let (h, d) = (
                flakes.theta_h.degrees()[k / width],
                flakes.theta_d.degrees()[k % width],
            );
            let parts: Vec<_> = slices_at(&kept_h, &kept_d, h, d)
                .into_iter()
                .map(|(weight, kept)| {
                    let (row, column) = (rows[kept / columns.len()], columns[kept % columns.len()]);
                    (weight, flakes.slice(row, column))
                })
                .collect();
            let own = LightnessMixture::of(&[(1.0, flakes.slice_at(k))]);
            own.distance(&LightnessMixture::of(&parts))
        })
        .collect();
    Percentiles::of(distances)
}
