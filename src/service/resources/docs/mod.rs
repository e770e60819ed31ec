//! The documentation: `/openapi.json`, a page that shows it without the internet, and what each problem means.

use std::collections::HashMap;
use std::sync::LazyLock;

use axum::extract::MatchedPath;
use axum::http::{HeaderName, Method, header};
use utoipa::OpenApi;
use utoipa::openapi::PathItem;

use super::{
    accuracy, blend_bundles, blends, documents, environments, estimates, jobs, operations, paints,
    previews, readings, realisations, uploads, visibility,
};
use crate::service::http::{Address, Answer, Keep, Kind, Problem, ProblemDocument};
use crate::service::parameters::{KnobsDocument, ProfileDocument};
use crate::service::work::{Format, JobDocument, Layout, Light, Shape, Show, ThetaHSpacing};

/// Only what this service itself serves.
const POLICY: &str =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; base-uri 'none'";

/// The interface as OpenAPI 3.1.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "carpaint",
        description = "Material synthesis for car paints: upload measurements, blend them, take realisations and pictures.\n\nEvery answer has `Server-Timing` (the stages of what was computed for it, then the whole of that with its waiting, then `total`) and `X-Request-Id`, and what can be asked for again a strong `ETag`; `If-None-Match` is answered with 304. Every error is `application/problem+json` (RFC 9457). Unknown fields and parameters are refused. Requests that cannot be taken on now are answered with 503 and `Retry-After`.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")
    ),
    paths(
        uploads::upload, paints::list, paints::show, paints::file, paints::measurement, paints::delete, visibility::change,
        blends::create, blends::show, blends::delete, blend_bundles::bundle,
        readings::show, readings::table, readings::document, realisations::of_blend, realisations::of_paint,
        previews::of_blend, previews::of_paint, previews::create,
        environments::upload, environments::list, environments::show, environments::file, environments::delete,
        estimates::create, estimates::of_upload, accuracy::show,
        jobs::show, jobs::events, jobs::cancel,
        operations::healthz, operations::readyz, operations::metrics,
    ),
    components(schemas(
        documents::PaintDocument, documents::PaintList, documents::PaintSummary, documents::BlendDocument, environments::EnvironmentDocument, environments::EnvironmentLinks, environments::EnvironmentList, environments::HeldLight,
        blends::BlendOrder, ProfileDocument, KnobsDocument, estimates::EstimateOrder, estimates::EstimateDocument, JobDocument, operations::Health, ProblemDocument,
        Layout, ThetaHSpacing, Format, previews::PreviewFormat, previews::PreviewOrder, Light, Shape, Show,
    )),
    tags(
        (name = "paints", description = "Uploads become paints"),
        (name = "blends", description = "Correspondences of two to five paints"),
        (name = "realisations", description = "Paints, and blends at some weights, as files"),
        (name = "previews", description = "The same as pictures"),
        (name = "environments", description = "Panoramas that light pictures"),
        (name = "accuracy", description = "What accuracy costs, and what a request will"),
        (name = "jobs", description = "Work that takes longer"),
        (name = "operations", description = "For the operator"),
    )
)]
#[derive(Clone, Copy, Debug)]
pub struct Interface;

/// The interface as it is served and committed.
///
/// # Panics
///
/// Never: the interface is plain data.
#[must_use]
pub fn interface() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        let mut text = Interface::openapi()
            .to_pretty_json()
            .expect("plain data serialises");
        text.push('\n');
        text
    });
    &TEXT
}

/// What answers a method that an address does not take.
pub async fn method_not_allowed(path: MatchedPath, method: Method) -> Problem {
    static METHODS: LazyLock<HashMap<String, String>> = LazyLock::new(|| {
        let paths = Interface::openapi().paths.paths.into_iter();
        paths.map(|(path, item)| (path, methods(&item))).collect()
    });
    let accepted = METHODS
        .get(path.as_str())
        .map_or("GET, HEAD", String::as_str);
    let detail = format!("{} does not take {method}.", path.as_str());
    Problem::new(Kind::MethodNotAllowed, detail).accepting(accepted)
}

fn methods(item: &PathItem) -> String {
    let known = [
        (&item.get, "GET, HEAD"),
        (&item.post, "POST"),
        (&item.patch, "PATCH"),
        (&item.delete, "DELETE"),
    ];
    known
        .iter()
        .filter(|(operation, _)| operation.is_some())
        .map(|(_, name)| *name)
        .collect::<Vec<_>>()
        .join(", ")
}

/// `/openapi.json`
pub async fn openapi() -> Answer {
    Answer::bytes("application/json", interface(), Keep::Revalidated)
}

/// `/docs`
pub async fn page() -> Answer {
    Answer::bytes(
        "text/html; charset=utf-8",
        &include_bytes!("page.html")[..],
        Keep::Revalidated,
    )
    .header(header::CONTENT_SECURITY_POLICY, POLICY)
    .header(HeaderName::from_static("referrer-policy"), "no-referrer")
}

/// `/docs/page.js`
pub async fn script() -> Answer {
    Answer::bytes(
        "text/javascript; charset=utf-8",
        &include_bytes!("page.js")[..],
        Keep::Revalidated,
    )
}

/// `/docs/page.css`
pub async fn style() -> Answer {
    Answer::bytes(
        "text/css; charset=utf-8",
        &include_bytes!("page.css")[..],
        Keep::Revalidated,
    )
}

/// `/problems/{kind}`: what the `type` of a problem means.
pub async fn problem(Address(name): Address<String>) -> Result<Answer, Problem> {
    let kind = Kind::ALL.into_iter().find(|kind| kind.told().0 == name);
    let (_, title, status) = kind.map(Kind::told).ok_or_else(|| {
        let names: Vec<&str> = Kind::ALL.into_iter().map(|kind| kind.told().0).collect();
        Problem::new(
            Kind::UnknownAddress,
            format!("There is no problem called {name:?}."),
        )
        .accepting(names.join(", "))
    })?;
    let told = serde_json::json!({ "type": format!("/problems/{name}"), "title": title, "status": status.as_u16() });
    Ok(Answer::json(&told, Keep::Revalidated))
}
