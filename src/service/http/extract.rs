//! What handlers take in: body, query and path, each refused with a problem that says where and what instead.

#[cfg(test)]
mod tests;

use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{FromRequest, FromRequestParts, Path, Request};
use axum::http::request::Parts;
use axum::http::{StatusCode, header};
use serde::de::{DeserializeOwned, IgnoredAny};
use utoipa::{IntoParams, PartialSchema};

use super::kind::Kind;
use super::problem::{Place, Problem};
use super::{accepted, query};
use crate::service::app::App;
use crate::workshop;

/// Most bytes of a JSON body; the router holds bodies to it.
pub const JSON_BYTES: usize = 64 << 10;

/// Most characters of a refused value that are told.
const LONGEST_GIVEN: usize = 80;

/// A JSON body. Its type must refuse unknown fields.
#[derive(Clone, Copy, Debug)]
pub struct Json<T>(pub T);

/// A query whose parameters are the fields of `T`, and no others.
#[derive(Clone, Copy, Debug)]
pub struct Query<T>(pub T);

/// A query whose parameters are the fields of `A` and those of `B`.
#[derive(Clone, Copy, Debug)]
pub struct QueryOfTwo<A, B>(pub A, pub B);

/// No query at all.
#[derive(Clone, Copy, Debug)]
pub struct NoQuery;

/// The parts of the address that the route names.
#[derive(Clone, Copy, Debug)]
pub struct Address<T>(pub T);

impl<T: DeserializeOwned + PartialSchema> FromRequest<App> for Json<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &App) -> Result<Self, Problem> {
        let media_type = request
            .headers()
            .get(header::CONTENT_TYPE)
            .and_then(|value| value.to_str().ok());
        let media_type = media_type
            .and_then(|value| value.split(';').next())
            .unwrap_or("")
            .trim();
        let is_json =
            media_type.eq_ignore_ascii_case("application/json") || media_type.ends_with("+json");
        if !is_json {
            let detail = format!("The body is of type {media_type:?}.");
            return Err(
                Problem::new(Kind::UnsupportedMediaType, detail).accepting("application/json")
            );
        }
        let time = state.config.body_time;
        let body = tokio::time::timeout(time, Bytes::from_request(request, state))
            .await
            .map_err(|_| {
                let detail = format!("The body did not end in {} seconds.", time.as_secs_f32());
                Problem::new(Kind::RequestTimeout, detail)
            })?
            .map_err(|error| broken_body(&error))?;
        read_json(&body).map(Self)
    }
}

fn broken_body(error: &BytesRejection) -> Problem {
    if error.status() == StatusCode::PAYLOAD_TOO_LARGE {
        return Problem::new(Kind::TooLarge, "The JSON in the body is too large.")
            .accepting(format!("up to {JSON_BYTES} bytes"));
    }
    Problem::new(
        Kind::MalformedRequest,
        "The body could not be read to its end.",
    )
}

fn read_json<T: DeserializeOwned + PartialSchema>(body: &[u8]) -> Result<T, Problem> {
    let whole = || accepted::in_body::<T>("").unwrap_or_else(|| "an object".to_owned());
    let malformed = |detail: String| {
        Problem::new(Kind::MalformedRequest, detail)
            .at(Place::Body, "")
            .accepting(format!("JSON: {}", whole()))
    };
    if body.iter().all(u8::is_ascii_whitespace) {
        return Err(malformed("The body is empty.".to_owned()));
    }
    // A body that is a list would be read as the fields in their order.
    let is_object = body.trim_ascii_start().starts_with(b"{");
    if !is_object && serde_json::from_slice::<IgnoredAny>(body).is_ok() {
        let detail = format!("The body is {}.", given(body, ""));
        return Err(Problem::value("", detail).accepting(whole()));
    }
    let mut reader = serde_json::Deserializer::from_slice(body);
    let value = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let parent = pointer(error.path());
        let cause = error.into_inner();
        let message = cause.to_string();
        let is_too_large = message.starts_with("number out of range");
        if !is_too_large && serde_json::from_slice::<IgnoredAny>(body).is_err() {
            return malformed(format!("The body is not JSON: {cause}."));
        }
        let message = message
            .rsplit_once(" at line ")
            .map_or(&*message, |(what, _)| what);
        let twice = field_after("duplicate field `", message);
        let pointer = match (twice, field_after("missing field `", message)) {
            (Some(name), _) => format!("{parent}/{name}"),
            (None, Some(name)) if parent.is_empty() => format!("/{name}"),
            _ => parent,
        };
        let name = match pointer.trim_start_matches('/') {
            "" => "The body",
            name => name,
        };
        let documented = || accepted::in_body::<T>(&pointer);
        let (detail, accepted) = if is_too_large {
            (format!("{name} is a number out of range."), documented())
        } else if let Some(accepted) = workshop::accepted(message) {
            (format!("{message}."), Some(accepted.to_owned()))
        } else if twice.is_some() {
            let accepted = "one of the two".to_owned();
            let last = given(body, &pointer);
            (
                format!("{name} is given twice, at last as {last}."),
                Some(accepted),
            )
        } else if is_about_names(message) {
            (sentence(message), expected(message))
        } else {
            // Told by its value, not by how a reader calls its type.
            let detail = format!("{name} is {}.", given(body, &pointer));
            (detail, documented().or_else(|| expected(message)))
        };
        let problem = Problem::value(pointer, detail);
        match accepted {
            Some(accepted) => problem.accepting(accepted),
            None => problem,
        }
    })?;
    reader
        .end()
        .map_err(|error| malformed(format!("The body is not JSON: {error}.")))?;
    Ok(value)
}

