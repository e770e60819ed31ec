//! The sample paints: the eight car paints of Günther et al. 2005.
//!
//! Source: J. Günther, T. Chen, M. Goesele, I. Wald, H.-P. Seidel, "Efficient Acquisition and Realistic Rendering of
//! Car Paint", VMV 2005: fitted diffuse albedo, and three lobes with weight per channel, reflectance at normal incidence
//! and roughness, in air, lacquer included. Read as this crate's lobes: s = ks, F0 = r, α = m.
//!
//! Which of them are metallic, the figures say: in `ford_f8`, `polaris_silber`, `opel_titan` and `bmw339` a wide lobe (α of 0.1
//! and more) reflects several times what the diffuse albedo does, which is aluminium; they get simulated flakes. White,
//! `2k_acrylack` (a plain two-component acrylic), blue and `blue_matte` carry their color in the diffuse albedo under lobes
//! of a lacquer's reflectance or of little weight: they are solid colors.

use super::WorkshopError;
use super::ingest::finish;
use crate::accuracy::{Profile, clustering_error};
use crate::fit::{FlakeRecipe, SimulatedPatch, fit_flakes};
use crate::paint::{CarPaint, Clustering, ColorTable, Lobe, PaintFile, Provenance};

/// One sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Name, as in the paper.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    diffuse: [f64; 3],
    weights: [[f64; 3]; 3],
    f0: [f64; 3],
    alpha: [f64; 3],
    flakes: Option<Sparkle>,
}

/// What is chosen per metallic: the measurement has no flakes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sparkle {
    per_mm2: f64,
    radius_um: f64,
    tilt: f64,
    tint_spread: f64,
    seed: u64,
}

/// All samples.
pub const SAMPLES: [Sample; 8] = [
    Sample {
        name: "ford_f8",
        about: "dark metallic, simulated flakes: sparse and coarse",
        diffuse: [0.0012, 0.0015, 0.0018],
        weights: [
            [0.0049, 0.0076, 0.012],
            [0.01, 0.013, 0.018],
            [0.007, 0.0065, 0.0077],
        ],
        f0: [0.15, 0.087, 0.9],
        alpha: [0.32, 0.11, 0.013],
        flakes: Some(Sparkle {
            per_mm2: 500.0,
            radius_um: 14.0,
            tilt: 0.15,
            tint_spread: 0.08,
            seed: 0xf8,
        }),
    },
    Sample {
        name: "polaris_silber",
        about: "silver metallic, simulated flakes: dense and fine",
        diffuse: [0.055, 0.063, 0.071],
        weights: [
            [0.065, 0.082, 0.088],
            [0.11, 0.11, 0.13],
            [0.008, 0.013, 0.015],
        ],
        f0: [1.0, 0.92, 0.9],
        alpha: [0.38, 0.17, 0.013],
        flakes: Some(Sparkle {
            per_mm2: 2400.0,
            radius_um: 11.0,
            tilt: 0.17,
            tint_spread: 0.03,
            seed: 0x51,
        }),
    },
    Sample {
        name: "opel_titan",
        about: "titanium gray metallic, simulated flakes: medium",
        diffuse: [0.011, 0.013, 0.015],
        weights: [
            [0.057, 0.066, 0.078],
            [0.11, 0.12, 0.13],
            [0.0095, 0.014, 0.016],
        ],
        f0: [0.85, 0.86, 0.9],
        alpha: [0.38, 0.17, 0.014],
        flakes: Some(Sparkle {
            per_mm2: 1400.0,
            radius_um: 13.0,
            tilt: 0.17,
            tint_spread: 0.04,
            seed: 0x71,
        }),
    },
    Sample {
        name: "bmw339",
        about: "gray metallic, simulated flakes: medium and fine",
        diffuse: [0.012, 0.015, 0.016],
        weights: [
            [0.062, 0.076, 0.08],
            [0.11, 0.12, 0.12],
            [0.0083, 0.015, 0.016],
        ],
        f0: [0.92, 0.87, 0.9],
        alpha: [0.39, 0.17, 0.013],
        flakes: Some(Sparkle {
            per_mm2: 1900.0,
            radius_um: 12.0,
            tilt: 0.17,
            tint_spread: 0.05,
            seed: 0x339,
        }),
    },
    Sample {
        name: "2k_acrylack",
        about: "solid yellow-beige two-component acrylic, no flakes",
        diffuse: [0.42, 0.32, 0.1],
        weights: [[0.0; 3], [0.028, 0.026, 0.006], [0.017, 0.0075, 0.0041]],
        f0: [1.0, 0.9, 0.17],
        alpha: [0.88, 0.8, 0.015],
        flakes: None,
    },
    Sample {
        name: "white",
        about: "solid white, no flakes",
        diffuse: [0.61, 0.63, 0.55],
        weights: [
            [2.6e-6, 0.00031, 3.1e-8],
            [0.013, 0.011, 0.0083],
            [0.049, 0.042, 0.037],
        ],
        f0: [0.049, 0.45, 0.17],
        alpha: [1.0, 0.15, 0.015],
        flakes: None,
    },
    Sample {
        name: "blue",
        about: "solid blue, no flakes",
        diffuse: [0.0079, 0.023, 0.1],
        weights: [
            [0.0011, 0.0015, 0.0019],
            [0.025, 0.03, 0.043],
            [0.059, 0.074, 0.082],
        ],
        f0: [1.0, 0.094, 0.17],
        alpha: [0.15, 0.043, 0.02],
        flakes: None,
    },
    Sample {
        name: "blue_matte",
        about: "solid blue without gloss, no flakes",
        diffuse: [0.0099, 0.036, 0.12],
        weights: [
            [0.0032, 0.0045, 0.0059],
            [0.18, 0.23, 0.28],
            [0.04, 0.049, 0.051],
        ],
        f0: [1.0, 0.046, 0.17],
        alpha: [0.16, 0.075, 0.034],
        flakes: None,
    },
];

