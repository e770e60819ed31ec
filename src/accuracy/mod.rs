//! Accuracy: the profiles that trade time against it.
//!
//! Every room owns its settings; a [`Profile`] is those settings together, handed down as they are. No room below asks
//! what the profile is called.

mod knobs;
mod profile;

pub use knobs::{CostKnob, Draw, Knobs, Preset, ProfileError, Transport};
pub use profile::{PRESETS, Profile};
