//! Why there is no such profile.

/// Why there is no such profile.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// Unknown preset.
    #[error(
        "there is no profile '{0}'; there are draft, standard and reference, and knobs as in clusters=100"
    )]
    Name(String),
    /// A number out of range.
    #[error("{knob} is {value}, accepted is {accepted}")]
    Range {
        /// The knob.
        knob: &'static str,
        /// What it was set to.
        value: String,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// A smoothing for a solver that has none.
    #[error("epsilon is set, but transport is not sinkhorn")]
    Epsilon,
    /// A knob or a value that there is not.
    #[error("{0}")]
    Knob(String),
}

impl ProfileError {
    /// The knob that is wrong, where it is one.
    #[must_use]
    pub const fn knob(&self) -> Option<&'static str> {
        match self {
            Self::Range { knob, .. } => Some(knob),
            Self::Epsilon => Some("epsilon"),
            Self::Name(_) | Self::Knob(_) => None,
        }
    }
}
