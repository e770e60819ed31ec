//! Pages of other addresses that call the service from a browser.
//!
//! A browser keeps an answer from a page of another origin unless the answer allows it (the Fetch standard's CORS
//! protocol), but it sends what a form could have sent, an upload as well. Whoever reaches the service may do all that it
//! does, so nothing is uploaded, changed or deleted for pages that the operator did not name. Browsers say whose page
//! sent a request: by `Sec-Fetch-Site` where they trust the address (https, and this machine), by `Origin` otherwise,
//! which is then held against `Host`. Programs say neither and are not asked. A page that comes to be served under the
//! service's own name (DNS rebinding) is one of its own.

use std::str::FromStr;

use axum::extract::{Request, State};
use axum::http::{HeaderName, HeaderValue, Method, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use tower_http::cors::{AllowOrigin, CorsLayer};

use super::{Kind, Problem};
use crate::service::app::App;

/// An origin whose pages may call, or all of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Pages of any address.
    Any,
    /// Scheme, host and, where it is not the scheme's own, port.
    One(HeaderValue),
}

impl FromStr for Origin {
    type Err = String;

    /// Reads `*` or an origin as browsers write it.
    ///
    /// # Errors
    ///
    /// What would be accepted.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "*" {
            return Ok(Self::Any);
        }
        let wrong = || {
            "accepted is * for all, or scheme, host and port alone, such as https://cars.example or http://localhost:3000"
                .to_owned()
        };
        let uri: Uri = text.parse().map_err(|_| wrong())?;
        let scheme = uri.scheme_str().filter(|s| ["http", "https"].contains(s));
        let written = scheme
            .zip(uri.authority())
            .map(|(scheme, authority)| format!("{scheme}://{authority}"));
        // Browsers write neither a path, nor a user, nor the scheme's own port, and hosts in small letters: an origin of
        // another form meets none.
        let own_port = match scheme {
            Some("https") => ":443",
            _ => ":80",
        };
        let as_browsers_do = written.as_deref() == Some(text)
            && !text.ends_with(own_port)
            && !text.ends_with(':')
            && !text.contains(|c: char| c.is_ascii_uppercase() || "@*".contains(c));
        if !as_browsers_do {
            return Err(wrong());
        }
        HeaderValue::from_str(text)
            .map(Self::One)
            .map_err(|_| wrong())
    }
}

/// Whether a header of an answer tells a browser who may read it.
pub fn is_told(name: &HeaderName) -> bool {
    name == header::VARY || name.as_str().starts_with("access-control-")
}

/// Refuses what a browser sends for a page of another address, unless that may.
pub async fn held_to_pages(State(app): State<App>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let elsewhere = match (headers.get("sec-fetch-site"), headers.get(header::ORIGIN)) {
        (Some(site), _) => site == "cross-site" || site == "same-site",
        (None, Some(origin)) => !is_of_host(origin, headers.get(header::HOST)),
        (None, None) => false,
    };
    if !elsewhere || request.method().is_safe() {
        return next.run(request).await;
    }
    let named = headers
        .get(header::ORIGIN)
        .is_some_and(|origin| names(&app.config.origins, origin));
    if named && request.method() == Method::POST {
        return next.run(request).await;
    }
    let (detail, accepted) = if named {
        (
            "Pages of other addresses change and delete nothing.",
            "GET, HEAD and POST",
        )
    } else {
        (
            "A browser sent this for a page of another address.",
            "pages of this address, programs, and origins named by serve --allow-origin",
        )
    };
    Problem::new(Kind::OtherOrigin, detail)
        .accepting(accepted)
        .into_response()
}

/// Whether a page of this origin came from the host that the request names.
fn is_of_host(origin: &HeaderValue, host: Option<&HeaderValue>) -> bool {
    let text = |value: &HeaderValue| value.to_str().ok().map(str::to_ascii_lowercase);
    let authority = |origin: &str| origin.split_once("://").map(|(_, rest)| rest.to_owned());
    let origin = text(origin).as_deref().and_then(authority);
    origin.is_some() && origin == host.and_then(text)
}

fn names(origins: &[Origin], origin: &HeaderValue) -> bool {
    origins.iter().any(|own| match own {
        Origin::Any => true,
        Origin::One(value) => value == origin,
    })
}

/// What tells browsers who may call and read which headers. Paints are asked for and made from other pages; they are
/// changed and deleted from none.
pub fn cors(origins: &[Origin]) -> CorsLayer {
    let allowed = if origins.contains(&Origin::Any) {
        AllowOrigin::any()
    } else {
        AllowOrigin::list(origins.iter().filter_map(|origin| match origin {
            Origin::Any => None,
            Origin::One(value) => Some(value.clone()),
        }))
    };
    CorsLayer::new()
        .allow_origin(allowed)
        .allow_methods([Method::GET, Method::HEAD, Method::POST])
        .allow_headers([
            header::CONTENT_TYPE,
            header::IF_NONE_MATCH,
            HeaderName::from_static("prefer"),
            HeaderName::from_static("idempotency-key"),
            HeaderName::from_static("x-request-id"),
        ])
        .expose_headers([
            header::ETAG,
            header::LOCATION,
            header::RETRY_AFTER,
            header::CONTENT_DISPOSITION,
            HeaderName::from_static("server-timing"),
            HeaderName::from_static("preference-applied"),
            HeaderName::from_static("x-request-id"),
            HeaderName::from_static("carpaint-accuracy"),
            HeaderName::from_static("carpaint-target"),
            HeaderName::from_static("carpaint-study"),
        ])
        .max_age(std::time::Duration::from_hours(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_read_as_browsers_write_it() {
        for origin in [
            "https://cars.example",
            "http://localhost:3000",
            "http://[::1]:8080",
        ] {
            let read: Origin = origin.parse().expect("an origin");
            assert_eq!(read, Origin::One(HeaderValue::from_static(origin)));
        }
        assert_eq!("*".parse(), Ok(Origin::Any));
        for wrong in [
            "",
            "cars.example",
            "https://cars.example/",
            "https://cars.example/shop",
            "https://Cars.example",
            "https://me@cars.example",
            "file:///home",
            "null",
            "https://*.example",
            "https://cars.example:443",
            "http://cars.example:80",
            "https://cars.example:",
            "ftp://cars.example",
        ] {
            let told = wrong.parse::<Origin>().expect_err(wrong);
            assert!(told.contains("https://cars.example"), "{told}");
        }
    }
}
