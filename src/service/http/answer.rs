//! Answers: bytes with a strong `ETag` of their content, and how long they may be kept.

use std::borrow::Cow;
use std::time::Duration;

use axum::body::Body;
use axum::http::{
    HeaderMap, HeaderName, HeaderValue, Response as HttpResponse, StatusCode, header,
};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use serde::Serialize;

use super::problem::Problem;
use crate::store::{BlobBytes, CachedResult, Hash};
use crate::workshop::Lap;

/// How long an answer may be kept by whoever gets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// For ever: the address is a hash of what made it.
    ForEver,
    /// By the caller alone, as long as it is asked again whether it is still there.
    Own,
    /// As long as it is asked again whether it changed.
    Revalidated,
    /// Not at all.
    Never,
}

impl Keep {
    /// No longer than until it is asked again whether it changed, by the same callers.
    #[must_use]
    pub const fn revalidated(self) -> Self {
        match self {
            Self::ForEver => Self::Revalidated,
            Self::Own | Self::Revalidated | Self::Never => self,
        }
    }
}

/// How accurate an answer's content is: it belongs to the content, so it is kept with it.
const ACCURACY: HeaderName = HeaderName::from_static("carpaint-accuracy");

/// An answer with its content.
#[derive(Debug)]
pub struct Answer {
    status: StatusCode,
    headers: HeaderMap,
    body: Body,
    stages: Stages,
    /// Why it is none after all.
    failed: Option<Problem>,
}

/// Time spent in the stages of an answer, for `Server-Timing`.
#[derive(Clone, Debug, Default)]
pub struct Stages(pub Vec<(Cow<'static, str>, Duration)>);

impl Answer {
    fn new(media_type: &'static str, hash: Hash, keep: Keep, body: Body) -> Self {
        let mut headers = HeaderMap::with_capacity(8);
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
        headers.insert(header::ETAG, etag(hash));
        let keep = match keep {
            Keep::ForEver => "public, max-age=31536000, immutable",
            Keep::Own => "private, no-cache",
            Keep::Revalidated => "no-cache",
            Keep::Never => "no-store",
        };
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(keep));
        Self {
            status: StatusCode::OK,
            headers,
            body,
            stages: Stages::default(),
            failed: None,
        }
    }

    /// An answer of these bytes.
    #[must_use]
    pub fn bytes(media_type: &'static str, bytes: impl Into<Bytes>, keep: Keep) -> Self {
        let bytes = bytes.into();
        Self::new(media_type, Hash::of(&bytes), keep, Body::from(bytes))
    }

    /// An answer of a result whose hash is known.
    #[must_use]
    pub fn result(media_type: &'static str, result: CachedResult, keep: Keep) -> Self {
        Self::new(media_type, result.hash, keep, Body::from(result.bytes))
    }

    /// An answer of a blob, a piece at a time.
    #[must_use]
    pub fn blob(media_type: &'static str, hash: Hash, blob: BlobBytes, keep: Keep) -> Self {
        let mut answer = Self::new(media_type, hash, keep, Body::from_stream(blob.pieces));
        answer
            .headers
            .insert(header::CONTENT_LENGTH, HeaderValue::from(blob.length));
        answer
    }

    /// A JSON answer.
    #[must_use]
    pub fn json(value: &impl Serialize, keep: Keep) -> Self {
        match serde_json::to_vec(value) {
            Ok(bytes) => Self::bytes("application/json", bytes, keep),
            Err(error) => Self {
                failed: Some(Problem::internal(error)),
                ..Self::bytes("application/json", Bytes::new(), Keep::Never)
            },
        }
    }

    /// With another status than 200.
    #[must_use]
    pub fn status(mut self, status: StatusCode) -> Self {
        self.status = status;
        self
    }

    /// With the address of what was made, or of the job that makes it.
    #[must_use]
    pub fn location(self, address: &str) -> Self {
        self.header(header::LOCATION, address)
    }

    /// With a name to save it under.
    #[must_use]
    pub fn saved_as(self, name: &str) -> Self {
        self.header(
            header::CONTENT_DISPOSITION,
            &format!("attachment; filename=\"{name}\""),
        )
    }

    /// With a header. A value that no header can have is left out.
    #[must_use]
    pub fn header(mut self, name: HeaderName, value: &str) -> Self {
        if let Ok(value) = HeaderValue::from_str(value) {
            self.headers.insert(name, value);
        }
        self
    }

    /// With how accurate the content is, where that is known.
    #[must_use]
    pub fn accuracy(self, accuracy: &str) -> Self {
        if accuracy.is_empty() {
            self
        } else {
            self.header(ACCURACY, accuracy)
        }
    }

    /// With the time that a stage took.
    #[must_use]
    pub fn stage(mut self, name: impl Into<Cow<'static, str>>, time: Duration) -> Self {
        self.stages.0.push((name.into(), time));
        self
    }

    /// With what each of these stages took.
    #[must_use]
    pub fn stages(mut self, stages: &[Lap]) -> Self {
        let named = stages.iter().map(|&(name, time)| (name.into(), time));
        self.stages.0.extend(named);
        self
    }
}

fn etag(hash: Hash) -> HeaderValue {
    // Half the hash tells contents apart just as surely.
    let hex = hash.to_string();
    HeaderValue::from_str(&format!("\"{}\"", &hex[..32]))
        .unwrap_or(HeaderValue::from_static("\"\""))
}

impl IntoResponse for Answer {
    fn into_response(self) -> Response {
        if let Some(problem) = self.failed {
            return problem.into_response();
        }
        let mut response = HttpResponse::new(self.body);
        *response.status_mut() = self.status;
        *response.headers_mut() = self.headers;
        if !self.stages.0.is_empty() {
            response.extensions_mut().insert(self.stages);
        }
        response
    }
}

/// Turns an answer that the caller has already into a 304.
pub fn unless_known(response: Response, if_none_match: Option<&HeaderValue>) -> Response {
    let (Some(known), Some(etag)) = (if_none_match, response.headers().get(header::ETAG)) else {
        return response;
    };
    if response.status() != StatusCode::OK || !names(known, etag) {
        return response;
    }
    let (mut parts, _) = response.into_parts();
    parts.status = StatusCode::NOT_MODIFIED;
    for gone in [
        header::CONTENT_TYPE,
        header::CONTENT_LENGTH,
        header::CONTENT_DISPOSITION,
    ] {
        parts.headers.remove(gone);
    }
    Response::from_parts(parts, Body::empty())
}

/// Weak comparison, as `If-None-Match` asks for.
fn names(known: &HeaderValue, etag: &HeaderValue) -> bool {
    let (Ok(known), Ok(etag)) = (known.to_str(), etag.to_str()) else {
        return false;
    };
    known
        .split(',')
        .map(str::trim)
        .any(|one| one == "*" || one.strip_prefix("W/").unwrap_or(one) == etag)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn if_none_match_is_a_list_of_weak_or_strong_tags() {
        let etag = HeaderValue::from_static("\"abc\"");
        for (known, same) in [
            ("\"abc\"", true),
            ("W/\"abc\"", true),
            ("*", true),
            ("\"x\", \"abc\"", true),
            ("abc", false),
            ("", false),
        ] {
            assert_eq!(
                names(&HeaderValue::from_str(known).expect("a header"), &etag),
                same,
                "{known}"
            );
        }
    }
}
