//! Problems: the only place where errors become HTTP (RFC 9457).
//!
//! Whatever goes wrong, the answer is `application/problem+json` with a stable `type`, what is wrong in this case, where
//! it stands, what would be accepted, and the request's id. A 5xx says nothing about the inside; that goes to the log
//! under the same id.

use std::borrow::Cow;

use axum::body::Body;
use axum::http::{HeaderValue, Response as HttpResponse, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::kind::Kind;
use super::origins;
use crate::service::work::{Fault, WorkshopError};
use crate::store::StoreError;
use crate::workshop::accepted;

/// Media type of a problem.
pub const MEDIA_TYPE: &str = "application/problem+json";

/// Where the offending field stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// JSON body.
    Body,
    /// Query of the address.
    Query,
    /// A part of the address.
    Path,
    /// A header.
    Header,
}

/// Something that went wrong with a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    kind: Kind,
    detail: String,
    field: Option<(Place, String)>,
    file: Option<String>,
    accepted: Option<String>,
}

/// A problem as it is told, RFC 9457.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ProblemDocument {
    /// Stable address of the kind of problem.
    #[serde(rename = "type")]
    #[schema(format = "uri-reference", example = "/problems/invalid-parameter")]
    pub kind: String,
    /// The kind of problem in words.
    pub title: Cow<'static, str>,
    /// HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What is wrong this time.
    pub detail: String,
    /// The offending field as a JSON pointer (RFC 6901); for a query, of the object of its parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "/paints/1")]
    pub pointer: Option<String>,
    /// The offending file in an uploaded package; `pointer` points into it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "paint.json")]
    pub file: Option<String>,
    /// Where the field stands.
    #[serde(default, skip_serializing_if = "Option::is_none", rename = "in")]
    pub place: Option<Place>,
    /// What would be accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accepted: Option<String>,
    /// Id of the request, as in the `X-Request-Id` header and the log.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request_id: Option<String>,
}

impl Problem {
    /// A problem of this kind.
    #[must_use]
    pub fn new(kind: Kind, detail: impl Into<String>) -> Self {
        Self {
            kind,
            detail: detail.into(),
            field: None,
            file: None,
            accepted: None,
        }
    }

    /// A parameter in the query that is not accepted.
    #[must_use]
    pub fn parameter(name: &str, detail: impl Into<String>) -> Self {
        Self::new(Kind::InvalidParameter, detail).at(Place::Query, format!("/{name}"))
    }

    /// A value in the body that is not accepted.
    #[must_use]
    pub fn value(pointer: impl Into<String>, detail: impl Into<String>) -> Self {
        Self::new(Kind::InvalidValue, detail).at(Place::Body, pointer)
    }

    /// Something on our side; `cause` goes to the log, not to the caller.
    #[must_use]
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        tracing::error!(%cause, "internal error");
        Self::new(
            Kind::Internal,
            "The request could not be answered. It may work when it is made again.",
        )
    }

    /// Too much work waits.
    #[must_use]
    pub fn overloaded() -> Self {
        Self::new(
            Kind::Overloaded,
            "Too many requests wait for the processors. Ask again a little later.",
        )
    }

    /// Says where the offending field stands.
    #[must_use]
    pub fn at(mut self, place: Place, pointer: impl Into<String>) -> Self {
        self.field = Some((place, pointer.into()));
        self
    }

    /// Says what would be accepted.
    #[must_use]
    pub fn accepting(mut self, accepted: impl Into<String>) -> Self {
        self.accepted = Some(accepted.into());
        self
    }

    /// The same problem where parameters stand in the body.
    #[must_use]
    pub fn in_body(mut self) -> Self {
        if self.kind == Kind::InvalidParameter {
            self.kind = Kind::InvalidValue;
            self.field = self.field.map(|(_, pointer)| (Place::Body, pointer));
        }
        self
    }

    /// The same problem of what a value in the body names.
    #[must_use]
    pub fn naming_value(self, field: &str) -> Self {
        Self {
            kind: Kind::InvalidValue,
            field: Some((Place::Body, format!("/{field}"))),
            ..self
        }
    }

    /// What kind of problem it is.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        self.kind
    }

    /// As it is told to the one who made this request.
    #[must_use]
    pub fn document(&self, request_id: Option<&str>) -> ProblemDocument {
        let (_, title, status) = self.kind.told();
        let (place, pointer) = self.field.clone().unzip();
        ProblemDocument {
            kind: self.kind.address(),
            title: Cow::Borrowed(title),
            status: status.as_u16(),
            detail: self.detail.clone(),
            pointer,
            file: self.file.clone(),
            place,
            accepted: self.accepted.clone(),
            request_id: request_id.map(str::to_owned),
        }
    }

    /// The problem of a document that was stored.
    #[must_use]
    pub fn of_document(document: ProblemDocument) -> Self {
        let kind = Kind::ALL
            .into_iter()
            .find(|kind| kind.address() == document.kind)
            .unwrap_or(Kind::Internal);
        Self {
            kind,
            detail: document.detail,
            field: document.place.zip(document.pointer),
            file: document.file,
            accepted: document.accepted,
        }
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        if error.is_full() {
            tracing::error!(%error, "storage is full");
            return Self::new(
                Kind::StorageFull,
                "The disk of this service is full. Nothing was kept of the request.",
            );
        }
        Self::internal(error)
    }
}

