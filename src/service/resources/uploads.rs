//! Uploads: a measurement comes in and becomes a paint.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::response::Response;
use serde::Deserialize;
use utoipa::IntoParams;

use super::documents::PaintDocument;
use super::making;
use crate::service::app::App;
use crate::service::http::{
    Idempotency, Kind, Prefer, Problem, ProblemDocument, Problems, Query, receiving,
};
use crate::service::ids;
use crate::service::parameters::{ProfileText, targets};
use crate::service::work::{
    Asked, IngestOrder, IngestRequest, JobDocument, Layout, Picked, Target, ThetaHSpacing, runner,
};
use crate::store::{BlobWriter, Hash, JobKind};
use crate::workshop::NAME_CHARACTERS;

/// What an upload is to be.
const MEASUREMENT: receiving::Expected = receiving::Expected {
    archive: true,
    unusable: Kind::UnusableMeasurement,
    accepted: "a measured-paint package, an RGL .bsdf, an MPI 2005 table, a MERL binary, readings as CSV or CxF3, or a .paint",
};

/// How an upload is read and fitted.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct IngestQuery {
    /// Name of the paint, in place of the measurement's own. Of a `CxF3` document with several paints, the name or Id of one.
    #[param(min_length = 1, max_length = 200)]
    name: Option<String>,
    /// What the file is, where its bytes do not say.
    layout: Option<Layout>,
    /// Spacing of `theta_h` in an MPI 2005 table.
    theta_h: Option<ThetaHSpacing>,
    /// Bytes before the values of an MPI 2005 table, 84 unless given.
    #[param(maximum = 1_048_576)]
    header_bytes: Option<u64>,
    /// Give the paint a clear coat of this index of refraction; otherwise the fit decides. Of readings as CSV or `CxF3`, which
    /// 1 leaves uncoated, it is 1.5 unless given.
    #[param(minimum = 1.0, maximum = 4.0)]
    coat_ior: Option<f64>,
    /// Accuracy: `draft`, `standard`, `reference`, and knobs such as `standard,clusters=100`.
    #[param(value_type = Option<String>, example = "standard")]
    profile: Option<ProfileText>,
    /// Clusters per slice, in place of the preset's; refused beside another number in the profile.
    #[param(minimum = 1, maximum = 4096)]
    clusters: Option<u32>,
    /// In place of a profile: the cheapest whose error is at most this, Lab.
    #[param(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[param(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
}

impl IngestQuery {
    /// What is asked, and the target in place of a profile.
    ///
    /// # Errors
    ///
    /// [`Problem`] that names the parameter.
    pub fn order(self) -> Result<(IngestOrder, Target), Problem> {
        if let Some(name) = &self.name
            && (!NAME_CHARACTERS.contains(&name.chars().count())
                || name.chars().any(char::is_control))
        {
            return Err(Problem::parameter(
                "name",
                "The name is empty, too long, or holds control characters.",
            )
            .accepting("1 to 200 printable characters"));
        }
        if let Some(ior) = self.coat_ior
            && !(1.0..=4.0).contains(&ior)
        {
            return Err(
                Problem::parameter("coat_ior", format!("coat_ior is {ior}.")).accepting("1 to 4"),
            );
        }
        if let Some(bytes) = self.header_bytes
            && bytes > 1 << 20
        {
            return Err(
                Problem::parameter("header_bytes", format!("header_bytes is {bytes}."))
                    .accepting("0 to 1048576"),
            );
        }
        let instead = self.profile.is_some() || self.clusters.is_some();
        let target = targets::of_query(self.max_error, self.max_seconds, instead)?;
        let asked = self.profile.unwrap_or_default();
        let order = IngestOrder {
            name: self.name,
            layout: self.layout,
            theta_h: self.theta_h,
            header_bytes: self.header_bytes,
            coat_ior: self.coat_ior,
            clusters: self.clusters.or(asked.0.clusters),
            profile: asked.with_clusters(self.clusters).of_query()?,
        };
        Ok((order, target))
    }
}

