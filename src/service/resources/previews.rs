//! Previews: pictures of a paint, or of a blend at some weights.

use std::sync::Arc;

use axum::extract::{RawQuery, State};
use axum::http::header;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::blend::RealisationWeights;
use crate::service::app::App;
use crate::service::http::{
    Address, Answer, BlendProblems, Idempotency, Json, NoQuery, PaintProblems, Problem,
    ProblemDocument, Problems, Query, QueryOfTwo,
};
use crate::service::ids;
use crate::service::parameters::view::{self, Side, ViewQuery};
use crate::service::parameters::{Named, ProfileDocument, ProfileText, WeightQuery, targets};
use crate::service::shelf::Shelved;
use crate::service::work::drawing::{self, Drawn};
use crate::service::work::{Light, Picked, PictureFormat, Shape, Show, View};

/// What is sent of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PreviewFormat {
    /// Tone mapped for a screen, 8 bits.
    Png,
    /// Linear light; of angles one channel of degrees, `aspecular_deg`, -1 beside the object.
    Exr,
    /// The report on the picture: what was drawn and what left out and why, what had to be clamped, how accurate it is.
    Json,
}

impl PreviewFormat {
    /// The picture that is drawn for it.
    const fn drawn(self) -> PictureFormat {
        match self {
            Self::Png | Self::Json => PictureFormat::Png,
            Self::Exr => PictureFormat::Exr,
        }
    }
}

