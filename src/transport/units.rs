//! Masses as whole numbers, so that the solvers' arithmetic is exact.
//!
//! Each side's masses become `i64` units that sum to `2^s` exactly, at least one unit a point, the rounding going to the
//! side's heaviest point. Then everything is shifted left by `k` bits, each source gets one grain more, and the last
//! target gets those `ns` grains. No proper part of the sources then balances a proper part of the targets, so no basis
//! is degenerate: every pivot moves mass, and a simplex method cannot cycle. Because a tree flow is off by fewer than
//! `2^(k−1)` grains, rounding a flow back to units gives exactly the flow of the unperturbed masses, never negative.
//!
//! Going back to masses, a flow out of a source that is light in units is scaled by that source's own mass per unit, any
//! other flow by its target's. A mass of 1e-300, which counted as one unit of about 1e-17, gets its 1e-300 back, and
//! marginals hold to a few units absolutely (1e-15 for hundreds of points); for everything but a light source feeding a
//! light target they hold relatively too.

#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "counts of units lie below 2^62, and what their 53 leading bits miss is far below a mass's own rounding"
)]

use super::problem::{Cloud, Problem};

/// A source with fewer units than this is scaled by its own mass, since rounding moved it noticeably.
const LIGHT: i64 = 1 << 40;

/// The masses of a problem in grains and units.
#[derive(Clone, Debug, Default)]
pub(super) struct Units {
    /// Grains each source has to give.
    pub supplies: Vec<i64>,
    /// Grains each target has to receive.
    pub demands: Vec<i64>,
    /// Mass per unit of light sources, 0 for others.
    source_mass: Vec<f64>,
    /// Mass per unit of targets.
    target_mass: Vec<f64>,
    /// Grains in a unit, as a power of two.
    shift: u32,
}

impl Units {
    /// Counts the masses of a problem.
    pub(super) fn fill(&mut self, problem: &Problem) {
        let sources = problem.source().len();
        // 2^(shift−1) > sources.
        self.shift = usize::BITS - sources.leading_zeros() + 1;
        let sum_bits = 62 - self.shift;
        count(problem.source(), sum_bits, &mut self.supplies);
        count(problem.target(), sum_bits, &mut self.demands);
        self.source_mass.clear();
        self.source_mass
            .extend(
                self.supplies
                    .iter()
                    .zip(problem.source().masses())
                    .map(|(&units, &mass)| {
                        if units < LIGHT {
                            mass / units as f64
                        } else {
                            0.0
                        }
                    }),
            );
        self.target_mass.clear();
        self.target_mass.extend(
            self.demands
                .iter()
                .zip(problem.target().masses())
                .map(|(&units, &mass)| mass / units as f64),
        );
        for supply in &mut self.supplies {
            *supply = (*supply << self.shift) + 1;
        }
        for demand in &mut self.demands {
            *demand <<= self.shift;
        }
        if let Some(last) = self.demands.last_mut() {
            *last += i64::try_from(sources).unwrap_or(i64::MAX);
        }
    }

    /// Mass of a flow of grains along an edge of a basis, or `None` where only grains flow.
    pub(super) fn mass(&self, source: usize, target: usize, grains: i64) -> Option<f64> {
        let units = (grains + (1 << (self.shift - 1))) >> self.shift;
        if units == 0 {
            return None;
        }
        let own = self.source_mass[source];
        let per_unit = if own > 0.0 {
            own
        } else {
            self.target_mass[target]
        };
        Some((units as f64 * per_unit).max(f64::MIN_POSITIVE))
    }
}

/// Whole units, at least one a point, that sum to `2^sum_bits`.
fn count(cloud: &Cloud, sum_bits: u32, units: &mut Vec<i64>) {
    let scale = (1_u64 << sum_bits) as f64;
    units.clear();
    let mut sum = 0;
    let mut heaviest = 0;
    for &mass in cloud.masses() {
        let count = ((mass * scale + 0.5) as i64).max(1);
        sum += count;
        if units.get(heaviest).is_some_and(|&most| count > most) {
            heaviest = units.len();
        }
        units.push(count);
    }
    // The heaviest holds at least the average, 2^sum_bits / n; the correction is at most about n units.
    units[heaviest] += (1 << sum_bits) - sum;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(source: &[f64], target: &[f64]) -> Units {
        let points = vec![[0.0; 3]; source.len().max(target.len())];
        let problem = Problem::new(
            &points[..source.len()],
            source,
            &points[..target.len()],
            target,
        )
        .expect("positive masses");
        let mut units = Units::default();
        units.fill(&problem);
        units
    }

    #[test]
    fn both_sides_hold_the_same_number_of_grains() {
        let units = units(&[0.1; 7], &[1e-300, 0.3, 0.7, 1e-20]);
        assert_eq!(
            units.supplies.iter().sum::<i64>(),
            units.demands.iter().sum::<i64>()
        );
        assert!(units.supplies.iter().chain(&units.demands).all(|&n| n > 0));
    }

    #[test]
    fn no_proper_part_of_the_sources_balances_a_part_of_the_targets() {
        let units = units(&[0.25; 4], &[0.25; 4]);
        for sources in 1_u32..15 {
            for targets in 1_u32..15 {
                let part = |grains: &[i64], set: u32| -> i64 {
                    (0..4)
                        .filter(|i| set >> i & 1 == 1)
                        .map(|i| grains[i])
                        .sum()
                };
                assert_ne!(
                    part(&units.supplies, sources),
                    part(&units.demands, targets)
                );
            }
        }
    }

    #[test]
    fn a_tiny_mass_comes_back_as_itself() {
        let units = units(&[1e-300, 1.0], &[1.0]);
        let mass = units.mass(0, 0, units.supplies[0]).expect("not lost");
        assert!((mass / 1e-300 - 1.0).abs() < 1e-15, "{mass:e}");
    }
}
