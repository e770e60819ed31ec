//! Previews: pictures of a paint, or of a blend at some weights.

use std::str::FromStr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::{RawQuery, State};
use axum::http::{HeaderName, header};
use bytes::Bytes;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::blend::RealisationWeights;
use crate::service::app::{App, Shelved};
use crate::service::http::{
    Address, Answer, Idempotency, Json, Keep, Kind, NoQuery, Place, Problem, ProblemDocument,
    Query, QueryOfTwo,
};
use crate::service::ids;
use crate::service::parameters::{ProfileDocument, ProfileText, WeightQuery, targets};
use crate::service::work::{Asked, Light, Picked, Picture, PictureFormat, Shape, View, call_off};
use crate::store::{CachedResult, Hash};

/// Longest side of a picture.
const LONGEST_SIDE: u32 = 4096;

/// Most samples of one picture: pixels times samples per pixel.
const MOST_SAMPLES: u64 = 1 << 28;

/// Most lights of a scene.
const MOST_LIGHTS: usize = 16;

/// What a picture shows.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ViewQuery {
    /// What the paint is on, `sphere` unless given.
    scene: Option<Shape>,
    /// Width and height in pixels, `512x512` unless given.
    #[param(value_type = Option<String>, pattern = "^[0-9]{1,4}x[0-9]{1,4}$", example = "512x512")]
    size: Option<Size>,
    /// Samples per pixel, in place of the profile's.
    #[param(minimum = 1, maximum = 4096)]
    spp: Option<u32>,
    /// Direction towards the light, in place of the scene's usual one: x to the right, y up, z towards the viewer.
    #[param(style = Form, explode = false, min_items = 3, max_items = 3)]
    light: Option<Vec<f32>>,
    /// Accuracy: `draft`, `standard`, `reference`, and knobs such as `draft,samples_per_pixel=100`.
    #[param(value_type = Option<String>, example = "standard")]
    profile: Option<ProfileText>,
    /// In place of a profile: the cheapest whose mean error by sampling is at most this, CIEDE2000.
    #[param(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[param(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
}

/// Pixels across or down.
#[derive(ToSchema)]
#[schema(minimum = 1, maximum = 4096)]
#[allow(dead_code)] // says what is accepted
pub struct Side(u32);

/// `WxH` in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Size([u32; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |side: &str| {
            side.parse()
                .ok()
                .filter(|pixels| (1..=LONGEST_SIDE).contains(pixels))
        };
        text.split_once('x')
            .and_then(|(width, height)| Some(Self([side(width)?, side(height)?])))
            .ok_or_else(|| format!("{text:?} is no size; accepted is WxH such as 512x512, up to {LONGEST_SIDE} each."))
    }
}

impl<'de> Deserialize<'de> for Size {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?
            .parse()
            .map_err(serde::de::Error::custom)
    }
}

impl ViewQuery {
    fn view(&self, app: &App) -> Result<View, Problem> {
        let Size(size) = self.size.unwrap_or(Size([512, 512]));
        let profile = self.profile.clone().unwrap_or_default().of_query()?;
        let light = self.light.as_deref().map(|list| {
            <[f32; 3]>::try_from(list)
                .map(|towards| Light {
                    towards,
                    irradiance: None,
                })
                .map_err(|_| {
                    let detail = format!("light has {} numbers.", list.len());
                    Problem::parameter("light", detail)
                        .accepting("3 numbers, the direction towards the light")
                })
        });
        let asked = View {
            scene: self.scene.unwrap_or_default(),
            size,
            samples_per_pixel: self.spp.unwrap_or(profile.samples_per_pixel),
            lights: light.transpose()?.map(|light| vec![light]),
        };
        view(app, asked, &Names::QUERY)
    }
}

