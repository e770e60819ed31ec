//! What handlers take in: body, query and path, each refused with a problem that says where and what instead.

use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{FromRequest, FromRequestParts, Path, Request};
use axum::http::request::Parts;
use axum::http::{StatusCode, header};
use serde::de::DeserializeOwned;

use super::app::App;
use super::problem::{Kind, Problem};
use super::query;
use crate::workshop::accepted;

/// Most bytes of a JSON body; the router holds bodies to it.
pub const JSON_BYTES: usize = 64 << 10;

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

impl<T: DeserializeOwned> FromRequest<App> for Json<T> {
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

fn read_json<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    let mut reader = serde_json::Deserializer::from_slice(body);
    let value = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let parent = pointer(error.path());
        let cause = error.into_inner();
        let pointer = named_field(&cause)
            .filter(|_| parent.is_empty())
            .map_or(parent, |name| format!("/{name}"));
        match cause.classify() {
            serde_json::error::Category::Data => {
                let problem = Problem::value(pointer, sentence(&cause));
                match expected(&cause.to_string()) {
                    Some(accepted) => problem.accepting(accepted),
                    None => problem,
                }
            }
            _ => Problem::new(
                Kind::MalformedRequest,
                format!("The body is not JSON: {cause}."),
            ),
        }
    })?;
    reader.end().map_err(|error| {
        Problem::new(
            Kind::MalformedRequest,
            format!("The body is not JSON: {error}."),
        )
    })?;
    Ok(value)
}

/// What would be accepted, where a reader's message says it: "…, expected one of `a`, `b` at line 1 column 2".
fn expected(message: &str) -> Option<String> {
    if let Some(field) = message.strip_prefix("missing field `") {
        return field
            .split_once('`')
            .map(|(name, _)| format!("an object with the field {name}"));
    }
    let message = message
        .rsplit_once(" at line ")
        .map_or(message, |(what, _)| what);
    let Some((_, rest)) = message.rsplit_once(", expected ") else {
        return accepted(message).map(str::to_owned);
    };
    let what = rest.strip_prefix("one of ").unwrap_or(rest);
    Some(match what {
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number from 0".to_owned(),
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number".to_owned(),
        "f32" | "f64" => "a number".to_owned(),
        "a sequence" => "a list".to_owned(),
        what if what == "a map" || what.starts_with("struct ") => "an object".to_owned(),
        what => what.replace('`', ""),
    })
}

/// The field that an object lacks or has twice: the reader names it, but does not point at it.
fn named_field(cause: &serde_json::Error) -> Option<String> {
    let text = cause.to_string();
    let rest = text
        .strip_prefix("missing field `")
        .or_else(|| text.strip_prefix("duplicate field `"))?;
    rest.split_once('`').map(|(name, _)| name.to_owned())
}

fn sentence(cause: &serde_json::Error) -> String {
    let text = cause.to_string();
    let mut letters = text.chars();
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

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let pairs = query::pairs(parts.uri.query().unwrap_or(""))?;
        query::refuse_unknown(&pairs, query::names::<T>())?;
        query::read(&pairs).map(Self)
    }
}

impl<S: Send + Sync, A: DeserializeOwned, B: DeserializeOwned> FromRequestParts<S>
    for QueryOfTwo<A, B>
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let pairs = query::pairs(parts.uri.query().unwrap_or(""))?;
        query::refuse_unknown(&pairs, &[query::names::<A>(), query::names::<B>()].concat())?;
        Ok(Self(query::read(&pairs)?, query::read(&pairs)?))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for NoQuery {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        query::refuse_unknown(&query::pairs(parts.uri.query().unwrap_or(""))?, &[]).map(|()| Self)
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

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Order {
        #[allow(dead_code)] // read by the reader only
        paints: Vec<String>,
        #[allow(dead_code)] // read by the reader only
        clusters: Option<u32>,
        #[allow(dead_code)] // read by the reader only
        scene: Option<Scene>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Scene {
        Sphere,
        Panel,
    }

    #[test]
    fn a_json_problem_says_what_would_be_accepted() {
        let cases = [
            (r#"{"paints": 3}"#, "a list"),
            (
                r#"{"paints": [], "clusters": 5.5}"#,
                "a whole number from 0",
            ),
            (r#"{"paints": [], "scene": "cube"}"#, "sphere or panel"),
            (
                r#"{"paints": [], "surprise": 1}"#,
                "paints, clusters, scene",
            ),
            (r"{}", "an object with the field paints"),
            (r#""paints""#, "an object"),
        ];
        for (body, accepted) in cases {
            let problem = read_json::<Order>(body.as_bytes())
                .expect_err(body)
                .document(None);
            assert_eq!(problem.accepted.as_deref(), Some(accepted), "{body}");
        }
    }

    #[test]
    fn a_json_problem_points_at_the_field() {
        let cases = [
            (r#"{"paints": ["a", 3]}"#, 422, "/paints/1"),
            (r#"{"paints": [], "surprise": 1}"#, 422, "/surprise"),
            (r#"{"paints": [], "paints": []}"#, 422, "/paints"),
            (r"{}", 422, "/paints"),
            (r"[]", 422, ""),
        ];
        for (body, status, pointer) in cases {
            let problem = read_json::<Order>(body.as_bytes())
                .expect_err(body)
                .document(None);
            assert_eq!(
                (problem.status, problem.pointer.as_deref()),
                (status, Some(pointer)),
                "{body}: {problem:?}"
            );
        }
        for body in ["", "{", "[]x", "{\"paints\": []} x", "\u{1}"] {
            let problem = read_json::<Order>(body.as_bytes()).expect_err(body);
            assert!(
                matches!(problem.kind(), Kind::MalformedRequest | Kind::InvalidValue),
                "{body}: {problem:?}"
            );
        }
    }
}
