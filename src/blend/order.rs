//! In which order more than two paints are joined.
//!
//! The correspondence of three and more paints is found pair by pair, so it depends on the order (by up to 2 to 3 Lab in
//! W1). The canonical order is that of the content hashes: cheap, and the same however the paints are named. The cheapest
//! order is the one whose correspondence costs least over all pairs of paints,
//!
//! ```text
//! Σ_slices Σ_{i<j} Σ_k p_k w(c_k^i, c_k^j)
//! ```
//!
//! at the price of trying `n!/2` orders. A few slices, spread evenly over the grid, tell it at a small part of the price: of
//! three of the sample paints, at 12 to 100 clusters, the very order that all slices tell, for 0.9 to 1.2 times the time of
//! the canonical one in place of 2.4 to 3.2. Slices are never joined in orders of their own: flakes that are followed from
//! slice to slice would change partners.

use serde::{Deserialize, Serialize};

use crate::paint::slices_spread_over;

/// Order in which paints are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// That of the content hashes.
    Canonical,
    /// The cheapest of all, as a few slices tell.
    Sampled,
    /// The cheapest of all.
    Cheapest,
}

/// Joins of a slice that telling the cheapest order takes at most, as long as each order is tried on [`FEWEST`] slices.
const TRIES: usize = 96;
/// Slices that each order is tried on at least.
const FEWEST: usize = 4;
/// Slices that each order is tried on at most.
const MOST: usize = 24;

impl Order {
    /// The same of so many paints: of two there is but one order.
    #[must_use]
    pub const fn among(self, paints: usize) -> Self {
        if paints < 3 { Self::Canonical } else { self }
    }

    /// The slices of a grid that tell which of several orders is the cheapest.
    pub(super) fn telling(self, grid: [usize; 2], orders: usize) -> Vec<usize> {
        let tried = match self {
            Self::Sampled => (TRIES / orders).clamp(FEWEST, MOST),
            Self::Canonical | Self::Cheapest => usize::MAX,
        };
        slices_spread_over(grid, tried)
    }
}

/// The orders to try, the canonical one first. Exchanging the first two paints changes no cost: one of the two is tried.
pub(super) fn orders(paints: usize, order: Order) -> Vec<Vec<usize>> {
    let canonical: Vec<usize> = (0..paints).collect();
    if order.among(paints) == Order::Canonical {
        return vec![canonical];
    }
    let mut all = vec![Vec::new()];
    for _ in 0..paints {
        all = all
            .into_iter()
            .flat_map(|begun: Vec<usize>| {
                let left = canonical.iter().filter(|k| !begun.contains(k));
                left.map(|&k| [&begun[..], &[k]].concat())
                    .collect::<Vec<_>>()
            })
            .collect();
    }
    all.retain(|order| order[0] < order[1]);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_slices_tell_of_many_orders_and_all_of_the_cheapest() {
        for (orders, slices) in [(3, 24), (12, 8), (60, 4)] {
            assert_eq!(Order::Sampled.telling([24, 24], orders).len(), slices);
        }
        assert_eq!(Order::Sampled.telling([3, 1], 3), [0, 1, 2]);
        assert!(Order::Cheapest.telling([10, 5], 60).into_iter().eq(0..50));
    }

    #[test]
    fn every_order_is_tried_once_and_the_canonical_one_first() {
        assert_eq!(orders(5, Order::Canonical), [[0, 1, 2, 3, 4]]);
        assert_eq!(orders(2, Order::Cheapest), [[0, 1]]);
        for (paints, count) in [(3, 3), (4, 12), (5, 60)] {
            let all = orders(paints, Order::Cheapest);
            assert_eq!(all.len(), count);
            assert_eq!(all[0], (0..paints).collect::<Vec<_>>());
            let mut distinct = all.clone();
            distinct.sort();
            distinct.dedup();
            assert_eq!(distinct.len(), count);
        }
    }
}
