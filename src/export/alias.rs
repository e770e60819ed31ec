//! Alias tables: a draw from n clusters with one random number, one comparison and no loss.
//!
//! Take slot `k = floor(u n)`; with `u n − k` below the slot's threshold the cluster is `k`, otherwise the slot's alias.
//! Source: M. D. Vose, "A linear algorithm for generating random variates with a given distribution", IEEE TSE 17
//! (1991). A draw through the table has the slice's histogram but not its order: a random number kept over
//! neighbouring slices is not one flake any more. Where flakes must fade instead of flicker, draw by cumulative
//! probability.

/// One slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AliasEntry {
    /// Share of the slot that is its own cluster, `0..=1`.
    pub threshold: f64,
    /// Cluster of the rest, counted within the slice.
    pub alias: u32,
}

/// The table of one slice; `probability` sums to 1.
///
/// # Panics
///
/// When there are more than 2^32 clusters.
#[must_use]
pub fn alias_table(probability: &[f64]) -> Vec<AliasEntry> {
    let clusters = u32::try_from(probability.len()).expect("no more than 2^32 clusters");
    let whole = |alias| AliasEntry {
        threshold: 1.0,
        alias,
    };
    let mut table: Vec<AliasEntry> = (0..clusters).map(whole).collect();
    Slots::default().share(probability, |slot, threshold, alias| {
        table[slot as usize] = AliasEntry { threshold, alias };
    });
    table
}

/// Memory that is kept between slices.
#[derive(Debug, Default)]
pub(super) struct Slots {
    /// How much of a slot each cluster fills: 1 is a whole one.
    fill: Vec<f64>,
    /// Clusters that fill less than one, then, from the end backwards, those that fill more.
    order: Vec<u32>,
}

impl Slots {
    /// Calls `set` with slot, threshold and alias of every slot that two clusters share; the others are whole.
    pub(super) fn share(&mut self, probability: &[f64], mut set: impl FnMut(u32, f64, u32)) {
        let Self { fill, order } = self;
        #[allow(clippy::cast_precision_loss)] // a count of clusters
        let n = probability.len() as f64;
        fill.clear();
        fill.extend(probability.iter().map(|p| p * n));
        order.clear();
        order.resize(fill.len(), 0);
        // Written at both ends, and kept at one: whether a cluster is small is a coin that no processor predicts.
        let (mut smalls, mut larges) = (0, fill.len());
        for (cluster, &fill) in (0_u32..).zip(&*fill) {
            let is_small = fill < 1.0;
            order[smalls] = cluster;
            order[larges - 1] = cluster;
            smalls += usize::from(is_small);
            larges -= usize::from(!is_small);
        }
        let (small, large) = order.split_at(smalls);
        let mut large = large.iter().rev();
        let Some(&(mut high)) = large.next() else {
            return;
        };
        let mut rest = fill[high as usize];
        for &low in small {
            let share = fill[low as usize];
            set(low, share.max(0.0), high);
            rest = (rest + share) - 1.0;
            while rest < 1.0 {
                let Some(&next) = large.next() else {
                    // What is left is 1 but for rounding, and keeps its slot whole.
                    return;
                };
                set(high, rest.max(0.0), next);
                rest = (fill[next as usize] + rest) - 1.0;
                high = next;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Probability that the table gives each cluster.
    fn drawn(table: &[AliasEntry]) -> Vec<f64> {
        let mut out = vec![0.0; table.len()];
        #[allow(clippy::cast_precision_loss)]
        let slot = 1.0 / table.len() as f64;
        for (k, entry) in table.iter().enumerate() {
            out[k] += slot * entry.threshold;
            out[entry.alias as usize] += slot * (1.0 - entry.threshold);
        }
        out
    }

    #[test]
    fn a_single_cluster_is_always_drawn() {
        assert_eq!(
            alias_table(&[1.0]),
            [AliasEntry {
                threshold: 1.0,
                alias: 0
            }]
        );
    }

    #[test]
    fn a_cluster_of_probability_zero_is_never_drawn() {
        let table = alias_table(&[0.0, 0.25, 0.75]);
        assert_eq!(table[0].threshold, 0.0);
        assert!(
            table
                .iter()
                .skip(1)
                .all(|entry| entry.alias != 0 || entry.threshold == 1.0)
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn every_cluster_is_drawn_as_often_as_it_is_probable(
            weights in prop::collection::vec(prop_oneof![Just(0.0), 1e-12..1.0_f64, 0.9..1.0_f64], 1..150),
        ) {
            let sum: f64 = weights.iter().sum();
            prop_assume!(sum > 0.0);
            let p: Vec<f64> = weights.iter().map(|w| w / sum).collect();
            for (want, got) in p.iter().zip(drawn(&alias_table(&p))) {
                // Each slot's share passes through at most n subtractions of numbers below n.
                prop_assert!((want - got).abs() <= 1e-13 * p.len() as f64, "{want} {got}");
            }
        }
    }
}
