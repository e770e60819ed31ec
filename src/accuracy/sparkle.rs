//! Sparkle in numbers: how bright the brightest texels are, and how many flakes shine.
//!
//! At each instrument geometry the slices that meet there are mixed by their weights. Luminance depends on lightness
//! alone, so its percentiles are exact. A flake is *lit* where the texel is more than twice as bright as the surface on
//! average, base included; flakes are counted as the random texture deals them, in cells of a flake's size.

use serde::Serialize;

use super::clustering::{lightness_of, luminance_of};
use super::geometries::{Geometry, geometries, mixed};
use crate::color::{LinearRgb, luminance};
use crate::paint::{CarPaint, Flakes, LightnessMixture, Slice, cell_spacing};

/// Sparkle at one instrument geometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sparkle {
    /// Aspecular angle, degrees.
    pub aspecular_deg: f64,
    /// 50th, 90th, 99th and 99.9th percentile of the flakes' luminance factor (1 is the perfect diffuser).
    pub luminance: [f64; 4],
    /// Flakes that shine, per square millimetre.
    pub lit_per_mm2: f64,
}

const SHARES: [f64; 4] = [0.5, 0.9, 0.99, 0.999];

/// Sparkle at the six instrument geometries; empty for a solid color.
#[must_use]
pub fn sparkle(paint: &CarPaint) -> Vec<Sparkle> {
    let Some(flakes) = &paint.flakes else {
        return Vec::new();
    };
    geometries(paint)
        .iter()
        .map(|geometry| at(geometry, flakes))
        .collect()
}

/// The lightness from which on a flake is lit, beside flakes of this mean: twice as bright as all of the surface.
pub(super) fn lit_from(geometry: &Geometry, mean: LinearRgb) -> f64 {
    let mean = std::f64::consts::PI * luminance(mean);
    let base = geometry.base_luminance();
    lightness_of(2.0 * (base + mean) - base)
}

/// Share of lit texels below which flakes are too rare to count: fewer count as that many.
const COUNTED: f64 = 1e-3;

/// By which part the share of lit flakes is off.
pub(super) fn off_by(share: f64, exact: f64) -> f64 {
    (share - exact).abs() / exact.max(COUNTED)
}

fn at(geometry: &Geometry, flakes: &Flakes) -> Sparkle {
    let parts: Vec<(f64, Slice<'_>)> = geometry
        .slices(&flakes.theta_h, &flakes.theta_d)
        .into_iter()
        .map(|(weight, k)| (weight, flakes.slice_at(k)))
        .collect();
    let mixture = LightnessMixture::of(&parts);
    let mean = mixed(parts.iter().map(|(weight, slice)| (*weight, slice.mean())));
    let lit = mixture.above(lit_from(geometry, mean));
    let texture = &flakes.texture;
    let cell_um = cell_spacing(texture.grain_um / texture.texel_um).max(1.0) * texture.texel_um;
    Sparkle {
        aspecular_deg: geometry.aspecular_deg,
        luminance: SHARES.map(|share| luminance_of(mixture.quantile(share))),
        lit_per_mm2: lit * 1e6 / (cell_um * cell_um),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rare_flakes_are_off_by_no_more_than_they_can_be_counted() {
        assert_eq!(off_by(0.01, 0.01), 0.0);
        assert!((off_by(0.03, 0.02) - 0.5).abs() < 1e-12);
        assert!((off_by(1e-4, 0.0) - 0.1).abs() < 1e-12);
        assert!((off_by(0.0, 5e-4) - 0.5).abs() < 1e-12);
    }
}
