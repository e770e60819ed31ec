//! `/`: the studio's page and what it is made of.

use axum::http::{HeaderName, header};

use crate::service::http::{Answer, Keep};
use crate::studio;

/// Only what this service itself serves, pictures the page made of its answers, and its empty icon.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' blob: data:; base-uri 'none'";

/// `/`
pub async fn page() -> Answer {
    Answer::bytes("text/html; charset=utf-8", studio::PAGE, Keep::Revalidated)
        .header(header::CONTENT_SECURITY_POLICY, POLICY)
        .header(HeaderName::from_static("referrer-policy"), "no-referrer")
}

/// `/studio/page.js`
pub async fn script() -> Answer {
    Answer::bytes(
        "text/javascript; charset=utf-8",
        studio::SCRIPT,
        Keep::Revalidated,
    )
}

/// `/studio/page.css`
pub async fn style() -> Answer {
    Answer::bytes("text/css; charset=utf-8", studio::STYLE, Keep::Revalidated)
}
