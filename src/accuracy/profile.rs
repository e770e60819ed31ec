//! Accuracy profiles: the settings of all rooms, together.
//!
//! `standard` is the knee of blending in the study that comes with carpaint (`carpaint study`, docs/study): beyond it, a
//! share of the time buys less than that share of the error. `draft` is for sliders and thumbnails, `reference` is what
//! the others are measured against.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::knobs::{Knobs, ProfileError};
use crate::blend::{BlendSettings, Order};
use crate::export::{ExportSettings, Precision};
use crate::fit::{BoxRule, ClusterSettings};

/// Everything that trades time against accuracy.
///
/// Written as its knobs, all of them; read from knobs beside a preset, or from the preset's name alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// How flakes are clustered.
    pub flakes: ClusterSettings,
    /// How correspondences are found.
    pub blend: BlendSettings,
    /// How textures are written.
    pub export: ExportSettings,
    /// Samples per pixel of a preview.
    pub samples_per_pixel: u32,
}

/// Names of the presets, the cheapest first.
pub const PRESETS: [&str; 3] = ["draft", "standard", "reference"];

impl Default for Profile {
    fn default() -> Self {
        Self::standard()
    }
}

impl Profile {
    /// Fast: few clusters, every second angle, few samples. Transport stays exact: the study finds that greedy transport
    /// saves no time.
    #[must_use]
    pub fn draft() -> Self {
        Self {
            flakes: ClusterSettings {
                clusters: 24,
                box_rule: BoxRule::Moments,
                angle_step: 2,
            },
            samples_per_pixel: 16,
            ..Self::standard()
        }
    }

    /// The knee of blending: 50 clusters a slice, exact transport.
    #[must_use]
    pub fn standard() -> Self {
        Self {
            flakes: ClusterSettings::default(),
            blend: BlendSettings::default(),
            export: ExportSettings::default(),
            samples_per_pixel: 64,
        }
    }

    /// What the others are measured against.
    #[must_use]
    pub fn reference() -> Self {
        let standard = Self::standard();
        Self {
            flakes: ClusterSettings {
                clusters: 200,
                ..standard.flakes
            },
            blend: BlendSettings {
                order: Order::Cheapest,
                ..standard.blend
            },
            export: ExportSettings {
                precision: Precision::F32,
                ..standard.export
            },
            samples_per_pixel: 256,
        }
    }

    /// A preset by its name.
    ///
    /// # Errors
    ///
    /// [`ProfileError::Name`] for another name.
    pub fn named(name: &str) -> Result<Self, ProfileError> {
        match name {
            "draft" => Ok(Self::draft()),
            "standard" => Ok(Self::standard()),
            "reference" => Ok(Self::reference()),
            other => Err(ProfileError::Name(other.to_owned())),
        }
    }

    /// Name of the preset that has these very settings, `custom` where none has.
    #[must_use]
    pub fn name(&self) -> &'static str {
        let same = |name: &&&str| Self::named(name).is_ok_and(|preset| preset == *self);
        PRESETS.iter().find(same).copied().unwrap_or("custom")
    }
}

impl std::str::FromStr for Profile {
    type Err = ProfileError;

    /// A preset, knobs, or both: `standard`, `draft,clusters=40`, `transport=sinkhorn,epsilon=0.02`.
    fn from_str(text: &str) -> Result<Self, ProfileError> {
        text.parse::<Knobs>()?.profile()
    }
}

impl Serialize for Profile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Knobs::of(self).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Profile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Knobs::of_name_or_object(deserializer)?
            .profile()
            .map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_is_recognised_by_its_settings_whatever_it_was_called() {
        for name in PRESETS {
            let preset = Profile::named(name).expect("a preset");
            assert_eq!(preset.name(), name);
            let turned: Profile = format!("{name},clusters=51").parse().expect("knobs");
            assert_eq!(turned.name(), "custom", "{name}");
        }
        let spelled: Profile = "draft,clusters=50,angle_step=1,samples_per_pixel=64"
            .parse()
            .expect("knobs");
        assert_eq!(spelled.name(), "standard");
    }

    #[test]
    fn a_profile_reads_back_from_what_it_is_written_as() {
        for name in PRESETS {
            let preset = Profile::named(name).expect("a preset");
            let text = serde_json::to_string(&preset).expect("serialises");
            assert_eq!(
                serde_json::from_str::<Profile>(&text).expect("reads back"),
                preset,
                "{text}"
            );
            let by_name: Profile =
                serde_json::from_value(serde_json::json!(name)).expect("by name");
            assert_eq!(by_name, preset);
        }
        let sinkhorn: Profile = "transport=sinkhorn,epsilon=0.02".parse().expect("knobs");
        let text = serde_json::to_string(&sinkhorn).expect("serialises");
        assert_eq!(
            serde_json::from_str::<Profile>(&text).expect("reads back"),
            sinkhorn
        );
    }
}
