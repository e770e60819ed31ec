//! How far a fit is from its measurement, and the *floor*: how near any function of (θh, θd) comes.
//!
//! ```text
//! error = |fit − measured| / max(measured, 0.001/sr)   of luminance, both directions within 70° of the normal
//! floor = exp(median of the 12 nearest samples' ln), nearest in (θh/0.7°, θd/1.5°), from four fifths of the samples
//! ```
//!
//! The floor is not zero: a sample of flakes seen through a small spot is noisy, and what depends on φd no function of
//! the two angles can follow. At the instruments' six geometries the floor is the median over φd. Both are statistics
//! of one measurement: never compare floors of different ones as if they were accuracies.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use super::color_table::Frame;
use super::directions::{NEAR_MIRROR_DEG, Sample, measure};
use super::lobes::DARK;
use crate::color::{Lab, LinearRgb, ciede2000, luminance};
use crate::measurement::{MeasuredBrdf, half_frame_pair};
use crate::paint::{
    ASPECULAR_DEG, Direction, FitResiduals, InstrumentError, LuminanceError, half_angles,
    instrument_pairs, refract, transmission,
};

const SAMPLES: usize = 48_000;
const NEIGHBOURS: usize = 12;

/// Held-out samples with the floor's answer for each.
pub(super) struct Judge {
    test: Vec<Tested>,
    instrument: Vec<Instrument>,
    dark: f64,
    invalid_share: f64,
}

struct Tested {
    wi: Direction,
    wo: Direction,
    luminance: f64,
    floor: f64,
    near: bool,
}

struct Instrument {
    aspecular_deg: f64,
    wi: Direction,
    wo: Direction,
    /// From reflectance to what the instrument reads: π, and the coat's transmission where the data are inside.
    scale: f64,
    read: Lab,
    floor: f64,
}

/// Samples in buckets of one unit of scaled (θh, θd).
struct Neighbours {
    points: Vec<(f64, f64, LinearRgb)>,
    /// Points by bucket, in their own order.
    buckets: Vec<Vec<u32>>,
}

const ROWS: usize = 130;
const COLUMNS: usize = 62;

fn scaled(sample: &Sample) -> (f64, f64) {
    let half = sample.half();
    (
        half.theta_h.to_degrees() / 0.7,
        half.theta_d.to_degrees() / 1.5,
    )
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Clamped to the table of buckets.
fn bucket(x: f64, y: f64) -> (usize, usize) {
    (x.clamp(0.0, 129.0) as usize, y.clamp(0.0, 61.0) as usize)
}

impl Neighbours {
    /// `least` is the light below which logarithms stop falling.
    fn new(samples: &[Sample], least: f64) -> Self {
        let mut buckets = vec![Vec::new(); ROWS * COLUMNS];
        let mut points = Vec::with_capacity(samples.len());
        for (k, sample) in samples.iter().enumerate() {
            let (x, y) = scaled(sample);
            let (r, c) = bucket(x, y);
            buckets[r * COLUMNS + c].push(u32::try_from(k).unwrap_or(u32::MAX));
            points.push((x, y, sample.rgb.map(|v| v.max(least).ln())));
        }
        Self { points, buckets }
    }

    /// Per channel the median of the nearest points' logarithms, back from the logarithm.
    fn floor(&self, x: f64, y: f64) -> LinearRgb {
        let (row, column) = bucket(x, y);
        let mut found: Vec<(f64, u32)> = Vec::new();
        for reach in 0..ROWS {
            let rows = row.saturating_sub(reach)..=(row + reach).min(ROWS - 1);
            for r in rows {
                for c in column.saturating_sub(reach)..=(column + reach).min(COLUMNS - 1) {
                    if r.abs_diff(row).max(c.abs_diff(column)) != reach {
                        continue;
                    }
                    for &k in &self.buckets[r * COLUMNS + c] {
                        let (px, py, _) = self.points[k as usize];
                        found.push(((px - x).powi(2) + (py - y).powi(2), k));
                    }
                }
            }
            found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            found.truncate(NEIGHBOURS);
            // What the next ring holds is at least this far.
            let reached = f64::from(u32::try_from(reach).unwrap_or(u32::MAX));
            if found.len() == NEIGHBOURS && found[NEIGHBOURS - 1].0 <= reached * reached {
                break;
            }
        }
        std::array::from_fn(|k| {
            let mut logs: Vec<f64> = found
                .iter()
                .map(|&(_, p)| self.points[p as usize].2[k])
                .collect();
            logs.sort_by(f64::total_cmp);
            percentile(&logs, 50.0).exp()
        })
    }
}

/// Percentile of sorted values, linear between them; 0 of none.
fn percentile(sorted: &[f64], percent: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return 0.0;
    };
    let at = f64::from(u32::try_from(last).unwrap_or(u32::MAX)) * percent / 100.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0..=last.
    let low = (at as usize).min(last);
    let high = (low + 1).min(last);
    sorted[low] + (at - at.floor()) * (sorted[high] - sorted[low])
}

