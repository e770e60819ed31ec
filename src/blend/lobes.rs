//! Which lobe of one paint becomes which of another, and what lies between them.
//!
//! Lobes are matched by roughness: the paint with the most active lobes gives the places, every other paint's lobes take
//! the places that keep their order and cost least in `|Δ ln α|`. A paint without a lobe at a place has weight 0 there
//! and takes its partners' roughness and F0, so that a lobe fades in where it belongs.
//!
//! ```text
//! α = Π α_m^(w_m/Σw),   s = Σ w_m s_m,   F0 = Σ w_m F0_m
//! ```

use super::clamp::Ledger;
use super::geometric::geometric_mean;
use crate::paint::{Lobe, MAX_ALPHA, MAX_WEIGHT, MIN_ALPHA};

/// Lobes of several paints, place by place: `matched[place][paint]`.
pub(super) fn matched(lobes: &[&[Lobe]]) -> Vec<Vec<Lobe>> {
    let active: Vec<Vec<Lobe>> = lobes
        .iter()
        .map(|list| {
            let mut active: Vec<Lobe> = list
                .iter()
                .copied()
                .filter(|lobe| !lobe.is_absent())
                .collect();
            active.sort_by(|x, y| x.alpha.total_cmp(&y.alpha));
            active
        })
        .collect();
    let places = active.iter().map(Vec::len).max().unwrap_or(0);
    let Some(reference) = active.iter().find(|list| list.len() == places) else {
        return Vec::new();
    };
    let reference: Vec<f64> = reference.iter().map(|lobe| lobe.alpha).collect();
    let seats: Vec<Vec<usize>> = active.iter().map(|list| seats(list, &reference)).collect();
    (0..places)
        .map(|place| {
            let here = |paint: usize| {
                seats[paint]
                    .iter()
                    .position(|&s| s == place)
                    .map(|k| active[paint][k])
            };
            let present: Vec<Lobe> = (0..lobes.len()).filter_map(here).collect();
            #[allow(clippy::cast_precision_loss)] // at most five paints
            let count = present.len() as f64;
            let alpha = (present.iter().map(|lobe| lobe.alpha.ln()).sum::<f64>() / count).exp();
            let f0 = present.iter().map(|lobe| lobe.f0).sum::<f64>() / count;
            let stand_in = match present.as_slice() {
                [only] => Lobe {
                    weight: [0.0; 3],
                    ..*only
                },
                _ => Lobe {
                    weight: [0.0; 3],
                    alpha,
                    f0,
                },
            };
            (0..lobes.len())
                .map(|paint| here(paint).unwrap_or(stand_in))
                .collect()
        })
        .collect()
}

/// Places of a paint's lobes among the reference's, in order, of least total `|Δ ln α|`.
fn seats(lobes: &[Lobe], reference: &[f64]) -> Vec<usize> {
    let (n, m) = (lobes.len(), reference.len());
    let distance = |k: usize, place: usize| {
        (lobes[k].alpha.max(1e-300).ln() - reference[place].max(1e-300).ln()).abs()
    };
    // best[k][p]: least cost of seating the first k lobes among the first p places.
    let mut best = vec![vec![f64::INFINITY; m + 1]; n + 1];
    best[0] = vec![0.0; m + 1];
    for k in 1..=n {
        for place in k..=m {
            best[k][place] =
                (best[k - 1][place - 1] + distance(k - 1, place - 1)).min(best[k][place - 1]);
        }
    }
    let (mut seats, mut place) = (vec![0; n], m);
    for k in (1..=n).rev() {
        while place > k && best[k][place - 1] <= best[k][place] {
            place -= 1;
        }
        seats[k - 1] = place - 1;
        place -= 1;
    }
    seats
}

/// Blends matched lobes by weights in the paints' order.
pub(super) fn blend(places: &[Vec<Lobe>], weights: &[f64], ledger: &mut Ledger) -> Vec<Lobe> {
    places
        .iter()
        .map(|lobes| {
            let pairs = || lobes.iter().zip(weights);
            let alpha = geometric_mean(&lobes.iter().map(|lobe| lobe.alpha), weights);
            Lobe {
                weight: std::array::from_fn(|c| {
                    let s = pairs().map(|(lobe, w)| w * lobe.weight[c]).sum();
                    ledger.hold("lobes.weight", s, 0.0, MAX_WEIGHT)
                }),
                alpha: ledger.hold("lobes.alpha", alpha, MIN_ALPHA, MAX_ALPHA),
                f0: ledger.hold(
                    "lobes.f0",
                    pairs().map(|(lobe, w)| w * lobe.f0).sum(),
                    0.0,
                    1.0,
                ),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lobe(alpha: f64, s: f64) -> Lobe {
        Lobe {
            weight: [s; 3],
            alpha,
            f0: 0.5,
        }
    }

    #[test]
    fn a_single_lobe_takes_the_place_of_its_own_width() {
        let (white, metallic) = (
            [lobe(0.3, 0.02), lobe(0.2, 0.0)],
            [lobe(0.1, 1.0), lobe(0.42, 2.0), lobe(0.25, 3.0)],
        );
        let places = matched(&[&white, &metallic]);
        let first: Vec<f64> = places.iter().map(|p| p[0].weight[0]).collect();
        assert_eq!(first, [0.0, 0.02, 0.0]);
        assert_eq!(places[0][0].alpha, 0.1);
        assert_eq!(
            places[1].iter().map(|l| l.alpha).collect::<Vec<_>>(),
            [0.3, 0.25]
        );
    }

    #[test]
    fn halfway_between_two_widths_is_their_geometric_mean() {
        let places = matched(&[&[lobe(0.1, 1.0)], &[lobe(0.4, 3.0)]]);
        let mut ledger = Ledger::default();
        let half = blend(&places, &[0.5, 0.5], &mut ledger);
        assert!((half[0].alpha - 0.2).abs() < 1e-15);
        assert_eq!(half[0].weight, [2.0; 3]);
        assert!(ledger.close().is_empty());
        assert_eq!(
            blend(&places, &[1.0, 0.0], &mut Ledger::default()),
            [lobe(0.1, 1.0)]
        );
    }

    #[test]
    fn far_extrapolation_is_held_and_told() {
        let places = matched(&[&[lobe(0.1, 1.0)], &[lobe(0.4, 3.0)]]);
        let mut ledger = Ledger::default();
        let far = blend(&places, &[1e6, 1.0 - 1e6], &mut ledger);
        assert!(far[0].alpha == MIN_ALPHA && far[0].weight == [0.0; 3]);
        assert_eq!(ledger.close().len(), 2);
    }
}
