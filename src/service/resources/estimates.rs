//! Estimates: what a request will take and how accurate it will be, before it is made.

use std::sync::Arc;

use axum::extract::State;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::accuracy::Profile;
use crate::blend::RealisationWeights;
use crate::paint::PaintFile;
use crate::service::app::App;
use crate::service::environments::Unread;
use crate::service::http::{Answer, Json, Keep, Kind, NoQuery, Problem, ProblemDocument, Problems};
use crate::service::parameters::view::{self, Names, Side};
use crate::service::parameters::{ProfileDocument, ProfileText, WeightQuery, targets};
use crate::service::shelf::Shelved;
use crate::service::work::{
    Asked, Estimate, Format, IngestOrder, Layout, PictureFormat, Shape, Show, View, WorkError,
};
use crate::store::LocalBlob;
use crate::workshop::Environment;

/// Work to estimate.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EstimateOrder {
    /// `ingest` (again, of a paint that was uploaded as a measurement), `blend`, `realise` or `preview`.
    work: WorkName,
    /// Id of the paint to ingest again, or to write or draw.
    paint: Option<String>,
    /// Id of the blend to write or draw.
    blend: Option<String>,
    /// Ids of the paints to blend.
    paints: Option<Vec<String>>,
    /// Weights of a blend, in the order of its paints; even unless given.
    weights: Option<Vec<f64>>,
    /// Weights of coat, diffuse, lobes and color table alone.
    base: Option<Vec<f64>>,
    /// Weights of the flakes' lightness, grain and lifetime alone.
    flake_lightness: Option<Vec<f64>>,
    /// Weights of the flakes' color alone.
    flake_color: Option<Vec<f64>>,
    /// Factor on the flakes' color.
    flake_saturation: Option<f64>,
    /// File to write, `zip` unless given.
    format: Option<Format>,
    /// What the paint is on, `sphere` unless given.
    scene: Option<Shape>,
    /// Pixels across and down of a picture, 512 each unless given.
    #[schema(value_type = Option<Vec<Side>>, min_items = 2, max_items = 2)]
    size: Option<[u32; 2]>,
    /// What a picture shows, `paint` unless given. `aspecular` takes neither `profile` nor `max_error` nor `max_seconds`.
    show: Option<Show>,
    /// Panorama that lights a picture, the id of an answer to `POST /v1/environments`; `studio`, the built-in one, unless
    /// given.
    #[schema(pattern = "^(studio|e_[0-9a-f]{32})$")]
    environment: Option<String>,
    /// Accuracy: the name of a preset, or an object of knobs.
    #[schema(value_type = Option<ProfileDocument>)]
    profile: Option<ProfileText>,
    /// In place of a profile: the cheapest whose error is at most this.
    #[schema(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[schema(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
}

/// Kinds of work.
#[derive(Clone, Copy, Debug, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WorkName {
    /// A measurement becomes a paint.
    Ingest,
    /// Paints become a blend.
    Blend,
    /// A paint or blend becomes a file.
    Realise,
    /// A paint or blend becomes a picture.
    Preview,
}

/// What a request will take.
#[derive(Debug, Serialize, ToSchema)]
pub struct EstimateDocument {
    /// Name of the profile.
    profile: &'static str,
    /// Its knobs.
    #[schema(value_type = Object)]
    knobs: Profile,
    /// Wall time on this machine as it is now, seconds.
    seconds: f64,
    /// The same by stage: `stage` and `seconds`.
    #[schema(value_type = Vec<Object>)]
    stages: Value,
    /// Size of the answer, or of what is kept of it.
    bytes: u64,
    /// How far the answer is from the reference profile's: `value` and its `unit`, Lab or CIEDE2000.
    #[schema(value_type = Object)]
    error: Value,
    /// Of a target, whether it is met; if not, the estimate is of the best that can be done.
    #[serde(skip_serializing_if = "Option::is_none")]
    met: Option<bool>,
}

/// What is needed to estimate.
enum Needed {
    Ingest(LocalBlob, Box<IngestOrder>),
    Blend(Vec<Arc<Shelved>>),
    Realise(Arc<Shelved>, Option<RealisationWeights>),
    Preview(Box<Picture>),
}

impl Needed {
    /// The paints or the blend whose clusters are as they are.
    fn things(&self) -> &[Arc<Shelved>] {
        match self {
            Self::Ingest(..) => &[],
            Self::Blend(paints) => paints,
            Self::Realise(of, _) => std::slice::from_ref(of),
            Self::Preview(picture) => std::slice::from_ref(&picture.of),
        }
    }
}

/// A picture to estimate.
struct Picture {
    of: Arc<Shelved>,
    weights: Option<RealisationWeights>,
    view: View,
    unread: Option<Unread>,
}

