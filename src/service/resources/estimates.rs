//! Estimates: what a request will take and how accurate it will be, before it is made.

mod order;

use std::sync::Arc;

use axum::extract::{Request, State};
use serde::Serialize;
use utoipa::ToSchema;

pub use self::order::EstimateOrder;
use self::order::WorkName;
use super::uploads::{self, IngestQuery};
use super::{blend_bundles, blends, realisations};
use crate::accuracy::Profile;
use crate::blend::RealisationWeights;
use crate::paint::PaintFile;
use crate::service::app::App;
use crate::service::environments::Unread;
use crate::service::http::{
    Answer, Json, Keep, Kind, NoQuery, Problem, ProblemDocument, Problems, Query,
};
use crate::service::parameters::{of_field, targets, view};
use crate::service::shelf::Shelved;
use crate::service::work::{
    Asked, Estimate, Format, IngestOrder, Layout, Picked, PictureFormat, Target, View,
    WorkshopError, drawing, runner,
};
use crate::store::{Hash, LocalBlob};
use crate::workshop::{Environment, EstimatedError, Stage, receive_stage};

/// What a request will take.
#[derive(Debug, Serialize, ToSchema)]
pub struct EstimateDocument {
    /// Name of the profile.
    profile: &'static str,
    /// Its knobs.
    #[schema(value_type = Object)]
    knobs: Profile,
    /// Wall time on this machine, seconds, under its load of now.
    seconds: f64,
    /// The same by stage.
    stages: Vec<Stage>,
    /// Of a blend, file or picture, whether it is kept already, as far as can be told without reading it: who asks for it
    /// then waits for none of the work, whose `seconds` are told all the same. What makes a blend may be kept where the
    /// blend itself is not.
    #[serde(skip_serializing_if = "Option::is_none")]
    kept: Option<bool>,
    /// Size of the answer, or of what is kept of it.
    bytes: u64,
    /// How far the answer is from the reference profile's.
    error: EstimatedError,
    /// Of a target, whether it is met; if not, the estimate is of the best that can be done.
    #[serde(skip_serializing_if = "Option::is_none")]
    met: Option<bool>,
    /// Of a target, seconds that looking for a profile took: they are part of `max_seconds`.
    #[serde(skip_serializing_if = "Option::is_none")]
    searched: Option<f64>,
}

/// What is needed to estimate.
enum Needed {
    Ingest(LocalBlob, Box<IngestOrder>),
    Blend(Vec<Arc<Shelved>>),
    Realise(Arc<Shelved>, Option<RealisationWeights>, Format),
    Bundle(Arc<Shelved>),
    Preview(Box<Picture>),
}

/// A picture to estimate.
struct Picture {
    of: Arc<Shelved>,
    weights: Option<RealisationWeights>,
    view: View,
    format: PictureFormat,
    unread: Option<Unread>,
}

/// Estimate a request.
///
/// A small part of the work is done, here and now, and the rest is reckoned from it; writing, hashing and fits are reckoned
/// by what this machine took a moment ago, or in the study in its data folder. Nothing is kept of
/// it; `kept` says whether the work was done before. With `max_error` or `max_seconds` the answer says which profile would be
/// picked.
#[utoipa::path(
    post, operation_id = "create_estimate", path = "/v1/estimates", tag = "accuracy",
    request_body = EstimateOrder,
    responses(
        (status = 200, description = "Seconds, bytes and error", body = EstimateDocument),
        (status = 422, description = "Work that would be refused", body = ProblemDocument, content_type = "application/problem+json"),
        Problems,
    )
)]
pub async fn create(
    State(app): State<App>,
    _: NoQuery,
    Json(order): Json<EstimateOrder>,
) -> Result<Answer, Problem> {
    let target = targets::of_body(order.max_error, order.max_seconds, order.profile.is_some())?;
    let profile = order.profile.clone().unwrap_or_default().of_body()?;
    order.refuse_beside_the_point()?;
    let needed = Needed::of(&order, &app, &profile).await?;
    if let Some(asked) = &order.profile {
        for thing in needed.things() {
            match needed {
                // A blend may leave out angles of its paints.
                Needed::Blend(_) => asked.clusters_fit_in_body(thing)?,
                _ => asked.fits_in_body(thing)?,
            }
        }
    }
    let works = Arc::clone(&app.works);
    // The caller knows the paint, neither the file its upload is kept in nor the options it came with.
    let kept_in = match &needed {
        Needed::Ingest(local, _) => Some(local.path().display().to_string()),
        _ => None,
    };
    let told = move |error: WorkshopError| {
        Problem::of_body(match &kept_in {
            Some(file) => WorkshopError {
                field: Some("paint".to_owned()),
                ..error.without(file)
            },
            None => error,
        })
    };
    let needed = Arc::new(needed);
    let on = Arc::clone(&needed);
    let estimated = app.bench.run(move || {
        let environment = on.environment().map_err(Problem::in_body)?;
        let estimate = |asked: &Asked<'_>| {
            if target.is_some() {
                let picked = works.pick(asked, &target)?;
                Ok(EstimateDocument::of_picked(&picked))
            } else {
                let estimate = works.estimate(asked, &profile)?;
                Ok(EstimateDocument::of(&estimate, None))
            }
        };
        let done = on.with_asked(environment.as_deref(), estimate);
        done.map_err(told)
    });
    let estimated = estimated.await??;
    let kept = needed.is_kept(&app, &estimated.knobs).await?;
    Ok(Answer::json(
        &EstimateDocument { kept, ..estimated },
        Keep::Never,
    ))
}