/// Upload a measurement.
///
/// The body is the file itself: a measured-paint package (.zip), an RGL `.bsdf`, an MPI 2005 table, a MERL binary, readings
/// of a multi-angle instrument as CSV (what `readings.csv` of a paint is, or with `nm400` to `nm700` in place of `L,a,b`) or
/// `CxF3`, or a `.paint`. Readings alone make a paint that reads the same and has no flakes. It is streamed to disk. The
/// same bytes with the same options have the same id: asking again is safe, and answers at once. `Prefer: wait=N` waits up
/// to N seconds for the paint; otherwise what takes more than 3 seconds is answered with the job that goes on.
#[utoipa::path(
    post, operation_id = "upload_paint", path = "/v1/paints", tag = "paints", params(IngestQuery,
        ("Prefer" = Option<String>, Header, description = "`wait=N` seconds, or `respond-async`"),
        ("Idempotency-Key" = Option<String>, Header, description = "Refuses this key with another request")),
    request_body(content = Vec<u8>, content_type = "application/octet-stream", description = "The measurement"),
    responses(
        (status = 200, description = "The paint, made of the same upload before", body = PaintDocument,
            headers(("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"))),
        (status = 201, description = "The paint", body = PaintDocument, headers(
            ("Location" = String, description = "Its address"),
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"))),
        (status = 202, description = "The job that makes it", body = JobDocument, headers(
            ("Location" = String, description = "The job's address"),
            ("Carpaint-Target" = String, description = "Of a target: whether it is met, with which profile, and what was estimated"))),
        (status = 413, description = "The upload is too large", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "The upload is no measurement, or a damaged one", body = ProblemDocument, content_type = "application/problem+json"),
        Problems,
    )
)]
pub async fn upload(
    State(app): State<App>,
    query: Result<Query<IngestQuery>, Problem>,
    prefer: Prefer,
    idempotency: Result<Idempotency, Problem>,
    request: Request,
) -> Result<Response, Problem> {
    let asked = query.and_then(|Query(query)| Ok((query.order()?, idempotency?)));
    let ((order, idempotency), received) = take_in(&app, asked, request).await?;
    let accepted = runner::to_its_end(accept(app.clone(), received, order, idempotency)).await?;
    let Accepted { id, job, picked } = accepted;
    let address = format!("/v1/paints/{id}");
    let made = || app.paint(&id);
    making::answer(&app, prefer, job, &address, picked.as_ref(), made).await
}

/// Takes in a measurement that is not refused by what was `asked` of it, or by its headers.
///
/// # Errors
///
/// [`Problem`] of those, or as [`receiving::receive`].
pub async fn take_in<T>(
    app: &App,
    asked: Result<T, Problem>,
    request: Request,
) -> Result<(T, Box<dyn BlobWriter>), Problem> {
    let (parts, body) = request.into_parts();
    let asked = asked.and_then(|asked| {
        receiving::check_headers(app, &MEASUREMENT, &parts.headers).map(|()| asked)
    });
    match asked {
        Ok(asked) => Ok((asked, receiving::receive(app, body, &MEASUREMENT).await?)),
        Err(problem) => {
            receiving::drain(body.into_data_stream()).await;
            Err(problem)
        }
    }
}

/// An upload that was kept.
struct Accepted {
    /// Id of the paint it becomes.
    id: String,
    /// The job that makes it, unless it was made before.
    job: Option<String>,
    /// What was picked for a target.
    picked: Option<Picked>,
}

/// Keeps what was received and has a job make a paint of it, unless there is one.
async fn accept(
    app: App,
    received: Box<dyn BlobWriter>,
    (order, target): (IngestOrder, Target),
    idempotency: Idempotency,
) -> Result<Accepted, Problem> {
    let uploaded = app.uploaded(received).await?;
    let accepted = submitted(&app, uploaded.blob(), (order, target), &idempotency).await;
    uploaded.settle(accepted).await
}

async fn submitted(
    app: &App,
    upload: Hash,
    (mut order, target): (IngestOrder, Target),
    idempotency: &Idempotency,
) -> Result<Accepted, Problem> {
    let whole = (upload, &order, target.max_error, target.max_seconds);
    idempotency.claim(app, &ids::asked("paint", &whole)).await?;
    let mut picked = None;
    if target.is_some() {
        let found = pick_for_upload(app, upload, &order, target).await?;
        order.profile = *found.profile();
        picked = Some(found);
    }
    let id = ids::made_of("p_", &(upload, &order));
    let job = if app.catalogue.paint(&id).await?.is_some() {
        None
    } else {
        let request = IngestRequest::new(upload, order);
        Some(runner::submit(app, JobKind::Ingest, &id, &request).await?)
    };
    Ok(Accepted { id, job, picked })
}

/// Picks a profile for an upload that is kept.
///
/// # Errors
///
/// [`Problem`] with the upload, or when too many wait to compute.
pub async fn pick_for_upload(
    app: &App,
    upload: Hash,
    order: &IngestOrder,
    target: Target,
) -> Result<Picked, Problem> {
    let local = app.upload_at_hand(upload).await?;
    let (works, order) = (Arc::clone(&app.works), order.clone());
    let whole = (upload, order.clone(), target);
    let pick = move || {
        let asked = Asked::Ingest {
            upload: local.path(),
            order: &order,
        };
        let file = local.path().display().to_string();
        works
            .pick(&asked, &target)
            .map_err(|error| Problem::of_upload(error.without(&file)))
    };
    app.pick(&whole, pick).await
}