/// Estimate a request.
///
/// A small part of the work is done, here and now, and the rest is reckoned from it; nothing is kept. With `max_error`
/// or `max_seconds` the answer says which profile would be picked.
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
    let needed = order.needed(&app, &profile).await?;
    if let Some(asked) = &order.profile {
        for thing in needed.things() {
            asked.fits(thing).map_err(Problem::in_body)?;
        }
    }
    let works = Arc::clone(&app.works);
    // The caller knows the paint, neither the file its upload is kept in nor the options it came with.
    let kept_in = match &needed {
        Needed::Ingest(local, _) => Some(local.path().display().to_string()),
        _ => None,
    };
    let told = move |error: WorkError| {
        WorkError::of_body(match &kept_in {
            Some(file) => WorkError {
                field: Some("paint".to_owned()),
                ..error.without(file)
            },
            None => error,
        })
    };
    let estimated = app.bench.run(move || {
        let estimate = |asked: &Asked<'_>| {
            if target.is_some() {
                let picked = works.pick(asked, &target)?;
                Ok((picked.estimate, Some(picked.met)))
            } else {
                works.estimate(asked, &profile).map(|made| (made, None))
            }
        };
        let environment = match &needed {
            Needed::Preview(picture) => picture.unread.as_ref().map(Unread::read),
            _ => None,
        };
        let environment = environment.transpose().map_err(Problem::in_body)?;
        let done = order.with_asked(&needed, environment.as_deref(), estimate);
        done.map_err(told)
    });
    let (estimate, met) = estimated.await??;
    Ok(Answer::json(
        &EstimateDocument::of(&estimate, met),
        Keep::Never,
    ))
}

impl EstimateDocument {
    fn of(estimate: &Estimate, met: Option<bool>) -> Self {
        Self {
            profile: estimate.profile,
            knobs: estimate.knobs,
            seconds: estimate.seconds,
            stages: serde_json::to_value(&estimate.stages).unwrap_or_default(),
            bytes: estimate.bytes,
            error: serde_json::to_value(estimate.error).unwrap_or_default(),
            met,
        }
    }
}

impl EstimateOrder {
    /// A field that the work does not have would be an answer to another question.
    fn refuse_beside_the_point(&self) -> Result<(), Problem> {
        let given = [
            ("paint", self.paint.is_some()),
            ("blend", self.blend.is_some()),
            ("paints", self.paints.is_some()),
            ("weights", self.weights.is_some()),
            ("base", self.base.is_some()),
            ("flake_lightness", self.flake_lightness.is_some()),
            ("flake_color", self.flake_color.is_some()),
            ("flake_saturation", self.flake_saturation.is_some()),
            ("format", self.format.is_some()),
            ("scene", self.scene.is_some()),
            ("size", self.size.is_some()),
            ("show", self.show.is_some()),
            ("environment", self.environment.is_some()),
        ];
        let of_blend: &[&str] = &[
            "blend",
            "weights",
            "base",
            "flake_lightness",
            "flake_color",
            "flake_saturation",
        ];
        let (work, own): (_, &[&str]) = match self.work {
            WorkName::Ingest => ("ingest", &["paint"]),
            WorkName::Blend => ("blend", &["paints"]),
            WorkName::Realise => ("realise", &["paint", "format"]),
            WorkName::Preview => (
                "preview",
                &["paint", "scene", "size", "show", "environment"],
            ),
        };
        let weighs = matches!(self.work, WorkName::Realise | WorkName::Preview);
        let (work, taken) = match &self.blend {
            Some(_) if weighs => (work.to_owned(), [own, of_blend].concat()),
            None if weighs => (format!("{work}, of a paint,"), own.to_vec()),
            _ => (work.to_owned(), own.to_vec()),
        };
        match given.iter().find(|(name, is)| *is && !taken.contains(name)) {
            Some((name, _)) => Err(Problem::value(
                format!("/{name}"),
                format!("The work {work} takes no {name}."),
            )
            .accepting(taken.join(", "))),
            None => Ok(()),
        }
    }

    /// What a picture of it shows, by the checks of a picture.
    async fn view(&self, app: &App, profile: &Profile) -> Result<View, Problem> {
        let show = self.show.unwrap_or_default();
        let sampled = [
            ("profile", self.profile.is_some()),
            ("max_error", self.max_error.is_some()),
            ("max_seconds", self.max_seconds.is_some()),
        ];
        view::refuse_samples_of_angles(show, &sampled, &Names::BODY)?;
        let environment = view::environment(app, self.environment.as_deref(), &Names::BODY);
        let asked = View {
            show,
            scene: self.scene.unwrap_or_default(),
            size: self.size.unwrap_or([512; 2]),
            samples_per_pixel: view::samples(show, None, profile),
            environment: environment.await?,
            lights: None,
        };
        view::view(app, asked, &Names::BODY)
    }

