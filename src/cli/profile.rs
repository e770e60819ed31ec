//! Which accuracy profile a command computes with.

use std::path::Path;

use clap::Args;

use super::number::{above_zero, whole};
use crate::accuracy::{Knobs, Profile, ProfileError};
use crate::paint::Limits;
use crate::workshop::{Picked, Target, Work, WorkshopError, read};

/// The profile, by name or by file, with knobs turned in place of its own; a knob turned twice is refused.
#[derive(Args, Clone, Debug, Default)]
pub struct ProfileArgs {
    /// Accuracy profile: draft, standard, reference, or a JSON file of knobs.
    #[arg(
        long,
        value_name = "NAME|FILE.json",
        default_value = "standard",
        allow_hyphen_values = true
    )]
    pub profile: String,
    #[allow(clippy::doc_markdown)] // a help text, printed as it stands
    /// Turn one knob of the profile, such as clusters=100; may be repeated. Knobs: clusters, box_rule, angle_step,
    /// transport, epsilon, cost, order, precision, draw, samples_per_pixel.
    #[arg(long = "knob", value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub knobs: Vec<Knobs>,
    /// Clusters per flake slice, 1 to 4096, in place of the profile's.
    #[arg(long, value_name = "N", value_parser = whole(1..=4096_u32), allow_hyphen_values = true)]
    pub clusters: Option<u32>,
}

/// The profile, or a target in its place.
#[derive(Args, Clone, Debug, Default)]
pub struct TargetArgs {
    #[command(flatten)]
    pub profile: ProfileArgs,
    /// In place of a profile: the cheapest whose error is at most this: of flakes in Lab; of pictures in CIEDE2000, in the
    /// mean, what their samples leave to chance and how far off the paint is.
    #[arg(long, value_name = "E", value_parser = above_zero, allow_hyphen_values = true,
        conflicts_with_all = ["profile", "knobs", "clusters"])]
    pub max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds on this machine.
    #[arg(long, value_name = "S", value_parser = above_zero, allow_hyphen_values = true,
        conflicts_with_all = ["profile", "knobs", "clusters"])]
    pub max_seconds: Option<f64>,
}

impl ProfileArgs {
    /// The knobs these arguments turn.
    pub fn knobs(&self) -> Result<Knobs, WorkshopError> {
        let wrong = |e: ProfileError| WorkshopError::usage("--profile", e);
        let is_file = Path::new(&self.profile)
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        let knobs: Knobs = if is_file {
            let bytes = read(Path::new(&self.profile), &Limits::default())?;
            let mut reader = serde_json::Deserializer::from_slice(&bytes);
            Knobs::of_name_or_object(&mut reader)
                .map_err(|e| WorkshopError::input(&self.profile, e))?
        } else {
            self.profile.parse().map_err(wrong)?
        };
        let mut turned = Knobs {
            clusters: self.clusters,
            ..Knobs::default()
        };
        for also in &self.knobs {
            if let Some((knob, one, other)) = turned.contradicted_by(also) {
                let problem = format!(
                    "{knob} is turned twice, to {one} and to {other}; accepted is one of the two"
                );
                return Err(WorkshopError::usage("--knob", problem));
            }
            turned = also.over(&turned).map_err(wrong)?;
        }
        turned.over(&knobs).map_err(wrong)
    }

    /// Whether anything but the usual profile is asked for.
    pub fn is_given(&self) -> bool {
        self.profile != "standard" || !self.knobs.is_empty() || self.clusters.is_some()
    }

    /// The profile these arguments mean.
    pub fn profile(&self) -> Result<Profile, WorkshopError> {
        self.knobs()?
            .profile()
            .map_err(|e| WorkshopError::usage("--profile", e))
    }
}

impl TargetArgs {
    /// The profile that meets the target, where one was given.
    pub fn pick(&self, work: &Work<'_>) -> Result<Option<Picked>, WorkshopError> {
        let target = Target {
            max_error: self.max_error,
            max_seconds: self.max_seconds,
        };
        let wrong = |e: WorkshopError| match e.field.as_deref() {
            Some(field @ ("max_error" | "max_seconds")) => {
                let option = format!("--{}", field.replace('_', "-"));
                WorkshopError::usage(&option, e.message.replace(field, &option))
            }
            _ => e,
        };
        if !target.is_some() {
            return Ok(None);
        }
        target.pick(work).map(Some).map_err(wrong)
    }
}
