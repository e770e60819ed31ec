//! Environments: panoramas come in, and light pictures in place of the built-in studio.

use axum::extract::{Request, State};
use axum::http::StatusCode;
use serde::Serialize;
use utoipa::ToSchema;

use crate::service::app::App;
use crate::service::http::{
    Address, Answer, EnvironmentProblems, Idempotency, Keep, Kind, NoQuery, Place, Problem,
    ProblemDocument, Problems, receiving,
};
use crate::service::ids;
use crate::service::surroundings::{PREFIX, unknown_environment};
use crate::service::work::runner;
use crate::store::{BlobWriter, EnvironmentRecord, Hash};

/// What an upload is to be.
const PANORAMA: receiving::Expected = receiving::Expected {
    archive: false,
    unusable: Kind::UnusableEnvironment,
    accepted: "a latitude-longitude panorama, Radiance .hdr or OpenEXR .exr",
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
    /// Where it is, and its file.
    pub links: EnvironmentLinks,
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
        }
    }
}

/// Upload a panorama that lights pictures.
///
/// The body is the file itself, a latitude-longitude picture in linear light: Radiance `.hdr` or OpenEXR `.exr`. The
/// same bytes have the same id. Pictures take it as `environment`.
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
    let asked = query.and_then(|_| receiving::check_headers(&app, &parts.headers));
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
    let file = {
        let _writing = app.removal.read().await;
        received.finish().await?.hash
    };
    let kept = named(&app, file, &idempotency).await;
    if kept.is_err() {
        app.forget_upload(file).await?;
    }
    kept
}

async fn named(
    app: &App,
    file: Hash,
    idempotency: &Idempotency,
) -> Result<(EnvironmentRecord, bool), Problem> {
    let claimed = ids::asked("environment", &file.to_string());
    idempotency.claim(app, &claimed).await?;
    // Not held while a place to compute is waited for.
    let read = app.panorama_of(file).await?;
    let _naming = app.removal.read().await;
    // Who uploaded and deleted the same bytes meanwhile took them away.
    let (Some(read), Some(_)) = (read, app.blobs.local(file).await?) else {
        return Err(Problem::overloaded());
    };
    let (environment, format) = read.map_err(|error| {
        let most = app.config.limits.pixels;
        Problem::new(PANORAMA.unusable, error.to_string())
            .at(Place::Body, "")
            .accepting(format!("{}, up to {most} pixels", PANORAMA.accepted))
    })?;
    let [width, height] = environment.size().unwrap_or_default();
    let record = EnvironmentRecord {
        id: ids::of_content(PREFIX, file),
        format: format.to_owned(),
        width: u32::try_from(width).map_err(Problem::internal)?,
        height: u32::try_from(height).map_err(Problem::internal)?,
        file,
    };
    let new = app.catalogue.add_environment(&record).await?;
    Ok((record, new))
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
    // An open blob can be read to its end, whatever becomes of its name.
    let blob = app.blobs.stream(record.file).await?;
    let blob = blob.ok_or_else(|| unknown_environment(&id))?;
    let media_type = match record.format.as_str() {
        "hdr" => "image/vnd.radiance",
        _ => "image/x-exr",
    };
    Ok(Answer::blob(media_type, record.file, blob, Keep::Own)
        .saved_as(&format!("{id}.{}", record.format)))
}

/// Delete a panorama. Pictures are no longer lit by it.
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
    app.forget_environment(&id).await?;
    Ok(StatusCode::NO_CONTENT)
}