/// Median and 90th percentile of an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Percentiles {
    pub median: f64,
    pub p90: f64,
}

fn percentiles(errors: impl Iterator<Item = f64>) -> Percentiles {
    let mut sorted: Vec<f64> = errors.collect();
    sorted.sort_by(f64::total_cmp);
    Percentiles {
        median: percentile(&sorted, 50.0),
        p90: percentile(&sorted, 90.0),
    }
}

impl Judge {
    /// Draws samples within `cone_deg` of the normal, keeps a fifth for judging, and finds the floor from the rest.
    /// `unit` scales what counts as dark.
    pub fn new(measured: &dyn MeasuredBrdf, frame: Frame, cone_deg: f64, unit: f64) -> Self {
        let samples = measure(measured, SAMPLES, cone_deg, 0x0F10_0A5E);
        let (train, test) = samples.split_at(samples.len() * 4 / 5);
        let neighbours = Neighbours::new(train, 1e-3 * DARK * unit);
        let test = test
            .par_iter()
            .map(|s| {
                let (x, y) = scaled(s);
                let near = s.half().theta_h < NEAR_MIRROR_DEG.to_radians();
                let floor = luminance(neighbours.floor(x, y));
                Tested {
                    wi: s.wi,
                    wo: s.wo,
                    luminance: s.luminance,
                    floor,
                    near,
                }
            })
            .collect();
        let instrument = instrument_pairs()
            .into_iter()
            .zip(ASPECULAR_DEG)
            .filter_map(|((wi, wo), aspecular_deg)| {
                let (wi, wo, scale) = match frame {
                    Frame::Air => (wi, wo, PI),
                    Frame::Inside(ior) => (
                        refract(wi, ior),
                        refract(wo, ior),
                        PI * transmission(wi, wo, ior),
                    ),
                };
                let read = Lab::from_rgb(Sample::take(measured, wi, wo)?.rgb.map(|v| v * scale));
                let floor = ciede2000(
                    Lab::from_rgb(ring_median(measured, wi, wo)?.map(|v| v * scale)),
                    read,
                );
                Some(Instrument {
                    aspecular_deg,
                    wi,
                    wo,
                    scale,
                    read,
                    floor,
                })
            })
            .collect();
        Self {
            test,
            instrument,
            dark: DARK * unit,
            invalid_share: measured.invalid_share(),
        }
    }

    /// Relative luminance errors of a fit away from the mirror direction, and next to it.
    pub fn luminance_errors(
        &self,
        fit: impl Fn(Direction, Direction) -> LinearRgb + Sync,
    ) -> [Percentiles; 2] {
        let errors: Vec<f64> = self
            .test
            .par_iter()
            .map(|t| self.error(t, luminance(fit(t.wi, t.wo))))
            .collect();
        self.split(&errors)
    }

    /// The floor's errors, in the same two regions.
    pub fn floor_errors(&self) -> [Percentiles; 2] {
        let errors: Vec<f64> = self.test.iter().map(|t| self.error(t, t.floor)).collect();
        self.split(&errors)
    }

    fn error(&self, t: &Tested, value: f64) -> f64 {
        (value - t.luminance).abs() / t.luminance.max(self.dark)
    }

    fn split(&self, errors: &[f64]) -> [Percentiles; 2] {
        [false, true].map(|near| {
            percentiles(
                self.test
                    .iter()
                    .zip(errors)
                    .filter(|(t, _)| t.near == near)
                    .map(|x| *x.1),
            )
        })
    }

