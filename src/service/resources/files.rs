//! Files that are made for a request: once, however many ask, with what is told about them in headers.

use std::sync::{Arc, OnceLock};
use std::time::Instant;

use metrics::Counter;

use crate::service::app::App;
use crate::service::http::{Answer, Keep, Problem};
use crate::service::work::{KeptFile, MadeFile, Picked, Works, WorkshopError};
use crate::store::Hash;

/// A file to answer with.
pub struct FileAnswer<'a> {
    /// Key of everything that makes it.
    pub key: Hash,
    /// Its media type.
    pub media_type: &'static str,
    /// Name under which it is saved.
    pub name: String,
    /// How long it may be kept.
    pub keep: Keep,
    /// Of a target: what was picked.
    pub picked: Option<&'a Picked>,
    /// What making it is called.
    pub stage: &'static str,
    /// Counts those that were made.
    pub counter: Counter,
}

impl FileAnswer<'_> {
    /// Makes the file, or finds the one that was made before.
    ///
    /// # Errors
    ///
    /// [`Problem`] of the work, and when too many wait to compute.
    pub async fn make(
        self,
        app: &App,
        work: impl FnOnce(&dyn Works) -> Result<MadeFile, WorkshopError> + Send + 'static,
    ) -> Result<Answer, Problem> {
        let begun = Instant::now();
        let took = Arc::new(OnceLock::new());
        let (on, told, counter) = (app.clone(), Arc::clone(&took), self.counter);
        let compute = move || async move {
            let works = Arc::clone(&on.works);
            let make = move || -> Result<_, WorkshopError> {
                let made = work(&*works)?;
                let _ = told.set(made.stages);
                // What there is to report of a file is in it.
                Ok(KeptFile::form(&made.accuracy, None, &made.bytes))
            };
            let kept = on.bench.run(make).await?.map_err(Problem::of_query)?;
            counter.increment(1);
            Ok(kept)
        };
        let kept = KeptFile::of(&app.results.get_or_compute(self.key, compute).await?)?;
        // What a target picks may change with the machine's load.
        let keep = if self.picked.is_some() {
            self.keep.revalidated()
        } else {
            self.keep
        };
        Ok(Answer::result(self.media_type, kept.file, keep)
            .saved_as(&self.name)
            .accuracy(&kept.accuracy)
            .picked(self.picked)
            .stages(took.get().map_or(&[], Vec::as_slice))
            .stage(self.stage, begun.elapsed()))
    }
}
