//! Paints: uploads become paints, which can be listed, read, taken back and deleted.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::{Body, BodyDataStream};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures::StreamExt;
use serde::{Deserialize, Serialize};
use utoipa::IntoParams;

use super::documents::{PaintDocument, PaintList, PaintSummary};
use super::visibility::Visibility;
use crate::service::app::App;
use crate::service::http::{
    Address, Answer, Idempotency, Keep, Kind, NoQuery, Place, Prefer, Problem, ProblemDocument,
    Query,
};
use crate::service::ids;
use crate::service::parameters::{ProfileText, targets};
use crate::service::work::{
    Asked, CalledOff, Ended, Format, IngestOrder, JobDocument, Layout, Picked, Target,
    ThetaHSpacing, UnderWay, runner,
};
use crate::store::{BlobWriter, Hash, JobKind, JobRecord, PaintRecord};
use crate::workshop::NAME_CHARACTERS;

/// Longest silence in the middle of an upload.
const SILENCE: Duration = Duration::from_secs(30);

/// Least bytes a second of an upload, but for so much time as one silence.
const LEAST_RATE: u64 = 16 << 10;

/// Longest time that a refused upload is still taken in, and most bytes of it.
const PATIENCE: Duration = Duration::from_secs(5);
const MOST_DRAINED: usize = 64 << 20;

/// Longest page of a list.
const LONGEST_PAGE: u32 = 200;

/// How an upload is read and fitted.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct IngestQuery {
    /// Name of the paint, in place of the measurement's own.
    #[param(min_length = 1, max_length = 200)]
    name: Option<String>,
    /// What the file is, where its bytes do not say.
    layout: Option<Layout>,
    /// Spacing of `theta_h` in an MPI 2005 table.
    theta_h: Option<ThetaHSpacing>,
    /// Bytes before the values of an MPI 2005 table, 84 unless given.
    #[param(maximum = 1_048_576)]
    header_bytes: Option<u64>,
    /// Give the paint a clear coat of this index of refraction; otherwise the fit decides.
    #[param(minimum = 1.0, maximum = 4.0)]
    coat_ior: Option<f64>,
    /// Accuracy: `draft`, `standard`, `reference`, and knobs such as `standard,clusters=100`.
    #[param(value_type = Option<String>, example = "standard")]
    profile: Option<ProfileText>,
    /// Clusters per slice, in place of the profile's.
    #[param(minimum = 1, maximum = 4096)]
    clusters: Option<u32>,
    /// In place of a profile: the cheapest whose error is at most this, Lab.
    #[param(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[param(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
}

/// Which paints to list.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ListQuery {
    /// Words that name or source contain, whatever the case.
    q: Option<String>,
    /// `private` lists paints that are not published, in place of those that are.
    visibility: Option<Visibility>,
    /// `next` of the page before.
    cursor: Option<String>,
    /// Most paints on the page, 50 unless given.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
}

/// What a job needs to make a paint.
#[derive(Debug, Serialize, Deserialize)]
struct IngestRequest {
    upload: Hash64,
    order: IngestOrder,
}

/// A hash in JSON.
#[derive(Debug, Serialize, Deserialize)]
struct Hash64(String);

impl Hash64 {
    fn hash(&self) -> Result<Hash, Problem> {
        self.0.parse().map_err(Problem::internal)
    }
}

impl IngestQuery {
    fn order(self) -> Result<IngestOrder, Problem> {
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
        let asked = self.profile.unwrap_or_default();
        Ok(IngestOrder {
            name: self.name,
            layout: self.layout,
            theta_h: self.theta_h,
            header_bytes: self.header_bytes,
            coat_ior: self.coat_ior,
            clusters: self.clusters.or(asked.0.clusters),
            profile: asked.with_clusters(self.clusters).of_query()?,
        })
    }
}

