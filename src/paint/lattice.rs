//! A few slices in place of all of a grid.

/// Numbers of so many slices, θd fastest, spread evenly over a grid; all of a grid that has no more.
///
/// A slanted lattice: no two are of one row or column while there are enough of those. Where there are not, some may fall
/// together, so that they are fewer.
#[must_use]
pub fn slices_spread_over([rows, columns]: [usize; 2], count: usize) -> Vec<usize> {
    if count >= rows * columns {
        return (0..rows * columns).collect();
    }
    let is_divided_by_none_of = |stride: &usize| {
        let (mut x, mut y) = (count, *stride);
        while y > 0 {
            (x, y) = (y, x % y);
        }
        x == 1
    };
    // From the smaller part of the golden section on.
    let strides = (count * 382).div_ceil(1000).max(1)..count;
    let stride = strides.into_iter().find(is_divided_by_none_of).unwrap_or(1);
    let mut slices: Vec<usize> = (0..count)
        .map(|k| {
            let (h, d) = (k, (stride * k + count / 6) % count);
            (2 * h + 1) * rows / (2 * count) * columns + (2 * d + 1) * columns / (2 * count)
        })
        .collect();
    slices.sort_unstable();
    slices.dedup();
    slices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_are_spread_over_rows_and_columns() {
        for (grid, count) in [([24, 24], 24), ([24, 24], 8), ([24, 24], 4), ([13, 13], 12)] {
            let slices = slices_spread_over(grid, count);
            assert_eq!(slices.len(), count);
            for places in [
                slices.iter().map(|k| k / grid[1]).collect::<Vec<_>>(),
                slices.iter().map(|k| k % grid[1]).collect(),
            ] {
                let (mut sorted, even) = (places, grid[0] / count);
                sorted.sort_unstable();
                let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
                assert!(
                    gaps.clone().all(|gap| (even..=even + 1).contains(&gap)),
                    "{grid:?} {count}: {sorted:?}"
                );
                assert!(sorted[0] <= even && sorted[count - 1] + even + 1 >= grid[0]);
            }
        }
        assert_eq!(slices_spread_over([90, 1], 3), [15, 45, 75]);
        assert_eq!(slices_spread_over([2, 2], 9), [0, 1, 2, 3]);
    }
}
