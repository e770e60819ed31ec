//! Simulated flakes for paints that were measured without pictures of them.
//!
//! Günther et al. (VMV 2005) give a fitted car paint its sparkle back by random flake normals seen through the paint's
//! own reflection. Here a patch is scattered with flakes: discs of varied size lying over one another in random order,
//! the upper ones hiding the lower, each with a normal of its own, a tint of its own and a brightness that stands for its
//! depth. Every flake reflects like a small rough mirror,
//!
//! ```text
//! f = g tint D_w(angle(m, h)) / (4 cosθi cosθo),   D_w = exp(−tan²δ/w²) / (π w² cos⁴δ)
//! ```
//!
//! with light and view on either side of the half vector across its plane of tilt, so that both cosines are
//! `cosθh cosθd`; a metal's reflectance hardly depends on θd within the grid. The gain g is set once, so that the patch's mean luminance at θh = θd = 0 is a given share of the base's
//! there, lobes narrower than any flake's spread (a lacquer's highlight) not counted. The pictures then go the way of
//! measured ones, [`fit_flakes`]. A plausible paint, not a measured one: mark it as simulated.

use super::clusters::ClusterSettings;
use super::flake_patch::SimulatedPatch;
use super::flakes::{FittedFlakes, FlakeFitError, Progress, fit_flakes};
use crate::color::LinearRgb;
use crate::paint::{AngleGrid, CarPaint};

/// What the flakes of a paint are like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeRecipe {
    /// Flakes per square millimetre, 0 to 100000.
    pub per_mm2: f64,
    /// Median radius, micrometres, 0.1 to 1000.
    pub radius_um: f64,
    /// Beckmann roughness α of the flakes' normals, 0.001 to 2; a metallic's widest lobe but one has it.
    pub tilt: f64,
    /// Width w of one flake's reflection as an angle, degrees, 0.5 to 45: how smooth the flakes are.
    pub half_width_deg: f64,
    /// Color of the metal, 0 to 2: of luminance 1 where it only tints what brightness and depth decide.
    pub tint: LinearRgb,
    /// Standard deviation of the logarithm of a flake's own tint, per channel.
    pub tint_spread: f64,
    /// Standard deviation of the logarithm of a flake's brightness: the spread of depths.
    pub depth_spread: f64,
    /// Mean luminance of the flakes at the mirror direction, as a share of the base's.
    pub share: f64,
    /// Side of a texel, micrometres.
    pub texel_um: f64,
    /// Texels along a side of the patch, 1 to 4096.
    pub texels: u32,
    /// Angles of θh and θd, 1 to 181.
    pub angles: u32,
    /// Largest angle, degrees, to 85.
    pub largest_deg: f64,
    /// Another seed is another patch of the same paint.
    pub seed: u64,
}

impl Default for FlakeRecipe {
    fn default() -> Self {
        Self {
            per_mm2: 1500.0,
            radius_um: 12.0,
            tilt: 0.17,
            half_width_deg: 3.0,
            tint: [1.0; 3],
            tint_spread: 0.04,
            depth_spread: 0.4,
            share: 0.15,
            texel_um: 20.0,
            texels: 64,
            angles: 24,
            largest_deg: 66.0,
            seed: 1,
        }
    }
}

/// Simulates the flakes of a paint and fits them.
///
/// # Errors
///
/// [`FlakeFitError::Recipe`] for a recipe out of range, and what [`fit_flakes`] refuses.
pub fn simulate_flakes(
    base: &CarPaint,
    recipe: &FlakeRecipe,
    settings: &ClusterSettings,
    progress: Progress,
) -> Result<FittedFlakes, FlakeFitError> {
    fit_flakes(&SimulatedPatch::new(base, recipe)?, settings, progress)
}

impl FlakeRecipe {
    pub(super) fn check(&self) -> Result<(), FlakeFitError> {
        let fields = [
            ("per_mm2", self.per_mm2, 0.0, 1e5),
            ("radius_um", self.radius_um, 0.1, 1000.0),
            ("tilt", self.tilt, 1e-3, 2.0),
            ("half_width_deg", self.half_width_deg, 0.5, 45.0),
            ("tint_spread", self.tint_spread, 0.0, 2.0),
            ("depth_spread", self.depth_spread, 0.0, 2.0),
            ("share", self.share, 0.0, 10.0),
            ("texel_um", self.texel_um, 0.1, 1000.0),
            ("texels", f64::from(self.texels), 1.0, 4096.0),
            ("angles", f64::from(self.angles), 1.0, 181.0),
            ("largest_deg", self.largest_deg, 0.0, 85.0),
            ("tint red", self.tint[0], 0.0, 2.0),
            ("tint green", self.tint[1], 0.0, 2.0),
            ("tint blue", self.tint[2], 0.0, 2.0),
        ];
        for (field, value, low, high) in fields {
            if !(low..=high).contains(&value) {
                return Err(FlakeFitError::Recipe {
                    field,
                    value,
                    low,
                    high,
                });
            }
        }
        Ok(())
    }

    pub(super) fn grid(&self) -> AngleGrid {
        let steps = (self.angles - 1).max(1);
        let angles = if self.largest_deg > 0.0 {
            self.angles
        } else {
            1
        };
        // As instruments write them: paints that were measured at the same angles share them to the bit.
        let written = |degrees: f64| (degrees * 1e4).round() / 1e4;
        let degrees = (0..angles)
            .map(|k| written(self.largest_deg * f64::from(k) / f64::from(steps)))
            .collect();
        // Multiples of a positive step up to at most 85°.
        AngleGrid::new(degrees).unwrap_or_else(|_| AngleGrid::single())
    }
}
