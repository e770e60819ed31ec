//! Environments: panoramas come in, and light pictures in place of the built-in studio.

use axum::extract::{Request, State};
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::service::app::App;
use crate::service::environments::PREFIX;
use crate::service::http::{
    Address, Answer, EnvironmentProblems, Idempotency, Keep, Kind, NoQuery, Place, Problem,
    ProblemDocument, Problems, Query, receiving,
};
use crate::service::ids;
use crate::service::parameters::page;
use crate::service::work::runner;
use crate::store::{BlobWriter, EnvironmentRecord, Hash};
use crate::workshop::{Environment, EnvironmentFile, EnvironmentFormat};

/// What an upload is to be.
const PANORAMA: receiving::Expected = receiving::Expected {
    archive: false,
    unusable: Kind::UnusableEnvironment,
    accepted: "a latitude-longitude panorama, twice as wide as high, Radiance .hdr or OpenEXR .exr",
};

/// A panorama.
#[derive(Debug, Serialize, ToSchema)]
pub struct EnvironmentDocument {
    /// Address: `e_` and 32 hexadecimal digits, of the hash of the file.
    #[schema(pattern = "^e_[0-9a-f]{32}$")]
    pub id: String,
    /// Pixels across.
    #[schema(minimum = 1)]
    pub width: u32,
    /// Pixels down.
    #[schema(minimum = 1)]
    pub height: u32,
    /// `hdr` or `exr`.
    pub format: String,
    /// What of its light is not drawn as bright as it was; absent where all of it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held: Option<HeldLight>,
    /// Where it is, and its file.
    pub links: EnvironmentLinks,
}

/// Channels of a panorama's pixels that are held in the range of light that is drawn, 0 to 65504.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
pub struct HeldLight {
    /// Channels above it, which a bare sun reaches.
    pub too_bright: u64,
    /// The brightest of them, or 0.
    pub brightest: f32,
    /// Channels below 0, which resampling leaves beside bright lights.
    pub negative: u64,
    /// The lowest of them, or 0.
    pub lowest: f32,
}

/// A page of panoramas.
#[derive(Debug, Serialize, ToSchema)]
pub struct EnvironmentList {
    /// The panoramas, in the order they came.
    pub environments: Vec<EnvironmentDocument>,
    /// Cursor of the next page; null after the last.
    pub next: Option<String>,
}

/// Which panoramas to list.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ListQuery {
    /// `next` of the page before.
    cursor: Option<String>,
    /// Most panoramas on the page, 50 unless given.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
}

/// Where a panorama is.
#[derive(Debug, Serialize, ToSchema)]
pub struct EnvironmentLinks {
    /// This document.
    #[serde(rename = "self")]
    #[schema(format = "uri-reference")]
    pub own: String,
    /// The file.
    #[schema(format = "uri-reference")]
    pub file: String,
}

impl From<EnvironmentRecord> for EnvironmentDocument {
    fn from(record: EnvironmentRecord) -> Self {
        let own = format!("/v1/environments/{}", record.id);
        Self {
            links: EnvironmentLinks {
                file: format!("{own}/file"),
                own,
            },
            id: record.id,
            width: record.width,
            height: record.height,
            format: record.format,
            held: record
                .held
                .and_then(|held| serde_json::from_str(&held).ok()),
        }
    }
}

/// Upload a panorama that lights pictures.
///
/// The body is the file itself, a latitude-longitude picture in linear light, twice as wide as high: Radiance `.hdr` or
/// OpenEXR `.exr`. Pictures take it as `environment`. The same bytes have the same id, whoever uploads them: they are
/// kept once, and a delete by one uploader is a delete for all.
#[utoipa::path(
    post, operation_id = "upload_environment", path = "/v1/environments", tag = "environments",
    params(("Idempotency-Key" = Option<String>, Header, description = "Refuses this key with another request")),
    request_body(content = Vec<u8>, content_type = "application/octet-stream", description = "The panorama"),
    responses(
        (status = 200, description = "The environment, of the same bytes uploaded before", body = EnvironmentDocument),
        (status = 201, description = "The environment", body = EnvironmentDocument, headers(("Location" = String, description = "Its address"))),
        (status = 413, description = "The upload is too large", body = ProblemDocument, content_type = "application/problem+json"),
        (status = 422, description = "The upload is no panorama, or a damaged one", body = ProblemDocument, content_type = "application/problem+json"),
        Problems,
    )
)]
pub async fn upload(
    State(app): State<App>,
    query: Result<NoQuery, Problem>,
    idempotency: Result<Idempotency, Problem>,
    request: Request,
) -> Result<Answer, Problem> {
    let (parts, body) = request.into_parts();
    let asked = query.and_then(|_| receiving::check_headers(&app, &PANORAMA, &parts.headers));
    let idempotency = match asked.and(idempotency) {
        Ok(idempotency) => idempotency,
        Err(problem) => {
            receiving::drain(body.into_data_stream()).await;
            return Err(problem);
        }
    };
    let received = receiving::receive(&app, body, &PANORAMA).await?;
    let (record, new) = runner::to_its_end(keep(app.clone(), received, idempotency)).await?;
    let address = format!("/v1/environments/{}", record.id);
    let answer = Answer::json(&EnvironmentDocument::from(record), Keep::Revalidated);
    let status = if new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    Ok(answer.status(status).location(&address))
}