    async fn needed(&self, app: &App, profile: &Profile) -> Result<Needed, Problem> {
        match self.work {
            WorkName::Ingest => {
                let id = self.paint.as_deref();
                let id = id.ok_or_else(|| missing("paint").accepting("the id of a paint"))?;
                let paint = of_field(app.paint(id).await, "/paint")?;
                let none = || {
                    Problem::new(
                        Kind::NoMeasurement,
                        "This paint was not uploaded as a measurement.",
                    )
                };
                let upload = paint.measurement.ok_or_else(none)?;
                let local = app.blobs.local(upload).await?;
                let gone = || Problem::internal(format!("upload {upload} is not there"));
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
                Ok(Needed::Ingest(local.ok_or_else(gone)?, Box::new(order)))
            }
            WorkName::Blend => {
                let most = app.config.limits.paints;
                let accepted = format!("2 to {most} ids of paints");
                let ids = self.paints.as_deref();
                let ids = ids.ok_or_else(|| missing("paints").accepting(&accepted))?;
                if !(2..=most).contains(&ids.len()) {
                    let detail = format!("{} paints are to be blended.", ids.len());
                    return Err(Problem::value("/paints", detail).accepting(accepted));
                }
                let mut paints = Vec::with_capacity(ids.len());
                for (place, id) in ids.iter().enumerate() {
                    let pointer = format!("/paints/{place}");
                    paints.push(of_field(app.paint(id).await, &pointer)?);
                }
                Ok(Needed::Blend(paints))
            }
            WorkName::Realise => {
                let (of, weights) = self.thing(app).await?;
                Ok(Needed::Realise(of, weights))
            }
            WorkName::Preview => {
                let view = self.view(app, profile).await?;
                let (of, weights) = self.thing(app).await?;
                let unread = app.unread(view.environment.as_deref()).await;
                Ok(Needed::Preview(Box::new(Picture {
                    of,
                    weights,
                    view,
                    unread: unread.map_err(Problem::in_body)?,
                })))
            }
        }
    }

    async fn thing(
        &self,
        app: &App,
    ) -> Result<(Arc<Shelved>, Option<RealisationWeights>), Problem> {
        match (&self.paint, &self.blend) {
            (Some(id), None) => {
                if self.weights.is_some() {
                    let problem = Problem::value("/weights", "One paint takes no weights.");
                    return Err(problem.accepting("nothing"));
                }
                let paint = of_field(app.paint(id).await, "/paint")?;
                Ok((paint, None))
            }
            (None, Some(id)) => {
                let blend = of_field(app.blend(id).await, "/blend")?;
                let weights = self.weights_for(&blend.names)?;
                Ok((blend, Some(weights)))
            }
            _ => Err(missing("paint").accepting("either paint or blend")),
        }
    }

    fn weights_for(&self, names: &[String]) -> Result<RealisationWeights, Problem> {
        let even = || vec![1.0 / names.len() as f64; names.len()];
        let asked = WeightQuery::of_lists(
            Some(self.weights.clone().unwrap_or_else(even)),
            self.base.clone(),
            self.flake_lightness.clone(),
            self.flake_color.clone(),
            self.flake_saturation,
        );
        asked.for_blend(names).map_err(Problem::in_body)
    }

    fn with_asked<T>(
        &self,
        needed: &Needed,
        environment: Option<&Environment>,
        then: impl FnOnce(&Asked<'_>) -> T,
    ) -> T {
        match needed {
            Needed::Ingest(local, order) => then(&Asked::Ingest {
                upload: local.path(),
                order,
            }),
            Needed::Blend(shelved) => {
                let paints: Vec<&PaintFile> =
                    shelved.iter().filter_map(|p| p.file_of_paint()).collect();
                then(&Asked::Blend { paints: &paints })
            }
            Needed::Realise(shelved, weights) => then(&Asked::Realise {
                thing: &shelved.thing,
                weights: weights.as_ref(),
                format: self.format.unwrap_or(Format::Zip),
            }),
            Needed::Preview(picture) => then(&Asked::Preview {
                thing: &picture.of.thing,
                weights: picture.weights.as_ref(),
                view: &picture.view,
                environment,
                format: PictureFormat::Png,
            }),
        }
    }
}

fn missing(field: &str) -> Problem {
    Problem::value(format!("/{field}"), format!("{field} is missing."))
}

/// A paint or blend that is named in a body: when there is none, the body is wrong.
fn of_field(found: Result<Arc<Shelved>, Problem>, pointer: &str) -> Result<Arc<Shelved>, Problem> {
    found.map_err(|problem| match problem.kind() {
        Kind::UnknownPaint | Kind::UnknownBlend => {
            Problem::value(pointer.to_owned(), "There is none of this id.")
                .accepting("an id that was answered before")
        }
        _ => problem,
    })
}