/// What goes wrong in the workshop, told by where it came in.
impl Problem {
    /// The problem with an upload, or with the query that came with it.
    #[must_use]
    pub fn of_upload(error: WorkshopError) -> Self {
        if error.fault != Fault::Input {
            return Self::of_query(error);
        }
        let problem = Self {
            file: error.inside.file.clone(),
            ..Self::new(Kind::UnusableMeasurement, &*error.message)
        };
        let problem = match (&error.field, &error.inside.pointer) {
            (Some(field), _) => problem.at(Place::Query, format!("/{field}")),
            (None, Some(pointer)) => problem.at(Place::Body, pointer),
            // The body, or the file in it, as a whole.
            (None, None) => problem.at(Place::Body, ""),
        };
        problem.accepting_as(&error)
    }

    /// The problem with a query.
    #[must_use]
    pub fn of_query(error: WorkshopError) -> Self {
        let problem = match (error.fault, &error.field) {
            (Fault::Internal | Fault::Output, _) => return Self::internal(error.message),
            (_, Some(field)) => Self::parameter(field, &*error.message),
            (_, None) => Self::new(Kind::InvalidParameter, &*error.message),
        };
        problem.accepting_as(&error)
    }

    /// The problem with a JSON body.
    #[must_use]
    pub fn of_body(error: WorkshopError) -> Self {
        let problem = match (error.fault, &error.field) {
            (Fault::Internal | Fault::Output, _) => return Self::internal(error.message),
            (_, Some(field)) => Self::value(format!("/{field}"), &*error.message),
            (_, None) => Self::new(Kind::InvalidValue, &*error.message),
        };
        problem.accepting_as(&error)
    }

    /// Says what would be accepted, where the error's message does.
    fn accepting_as(self, error: &WorkshopError) -> Self {
        match accepted(&error.message) {
            Some(what) => self.accepting(what),
            None => self,
        }
    }
}

impl IntoResponse for Problem {
    /// A response without a body: [`finish`] writes it, which knows the request's id.
    fn into_response(self) -> Response {
        let mut response = self.kind.told().2.into_response();
        response.extensions_mut().insert(self);
        response
    }
}

/// Gives every failed response its body: that of its problem, or of its status where something else refused.
pub fn finish(mut response: Response, request_id: &str) -> Response {
    let status = response.status();
    if !status.is_client_error() && !status.is_server_error() {
        return response;
    }
    let problem = response
        .extensions_mut()
        .remove::<Problem>()
        .unwrap_or_else(|| of_status(&response));
    let document = problem.document(Some(request_id));
    let body = serde_json::to_vec(&document).unwrap_or_else(|error| {
        tracing::error!(%error, "a problem does not serialise");
        br#"{"type":"/problems/internal","status":500}"#.to_vec()
    });
    let mut finished = HttpResponse::new(Body::from(body));
    *finished.status_mut() = problem.kind.told().2;
    let headers = finished.headers_mut();
    for (name, value) in response.headers() {
        let kept = [header::ALLOW, header::RETRY_AFTER, header::LOCATION].contains(name)
            || origins::is_told(name);
        if kept {
            headers.append(name, value.clone());
        }
    }
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if problem.kind == Kind::Overloaded {
        headers.insert(header::RETRY_AFTER, HeaderValue::from_static("2"));
    }
    finished
}

/// What a refusal means that came without a problem: from the router, or from the HTTP library.
fn of_status(response: &Response) -> Problem {
    match response.status() {
        StatusCode::NOT_FOUND => {
            Problem::new(Kind::UnknownAddress, "There is nothing at this address.")
                .accepting("the addresses listed in /openapi.json")
        }
        StatusCode::METHOD_NOT_ALLOWED => Problem::new(
            Kind::MethodNotAllowed,
            "This address does not take this method.",
        ),
        StatusCode::REQUEST_TIMEOUT => {
            Problem::new(Kind::RequestTimeout, "The request did not come in time.")
        }
        StatusCode::PAYLOAD_TOO_LARGE => {
            Problem::new(Kind::TooLarge, "The request's body is too large.")
        }
        StatusCode::UNSUPPORTED_MEDIA_TYPE => Problem::new(
            Kind::UnsupportedMediaType,
            "A body of this type is not read here.",
        ),
        status if status.is_client_error() => {
            Problem::new(Kind::MalformedRequest, "The request was refused.")
        }
        status => Problem::internal(format!("a response of status {status} without a problem")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_problem_reads_back_from_its_document() {
        let problem = Problem::value("/paints/1", "no such paint").accepting("ids");
        let text = serde_json::to_string(&problem.document(None)).expect("serialises");
        assert_eq!(
            Problem::of_document(serde_json::from_str(&text).expect("reads back")),
            problem
        );
    }
}
