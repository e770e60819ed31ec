//! Previews: pictures of a paint, or of a blend at some weights.

use std::str::FromStr;
use std::sync::Arc;
use std::time::Instant;

use axum::extract::State;
use axum::http::HeaderName;
use bytes::Bytes;
use serde::{Deserialize, Deserializer};
use utoipa::IntoParams;

use super::answer::{Answer, Keep};
use super::app::{App, Shelved};
use super::extract::{Address, Query, QueryOfTwo};
use super::ids;
use super::problem::{Problem, ProblemDocument};
use super::profile::ProfileText;
use super::targets;
use super::weights::WeightQuery;
use super::works::{Asked, Picture, PictureFormat, Scene, View};
use crate::blend::RealisationWeights;
use crate::store::CachedResult;

/// Longest side of a picture.
const LONGEST_SIDE: u32 = 4096;

/// Most samples of one picture: pixels times samples per pixel.
const MOST_SAMPLES: u64 = 1 << 30;

/// What a picture shows.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ViewQuery {
    /// What the paint is on, `sphere` unless given.
    scene: Option<Scene>,
    /// Width and height in pixels, `512x512` unless given.
    #[param(value_type = Option<String>, pattern = "^[0-9]{1,4}x[0-9]{1,4}$", example = "512x512")]
    size: Option<Size>,
    /// Samples per pixel, in place of the profile's.
    #[param(minimum = 1, maximum = 4096)]
    spp: Option<u32>,
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
        let most = app.config.limits.samples;
        let spp = match self.spp {
            Some(spp) if (1..=most).contains(&spp) => spp,
            Some(spp) => {
                return Err(Problem::parameter("spp", format!("spp is {spp}."))
                    .accepting(format!("1 to {most}")));
            }
            None => {
                self.profile
                    .clone()
                    .unwrap_or_default()
                    .of_query()?
                    .samples_per_pixel
            }
        };
        if u64::from(size[0]) * u64::from(size[1]) * u64::from(spp) > MOST_SAMPLES {
            let detail = format!(
                "{} x {} pixels with {spp} samples each are too much.",
                size[0], size[1]
            );
            return Err(Problem::parameter("spp", detail)
                .accepting(format!("up to {MOST_SAMPLES} samples in all")));
        }
        Ok(View {
            scene: self.scene.unwrap_or_default(),
            size,
            samples_per_pixel: spp,
        })
    }
}

/// A picture of a blend at some weights.
#[utoipa::path(
    get, operation_id = "preview_blend", path = "/v1/blends/{id}/preview.{format}", tag = "previews",
    params(("id" = String, Path, description = "Blend"), ("format" = PictureFormat, Path, description = "Picture"), WeightQuery, ViewQuery),
    responses(
        (status = 200, description = "The picture", headers(("Carpaint-Accuracy" = String, description = "Standard error by sampling, CIEDE2000, mean and 95th percentile over pixels; error of the flakes, Lab")), content((Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"))),
        (status = 400, description = "Weights that do not fit the blend, or a view that is not offered", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 404, description = "There is no such blend", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn of_blend(
    State(app): State<App>,
    Address((id, format)): Address<(String, PictureFormat)>,
    QueryOfTwo(weights, query): QueryOfTwo<WeightQuery, ViewQuery>,
) -> Result<Answer, Problem> {
    let blend = app.blend(&id).await?;
    let weights = weights.for_blend(&blend.names)?;
    draw(&app, blend, Some(weights), format, &query).await
}

/// A picture of a paint.
#[utoipa::path(
    get, operation_id = "preview_paint", path = "/v1/paints/{id}/preview.{format}", tag = "previews",
    params(("id" = String, Path, description = "Paint"), ("format" = PictureFormat, Path, description = "Picture"), ViewQuery),
    responses(
        (status = 200, description = "The picture", headers(("Carpaint-Accuracy" = String, description = "Standard error by sampling, CIEDE2000, mean and 95th percentile over pixels; error of the flakes, Lab")), content((Vec<u8> = "image/png"), (Vec<u8> = "image/x-exr"))),
        (status = 404, description = "There is no such paint", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn of_paint(
    State(app): State<App>,
    Address((id, format)): Address<(String, PictureFormat)>,
    Query(query): Query<ViewQuery>,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    draw(&app, paint, None, format, &query).await
}

async fn draw(
    app: &App,
    thing: Arc<Shelved>,
    weights: Option<RealisationWeights>,
    format: PictureFormat,
    query: &ViewQuery,
) -> Result<Answer, Problem> {
    let begun = Instant::now();
    let mut view = query.view(app)?;
    let knobs = query.profile.is_some() || query.spp.is_some();
    let target = targets::of_query(query.max_error, query.max_seconds, knobs)?;
    let mut picked = None;
    if target.is_some() {
        let (works, thing, weights) = (Arc::clone(&app.works), Arc::clone(&thing), weights.clone());
        let found = app.bench.run(move || {
            let asked = Asked::Preview {
                thing: &thing.thing,
                weights: weights.as_ref(),
                view: &view,
                format,
            };
            works.pick(&asked, &target)
        });
        let found = found.await?.map_err(super::works::WorkError::of_query)?;
        view.samples_per_pixel = found.profile().samples_per_pixel;
        picked = Some(found);
    }
    let key = ids::key(
        "preview",
        &(&thing.id, thing.file.to_string(), &weights, view, format),
    );
    let on = app.clone();
    let compute = move || async move {
        let (works, counter) = (Arc::clone(&on.works), on.metrics.previews_rendered.clone());
        let drawn = on
            .bench
            .run(move || works.preview(&thing.thing, weights.as_ref(), &view, format))
            .await?;
        let picture = drawn.map_err(super::works::WorkError::of_query)?;
        counter.increment(1);
        Ok(with_accuracy(&picture))
    };
    let kept = app.results.get_or_compute(key, compute).await?;
    let (accuracy, picture) = split(&kept)?;
    // What a target picks may change with the machine's load.
    let keep = picked.as_ref().map_or(Keep::ForEver, |_| Keep::Revalidated);
    Ok(Answer::result(format.media_type(), picture, keep)
        .header(ACCURACY, &accuracy)
        .picked(picked.as_ref())
        .stage("preview", begun.elapsed()))
}

/// How accurate a picture is: it belongs to the picture, so it is kept with it.
const ACCURACY: HeaderName = HeaderName::from_static("carpaint-accuracy");

/// What is kept of a picture: its accuracy, a line feed, the file.
fn with_accuracy(picture: &Picture) -> Bytes {
    [picture.accuracy.as_bytes(), b"\n", &picture.bytes]
        .concat()
        .into()
}

fn split(kept: &CachedResult) -> Result<(String, CachedResult), Problem> {
    let end = kept.bytes.iter().position(|&byte| byte == b'\n');
    let end = end.ok_or_else(|| Problem::internal("a kept picture without its accuracy"))?;
    let accuracy = String::from_utf8_lossy(&kept.bytes[..end]).into_owned();
    let bytes = kept.bytes.slice(end + 1..);
    // The hash of both tells pictures apart as surely as that of one.
    let hash = kept.hash;
    Ok((accuracy, CachedResult { hash, bytes }))
}
