//! What surrounds the object: the built-in studio, one radiance everywhere, or a picture of the sky.
//!
//! Files of pictures are read by [`Environment::from_bytes`](Environment).

use std::f32::consts::TAU;
use std::sync::Arc;

use serde::Serialize;

use super::environment_map::{Map, luminance};
use super::scene::DirectionalLight;
use super::studio::Studio;
use super::vector::Vec3;

/// The surroundings, as radiance by direction.
#[derive(Clone, Debug)]
pub struct Environment {
    source: Source,
    held: Held,
}

/// Channels of a picture that were held in the range of light that is drawn, 0 to 65504.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Held {
    /// Channels above it, which a bare sun reaches.
    pub too_bright: u64,
    /// The brightest of them, or 0.
    pub brightest: f32,
    /// Channels below 0, which resampling leaves beside bright lights.
    pub negative: u64,
    /// The lowest of them, or 0.
    pub lowest: f32,
}

#[derive(Clone, Debug)]
pub(super) enum Source {
    Studio(Studio),
    Uniform(Vec3),
    Map(Arc<Map>),
}

impl Held {
    pub(super) const NONE: Self = Self {
        too_bright: 0,
        brightest: 0.0,
        negative: 0,
        lowest: 0.0,
    };

    /// The channel within the range, counted where it was outside.
    pub(super) fn hold(&mut self, channel: f32, most: f32) -> f32 {
        if channel > most {
            self.too_bright += 1;
            self.brightest = self.brightest.max(channel);
        } else if channel < 0.0 {
            self.negative += 1;
            self.lowest = self.lowest.min(channel);
        }
        channel.clamp(0.0, most)
    }

    /// Whether nothing was held.
    #[must_use]
    pub const fn is_none(&self) -> bool {
        self.too_bright == 0 && self.negative == 0
    }

    /// In words, where there is anything to say.
    #[must_use]
    pub fn line(&self) -> Option<String> {
        let mut parts = Vec::new();
        if self.too_bright > 0 {
            parts.push(format!(
                "{} channels above 65504, up to {}, are drawn as 65504",
                self.too_bright, self.brightest
            ));
        }
        if self.negative > 0 {
            parts.push(format!(
                "{} channels below 0, down to {}, are drawn as 0",
                self.negative, self.lowest
            ));
        }
        (!parts.is_empty()).then(|| format!("environment: {}", parts.join("; ")))
    }
}

impl Default for Environment {
    fn default() -> Self {
        Self::studio()
    }
}

impl Environment {
    /// The built-in studio.
    #[must_use]
    pub fn studio() -> Self {
        Self::of(Source::Studio(Studio::new()))
    }

    /// The same radiance from everywhere, a white furnace for 1.
    #[must_use]
    pub const fn uniform(radiance: Vec3) -> Self {
        Self::of(Source::Uniform(radiance))
    }

    /// A picture, and what of it was held.
    pub(super) fn map(map: Map, held: Held) -> Self {
        Self {
            source: Source::Map(Arc::new(map)),
            held,
        }
    }

    const fn of(source: Source) -> Self {
        Self {
            source,
            held: Held::NONE,
        }
    }

    /// Bytes that it takes in memory, about.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.source {
            Source::Map(map) => size_of::<Vec3>() * map.pixels.len(),
            Source::Studio(_) | Source::Uniform(_) => size_of::<Self>(),
        }
    }

    /// What of the picture is not drawn as bright as it was.
    #[must_use]
    pub const fn held(&self) -> &Held {
        &self.held
    }

    pub(super) const fn source(&self) -> &Source {
        &self.source
    }

    /// Radiance from a unit direction that points towards the surroundings.
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match &self.source {
            Source::Studio(studio) => studio.radiance(direction),
            Source::Uniform(radiance) => *radiance,
            Source::Map(map) => map.radiance(direction),
        }
    }

    /// The main light as one of a single direction: the studio's key, or a picture's brightest light with all that is
    /// within six degrees of its middle. Light that is the same from everywhere has none: no irradiance, along y.
    #[must_use]
    pub fn main_light(&self) -> DirectionalLight {
        match &self.source {
            Source::Studio(studio) => studio.key(),
            Source::Uniform(_) => DirectionalLight {
                towards: [0.0, 1.0, 0.0],
                irradiance: [0.0; 3],
            },
            Source::Map(map) => map.main_light(),
        }
    }

    /// What a white diffuser turned upwards reflects: the brightness of these surroundings.
    #[must_use]
    pub fn level(&self) -> f32 {
        if let Source::Map(map) = &self.source {
            return map.level();
        }
        let (rings, spokes) = (48_u16, 96_u16);
        let mut sum = 0.0;
        for ring in 0..rings {
            // Even in cos², the share of light a ring adds.
            let sine2 = (f32::from(ring) + 0.5) / f32::from(rings);
            for spoke in 0..spokes {
                let turn = TAU * (f32::from(spoke) + 0.5) / f32::from(spokes);
                let direction = [
                    sine2.sqrt() * turn.cos(),
                    (1.0 - sine2).sqrt(),
                    sine2.sqrt() * turn.sin(),
                ];
                sum += luminance(self.radiance(direction));
            }
        }
        sum / f32::from(rings) / f32::from(spokes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_environment_has_its_own_level() {
        assert!((Environment::uniform([0.7; 3]).level() - 0.7).abs() < 1e-4);
    }
}
