//! The job that finds the correspondence of paints.

use std::sync::Arc;

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use super::runner::Ended;
use super::under_way::UnderWay;
use super::workbench::CalledOff;
use super::works::WorkshopError;
use crate::accuracy::Profile;
use crate::paint::PaintFile;
use crate::service::app::App;
use crate::service::http::{Kind, Problem};
use crate::service::ids;
use crate::service::shelf::Shelved;

/// What a job needs to make a blend.
#[derive(Debug, Serialize, Deserialize)]
pub struct BlendRequest {
    /// Ids of the paints, in the order of weights.
    pub paints: Vec<String>,
    /// How accurate.
    pub profile: Profile,
}

/// What else than its paints was asked of a blend, kept with its record.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BlendOptions {
    /// How accurate.
    pub profile: Profile,
    /// Place, in the stored blend, of the paint asked for first, second, …
    pub places: Vec<usize>,
}

/// The job: finds the correspondence and keeps the blend.
pub async fn blend(app: &App, under_way: &Arc<UnderWay>) -> Result<Ended, Problem> {
    let id = &under_way.job().subject;
    let Ok(there) = under_way.insist(app, || app.catalogue.blend(id)).await? else {
        return Ok(Err(CalledOff));
    };
    if there.is_some() {
        return Ok(Ok(()));
    }
    let BlendRequest { paints, profile } = under_way.request()?;
    under_way.stage("reading");
    let mut shelved = Vec::with_capacity(paints.len());
    for paint in &paints {
        shelved.push(app.paint(paint).await?);
    }
    under_way.ended("read");
    let (canonical, places) = in_order_of_hashes(&shelved);
    let names: Vec<&str> = canonical.iter().map(|paint| paint.id.as_str()).collect();
    let key = ids::key("blend", &(&names, profile.flakes, profile.blend));
    // Whichever order is asked for first finds the correspondence, the others wait for it.
    let file = loop {
        let (on, this, paints) = (app.clone(), Arc::clone(under_way), canonical.clone());
        let compute = move || async move { correspond(&on, &this, paints, profile).await };
        // Whoever finds it, this job can be called off on its own.
        let found = tokio::select! {
            found = app.results.get_or_compute(key, compute) => found,
            () = under_way.called_off() => return Ok(Err(CalledOff)),
            () = app.stopped() => return Ok(Err(CalledOff)),
        };
        match found {
            Ok(found) => break found.bytes,
            Err(problem) if problem.kind() != Kind::JobCancelled => return Err(problem),
            Err(_) if under_way.is_cancelled() || app.is_stopping() => return Ok(Err(CalledOff)),
            // Another job was at it and was cancelled: this one takes over.
            Err(_) => {}
        }
    };
    under_way.ended("blend");
    under_way.stage("storing");
    let options =
        serde_json::to_string(&BlendOptions { profile, places }).map_err(Problem::internal)?;
    let keep = || app.keep_blend(id, &paints, &options, file.clone());
    let kept = under_way.insist(app, keep).await?;
    if kept.is_ok() {
        under_way.ended("store");
    }
    Ok(kept)
}

async fn correspond(
    app: &App,
    under_way: &Arc<UnderWay>,
    paints: Vec<Arc<Shelved>>,
    profile: Profile,
) -> Result<Bytes, Problem> {
    let works = Arc::clone(&app.works);
    let found = under_way.compute(app, "blending", move |progress| {
        let files: Vec<&PaintFile> = paints
            .iter()
            .filter_map(|paint| paint.file_of_paint())
            .collect();
        let blend = works.blend(&files, &profile, progress)?;
        Ok::<_, WorkshopError>(Bytes::from(blend.to_bytes()?))
    });
    let Ok(found) = found.await? else {
        return Err(Problem::new(
            Kind::JobCancelled,
            "The job that found this correspondence was cancelled.",
        ));
    };
    let file = found.map_err(Problem::of_body)?;
    app.metrics.blends_computed.increment(1);
    Ok(file)
}

/// Paints in the order of their physical content, and where in it the paint asked for first, second, … is.
fn in_order_of_hashes(asked: &[Arc<Shelved>]) -> (Vec<Arc<Shelved>>, Vec<usize>) {
    let key = |paint: &Arc<Shelved>| (paint.content, paint.id.clone());
    let keys: Vec<_> = asked.iter().map(key).collect();
    let mut order: Vec<usize> = (0..asked.len()).collect();
    order.sort_by(|&x, &y| keys[x].cmp(&keys[y]));
    let mut places = vec![0; asked.len()];
    for (place, &k) in order.iter().enumerate() {
        places[k] = place;
    }
    (
        order.iter().map(|&k| Arc::clone(&asked[k])).collect(),
        places,
    )
}