impl ViewQuery {
    /// The view, with the samples that meet a target where there is one.
    async fn picked_view(
        &self,
        app: &App,
        thing: &Arc<Shelved>,
        weights: Option<&RealisationWeights>,
        format: PreviewFormat,
    ) -> Result<(View, Option<Picked>), Problem> {
        if let Some(asked) = &self.profile {
            asked.fits(thing)?;
        }
        let mut view = self.view(app)?;
        let knobs = self.profile.is_some() || self.spp.is_some();
        let target = targets::of_query(self.max_error, self.max_seconds, knobs)?;
        if !target.is_some() {
            return Ok((view, None));
        }
        let (works, thing, weights) = (Arc::clone(&app.works), Arc::clone(thing), weights.cloned());
        let wanted = view.clone();
        let found = app.bench.run(move || {
            let asked = Asked::Preview {
                thing: &thing.thing,
                weights: weights.as_ref(),
                view: &wanted,
                format: format.drawn(),
            };
            works.pick(&asked, &target)
        });
        let found = found
            .await?
            .map_err(crate::service::work::WorkError::of_query)?;
        view.samples_per_pixel = found.profile().samples_per_pixel;
        Ok((view, Some(found)))
    }
}

/// How a request calls what makes a view.
pub struct Names {
    place: Place,
    samples: &'static str,
    /// The light of a query, or the list that lights stand in.
    light: &'static str,
}

impl Names {
    const QUERY: Self = Self {
        place: Place::Query,
        samples: "spp",
        light: "light",
    };
    pub const BODY: Self = Self {
        place: Place::Body,
        samples: "samples_per_pixel",
        light: "lights",
    };

    fn refuse(&self, name: &str, detail: String, accepted: String) -> Problem {
        let problem = match self.place {
            Place::Body => Problem::value(format!("/{name}"), detail),
            _ => Problem::parameter(name, detail),
        };
        problem.accepting(accepted)
    }

    fn light(&self, place: usize) -> String {
        match self.place {
            Place::Body => format!("{}/{place}", self.light),
            _ => self.light.to_owned(),
        }
    }
}

/// A view, with everything in range.
pub fn view(app: &App, view: View, names: &Names) -> Result<View, Problem> {
    let (most, spp) = (app.config.limits.samples, view.samples_per_pixel);
    let [width, height] = view.size;
    let size = format!("{width}x{height}");
    if !(1..=most).contains(&spp) {
        let detail = format!("{} is {spp}.", names.samples);
        return Err(names.refuse(names.samples, detail, format!("1 to {most}")));
    }
    if !view
        .size
        .iter()
        .all(|side| (1..=LONGEST_SIDE).contains(side))
    {
        let accepted = format!("1 to {LONGEST_SIDE} each");
        return Err(names.refuse("size", format!("size is {size}."), accepted));
    }
    if u64::from(width) * u64::from(height) * u64::from(spp) > MOST_SAMPLES {
        let detail = format!("{} is {spp} for each of {size} pixels.", names.samples);
        let accepted = format!("up to {MOST_SAMPLES} samples in all");
        return Err(names.refuse(names.samples, detail, accepted));
    }
    let lights = view.lights.as_deref().unwrap_or_default();
    if lights.len() > MOST_LIGHTS {
        let detail = format!("{} has {} lights.", names.light, lights.len());
        return Err(names.refuse(names.light, detail, format!("up to {MOST_LIGHTS} lights")));
    }
    for (place, light) in lights.iter().enumerate() {
        let length: f32 = light.towards.iter().map(|v| v * v).sum();
        let bright = light.irradiance.unwrap_or_default();
        let dim = bright.iter().all(|v| (0.0..=65504.0).contains(v));
        if !(length > 0.0 && length.is_finite() && dim) {
            let name = names.light(place);
            let towards = light.towards;
            let detail = match light.irradiance {
                Some(irradiance) => {
                    format!("{name} is towards {towards:?} with irradiance {irradiance:?}.")
                }
                None => format!("{name} is towards {towards:?}."),
            };
            let accepted =
                "a direction of some length, and an irradiance of 0 to 65504 per channel";
            return Err(names.refuse(&name, detail, accepted.to_owned()));
        }
    }
    Ok(view)
}

