//! Accuracy profiles: the settings of all rooms, together.

use serde::{Deserialize, Serialize};

use crate::blend::BlendSettings;
use crate::export::{ExportSettings, Precision};
use crate::fit::ClusterSettings;
use crate::transport::{Cost, Method};

/// Everything that trades time against accuracy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Name of the preset this began as, `custom` once a knob was turned.
    pub name: String,
    /// How flakes are clustered.
    pub flakes: ClusterSettings,
    /// How correspondences are found.
    pub blend: BlendSettings,
    /// How textures are written.
    pub export: ExportSettings,
    /// Samples per pixel of a preview.
    pub samples_per_pixel: u32,
}

/// Why there is no such profile.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// Unknown name.
    #[error("there is no profile '{0}'; there are draft, standard and reference")]
    Name(String),
    /// Clusters out of range.
    #[error("{0} clusters a slice, accepted are 1 to 4096")]
    Clusters(usize),
}

impl Default for Profile {
    fn default() -> Self {
        Self::standard()
    }
}

impl Profile {
    /// Fast: few clusters, greedy correspondence, few samples.
    #[must_use]
    pub fn draft() -> Self {
        let standard = Self::standard();
        Self {
            name: "draft".to_owned(),
            flakes: ClusterSettings {
                clusters: 24,
                ..standard.flakes
            },
            blend: BlendSettings {
                method: Method::Greedy,
                cost: Cost::Distance,
            },
            samples_per_pixel: 16,
            ..standard
        }
    }

    /// What the paper chose: 50 clusters a slice, exact transport.
    #[must_use]
    pub fn standard() -> Self {
        Self {
            name: "standard".to_owned(),
            flakes: ClusterSettings {
                clusters: 50,
                ..ClusterSettings::default()
            },
            blend: BlendSettings {
                method: Method::Exact,
                cost: Cost::Distance,
            },
            export: ExportSettings::default(),
            samples_per_pixel: 64,
        }
    }

    /// What the others are measured against.
    #[must_use]
    pub fn reference() -> Self {
        let standard = Self::standard();
        Self {
            name: "reference".to_owned(),
            flakes: ClusterSettings {
                clusters: 200,
                ..standard.flakes
            },
            export: ExportSettings {
                precision: Precision::F32,
                ..standard.export
            },
            samples_per_pixel: 256,
            ..standard
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

    /// The same profile with another number of clusters per slice.
    ///
    /// # Errors
    ///
    /// [`ProfileError::Clusters`] outside 1 to 4096.
    pub fn with_clusters(self, clusters: usize) -> Result<Self, ProfileError> {
        if !(1..=4096).contains(&clusters) {
            return Err(ProfileError::Clusters(clusters));
        }
        if clusters == self.flakes.clusters {
            return Ok(self);
        }
        Ok(Self {
            name: "custom".to_owned(),
            flakes: ClusterSettings {
                clusters,
                ..self.flakes
            },
            ..self
        })
    }
}
