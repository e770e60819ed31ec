//! The brightest texels, which are the sparkle: found exactly, in groups of fixed sizes.

use std::cmp::Ordering;

use super::super::texels::Texel;

/// Share of the brightest texels at which sparkle is judged: the 99.9th percentile.
pub(super) const SPARKLE: f64 = 1e-3;
/// Sizes of the clusters below the sparkle's, of 4096 texels.
const BELOW_SPARKLE: [usize; 4] = [2, 2, 4, 8];
/// Brightest texels up to which a list of them beats partial sorting.
const LISTED: usize = 64;

/// Order of lightness, of the place in the picture among equals.
pub(super) fn by_lightness(x: &Texel, y: &Texel) -> Ordering {
    x[0].total_cmp(&y[0]).then(x[3].total_cmp(&y[3]))
}

/// Ends of the groups of the brightest of `count` texels, brightest first, in at most `groups` groups.
pub(super) fn bright_groups(count: usize, groups: usize) -> Vec<usize> {
    let rank = SPARKLE * (count as f64 - 1.0);
    let (middle, reach) = (rank.round() as usize, (0.3 * rank).round() as usize);
    let (mut from, mut to) = (middle - reach, middle + reach + 1);
    if rank >= 1.0 {
        // The percentile lies between two texels: both belong to the cluster around it.
        (from, to) = (from.min(rank as usize), to.max(rank.ceil() as usize + 1));
    }
    let mut ends = match groups {
        0..3 => Vec::new(),
        3..6 => vec![from, to],
        _ => vec![from / 3, from * 2 / 3, from, to],
    };
    for size in BELOW_SPARKLE
        .into_iter()
        .take(groups.saturating_sub(ends.len()))
    {
        if let Some(end) = ends.last().copied() {
            ends.push(end + (count * size + 2048) / 4096);
        }
    }
    ends.retain(|end| *end > 0);
    ends.dedup();
    ends
}

/// Moves the brightest `taken` texels, fewer than all, to the end, the brightest of them first.
pub(super) fn brightest_last(texels: &mut [Texel], taken: usize) {
    let crowd = texels.len() - taken;
    if taken > LISTED {
        texels.select_nth_unstable_by(crowd, by_lightness);
        texels[crowd..].sort_unstable_by(|x, y| by_lightness(y, x));
        return;
    }
    let mut list: Vec<Texel> = Vec::with_capacity(taken + 1);
    let mut least = f32::NEG_INFINITY;
    for texel in texels.iter() {
        if texel[0] >= least {
            let place = list.partition_point(|brighter| by_lightness(brighter, texel).is_gt());
            list.insert(place, *texel);
            list.truncate(taken);
            if list.len() == taken {
                least = list[taken - 1][0];
            }
        }
    }
    let (last, mut end, mut k) = (list[taken - 1], texels.len(), 0);
    while end > crowd {
        if texels[k][0] >= least && by_lightness(&texels[k], &last).is_ge() {
            end -= 1;
            texels.swap(k, end);
        } else {
            k += 1;
        }
    }
    texels[crowd..].copy_from_slice(&list);
}