/// The sample of this name.
#[must_use]
pub fn by_name(name: &str) -> Option<&'static Sample> {
    SAMPLES.iter().find(|sample| sample.name == name)
}

impl Sample {
    /// Everything that its paint is made of, in words: another recipe is another paint.
    #[must_use]
    pub fn recipe(&self) -> String {
        let flakes = self.flakes.map(|sparkle| sparkle.recipe(&self.base()));
        format!(
            "{:?}",
            (self.diffuse, self.weights, self.f0, self.alpha, flakes)
        )
    }

    /// Whether flakes are simulated for it.
    #[must_use]
    pub const fn is_metallic(&self) -> bool {
        self.flakes.is_some()
    }

    /// The patch of flakes that is simulated for it; `None` for a solid color.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] never: the recipes are in range.
    pub fn patch(&self) -> Result<Option<SimulatedPatch>, WorkshopError> {
        self.flakes
            .map(|sparkle| {
                let base = self.base();
                SimulatedPatch::new(&base, &sparkle.recipe(&base))
            })
            .transpose()
            .map_err(WorkshopError::internal)
    }

    /// The base as the paper fitted it, without flakes.
    #[must_use]
    pub fn base(&self) -> CarPaint {
        let lobes = (0..3)
            .map(|k| Lobe {
                weight: self.weights[k],
                alpha: self.alpha[k],
                f0: self.f0[k],
            })
            .collect();
        CarPaint {
            coat: None,
            diffuse: self.diffuse,
            lobes,
            color_table: ColorTable::white(),
            flakes: None,
        }
    }
}

impl Sample {
    /// The paint, its flakes simulated and clustered as the profile says.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] when the profile's clusters are out of range.
    pub fn build(
        &self,
        profile: &Profile,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<PaintFile, WorkshopError> {
        let mut paint = self.base();
        let mut provenance = Provenance {
            source: "sample".to_owned(),
            ..Provenance::default()
        };
        provenance.notes.insert(
            "base".to_owned(),
            "Günther et al., VMV 2005, table of fits".to_owned(),
        );
        let (mut clustering, mut warnings) = (None, Vec::new());
        if let Some(patch) = self.patch()? {
            let tell = |done: usize, of: usize| {
                #[allow(clippy::cast_precision_loss)] // a progress bar
                progress(done as f32 / of as f32);
            };
            let refused = |e| WorkshopError::usage("clusters", e);
            let fitted = fit_flakes(&patch, &profile.flakes, &tell).map_err(refused)?;
            paint.flakes = Some(fitted.flakes);
            clustering = Some(Clustering {
                error: clustering_error(&patch, &paint),
                ..fitted.clustering
            });
            warnings = fitted.warnings;
            warnings.push("the flakes are simulated, not measured".to_owned());
            provenance.simulated_flakes = true;
        }
        Ok(finish(
            self.name.to_owned(),
            provenance,
            paint,
            None,
            clustering,
            warnings,
        ))
    }
}

/// Roughness from which a lobe is the metal's and not the lacquer's.
const METAL_ALPHA: f64 = 0.05;

impl Sparkle {
    /// Flakes whose metal has the color of the base's wide lobes, which is theirs seen from afar.
    fn recipe(&self, base: &CarPaint) -> FlakeRecipe {
        let wide = base.lobes.iter().filter(|lobe| lobe.alpha >= METAL_ALPHA);
        let color = wide.fold([0.0; 3], |sum, lobe| {
            std::array::from_fn(|c| sum[c] + lobe.weight[c])
        });
        // A reflectance is at most 1; how bright the flakes are, their share says.
        let largest = color.into_iter().fold(0.0, f64::max);
        FlakeRecipe {
            per_mm2: self.per_mm2,
            radius_um: self.radius_um,
            tilt: self.tilt,
            tint: color.map(|c| c / largest),
            tint_spread: self.tint_spread,
            seed: self.seed,
            ..FlakeRecipe::default()
        }
    }
}