/// The value at a pointer as it was sent, no more of it than fits in a line.
fn given(body: &[u8], pointer: &str) -> String {
    let text = match serde_json::from_slice::<serde_json::Value>(body) {
        Ok(body) => body
            .pointer(pointer)
            .map_or("missing".to_owned(), ToString::to_string),
        // Numbers that are none, or lists in lists without end.
        Err(_) => String::from_utf8_lossy(body.trim_ascii()).into_owned(),
    };
    match text.char_indices().nth(LONGEST_GIVEN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

/// What would be accepted, where a reader's message says it: "…, expected one of `a`, `b`".
fn expected(message: &str) -> Option<String> {
    if let Some(name) = field_after("missing field `", message) {
        return Some(format!("an object with the field {name}"));
    }
    let (_, rest) = message.rsplit_once(", expected ")?;
    let what = rest.strip_prefix("one of ").unwrap_or(rest);
    Some(what.replace('`', ""))
}

/// Whether a reader's message is about the name of a field or of a choice.
fn is_about_names(message: &str) -> bool {
    ["missing field", "unknown field", "unknown variant"]
        .iter()
        .any(|words| message.starts_with(words))
}

/// The field that a message names after these words: the reader does not point at what is missing or there twice.
fn field_after<'a>(words: &str, message: &'a str) -> Option<&'a str> {
    let (name, _) = message.strip_prefix(words)?.split_once('`')?;
    Some(name)
}

fn sentence(message: &str) -> String {
    let mut letters = message.chars();
    letters.next().map_or(String::new(), |first| {
        format!("{}{}.", first.to_uppercase(), letters.as_str())
    })
}

/// RFC 6901.
fn pointer(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    path.iter()
        .map(|segment| match segment {
            Segment::Seq { index } => format!("/{index}"),
            Segment::Map { key } => format!("/{}", key.replace('~', "~0").replace('/', "~1")),
            Segment::Enum { variant } => format!("/{variant}"),
            Segment::Unknown => String::new(),
        })
        .collect()
}

/// The parameters of a query, none of which has another name than these.
fn known_pairs(parts: &Parts, names: &[&str]) -> Result<Vec<query::Pair>, Problem> {
    let pairs = query::pairs(parts.uri.query().unwrap_or(""))?;
    query::refuse_unknown(&pairs, names)?;
    Ok(pairs)
}

fn read_query<T: DeserializeOwned + IntoParams>(pairs: &[query::Pair]) -> Result<T, Problem> {
    query::read(pairs, accepted::in_query::<T>)
}

impl<S: Send + Sync, T: DeserializeOwned + IntoParams> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        read_query(&known_pairs(parts, query::names::<T>())?).map(Self)
    }
}

impl<S, A, B> FromRequestParts<S> for QueryOfTwo<A, B>
where
    S: Send + Sync,
    A: DeserializeOwned + IntoParams,
    B: DeserializeOwned + IntoParams,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let names = [query::names::<A>(), query::names::<B>()].concat();
        let pairs = known_pairs(parts, &names)?;
        Ok(Self(read_query(&pairs)?, read_query(&pairs)?))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for NoQuery {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        known_pairs(parts, &[]).map(|_| Self)
    }
}

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for Address<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        match Path::from_request_parts(parts, state).await {
            Ok(Path(address)) => Ok(Self(address)),
            Err(refused) => {
                let accepted = expected(&refused.body_text())
                    .unwrap_or_else(|| "the addresses listed in /openapi.json".to_owned());
                Err(
                    Problem::new(Kind::UnknownAddress, "There is nothing at this address.")
                        .accepting(accepted),
                )
            }
        }
    }
}
