//! Pictures: drawn once however many ask, and not to the end when nobody waits for them any more.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use bytes::Bytes;

use super::kept_file::KeptFile;
use super::workbench::call_off;
use super::works::{Lap, PictureFormat, Show, View};
use crate::blend::RealisationWeights;
use crate::service::app::App;
use crate::service::environments::Unread;
use crate::service::http::{Keep, Kind, Problem};
use crate::service::ids;
use crate::service::shelf::Shelved;
use crate::store::Hash;

/// A picture that was drawn, now or before.
#[derive(Debug)]
pub struct Drawn {
    /// The picture and what is told about it.
    pub kept: KeptFile,
    /// How long it may be kept.
    pub keep: Keep,
    /// How long each stage took, where it was drawn now.
    pub stages: Vec<Lap>,
    /// How long all of this took, waiting for a place included.
    pub time: Duration,
}

/// Key of a picture: everything that makes it. The paint is no part of angles.
#[must_use]
pub fn key(
    thing: &Shelved,
    weights: Option<&RealisationWeights>,
    view: &View,
    format: PictureFormat,
) -> Hash {
    match view.show {
        Show::Paint => ids::result("preview", &(&thing.id, thing.file, weights, view, format)),
        Show::Aspecular => ids::result("aspecular", &(view, format)),
    }
}

/// Draws a picture, or finds the one that was drawn before; who asks at the same time waits for the same.
///
/// # Errors
///
/// [`Problem`] for weights or a view that is refused, and when too many pictures wait.
pub async fn draw(
    app: &App,
    thing: Arc<Shelved>,
    weights: Option<RealisationWeights>,
    format: PictureFormat,
    view: View,
) -> Result<Drawn, Problem> {
    let (begun, keep) = (Instant::now(), thing.keep());
    let key = key(&thing, weights.as_ref(), &view, format);
    let _waits = app.watchers.watch(key);
    let took = Arc::new(OnceLock::new());
    let kept = loop {
        let told = Arc::clone(&took);
        let (on, thing, weights) = (app.clone(), Arc::clone(&thing), weights.clone());
        let view = view.clone();
        let compute = move || async move {
            let (works, counter) = (Arc::clone(&on.works), on.metrics.previews_rendered.clone());
            let bench = on.bench.clone();
            let app = on.clone();
            let progress = move |_: f32| {
                if app.has_given_up() || !app.watchers.any(key) {
                    call_off();
                }
            };
            let unread = on.unread(view.environment.as_deref()).await?;
            let drawn = bench.run_or_call_off(move || -> Result<Bytes, Problem> {
                // Who waited for a place may be gone by now.
                progress(0.0);
                let environment = unread.as_ref().map(Unread::read).transpose()?;
                let (thing, weights, light) =
                    (&thing.thing, weights.as_ref(), environment.as_deref());
                let drawn = works.preview(thing, weights, &view, light, format, &progress);
                let drawn = drawn.map_err(Problem::of_query)?;
                let kept = KeptFile::form(&drawn.accuracy, Some(&drawn.report), &drawn.bytes);
                let _ = told.set(drawn.stages);
                Ok(kept)
            });
            let Ok(drawn) = drawn.await? else {
                return Err(Problem::new(
                    Kind::JobCancelled,
                    "Nobody waited for this picture any more.",
                ));
            };
            let kept = drawn?;
            counter.increment(1);
            Ok(kept)
        };
        match app.results.get_or_compute(key, compute).await {
            // Whoever was before us gave up a moment ago.
            Err(problem) if problem.kind() == Kind::JobCancelled && !app.has_given_up() => {}
            Err(problem) if problem.kind() == Kind::JobCancelled => {
                return Err(Problem::overloaded());
            }
            kept => break kept?,
        }
    };
    Ok(Drawn {
        kept: KeptFile::of(&kept)?,
        keep,
        stages: took.get().cloned().unwrap_or_default(),
        time: begun.elapsed(),
    })
}