/// Upload a measurement.
///
/// The body is the file itself: a measured-paint package (.zip), an RGL `.bsdf`, an MPI 2005 table, a MERL binary, or a
/// `.paint`. It is streamed to disk. The same bytes with the same options have the same id: asking again is safe, and
/// answers at once. `Prefer: wait=N` waits up to N seconds for the paint; otherwise what takes more than 3 seconds is
/// answered with the job that goes on.
#[utoipa::path(
    post, operation_id = "upload_paint", path = "/v1/paints", tag = "paints", params(IngestQuery,
        ("Prefer" = Option<String>, Header, description = "`wait=N` seconds, or `respond-async`"),
        ("Idempotency-Key" = Option<String>, Header, description = "Refuses this key with another request")),
    request_body(content = Vec<u8>, content_type = "application/octet-stream", description = "The measurement"),
    responses(
        (status = 200, description = "The paint, made of the same upload before", body = PaintDocument),
        (status = 201, description = "The paint", body = PaintDocument, headers(("Location" = String, description = "Its address"))),
        (status = 202, description = "The job that makes it", body = JobDocument, headers(("Location" = String, description = "The job's address"))),
        (status = 413, description = "The upload is too large", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "The upload is no measurement, or a damaged one", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn upload(
    State(app): State<App>,
    query: Result<Query<IngestQuery>, Problem>,
    prefer: Prefer,
    idempotency: Result<Idempotency, Problem>,
    request: Request,
) -> Result<Response, Problem> {
    let (parts, body) = request.into_parts();
    let target = query.as_ref().map_or_else(
        |_| Ok(Target::default()),
        |Query(q)| {
            targets::of_query(
                q.max_error,
                q.max_seconds,
                q.profile.is_some() || q.clusters.is_some(),
            )
        },
    );
    let order = query.and_then(|Query(query)| Ok((query.order()?, target?)));
    let order = order.and_then(|order| check_headers(&app, &parts.headers).map(|()| order));
    let (order, idempotency) = match order.and_then(|order| Ok((order, idempotency?))) {
        Ok(asked) => asked,
        Err(problem) => {
            drain(body.into_data_stream()).await;
            return Err(problem);
        }
    };
    let received = receive(&app, body).await?;
    let accepted = runner::to_its_end(accept(app.clone(), received, order, idempotency)).await?;
    let Accepted { id, job, picked } = accepted;
    let address = format!("/v1/paints/{id}");
    let Some(job) = job else {
        let known = app.paint(&id).await?.document.clone();
        let answer = Answer::result("application/json", known, Keep::Revalidated);
        let answer = answer.location(&address).picked(picked.as_ref());
        return Ok(answer.into_response());
    };
    let made = || async { Ok(app.paint(&id).await?.document.clone()) };
    let answer = prefer.answer(&app, &job, &address, made).await?;
    Ok(targets::told(answer, picked.as_ref()))
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
    (mut order, target): (IngestOrder, Target),
    idempotency: Idempotency,
) -> Result<Accepted, Problem> {
    // Until a job names the upload it must not be swept as nobody's.
    let mut naming = app.removal.read().await;
    let stored = received.finish().await?;
    let whole = (
        stored.hash.to_string(),
        &order,
        target.max_error,
        target.max_seconds,
    );
    let claimed = idempotency.claim(&app, &ids::made_of("p_", &whole)).await;
    let mut picked = None;
    let ready = match claimed {
        Ok(()) if target.is_some() => {
            // Not held while a place to compute is waited for.
            drop(naming);
            let found = pick_for_upload(&app, stored.hash, &order, target).await;
            naming = app.removal.read().await;
            match found {
                Ok(_) if app.blobs.local(stored.hash).await?.is_none() => {
                    Err(Problem::overloaded())
                }
                Ok(found) => {
                    order.profile = *found.profile();
                    picked = Some(found);
                    Ok(())
                }
                Err(problem) => Err(problem),
            }
        }
        claimed => claimed,
    };
    if let Err(problem) = ready {
        drop(naming);
        app.forget_upload(stored.hash).await?;
        return Err(problem);
    }
    let id = ids::made_of("p_", &(stored.hash.to_string(), &order));
    if app.catalogue.paint(&id).await?.is_some() {
        return Ok(Accepted {
            id,
            job: None,
            picked,
        });
    }
    let request = IngestRequest {
        upload: Hash64(stored.hash.to_string()),
        order,
    };
    let job = runner::submit(&app, JobKind::Ingest, &id, &request).await;
    drop(naming);
    match job {
        Ok(job) => Ok(Accepted {
            id,
            job: Some(job),
            picked,
        }),
        Err(problem) => {
            app.forget_upload(stored.hash).await?;
            Err(problem)
        }
    }
}

async fn pick_for_upload(
    app: &App,
    upload: Hash,
    order: &IngestOrder,
    target: Target,
) -> Result<Picked, Problem> {
    let local = app.blobs.local(upload).await?;
    let local = local.ok_or_else(|| Problem::internal(format!("upload {upload} is not there")))?;
    let (works, order) = (Arc::clone(&app.works), order.clone());
    let picked = app.bench.run(move || {
        let asked = Asked::Ingest {
            upload: local.path(),
            order: &order,
        };
        let folder = local.path().display().to_string();
        works
            .pick(&asked, &target)
            .map_err(|error| error.without(&folder).of_upload())
    });
    picked.await?
}

fn check_headers(app: &App, headers: &HeaderMap) -> Result<(), Problem> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    if text(header::CONTENT_TYPE).is_some_and(|kind| kind.starts_with("multipart/")) {
        let problem = Problem::new(
            Kind::UnsupportedMediaType,
            "The upload is wrapped in a multipart form.",
        );
        return Err(problem
            .accepting("the file's bytes as the body, as curl --data-binary @FILE sends them"));
    }
    if let Some(encoding) =
        text(header::CONTENT_ENCODING).filter(|encoding| *encoding != "identity")
    {
        let problem = Problem::new(
            Kind::UnsupportedMediaType,
            format!("The upload is encoded as {encoding:?}."),
        );
        return Err(problem.accepting("the file's bytes as they are"));
    }
    let announced: u64 = text(header::CONTENT_LENGTH)
        .and_then(|length| length.parse().ok())
        .unwrap_or(0);
    if announced > app.config.limits.bytes {
        Err(too_large(app))
    } else {
        Ok(())
    }
}

fn too_large(app: &App) -> Problem {
    Problem::new(Kind::TooLarge, "The upload is too large.")
        .accepting(format!("up to {} bytes", app.config.limits.bytes))
}

/// Takes in what is refused, within reason: who still sends does not listen.
async fn drain(mut pieces: BodyDataStream) {
    let drained = async {
        let mut length = 0;
        while let Some(Ok(piece)) = pieces.next().await {
            length += piece.len();
            if length > MOST_DRAINED {
                return;
            }
        }
    };
    let _ = tokio::time::timeout(PATIENCE, drained).await;
}

/// Streams a body into a blob that is still to be finished.
async fn receive(app: &App, body: Body) -> Result<Box<dyn BlobWriter>, Problem> {
    let mut writer = app.blobs.begin().await?;
    let mut pieces = body.into_data_stream();
    let (mut length, begun) = (0, Instant::now());
    loop {
        let piece = match tokio::time::timeout(SILENCE, pieces.next()).await {
            Ok(None) => break,
            Ok(Some(Ok(piece))) => piece,
            Ok(Some(Err(_))) => {
                return Err(Problem::new(
                    Kind::MalformedRequest,
                    "The upload broke off before its end.",
                ));
            }
            Err(_) => {
                let detail = format!(
                    "Nothing came for {} seconds in the middle of the upload.",
                    SILENCE.as_secs()
                );
                return Err(Problem::new(Kind::RequestTimeout, detail));
            }
        };
        length += piece.len() as u64;
        if length > app.config.limits.bytes {
            drop(writer);
            drain(pieces).await;
            return Err(too_large(app));
        }
        if begun.elapsed() > SILENCE + Duration::from_secs(length / LEAST_RATE) {
            let detail = format!(
                "{length} bytes came in {} seconds.",
                begun.elapsed().as_secs()
            );
            return Err(
                Problem::new(Kind::RequestTimeout, detail).accepting(format!(
                    "at least {LEAST_RATE} bytes a second after the first {} seconds",
                    SILENCE.as_secs()
                )),
            );
        }
        writer.append(piece).await?;
    }
    if length == 0 {
        return Err(Problem::new(Kind::UnusableMeasurement, "The body is empty.")
            .at(Place::Body, "")
            .accepting("a measured-paint package, an RGL .bsdf, an MPI 2005 table, a MERL binary or a .paint"));
    }
    Ok(writer)
}

/// The job: fits an upload and keeps the paint.
pub async fn ingest(app: &App, under_way: &Arc<UnderWay>) -> Result<Ended, Problem> {
    let id = &under_way.job().subject;
    if app.catalogue.paint(id).await?.is_some() {
        return Ok(Ok(()));
    }
    let IngestRequest { upload, order } = under_way.request()?;
    let upload = upload.hash()?;
    let local = app.blobs.local(upload).await?;
    let local = local.ok_or_else(|| Problem::internal(format!("upload {upload} is not there")))?;
    let works = Arc::clone(&app.works);
    let fitted = under_way.compute(app, "fitting", move |progress| {
        let fitted = works.ingest(local.path(), &order, progress);
        // The caller knows the upload, not the file it was kept in.
        let folder = local.path().display().to_string();
        fitted.map_err(|error| error.without(&folder))
    });
    let Ok(fitted) = fitted.await? else {
        return Ok(Err(CalledOff));
    };
    let file = fitted.map_err(crate::service::work::WorkError::of_upload)?;
    app.metrics.paints_fitted.increment(1);
    under_way.stage("storing");
    app.keep_paint(id, file, Some(upload)).await.map(Ok)
}

/// Lets go of the upload of a job that came to nothing.
pub async fn forget_upload(app: &App, job: &JobRecord) -> Result<(), Problem> {
    let request: IngestRequest = serde_json::from_str(&job.request).map_err(Problem::internal)?;
    app.forget_upload(request.upload.hash()?).await
}

/// List paints.
#[utoipa::path(
    get, operation_id = "list_paints", path = "/v1/paints", tag = "paints", params(ListQuery),
    responses(
        (status = 200, description = "A page of paints", body = PaintList),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn list(
    State(app): State<App>,
    Query(query): Query<ListQuery>,
) -> Result<Answer, Problem> {
    let cursor = query
        .cursor
        .as_deref()
        .map(|cursor| i64::from_str_radix(cursor, 36))
        .transpose();
    let cursor = cursor.map_err(|_| {
        Problem::parameter("cursor", "The cursor was not made here.")
            .accepting("`next` of the page before")
    })?;
    let limit = query.limit.unwrap_or(50);
    if !(1..=LONGEST_PAGE).contains(&limit) {
        return Err(Problem::parameter("limit", format!("limit is {limit}.")).accepting("1 to 200"));
    }
    let page = app
        .catalogue
        .paints(
            query.q.as_deref(),
            query.visibility.unwrap_or_default().into(),
            cursor,
            limit,
        )
        .await?;
    let list = PaintList {
        paints: page.paints.into_iter().map(summary).collect(),
        next: page.next.map(base36),
    };
    Ok(Answer::json(&list, Keep::Revalidated))
}

/// A cursor says nothing to who holds it.
fn base36(mut number: i64) -> String {
    let mut digits = Vec::new();
    while number > 0 {
        digits.push(char::from_digit(u32::try_from(number % 36).unwrap_or(0), 36).unwrap_or('0'));
        number /= 36;
    }
    digits.iter().rev().collect()
}

fn summary(record: PaintRecord) -> PaintSummary {
    PaintSummary {
        href: format!("/v1/paints/{}", record.id),
        id: record.id,
        name: record.name,
        source: record.source,
        visibility: record.visibility.into(),
        hash: record.content.to_string(),
    }
}

/// What is known about a paint.
///
/// Provenance, parameters, fit residuals with their floor, energy certificate, flake statistics, warnings.
#[utoipa::path(
    get, operation_id = "show_paint", path = "/v1/paints/{id}", tag = "paints", params(("id" = String, Path, description = "Paint")),
    responses(
        (status = 200, description = "The paint", body = PaintDocument),
        (status = 404, description = "There is no such paint", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn show(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    Ok(Answer::result(
        "application/json",
        paint.document.clone(),
        Keep::Revalidated,
    ))
}

/// A paint as a `.paint` file.
#[utoipa::path(
    get, operation_id = "paint_file", path = "/v1/paints/{id}/paint", tag = "paints", params(("id" = String, Path, description = "Paint")),
    responses(
        (status = 200, description = "The file", body = Vec<u8>, content_type = "application/vnd.carpaint.paint"),
        (status = 404, description = "There is no such paint", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn file(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    let blob = app.stream_of(&id, paint.file).await?;
    Ok(
        Answer::blob(Format::Paint.media_type(), paint.file, blob, paint.keep())
            .saved_as(&format!("{id}.paint")),
    )
}

/// The measurement a paint was made of: the very bytes that were uploaded.
#[utoipa::path(
    get, operation_id = "paint_measurement", path = "/v1/paints/{id}/measurement", tag = "paints", params(("id" = String, Path, description = "Paint")),
    responses(
        (status = 200, description = "The bytes", body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 404, description = "There is no such paint, or it had no measurement", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn measurement(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    let paint = app.paint(&id).await?;
    let none = || {
        Problem::new(
            Kind::NoMeasurement,
            "This paint was not uploaded as a measurement.",
        )
    };
    let upload = paint.measurement.ok_or_else(none)?;
    let blob = app.stream_of(&id, upload).await?;
    Ok(
        Answer::blob("application/octet-stream", upload, blob, Keep::Own)
            .saved_as(&format!("{id}.measurement")),
    )
}

/// Delete a paint with its measurement. Blends that were made of it stay.
#[utoipa::path(
    delete, operation_id = "delete_paint", path = "/v1/paints/{id}", tag = "paints", params(("id" = String, Path, description = "Paint")),
    responses(
        (status = 204, description = "It is gone"),
        (status = 409, description = "It is a sample", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 404, description = "There is no such paint", body = ProblemDocument, content_type = "application/problem+json"),
        (status = "default", description = "A problem", body = ProblemDocument, content_type = "application/problem+json"),
    )
)]
pub async fn delete(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    let record = app.catalogue.paint(&id).await?;
    if record.is_some_and(|of| of.source == "sample" && of.measurement.is_none()) {
        let detail = "This paint is a sample: it would be there again at the next start.";
        return Err(Problem::new(Kind::SamplePaint, detail).accepting(
            "PATCH with {\"visibility\": \"private\"}, or a service started with --no-samples",
        ));
    }
    app.forget_paint(&id).await?;
    Ok(StatusCode::NO_CONTENT)
}
