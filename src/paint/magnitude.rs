//! The largest magnitude in a list, at the speed of memory.

/// Lists that are looked through side by side, so that the loop becomes vectors.
const LANES: usize = 32;

/// Largest `|v|` of a list; not a number where one of them is none, 0 for no number at all.
#[must_use]
pub(crate) fn largest_magnitude(values: &[f32]) -> f32 {
    pulp::Arch::new().dispatch(Largest { values })
}

/// The search, compiled for wide registers too: narrow ones have no maximum of whole numbers.
struct Largest<'a> {
    values: &'a [f32],
}

impl pulp::NullaryFnOnce for Largest<'_> {
    type Output = f32;

    #[inline(always)]
    fn call(self) -> f32 {
        // Magnitudes compare like their bits, and those of what is no number come last.
        let mut most = [0_u32; LANES];
        let (runs, rest) = self.values.as_chunks::<LANES>();
        for run in runs {
            for k in 0..LANES {
                most[k] = most[k].max(run[k].to_bits() & 0x7fff_ffff);
            }
        }
        for (most, value) in most.iter_mut().zip(rest) {
            *most = (*most).max(value.to_bits() & 0x7fff_ffff);
        }
        f32::from_bits(most.into_iter().fold(0, u32::max))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn it_is_that_of_every_number(values in prop::collection::vec(-300.0..300.0_f32, 0..70)) {
            let plain = values.iter().fold(0.0, |most: f32, v| most.max(v.abs()));
            prop_assert_eq!(largest_magnitude(&values), plain);
        }
    }

    #[test]
    fn what_is_no_number_shows() {
        for k in 0..40 {
            let mut values = [1e30_f32; 40];
            values[k] = f32::NEG_INFINITY;
            assert_eq!(largest_magnitude(&values), f32::INFINITY);
            values[39 - k] = f32::NAN;
            assert!(largest_magnitude(&values).is_nan());
        }
    }
}
