//! The `Idempotency-Key` header: one key, one request.
//!
//! Every request that makes something is answered alike however often it is made, key or not. A key adds that another
//! request under the same key is refused instead of answered.

use axum::extract::FromRequestParts;
use axum::http::HeaderName;
use axum::http::request::Parts;

use super::kind::Kind;
use super::problem::{Place, Problem};
use crate::service::app::App;

const KEY: HeaderName = HeaderName::from_static("idempotency-key");

/// Longest key, characters.
const LONGEST: usize = 255;

/// Keys that are remembered; beyond them the oldest are forgotten.
const KEPT: u32 = 100_000;

/// The key of a request, where it has one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Idempotency(Option<String>);

impl<S: Send + Sync> FromRequestParts<S> for Idempotency {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let Some(value) = parts.headers.get(KEY) else {
            return Ok(Self(None));
        };
        let plain = |text: &&str| {
            (1..=LONGEST).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_graphic())
        };
        match value.to_str().ok().filter(plain) {
            Some(text) => Ok(Self(Some(text.to_owned()))),
            None => Err(Problem::new(
                Kind::InvalidParameter,
                "The idempotency key is empty, too long, or not plain.",
            )
            .at(Place::Header, "/Idempotency-Key")
            .accepting(format!("1 to {LONGEST} printable characters of ASCII"))),
        }
    }
}

impl Idempotency {
    /// Ties the key to what the request makes, which is named by the hash of the whole request.
    ///
    /// # Errors
    ///
    /// [`Kind::KeyUsed`] when it is tied to something else.
    pub async fn claim(&self, app: &App, subject: &str) -> Result<(), Problem> {
        let Some(key) = &self.0 else {
            return Ok(());
        };
        let tied = app.catalogue.tie_key(key, subject, KEPT).await?;
        if tied == subject {
            return Ok(());
        }
        let detail = format!("The key {key:?} was used for another request.");
        Err(Problem::new(Kind::KeyUsed, detail)
            .at(Place::Header, "/Idempotency-Key")
            .accepting("the same request again, or a new key"))
    }
}