/// What is sent of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PreviewFormat {
    /// Tone mapped for a screen, 8 bits.
    Png,
    /// Linear light.
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
/// `json` is the report on the picture: effects that were planned or left out, what was clamped, how accurate it is.
#[utoipa::path(
    get, operation_id = "preview_blend", path = "/v1/blends/{id}/preview.{format}", tag = "previews",
    params(("id" = String, Path, description = "Blend"), ("format" = PreviewFormat, Path, description = "Picture, or its report"), WeightQuery, ViewQuery),
    responses(
        (status = 200, description = "The picture", headers(
            ("Carpaint-Accuracy" = String, description = "Standard error by sampling, CIEDE2000, mean and 95th percentile over pixels; error of the flakes, Lab"),
            ("Link" = String, description = "The picture's report")), content((Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"), (serde_json::Value = "application/json"))),
        (status = 400, description = "Weights that do not fit the blend, or a view that is not offered", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 404, description = "There is no such blend", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
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
    let weights = Some(weights);
    let (view, picked) = query
        .picked_view(&app, &blend, weights.as_ref(), format)
        .await?;
    let drawn = draw(&app, blend, weights, format.drawn(), view).await?;
    let report = report_link(&format!("/v1/blends/{id}"), raw.as_deref());
    Ok(drawn
        .answer(format, picked.as_ref())
        .header(header::LINK, &report))
}

/// A picture of a paint.
///
/// `json` is the report on the picture: effects that were planned or left out, how accurate it is.
#[utoipa::path(
    get, operation_id = "preview_paint", path = "/v1/paints/{id}/preview.{format}", tag = "previews",
    params(("id" = String, Path, description = "Paint"), ("format" = PreviewFormat, Path, description = "Picture, or its report"), ViewQuery),
    responses(
        (status = 200, description = "The picture", headers(
            ("Carpaint-Accuracy" = String, description = "Standard error by sampling, CIEDE2000, mean and 95th percentile over pixels; error of the flakes, Lab"),
            ("Link" = String, description = "The picture's report")), content((Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"), (serde_json::Value = "application/json"))),
        (status = 404, description = "There is no such paint", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn of_paint(
    State(app): State<App>,
    Address((id, format)): Address<(String, PreviewFormat)>,
    Query(query): Query<ViewQuery>,
    RawQuery(raw): RawQuery,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    let weights = None;
    let (view, picked) = query
        .picked_view(&app, &paint, weights.as_ref(), format)
        .await?;
    let drawn = draw(&app, paint, weights, format.drawn(), view).await?;
    let report = report_link(&format!("/v1/paints/{id}"), raw.as_deref());
    Ok(drawn
        .answer(format, picked.as_ref())
        .header(header::LINK, &report))
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
    /// Width and height in pixels, 512 and 512 unless given.
    #[schema(value_type = Option<Vec<Side>>, min_items = 2, max_items = 2)]
    size: Option<[u32; 2]>,
    /// Samples per pixel, in place of the profile's.
    #[schema(minimum = 1, maximum = 4096)]
    samples_per_pixel: Option<u32>,
    /// Lights in place of the scene's usual one; none leaves the surroundings alone.
    #[schema(max_items = 16)]
    lights: Option<Vec<Light>>,
    /// Accuracy: the name of a preset, or an object of knobs.
    #[schema(value_type = Option<ProfileDocument>)]
    profile: Option<ProfileText>,
    /// What is sent, `png` unless given.
    format: Option<PreviewFormat>,
}

/// A picture of a whole scene.
#[utoipa::path(
    post, operation_id = "create_preview", path = "/v1/previews", tag = "previews", request_body = PreviewOrder,
    params(("Idempotency-Key" = Option<String>, Header, description = "Refuses this key with another request")),
    responses(
        (status = 200, description = "The picture", headers(
            ("Carpaint-Accuracy" = String, description = "Standard error by sampling, CIEDE2000, mean and 95th percentile over pixels; error of the flakes, Lab")),
            content((Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"), (serde_json::Value = "application/json"))),
        (status = 422, description = "A paint that is not there, weights that do not fit, or a scene that is not offered", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn create(
    State(app): State<App>,
    _: NoQuery,
    idempotency: Idempotency,
    Json(order): Json<PreviewOrder>,
) -> Result<Answer, Problem> {
    let (thing, weights) = order.thing(&app).await?;
    let asked = order.profile.clone().unwrap_or_default();
    asked.fits(&thing).map_err(Problem::in_body)?;
    let profile = asked.of_body()?;
    let spp = order.samples_per_pixel;
    let asked = View {
        scene: order.scene.unwrap_or_default(),
        size: order.size.unwrap_or([512, 512]),
        samples_per_pixel: spp.unwrap_or(profile.samples_per_pixel),
        lights: order.lights,
    };
    let view = view(&app, asked, &Names::BODY)?;
    let format = order.format.unwrap_or(PreviewFormat::Png);
    let key = key(&thing, weights.as_ref(), &view, format.drawn());
    idempotency
        .claim(&app, &format!("{key} {format:?}"))
        .await?;
    let drawn = draw(&app, thing, weights, format.drawn(), view).await;
    Ok(drawn.map_err(Problem::in_body)?.answer(format, None))
}

impl PreviewOrder {
    async fn thing(
        &self,
        app: &App,
    ) -> Result<(Arc<Shelved>, Option<RealisationWeights>), Problem> {
        let missing = |field: &str, problem: Problem| match problem.kind() {
            Kind::UnknownPaint | Kind::UnknownBlend => problem.naming_value(field),
            _ => problem,
        };
        match (&self.paint, &self.blend) {
            (Some(id), None) => {
                let weights = [
                    ("weights", &self.weights),
                    ("base", &self.base),
                    ("flake_lightness", &self.flake_lightness),
                    ("flake_color", &self.flake_color),
                ];
                let given = weights.iter().find(|(_, list)| list.is_some());
                let saturation = self.flake_saturation.map(|_| "flake_saturation");
                if let Some(field) = given.map(|(field, _)| *field).or(saturation) {
                    let detail = format!("One paint takes no {field}.");
                    return Err(Problem::value(format!("/{field}"), detail).accepting("nothing"));
                }
                let paint = app.paint(id).await.map_err(|p| missing("paint", p))?;
                Ok((paint, None))
            }
            (None, Some(id)) => {
                let blend = app.blend(id).await.map_err(|p| missing("blend", p))?;
                let asked = WeightQuery::of_lists(
                    self.weights.clone(),
                    self.base.clone(),
                    self.flake_lightness.clone(),
                    self.flake_color.clone(),
                    self.flake_saturation,
                );
                let weights = asked.for_blend(&blend.names);
                Ok((Arc::clone(&blend), Some(weights.map_err(Problem::in_body)?)))
            }
            _ => Err(
                Problem::value("/paint", "Neither or both of paint and blend are given.")
                    .accepting("the id of a paint, or of a blend"),
            ),
        }
    }
}

/// Key of a picture: everything that makes it.
fn key(
    thing: &Shelved,
    weights: Option<&RealisationWeights>,
    view: &View,
    format: PictureFormat,
) -> Hash {
    ids::key(
        "preview",
        &(&thing.id, thing.file.to_string(), weights, view, format),
    )
}

async fn draw(
    app: &App,
    thing: Arc<Shelved>,
    weights: Option<RealisationWeights>,
    format: PictureFormat,
    view: View,
) -> Result<Drawn, Problem> {
    let (begun, keep) = (Instant::now(), thing.keep());
    let key = key(&thing, weights.as_ref(), &view, format);
    let _waits = app.watchers.watch(key);
    let kept = loop {
        let (on, thing, weights) = (app.clone(), Arc::clone(&thing), weights.clone());
        let view = view.clone();
        let compute = move || async move {
            let (works, counter) = (Arc::clone(&on.works), on.metrics.previews_rendered.clone());
            let bench = on.bench.clone();
            let progress = move |_: f32| {
                if on.is_stopping() || !on.watchers.any(key) {
                    call_off();
                }
            };
            let drawn = bench.run_or_call_off(move || {
                works.preview(&thing.thing, weights.as_ref(), &view, format, &progress)
            });
            let Ok(drawn) = drawn.await? else {
                return Err(Problem::new(
                    Kind::JobCancelled,
                    "Nobody waited for this picture any more.",
                ));
            };
            let picture = drawn.map_err(crate::service::work::WorkError::of_query)?;
            counter.increment(1);
            Ok(kept_form(&picture))
        };
        match app.results.get_or_compute(key, compute).await {
            // Whoever was before us gave up a moment ago.
            Err(problem) if problem.kind() == Kind::JobCancelled && !app.is_stopping() => {}
            Err(problem) if problem.kind() == Kind::JobCancelled => {
                return Err(Problem::overloaded());
            }
            kept => break kept?,
        }
    };
    let (accuracy, report, picture) = split(&kept)?;
    Ok(Drawn {
        accuracy,
        report,
        picture,
        keep,
        time: begun.elapsed(),
    })
}

/// The report on a picture stands beside it, under the same query.
fn report_link(address: &str, query: Option<&str>) -> String {
    let query = query.map_or(String::new(), |query| format!("?{query}"));
    format!("<{address}/preview.json{query}>; rel=\"describedby\"; type=\"application/json\"")
}

/// How accurate a picture is: it belongs to the picture, so it is kept with it.
const ACCURACY: HeaderName = HeaderName::from_static("carpaint-accuracy");

/// What is kept of a picture: a line of its accuracy, a line of its report as JSON, the file.
fn kept_form(picture: &Picture) -> Bytes {
    let head = format!("{}\n{}\n", picture.accuracy, picture.report);
    [head.as_bytes(), &picture.bytes].concat().into()
}

/// Accuracy, report and picture of what was kept.
fn split(kept: &CachedResult) -> Result<(String, Bytes, CachedResult), Problem> {
    let line_end = |from: usize| {
        let end = kept.bytes[from..].iter().position(|&byte| byte == b'\n');
        end.map(|end| from + end)
            .ok_or_else(|| Problem::internal("a kept picture without its report"))
    };
    let first = line_end(0)?;
    let second = line_end(first + 1)?;
    let picture = CachedResult {
        // The hash of all three tells pictures apart as surely as that of one.
        hash: kept.hash,
        bytes: kept.bytes.slice(second + 1..),
    };
    let accuracy = String::from_utf8_lossy(&kept.bytes[..first]).into_owned();
    Ok((accuracy, kept.bytes.slice(first + 1..second), picture))
}

/// A picture that was drawn, now or before.
struct Drawn {
    accuracy: String,
    report: Bytes,
    picture: CachedResult,
    keep: Keep,
    time: Duration,
}

impl Drawn {
    fn answer(self, format: PreviewFormat, picked: Option<&Picked>) -> Answer {
        // What a target picks may change with the machine's load.
        let keep = picked.map_or(self.keep, |_| Keep::Revalidated);
        let answer = match format {
            PreviewFormat::Json => Answer::bytes("application/json", self.report, keep),
            _ => Answer::result(format.drawn().media_type(), self.picture, keep),
        };
        answer
            .picked(picked)
            .header(ACCURACY, &self.accuracy)
            .stage("preview", self.time)
    }
}