/// Estimate the ingest of a new measurement.
///
/// The body and the parameters are those of an upload to `/v1/paints`: the file itself. A few of its angles are fitted, here
/// and now, and the rest is reckoned from them. Nothing is kept. With `max_error` or `max_seconds` the answer says which
/// profile would be picked.
#[utoipa::path(
    post, operation_id = "estimate_upload", path = "/v1/estimates/ingest", tag = "accuracy", params(IngestQuery),
    request_body(content = Vec<u8>, content_type = "application/octet-stream", description = "The measurement"),
    responses(
        (status = 200, description = "Seconds, bytes and error", body = EstimateDocument),
        (status = 413, description = "The measurement is too large", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "The body is no measurement, or a damaged one", body = ProblemDocument, content_type = "application/problem+json"),
        Problems,
    )
)]
pub async fn of_upload(
    State(app): State<App>,
    query: Result<Query<IngestQuery>, Problem>,
    request: Request,
) -> Result<Answer, Problem> {
    let asked = query.and_then(|Query(query)| query.order());
    let ((order, target), received) = uploads::take_in(&app, asked, request).await?;
    let on = app.clone();
    let uploaded = runner::to_its_end(async move { on.uploaded(received).await }).await?;
    let estimated = estimate_upload(&app, uploaded.blob(), order, target).await;
    if let Err(problem) = uploaded.forget().await {
        tracing::error!(
            ?problem,
            "a measurement that was estimated stays until the next start"
        );
    }
    Ok(Answer::json(&estimated?, Keep::Never))
}

async fn estimate_upload(
    app: &App,
    upload: Hash,
    order: IngestOrder,
    target: Target,
) -> Result<EstimateDocument, Problem> {
    let (local, works) = (app.upload_at_hand(upload).await?, Arc::clone(&app.works));
    let file = tokio::fs::metadata(local.path()).await;
    let bytes = file.map_err(Problem::internal)?.len();
    #[allow(clippy::cast_precision_loss)] // a size
    let receive = move || receive_stage(bytes as f64);
    if target.is_some() {
        let picked = uploads::pick_for_upload(app, upload, &order, target).await?;
        let receive = tokio::task::spawn_blocking(receive).await;
        let picked = picked.after(receive.map_err(Problem::internal)?);
        return Ok(EstimateDocument::of_picked(&picked));
    }
    let estimated = app.bench.run(move || {
        let asked = Asked::Ingest {
            upload: local.path(),
            order: &order,
        };
        let file = local.path().display().to_string();
        let estimate = works.estimate(&asked, &order.profile);
        let estimate = estimate.map_err(|error| Problem::of_upload(error.without(&file)))?;
        Ok::<_, Problem>(estimate.after(vec![receive()]))
    });
    Ok(EstimateDocument::of(&estimated.await??, None))
}

impl EstimateDocument {
    fn of_picked(picked: &Picked) -> Self {
        Self::of(&picked.estimate, Some((picked.met, picked.searched)))
    }

    fn of(estimate: &Estimate, picked: Option<(bool, f64)>) -> Self {
        Self {
            profile: estimate.profile,
            knobs: estimate.knobs,
            seconds: estimate.seconds,
            stages: estimate.stages.clone(),
            kept: None,
            bytes: estimate.bytes,
            error: estimate.error,
            met: picked.map(|(met, _)| met),
            searched: picked.map(|(_, seconds)| seconds),
        }
    }
}

