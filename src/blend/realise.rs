//! A realisation: the paint at given weights. Here is where flakes are blended.
//!
//! ```text
//! l = Σ_m w_m g_m,   l' = Σ_m w_m g'_m      (g, g' the corners of a cluster's box in paint m)
//! ```
//!
//! with one set of weights for the lightness of the boxes and one for their a and b; probabilities never change
//! (Golla and Klein 2018, eq. 14-15, 4.4). Weights may leave 0..1 and need not sum to 1. A box that turns inside out by
//! extrapolation gets its corners ordered again; boxes are not clamped to `L >= 0`, because the light they stand for is
//! clamped once, when it is evaluated.

use serde::{Deserialize, Serialize};

use super::clamp::{Clamp, Ledger};
use super::{Blend, BlendedFlakes, RealisationWeights, WeightError, base, lobes};
use crate::paint::{CarPaint, FlakeTexture, Flakes, MAX_LAB};

/// A synthesised paint and the account of what had to be clamped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Realised<Paint = CarPaint> {
    /// The paint, valid whatever the weights were.
    pub paint: Paint,
    /// Every bound that bit.
    pub clamps: Vec<Clamp>,
    /// Sums of the weights for base, flake lightness and flake color.
    pub weight_sums: [f64; 3],
}

impl Blend {
    /// The paint at these weights, given in the order the paints were asked for.
    ///
    /// # Errors
    ///
    /// [`WeightError`] for a list of another length than there are paints, or a weight that is not finite.
    ///
    /// # Panics
    ///
    /// Never: a blend has at least two paints.
    pub fn realise(&self, wanted: &RealisationWeights) -> Result<Realised, WeightError> {
        wanted.check(self.ingredients().map(|(name, _)| name))?;
        let by_hash = |given: &[f64]| {
            let mut weights = vec![0.0; given.len()];
            for (&place, &w) in self.asked.iter().zip(given) {
                weights[place] = w;
            }
            weights
        };
        let base_weights = by_hash(wanted.base());
        let lightness = by_hash(wanted.flake_lightness());
        let color = by_hash(wanted.flake_color());
        let mut ledger = Ledger::default();
        let places = self.matched_lobes();
        let paint = CarPaint {
            coat: base::coat(&self.paints, &base_weights, &mut ledger),
            diffuse: base::diffuse(&self.paints, &base_weights, &mut ledger),
            lobes: lobes::blend(&places, &base_weights, &mut ledger),
            color_table: base::color_table(&self.paints, &base_weights, &mut ledger),
            flakes: self
                .flakes
                .as_ref()
                .map(|f| f.blend(&lightness, &color, wanted.flake_saturation, &mut ledger)),
        };
        let weight_sums = [&base_weights, &lightness, &color].map(|w| w.iter().sum());
        Ok(Realised {
            paint,
            clamps: ledger.close(),
            weight_sums,
        })
    }
}

impl BlendedFlakes {
    /// The flakes at these weights, in the paints' order.
    fn blend(
        &self,
        lightness: &[f64],
        color: &[f64],
        saturation: f64,
        ledger: &mut Ledger,
    ) -> Flakes {
        let count = self.probability.len();
        let axes: Vec<[f64; 3]> = lightness
            .iter()
            .zip(color)
            .map(|(&l, &c)| [l, c * saturation, c * saturation])
            .collect();
        let (mut lower, mut upper) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let (mut inverted, mut narrowest) = (0, 0.0_f64);
        let (mut beyond, mut furthest) = (0, 0.0_f64);
        for k in 0..count {
            let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
            for (own, weights) in self.boxes.iter().zip(&axes) {
                for axis in 0..3 {
                    low[axis] += weights[axis] * f64::from(own.lower[k][axis]);
                    high[axis] += weights[axis] * f64::from(own.upper[k][axis]);
                }
            }
            for axis in 0..3 {
                let width = high[axis] - low[axis];
                inverted += usize::from(width < 0.0);
                narrowest = narrowest.min(width);
                (low[axis], high[axis]) = (low[axis].min(high[axis]), low[axis].max(high[axis]));
                let reach = high[axis].max(-low[axis]) - MAX_LAB;
                beyond += usize::from(reach > 0.0);
                furthest = furthest.max(reach);
            }
            lower.push(low.map(held));
            upper.push(high.map(held));
        }
        ledger.record(
            "flakes.boxes",
            "inverted corners put in order",
            inverted,
            3 * count,
            -narrowest,
        );
        ledger.record(
            "flakes.boxes",
            "Lab held to -2000..2000",
            beyond,
            3 * count,
            furthest,
        );
        Flakes {
            theta_h: self.theta_h.clone(),
            theta_d: self.theta_d.clone(),
            offsets: self.offsets.clone(),
            probability: self.probability.clone(),
            lower,
            upper,
            texture: self.texture(lightness, ledger),
        }
    }

    /// Texel, grain and lifetime follow the weights of the lightness: they are how the sparkle looks.
    fn texture(&self, weights: &[f64], ledger: &mut Ledger) -> FlakeTexture {
        let mix = |get: &dyn Fn(&FlakeTexture) -> f64| -> f64 {
            self.textures
                .iter()
                .zip(weights)
                .map(|(t, w)| w * get(t))
                .sum()
        };
        let mut angle = |field: &str, get: &dyn Fn(&FlakeTexture) -> f64| {
            ledger.hold(field, mix(get), 0.01, 1e4)
        };
        let lifetime_deg = [
            angle("flakes.lifetime_deg", &|t| t.lifetime_deg[0]),
            angle("flakes.lifetime_deg", &|t| t.lifetime_deg[1]),
        ];
        let persistence_deg = [
            angle("flakes.persistence_deg", &|t| t.persistence_deg[0]),
            angle("flakes.persistence_deg", &|t| t.persistence_deg[1]),
        ];
        FlakeTexture {
            texel_um: ledger.hold("flakes.texel_um", mix(&|t| t.texel_um), 1e-3, 1e5),
            grain_um: ledger.hold("flakes.grain_um", mix(&|t| t.grain_um), 1e-3, 1e6),
            lifetime_deg,
            persistence_deg,
        }
    }
}

#[allow(clippy::cast_possible_truncation)] // boxes are kept at texel precision
fn held(value: f64) -> f32 {
    value.clamp(-MAX_LAB, MAX_LAB) as f32
}
