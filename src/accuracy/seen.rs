//! What instrument and eye would notice of one paint's flakes beside another's, at one instrument geometry.

use super::clustering::{SPARKLE, luminance_of};
use super::geometries::{Geometry, mixed};
use super::sparkle::{lit_from, off_by};
use crate::color::{Lab, ciede2000};
use crate::paint::{LightnessMixture, Slice};

/// What is seen of a mixture of slices at a geometry.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    color: Lab,
    /// Luminance that one texel in a thousand exceeds.
    top: f64,
    /// Share of lit texels.
    lit: f64,
}

/// By how much it differs from what should be seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Noticed {
    /// CIEDE2000 of the mean color.
    pub delta_e_2000: f64,
    /// Relative difference of the 99.9th percentile of luminance.
    pub sparkle: f64,
    /// Relative difference of how many flakes are lit, fewer than one texel in a thousand counted as that many.
    pub lit: f64,
}

/// A top below this is none.
const DARK: f64 = 1e-9;

impl Seen {
    /// Of slices with weights that sum to 1; black of none.
    pub fn of(geometry: &Geometry, parts: &[(f64, Slice<'_>)]) -> Self {
        let mean = mixed(parts.iter().map(|(weight, slice)| (*weight, slice.mean())));
        let color = geometry.lab(mean);
        if parts.is_empty() {
            return Self {
                color,
                top: 0.0,
                lit: 0.0,
            };
        }
        let mixture = LightnessMixture::of(parts);
        Self {
            color,
            top: luminance_of(mixture.quantile(SPARKLE)),
            lit: mixture.above(lit_from(geometry, mean)),
        }
    }

    /// Beside what should be seen.
    pub fn beside(&self, best: &Self) -> Noticed {
        Noticed {
            delta_e_2000: ciede2000(self.color, best.color),
            sparkle: if best.top.abs() > DARK {
                (self.top / best.top - 1.0).abs()
            } else {
                0.0
            },
            lit: off_by(self.lit, best.lit),
        }
    }
}
