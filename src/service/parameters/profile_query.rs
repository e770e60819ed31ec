//! How accurately a file is written, in a query: knobs, or a target in their place.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use utoipa::IntoParams;

use super::profile::ProfileText;
use super::targets;
use crate::accuracy::Profile;
use crate::service::app::App;
use crate::service::http::Problem;
use crate::service::shelf::Shelved;
use crate::service::work::{Picked, Target, Thing, Works, WorkshopError};

/// How accurately a file is written.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ProfileQuery {
    /// Accuracy: `draft`, `standard`, `reference`, and knobs such as `standard,precision=f32,draw=alias`.
    #[param(value_type = Option<String>, example = "standard")]
    profile: Option<ProfileText>,
    /// In place of a profile: the cheapest whose error is at most this, Lab.
    #[param(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[param(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
}

impl ProfileQuery {
    /// The profile for what is written of a thing: as it is asked for, or as `pick` finds it for a target. `whole` tells
    /// the request from all others.
    ///
    /// # Errors
    ///
    /// [`Problem`] for a profile that is none or does not fit the thing, a target that is none or stands beside knobs,
    /// and what the pick refuses.
    pub async fn profile_of(
        self,
        app: &App,
        thing: &Arc<Shelved>,
        whole: &impl Serialize,
        pick: impl FnOnce(&dyn Works, &Thing, &Target) -> Result<Picked, WorkshopError> + Send + 'static,
    ) -> Result<(Profile, Option<Picked>), Problem> {
        let target = targets::of_query(self.max_error, self.max_seconds, self.profile.is_some())?;
        let asked = self.profile.unwrap_or_default();
        asked.fits(thing)?;
        let profile = asked.of_query()?;
        if !target.is_some() {
            return Ok((profile, None));
        }
        let (works, of) = (Arc::clone(&app.works), Arc::clone(thing));
        let whole = (whole, target);
        let found = app.pick(&whole, move || {
            pick(&*works, &of.thing, &target).map_err(Problem::of_query)
        });
        let found = found.await?;
        Ok((*found.profile(), Some(found)))
    }
}
