//! The profile that was picked for a target, and how that is told.

use serde::Serialize;

use super::Target;
use crate::accuracy::{Knobs, Profile};
use crate::workshop::{Estimate, Stage};

/// A profile picked for a target.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Picked {
    /// What was asked for.
    pub target: Target,
    /// Whether it is met; if not, this is the best that could be done: of a picture whose paint alone is too far off, samples
    /// as if it were not.
    pub met: bool,
    /// The profile, and what the work will take with it.
    pub estimate: Estimate,
    /// How many profiles were looked at.
    pub tried: usize,
    /// Seconds that took.
    pub searched: f64,
}

impl Picked {
    /// The same as it is for who finds it at hand, without a search of his own.
    #[must_use]
    pub fn at_hand(mut self) -> Self {
        self.searched = 0.0;
        self.met = self.target.is_met(&self.estimate, 0.0);
        self
    }

    /// The same with a stage that comes before the work.
    #[must_use]
    pub fn after(mut self, stage: Stage) -> Self {
        self.estimate = self.estimate.after(vec![stage]);
        self.met = self.target.is_met(&self.estimate, self.searched);
        self
    }

    /// The profile.
    #[must_use]
    pub const fn profile(&self) -> &Profile {
        &self.estimate.knobs
    }

    /// The same for people, with the reason where the error is not known.
    #[must_use]
    pub fn told(&self) -> String {
        let Estimate { seconds, error, .. } = &self.estimate;
        let why = error.unknown.map_or(String::new(), |why| {
            format!(" (its error is not known: {why})")
        });
        let late = if self.target.is_in_time(&self.estimate, self.searched) {
            String::new()
        } else {
            let all = seconds + self.searched;
            format!(" (the search counts too: {all:.3} s)")
        };
        format!("{}{why}{late}", self.line())
    }

    /// In one line.
    #[must_use]
    pub fn line(&self) -> String {
        let Estimate { seconds, error, .. } = &self.estimate;
        format!(
            "{}; profile={}, error={error}, seconds={seconds:.3}, searched={:.3}",
            if self.met { "met" } else { "not met" },
            Knobs::told(self.profile()),
            self.searched,
        )
    }
}