/// Keeps what was received, and says whether it is new. What is no panorama is forgotten.
async fn keep(
    app: App,
    received: Box<dyn BlobWriter>,
    idempotency: Idempotency,
) -> Result<(EnvironmentRecord, bool), Problem> {
    let uploaded = app.uploaded(received).await?;
    let kept = named(&app, uploaded.blob(), &idempotency).await;
    uploaded.settle(kept).await
}

async fn named(
    app: &App,
    file: Hash,
    idempotency: &Idempotency,
) -> Result<(EnvironmentRecord, bool), Problem> {
    let claimed = ids::asked("environment", &file.to_string());
    idempotency.claim(app, &claimed).await?;
    let id = ids::of_content(PREFIX, file);
    if let Some(record) = app.catalogue.environment(&id).await? {
        return Ok((record, false));
    }
    let read = read(app, file).await?;
    let held = read.environment.held();
    let held = (!held.is_none()).then(|| serde_json::to_string(held));
    let [width, height] = read.size;
    let record = EnvironmentRecord {
        id,
        format: read.format.ending().to_owned(),
        width,
        height,
        file,
        held: held.transpose().map_err(Problem::internal)?,
    };
    let new = app.catalogue.add_environment(&record).await?;
    Ok((record, new))
}

/// Reads an upload as a panorama, from its file at a place to work at: who waits for one holds no bytes.
async fn read(app: &App, file: Hash) -> Result<EnvironmentFile, Problem> {
    let local = app.upload_at_hand(file).await?;
    let limits = app.config.limits;
    let read = move || {
        let bytes = std::fs::read(local.path()).map_err(Problem::internal)?;
        Environment::from_bytes(&bytes, &limits).map_err(|error| {
            Problem::new(PANORAMA.unusable, error.to_string())
                .at(Place::Body, "")
                .accepting(format!(
                    "{}, up to {} pixels",
                    PANORAMA.accepted, limits.pixels
                ))
        })
    };
    app.bench.run(read).await?
}

/// List panoramas, in the order they came.
#[utoipa::path(
    get, operation_id = "list_environments", path = "/v1/environments", tag = "environments", params(ListQuery),
    responses(
        (status = 200, description = "A page of environments", body = EnvironmentList),
        Problems,
    )
)]
pub async fn list(
    State(app): State<App>,
    Query(query): Query<ListQuery>,
) -> Result<Answer, Problem> {
    let limit = page::limit(query.limit)?;
    let begin = page::begin(query.cursor.as_deref())?;
    let page = app.catalogue.environments(begin, limit).await?;
    let environments = page.environments.into_iter();
    let list = EnvironmentList {
        environments: environments.map(EnvironmentDocument::from).collect(),
        next: page.next.map(page::cursor),
    };
    Ok(Answer::json(&list, Keep::Revalidated))
}

/// What is known about a panorama.
#[utoipa::path(
    get, operation_id = "show_environment", path = "/v1/environments/{id}", tag = "environments",
    params(("id" = String, Path, description = "Environment")),
    responses(
        (status = 200, description = "The environment", body = EnvironmentDocument),
        EnvironmentProblems,
    )
)]
pub async fn show(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    let record = app.environment(&id).await?;
    Ok(Answer::json(
        &EnvironmentDocument::from(record),
        Keep::Revalidated,
    ))
}

/// The file of a panorama: the very bytes that were uploaded.
#[utoipa::path(
    get, operation_id = "environment_file", path = "/v1/environments/{id}/file", tag = "environments",
    params(("id" = String, Path, description = "Environment")),
    responses(
        (status = 200, description = "The file", content((Vec<u8> = "image/vnd.radiance"), (Vec<u8> = "image/x-exr"))),
        EnvironmentProblems,
    )
)]
pub async fn file(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<Answer, Problem> {
    let record = app.environment(&id).await?;
    let blob = app.stream_of_environment(&record).await?;
    let format = EnvironmentFormat::ALL
        .into_iter()
        .find(|format| format.ending() == record.format)
        .ok_or_else(|| Problem::internal(format!("{id} is a file .{}", record.format)))?;
    let answer = Answer::blob(format.media_type(), record.file, blob, Keep::Own);
    Ok(answer.saved_as(&format!("{id}.{}", record.format)))
}

/// Delete a panorama. Pictures are no longer lit by it.
///
/// It is gone for everybody, also for others who uploaded the same bytes.
#[utoipa::path(
    delete, operation_id = "delete_environment", path = "/v1/environments/{id}", tag = "environments",
    params(("id" = String, Path, description = "Environment")),
    responses(
        (status = 204, description = "It is gone"),
        EnvironmentProblems,
    )
)]
pub async fn delete(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    runner::to_its_end(async move { app.forget_environment(&id).await }).await?;
    Ok(StatusCode::NO_CONTENT)
}
