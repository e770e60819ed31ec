//! A realisation: the paint at given weights. Here is where flakes are blended.
//!
//! ```text
//! l = Σ_m w_m g_m,   l' = Σ_m w_m g'_m      (g, g' the corners of a cluster's box in paint m)
//! ```
//!
//! with one set of weights for the lightness of the boxes and one for their a and b; probabilities never change
//! (Golla and Klein 2018, eq. 14-15, 4.4). Weights may leave 0..1 and need not sum to 1. The sums themselves stand in
//! `boxes`; base and lobes have their own files.

use super::boxes::mix_boxes;
use super::clamp::{Clamp, Ledger};
use super::geometric::geometric_mean;
use super::{Blend, BlendedFlakes, Boxes, RealisationWeights, WeightError, base, lobes};
use crate::paint::{CarPaint, FlakeTexture, Flakes, GRAINS_UM, LIFETIMES_DEG, TEXELS_UM};

/// A synthesised paint and the account of what had to be clamped.
#[derive(Clone, Debug, PartialEq)]
pub struct Realised {
    /// The paint, valid whatever the weights were.
    pub paint: CarPaint,
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
    pub fn realise(&self, wanted: &RealisationWeights) -> Result<Realised, WeightError> {
        self.realised_in(wanted, Boxes::default())
    }

    /// The same in the memory of a realisation that is needed no more: for who moves weights to and fro, and whom new
    /// memory for every step would cost more than the step.
    ///
    /// # Errors
    ///
    /// As [`Blend::realise`].
    pub fn realise_over(
        &self,
        wanted: &RealisationWeights,
        old: Realised,
    ) -> Result<Realised, WeightError> {
        let lists = old.paint.flakes.map(|old| Boxes {
            lower: old.lower,
            upper: old.upper,
        });
        self.realised_in(wanted, lists.unwrap_or_default())
    }

    /// Refuses the weights that [`Blend::realise`] refuses, and realises nothing.
    ///
    /// # Errors
    ///
    /// As [`Blend::realise`].
    pub fn check(&self, wanted: &RealisationWeights) -> Result<(), WeightError> {
        wanted.check(self.ingredients().map(|(name, _)| name))
    }

    fn realised_in(
        &self,
        wanted: &RealisationWeights,
        lists: Boxes,
    ) -> Result<Realised, WeightError> {
        self.check(wanted)?;
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
            flakes: self.flakes.as_ref().map(|f| {
                f.blend(
                    [&lightness, &color],
                    wanted.flake_saturation,
                    lists,
                    &mut ledger,
                )
            }),
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
    /// The flakes at these weights of lightness and color, in the paints' order; their boxes take the place of others.
    fn blend(
        &self,
        [lightness, color]: [&[f64]; 2],
        saturation: f64,
        mut boxes: Boxes,
        ledger: &mut Ledger,
    ) -> Flakes {
        let axes: Vec<[f64; 3]> = lightness
            .iter()
            .zip(color)
            .map(|(&l, &c)| [l, c * saturation, c * saturation])
            .collect();
        mix_boxes(self, &axes, &mut boxes).close(3 * self.probability.len(), ledger);
        Flakes {
            theta_h: self.theta_h.clone(),
            theta_d: self.theta_d.clone(),
            offsets: self.offsets.clone(),
            probability: self.probability.clone(),
            lower: boxes.lower,
            upper: boxes.upper,
            texture: self.texture(lightness, ledger),
        }
    }

    /// Texel, grain and lifetime follow the weights of the lightness: they are how the sparkle looks.
    fn texture(&self, weights: &[f64], ledger: &mut Ledger) -> FlakeTexture {
        let mix = |get: &dyn Fn(&FlakeTexture) -> f64| {
            geometric_mean(&self.textures.iter().map(get), weights)
        };
        let mut angle = |field: &'static str, get: &dyn Fn(&FlakeTexture) -> f64| {
            ledger.hold(field, mix(get), LIFETIMES_DEG[0], LIFETIMES_DEG[1])
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
            texel_um: ledger.hold(
                "flakes.texel_um",
                mix(&|t| t.texel_um),
                TEXELS_UM[0],
                TEXELS_UM[1],
            ),
            grain_um: ledger.hold(
                "flakes.grain_um",
                mix(&|t| t.grain_um),
                GRAINS_UM[0],
                GRAINS_UM[1],
            ),
            lifetime_deg,
            persistence_deg,
        }
    }
}
