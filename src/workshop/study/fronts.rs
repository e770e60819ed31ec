//! Error against time of the kinds of work.

mod blend;
mod ingest;
mod join;
mod preview;
mod realise;

use std::collections::BTreeMap;

pub(super) use self::blend::blend;
pub(super) use self::ingest::ingest;
pub(super) use self::join::join;
pub(super) use self::preview::preview;
pub(super) use self::realise::realise;
use super::material::clustered;
use crate::accuracy::study::Point;
use crate::accuracy::{PRESETS, Profile, ResultError};
use crate::fit::{BoxRule, ClusterSettings};
use crate::workshop::WorkshopError;

/// A profile to measure, with what is told of it.
struct Setting {
    label: String,
    knob: &'static str,
    profile: Profile,
}

fn setting(label: impl Into<String>, knob: &'static str, profile: Profile) -> Setting {
    Setting {
        label: label.into(),
        knob,
        profile,
    }
}

fn presets() -> Vec<Setting> {
    PRESETS
        .iter()
        .filter_map(|&name| Some(setting(name, "preset", Profile::named(name).ok()?)))
        .collect()
}

fn with_flakes(flakes: ClusterSettings) -> Profile {
    Profile {
        flakes,
        ..Profile::standard()
    }
}

fn point(of: Setting, seconds: f64, error: f64) -> Point {
    Point {
        label: of.label,
        knob: of.knob.to_owned(),
        knobs: of.profile,
        seconds,
        error,
        bytes: None,
        more: BTreeMap::new(),
        on_front: false,
    }
}

/// Threads that parallel work is spread over.
fn all() -> usize {
    rayon::current_num_threads()
}

/// Each profile once, under the first of its labels; `read` gives the part of a profile that the work looks at.
fn distinct<T: PartialEq>(settings: Vec<Setting>, read: impl Fn(&Profile) -> T) -> Vec<Setting> {
    let mut kept: Vec<Setting> = Vec::with_capacity(settings.len());
    for setting in settings {
        let own = read(&setting.profile);
        if kept.iter().all(|other| read(&other.profile) != own) {
            kept.push(setting);
        }
    }
    kept
}

fn share(k: usize, of: usize, from: f32, to: f32) -> f32 {
    #[allow(clippy::cast_precision_loss)] // a progress bar
    let done = k as f32 / of.max(1) as f32;
    from + (to - from) * done
}

/// Clusters a slice that ingest and blend are measured with.
const CLUSTERS: [usize; 6] = [6, 12, 24, 50, 100, 200];

fn with_clusters(counts: &[usize]) -> impl Iterator<Item = Setting> {
    counts.iter().map(|&n| {
        let flakes = clustered(n, BoxRule::Moments, 1);
        setting(format!("{n} clusters"), "clusters", with_flakes(flakes))
    })
}

/// The error of what a study clustered itself is known.
fn measured(error: &ResultError) -> Result<f64, WorkshopError> {
    let unknown =
        || WorkshopError::internal("a paint of the study was not compared with its pictures");
    error.lab.ok_or_else(unknown)
}