impl Needed {
    /// Finds what an order names.
    async fn of(order: &EstimateOrder, app: &App, profile: &Profile) -> Result<Self, Problem> {
        match order.work {
            WorkName::Ingest => {
                let id = order.paint.as_deref();
                let id = id.ok_or_else(|| missing("paint").accepting("the id of a paint"))?;
                again(app, id, profile).await
            }
            WorkName::Blend => {
                let most = app.config.limits.paints;
                let accepted = format!("2 to {most} ids of paints");
                let ids = order.paints.as_deref();
                let ids = ids.ok_or_else(|| missing("paints").accepting(&accepted))?;
                if !(2..=most).contains(&ids.len()) {
                    let detail = format!("{} paints are to be blended.", ids.len());
                    return Err(Problem::value("/paints", detail).accepting(accepted));
                }
                let mut paints = Vec::with_capacity(ids.len());
                for (place, id) in ids.iter().enumerate() {
                    let field = format!("paints/{place}");
                    let paint = app.paint(id).await;
                    paints.push(paint.map_err(|problem| of_field(&field, problem))?);
                }
                Ok(Self::Blend(paints))
            }
            WorkName::Realise => {
                let (of, weights) = order.named().find(app).await?;
                let format = order.file()?;
                Ok(Self::Realise(of, weights, format))
            }
            WorkName::Bundle => {
                let id = order.blend.as_deref();
                let id = id.ok_or_else(|| missing("blend").accepting("the id of a blend"))?;
                let blend = app.blend(id).await;
                let blend = blend.map_err(|problem| of_field("blend", problem))?;
                Ok(Self::Bundle(blend))
            }
            WorkName::Preview => {
                let format = order.picture()?;
                let view = order.view(app, profile).await?;
                let (of, weights) = order.named().find(app).await?;
                let unread = app.unread(view.environment.as_deref()).await;
                Ok(Self::Preview(Box::new(Picture {
                    of,
                    weights,
                    view,
                    format,
                    unread: unread.map_err(Problem::in_body)?,
                })))
            }
        }
    }

    /// The paints or the blend whose clusters are as they are.
    fn things(&self) -> &[Arc<Shelved>] {
        match self {
            Self::Ingest(..) => &[],
            Self::Blend(paints) => paints,
            Self::Realise(of, ..) | Self::Bundle(of) => std::slice::from_ref(of),
            Self::Preview(picture) => std::slice::from_ref(&picture.of),
        }
    }

    /// Whether the result with a profile is kept already; an ingest is once more by its very nature.
    async fn is_kept(&self, app: &App, profile: &Profile) -> Result<Option<bool>, Problem> {
        let key = match self {
            Self::Ingest(..) => return Ok(None),
            Self::Blend(paints) => {
                let ids: Vec<&str> = paints.iter().map(|paint| paint.id.as_str()).collect();
                let blend = app.catalogue.blend(&blends::id_of(&ids, profile)).await?;
                return Ok(Some(blend.is_some()));
            }
            Self::Realise(of, weights, format) => {
                realisations::key(of, weights.as_ref(), *format, profile)
            }
            Self::Bundle(blend) => blend_bundles::key(blend, profile),
            Self::Preview(picture) => {
                let view = View {
                    samples_per_pixel: view::samples(picture.view.show, None, profile),
                    ..picture.view.clone()
                };
                let weights = picture.weights.as_ref();
                drawing::key(&picture.of, weights, &view, picture.format)
            }
        };
        Ok(Some(app.results.holds(key).await))
    }

    /// The light of a picture, where that is not the built-in studio.
    fn environment(&self) -> Result<Option<Arc<Environment>>, Problem> {
        match self {
            Self::Preview(picture) => picture.unread.as_ref().map(Unread::read).transpose(),
            _ => Ok(None),
        }
    }

    fn with_asked<T>(
        &self,
        environment: Option<&Environment>,
        then: impl FnOnce(&Asked<'_>) -> T,
    ) -> T {
        match self {
            Self::Ingest(local, order) => then(&Asked::Ingest {
                upload: local.path(),
                order,
            }),
            Self::Blend(shelved) => {
                let paints: Vec<&PaintFile> =
                    shelved.iter().filter_map(|p| p.file_of_paint()).collect();
                then(&Asked::Blend { paints: &paints })
            }
            Self::Realise(shelved, weights, format) => then(&Asked::Realise {
                thing: &shelved.thing,
                weights: weights.as_ref(),
                format: *format,
            }),
            Self::Bundle(shelved) => then(&Asked::Bundle {
                thing: &shelved.thing,
            }),
            Self::Preview(picture) => then(&Asked::Preview {
                thing: &picture.of.thing,
                weights: picture.weights.as_ref(),
                view: &picture.view,
                environment,
                format: picture.format,
            }),
        }
    }
}

/// The ingest of a paint's measurement once more.
async fn again(app: &App, id: &str, profile: &Profile) -> Result<Needed, Problem> {
    let paint = app.paint(id).await;
    let paint = paint.map_err(|problem| of_field("paint", problem))?;
    let none = || {
        Problem::new(
            Kind::NoMeasurement,
            "This paint was not uploaded as a measurement.",
        )
    };
    let upload = paint.measurement.ok_or_else(none)?;
    let local = app.upload_at_hand(upload).await?;
    let layout = paint
        .file_of_paint()
        .and_then(|file| Layout::by_name(&file.provenance.source));
    // Of several paints in one document the name took this one.
    let order = IngestOrder {
        name: paint.names.first().cloned(),
        layout,
        profile: *profile,
        ..IngestOrder::default()
    };
    Ok(Needed::Ingest(local, Box::new(order)))
}

fn missing(field: &str) -> Problem {
    Problem::value(format!("/{field}"), format!("{field} is missing."))
}
