//! Which accuracy profile a command computes with.

use clap::Args;

use crate::accuracy::Profile;
use crate::workshop::WorkshopError;

/// The profile, by name or by knobs.
#[derive(Args, Clone, Debug, Default)]
pub struct ProfileArgs {
    /// Accuracy profile: draft, standard or reference.
    #[arg(long, value_name = "P", default_value = "standard")]
    pub profile: String,
    /// Clusters per flake slice, 1 to 4096, in place of the profile's.
    #[arg(long, value_name = "N")]
    pub clusters: Option<usize>,
}

impl ProfileArgs {
    /// The profile these arguments mean.
    pub fn profile(&self) -> Result<Profile, WorkshopError> {
        let profile =
            Profile::named(&self.profile).map_err(|e| WorkshopError::usage("--profile", e))?;
        match self.clusters {
            None => Ok(profile),
            Some(clusters) => profile
                .with_clusters(clusters)
                .map_err(|e| WorkshopError::usage("--clusters", e)),
        }
    }
}