    /// Everything that is kept of a fit.
    pub fn residuals(
        &self,
        fit: impl Fn(Direction, Direction) -> LinearRgb + Sync,
    ) -> FitResiduals {
        let errors: Vec<f64> = self
            .test
            .par_iter()
            .map(|t| self.error(t, luminance(fit(t.wi, t.wo))))
            .collect();
        let count = f64::from(u32::try_from(errors.len().max(1)).unwrap_or(u32::MAX));
        let relative_rmse = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
        let (fits, floors) = (self.split(&errors), self.floor_errors());
        let both = |k: usize| LuminanceError {
            median: fits[k].median,
            p90: fits[k].p90,
            floor_median: floors[k].median,
            floor_p90: floors[k].p90,
        };
        let instrument = self
            .instrument
            .iter()
            .map(|i| InstrumentError {
                aspecular_deg: i.aspecular_deg,
                fit: ciede2000(Lab::from_rgb(fit(i.wi, i.wo).map(|v| v * i.scale)), i.read),
                floor: i.floor,
            })
            .collect();
        let invalid_share = self.invalid_share;
        FitResiduals {
            relative_rmse,
            all: both(0),
            near_mirror: both(1),
            instrument,
            invalid_share,
        }
    }
}

/// Median over φd of what was measured at a pair's (θh, θd).
fn ring_median(measured: &dyn MeasuredBrdf, wi: Direction, wo: Direction) -> Option<LinearRgb> {
    let half = half_angles(wi, wo);
    let ring: Vec<LinearRgb> = (0..180)
        .filter_map(|k| {
            let (i, o) = half_frame_pair(half.theta_h, half.theta_d, f64::from(k) * TAU / 180.0);
            (i[2] > 0.05 && o[2] > 0.05)
                .then(|| Sample::take(measured, i, o))
                .flatten()
                .map(|s| s.rgb)
        })
        .collect();
    (!ring.is_empty()).then(|| {
        std::array::from_fn(|k| {
            let mut channel: Vec<f64> = ring.iter().map(|rgb| rgb[k]).collect();
            channel.sort_by(f64::total_cmp);
            percentile(&channel, 50.0)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::directions::TRUSTED_DEG;

    struct OfHalfAngles;

    impl MeasuredBrdf for OfHalfAngles {
        fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
            let h = half_angles(wi, wo);
            Some([0.1 + h.h_z * h.h_o; 3])
        }
    }

    #[test]
    fn a_function_of_both_half_angles_has_hardly_a_floor() {
        let judge = Judge::new(&OfHalfAngles, Frame::Air, TRUSTED_DEG, 1.0);
        let [all, near] = judge.floor_errors();
        // Neighbours stand within 0.3° of each other, where the function changes by 0.5 %.
        assert!(all.p90 < 5e-3 && near.p90 < 5e-3, "{all:?} {near:?}");
        let residuals =
            judge.residuals(|wi, wo| OfHalfAngles.reflectance(wi, wo).expect("everywhere"));
        assert!(residuals.all.p90 == 0.0 && residuals.relative_rmse == 0.0);
        assert!(
            residuals.instrument.len() == 6
                && residuals
                    .instrument
                    .iter()
                    .all(|i| i.fit == 0.0 && i.floor < 1e-9)
        );
    }

    #[test]
    fn an_error_of_a_tenth_is_read_as_a_tenth() {
        let judge = Judge::new(&OfHalfAngles, Frame::Air, TRUSTED_DEG, 1.0);
        let residuals = judge.residuals(|wi, wo| {
            OfHalfAngles
                .reflectance(wi, wo)
                .expect("everywhere")
                .map(|v| v * 1.1)
        });
        assert!(
            (residuals.all.median - 0.1).abs() < 1e-9
                && (residuals.near_mirror.p90 - 0.1).abs() < 1e-9
        );
    }

    #[test]
    fn percentiles_are_linear_between_values() {
        assert_eq!(percentile(&[1.0, 2.0, 4.0], 50.0), 2.0);
        assert_eq!(percentile(&[1.0, 2.0], 90.0), 1.9);
        assert_eq!(percentile(&[], 50.0), 0.0);
    }
}
