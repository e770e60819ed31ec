//! What was picked for targets, remembered for a while.
//!
//! To pick a profile takes a part of the work itself. Who asks for the same at the same time, or soon after, is answered
//! with the same pick: a picture that is kept is not estimated again. What is remembered is forgotten after a while, for
//! it depends on the machine and its load; what a busy moment let fail is looked for again.

use std::sync::Arc;
use std::time::Duration;

use moka::future::Cache;
use serde::Serialize;
use utoipa::ToSchema;

use super::works::{Picked, Target};
use crate::accuracy::Profile;
use crate::service::app::App;
use crate::service::http::Problem;
use crate::service::ids;
use crate::store::Hash;
use crate::workshop::EstimatedError;

/// How long a pick holds.
const HOLDS: Duration = Duration::from_mins(10);

/// Most picks that are remembered.
const MOST: u64 = 10_000;

/// Picks by what was asked for.
#[derive(Debug)]
pub struct Picks(Cache<Hash, Arc<Picked>>);

impl Default for Picks {
    fn default() -> Self {
        let cache = Cache::builder().max_capacity(MOST).time_to_live(HOLDS);
        Self(cache.build())
    }
}

/// A target, and what was picked for it; seconds stand in the header `Carpaint-Target`.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct TargetDocument {
    /// What was asked for: `max_error`, `max_seconds` or both.
    asked: Target,
    /// Whether it is met. If not, this is the best that could be done.
    met: bool,
    /// Name of the profile that was picked.
    profile: &'static str,
    /// Its knobs.
    #[schema(value_type = Object)]
    knobs: Profile,
    /// Estimated error.
    error: EstimatedError,
}

impl TargetDocument {
    /// What is told of a pick.
    #[must_use]
    pub fn of(picked: &Picked) -> Self {
        Self {
            asked: picked.target,
            met: picked.met,
            profile: picked.estimate.profile,
            knobs: picked.estimate.knobs,
            error: picked.estimate.error,
        }
    }
}

impl App {
    /// What is picked for work that `asked` tells from all other work: as it was a while ago, or as `pick` finds it at a
    /// place to compute.
    ///
    /// # Errors
    ///
    /// [`Problem`] of the pick, and when too many wait to compute.
    pub async fn pick(
        &self,
        asked: &impl Serialize,
        pick: impl FnOnce() -> Result<Picked, Problem> + Send + 'static,
    ) -> Result<Picked, Problem> {
        let key = ids::key("pick", asked);
        if let Some(known) = self.picks.0.get(&key).await {
            return Ok((*known).clone().at_hand());
        }
        let counter = &self.metrics.targets_searched;
        let search = async {
            let picked = self.bench.run(pick).await??;
            counter.increment(1);
            Ok(Arc::new(picked))
        };
        let found = self.picks.0.try_get_with(key, search).await;
        let picked = (*found.map_err(|problem| Problem::clone(&problem))?).clone();
        if !picked.met && picked.target.max_seconds.is_some() {
            self.picks.0.invalidate(&key).await;
        }
        Ok(picked)
    }
}