/// A picture of a blend at some weights.
///
/// `json` is the report on the picture: effects that were planned or left out, what was clamped, how accurate it is:
/// `picture_error` is how far off it is, CIEDE2000 in the mean, by its samples' chance and by its paint; `error` that of
/// the flakes; `rendering.sampling` the chance by percentiles and in FLIP.
#[utoipa::path(
    get, operation_id = "preview_blend", path = "/v1/blends/{id}/preview.{format}", tag = "previews",
    params(("id" = String, Path, description = "Blend"), ("format" = PreviewFormat, Path, description = "Picture, or its report"), WeightQuery, ViewQuery),
    responses(
        (status = 200, description = "The picture", headers(
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"),
            ("Carpaint-Accuracy" = String, description = "Error of the picture, CIEDE2000 in the mean, where the paint's own is known; standard error by sampling, mean and 95th percentile over pixels; FLIP between two drawings, usually above that of one; error of the flakes, Lab"),
            ("Link" = String, description = "The picture's report")), content((Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"), (serde_json::Value = "application/json"))),
        (status = 400, description = "Weights that do not fit the blend, or a view that is not offered", body = ProblemDocument, content_type = "application/problem+json"),
        BlendProblems,
    )
)]
pub async fn of_blend(
    State(app): State<App>,
    Address((id, format)): Address<(String, PreviewFormat)>,
    QueryOfTwo(weights, query): QueryOfTwo<WeightQuery, ViewQuery>,
    RawQuery(raw): RawQuery,
) -> Result<Answer, Problem> {
    let blend = app.blend(&id).await?;
    let weights = weights.for_blend(&blend.names)?;
    let report = report_link(&format!("/v1/blends/{id}"), raw.as_deref());
    let answer = drawn(&app, blend, Some(weights), &query, format).await?;
    Ok(answer.header(header::LINK, &report))
}

/// A picture of a paint.
///
/// `json` is the report on the picture: effects that were planned or left out, how accurate it is:
/// `picture_error` is how far off it is, CIEDE2000 in the mean, by its samples' chance and by its paint; `error` that of
/// the flakes; `rendering.sampling` the chance by percentiles and in FLIP.
#[utoipa::path(
    get, operation_id = "preview_paint", path = "/v1/paints/{id}/preview.{format}", tag = "previews",
    params(("id" = String, Path, description = "Paint"), ("format" = PreviewFormat, Path, description = "Picture, or its report"), ViewQuery),
    responses(
        (status = 200, description = "The picture", headers(
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"),
            ("Carpaint-Accuracy" = String, description = "Error of the picture, CIEDE2000 in the mean, where the paint's own is known; standard error by sampling, mean and 95th percentile over pixels; FLIP between two drawings, usually above that of one; error of the flakes, Lab"),
            ("Link" = String, description = "The picture's report")), content((Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"), (serde_json::Value = "application/json"))),
        PaintProblems,
    )
)]
pub async fn of_paint(
    State(app): State<App>,
    Address((id, format)): Address<(String, PreviewFormat)>,
    Query(query): Query<ViewQuery>,
    RawQuery(raw): RawQuery,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    let report = report_link(&format!("/v1/paints/{id}"), raw.as_deref());
    let answer = drawn(&app, paint, None, &query, format).await?;
    Ok(answer.header(header::LINK, &report))
}

async fn drawn(
    app: &App,
    thing: Arc<Shelved>,
    weights: Option<RealisationWeights>,
    query: &ViewQuery,
    format: PreviewFormat,
) -> Result<Answer, Problem> {
    let view = query.picked_view(app, &thing, weights.as_ref(), format.drawn());
    let (view, picked) = view.await?;
    let drawn = drawing::draw(app, thing, weights, format.drawn(), view).await?;
    Ok(answer(drawn, format, picked.as_ref()))
}

/// A whole scene.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PreviewOrder {
    /// Id of a paint. Either this or `blend`.
    paint: Option<String>,
    /// Id of a blend, with weights.
    blend: Option<String>,
    /// One weight per paint of the blend.
    weights: Option<Vec<f64>>,
    /// Weights of coat, diffuse, lobes and color table alone.
    base: Option<Vec<f64>>,
    /// Weights of the flakes' lightness, grain and lifetime alone.
    flake_lightness: Option<Vec<f64>>,
    /// Weights of the flakes' color alone.
    flake_color: Option<Vec<f64>>,
    /// Factor on the flakes' color: 0 makes them white, 1 leaves them.
    flake_saturation: Option<f64>,
    /// What the paint is on, `sphere` unless given.
    scene: Option<Shape>,
    /// What is shown on it, `paint` unless given. `aspecular` is the same for every paint and weights, and takes neither
    /// `samples_per_pixel`, `profile`, `max_error` nor `max_seconds`.
    show: Option<Show>,
    /// Width and height in pixels, 512 and 512 unless given.
    #[schema(value_type = Option<Vec<Side>>, min_items = 2, max_items = 2)]
    size: Option<[u32; 2]>,
    /// Samples per pixel, in place of the preset's; refused beside another number in the profile.
    #[schema(minimum = 1, maximum = 4096)]
    samples_per_pixel: Option<u32>,
    /// Panorama that lights it and stands behind it, the id of an answer to `POST /v1/environments`; `studio`, the built-in
    /// one, unless given. A panorama is all the light there is unless `lights` are given.
    #[schema(pattern = "^(studio|e_[0-9a-f]{32})$")]
    environment: Option<String>,
    /// Lights in place of the scene's usual one; none leaves the surroundings alone.
    #[schema(max_items = 16)]
    lights: Option<Vec<Light>>,
    /// Accuracy: the name of a preset, or an object of knobs.
    #[schema(value_type = Option<ProfileDocument>)]
    profile: Option<ProfileText>,
    /// In place of a profile: the cheapest whose picture is at most so far off, CIEDE2000 in the mean: what samples leave to
    /// chance, and the paint's own error.
    #[schema(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[schema(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
    /// What is sent, `png` unless given.
    format: Option<PreviewFormat>,
}

/// A picture of a whole scene.
#[utoipa::path(
    post, operation_id = "create_preview", path = "/v1/previews", tag = "previews", request_body = PreviewOrder,
    params(("Idempotency-Key" = Option<String>, Header, description = "Refuses this key with another request")),
    responses(
        (status = 200, description = "The picture", headers(
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"),
            ("Carpaint-Accuracy" = String, description = "Error of the picture, CIEDE2000 in the mean, where the paint's own is known; standard error by sampling, mean and 95th percentile over pixels; FLIP between two drawings, usually above that of one; error of the flakes, Lab")),
            content((Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"), (serde_json::Value = "application/json"))),
        (status = 422, description = "A paint that is not there, weights that do not fit, or a scene that is not offered", body = ProblemDocument, content_type = "application/problem+json"),
        Problems,
    )
)]
pub async fn create(
    State(app): State<App>,
    _: NoQuery,
    idempotency: Idempotency,
    Json(order): Json<PreviewOrder>,
) -> Result<Answer, Problem> {
    let show = order.show.unwrap_or_default();
    let sampled = [
        ("samples_per_pixel", order.samples_per_pixel.is_some()),
        ("profile", order.profile.is_some()),
        ("max_error", order.max_error.is_some()),
        ("max_seconds", order.max_seconds.is_some()),
    ];
    view::refuse_samples_of_angles(show, &sampled, &view::Names::BODY)?;
    let knobs = order.profile.is_some() || order.samples_per_pixel.is_some();
    let target = targets::of_body(order.max_error, order.max_seconds, knobs)?;
    let (thing, weights) = order.named().find(&app).await?;
    let asked = order.profile.clone().unwrap_or_default();
    asked.fits_in_body(&thing)?;
    asked.refuse_other_samples_in_body(order.samples_per_pixel)?;
    let profile = asked.of_body()?;
    // How many samples it takes to meet a target is found once everything else is known to be right.
    let spp = order.samples_per_pixel.or(target.is_some().then_some(1));
    let environment =
        view::environment(&app, order.environment.as_deref(), &view::Names::BODY).await?;
    let asked = View {
        show,
        scene: order.scene.unwrap_or_default(),
        size: order.size.unwrap_or([512, 512]),
        samples_per_pixel: view::samples(show, spp, &profile),
        environment,
        lights: order.lights,
    };
    let view = view::view(&app, asked, &view::Names::BODY)?;
    let format = order.format.unwrap_or(PreviewFormat::Png);
    let whole = (&thing.id, &weights, &view, format);
    let claimed = if target.is_some() {
        ids::asked("preview", &(whole, target))
    } else {
        ids::asked("preview", &whole)
    };
    idempotency.claim(&app, &claimed).await?;
    let (view, picked) = if target.is_some() {
        let sent = format.drawn();
        let found = view::picked(&app, &thing, weights.as_ref(), (view, sent), target).await;
        let (view, picked) = found.map_err(Problem::in_body)?;
        (view, Some(picked))
    } else {
        (view, None)
    };
    let drawn = drawing::draw(&app, thing, weights, format.drawn(), view).await;
    let drawn = drawn.map_err(Problem::in_body)?;
    Ok(answer(drawn, format, picked.as_ref()))
}

impl PreviewOrder {
    fn named(&self) -> Named<'_> {
        Named {
            paint: self.paint.as_deref(),
            blend: self.blend.as_deref(),
            weights: WeightQuery::of_lists(
                self.weights.clone(),
                self.base.clone(),
                self.flake_lightness.clone(),
                self.flake_color.clone(),
                self.flake_saturation,
            ),
            or_even: false,
        }
    }
}

/// The report on a picture stands beside it, under the same query.
fn report_link(address: &str, query: Option<&str>) -> String {
    let query = query.map_or(String::new(), |query| format!("?{query}"));
    format!("<{address}/preview.json{query}>; rel=\"describedby\"; type=\"application/json\"")
}

fn answer(drawn: Drawn, format: PreviewFormat, picked: Option<&Picked>) -> Answer {
    // What a target picks may change with the machine's load.
    let keep = if picked.is_some() {
        drawn.keep.revalidated()
    } else {
        drawn.keep
    };
    let answer = match format {
        PreviewFormat::Json => Answer::bytes("application/json", drawn.kept.report, keep),
        _ => Answer::result(format.drawn().media_type(), drawn.kept.file, keep),
    };
    answer
        .accuracy(&drawn.kept.accuracy)
        .picked(picked)
        .stages(&drawn.stages)
        .stage("preview", drawn.time)
}
