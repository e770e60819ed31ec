//! The service end to end, over real connections on a port of its own.

// A test tells one story from its begin to its end.
#![allow(clippy::too_many_lines)]

mod bundle;
mod client;
mod fields;
mod house;
mod kill;
mod readings;
mod real;

use std::time::{Duration, Instant};

use carpaint::service::ServiceConfig;
use client::raw;
use futures::future::join_all;
use house::House;
use serde_json::json;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("temporary folder")
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_becomes_a_paint_that_can_be_read_taken_back_and_deleted() {
    let data = folder();
    let house = House::open(data.path()).await;
    let upload = vec![b's'; 3_000_000];
    let headers = [("Prefer", "wait=30"), ("Content-Type", "application/zip")];
    let made = house
        .ask("POST", "/v1/paints?name=Silver%20one", &headers, &upload)
        .await;
    assert_eq!(made.status, 201, "{made:?}");
    assert_eq!(made.header("preference-applied"), Some("wait=30"));
    let id = made.json()["id"].as_str().expect("an id").to_owned();
    let address = format!("/v1/paints/{id}");
    assert_eq!(made.header("location"), Some(address.as_str()));
    assert_eq!(made.json()["name"], "Silver one");

    let again = house
        .ask("POST", "/v1/paints?name=Silver%20one", &headers, &upload)
        .await;
    assert_eq!(
        (again.status, again.json()),
        (200, made.json()),
        "the same upload is the same paint"
    );
    let other = house
        .ask(
            "POST",
            "/v1/paints?name=Silver%20one&clusters=24",
            &headers,
            &upload,
        )
        .await;
    assert_ne!(
        other.json()["id"],
        made.json()["id"],
        "other options are another paint"
    );
    assert_eq!(house.count("carpaint_paints_fitted_total").await, 2.0);

    let shown = house.get(&address).await;
    assert_eq!((shown.status, shown.etag()), (200, made.etag()));
    assert_eq!(
        house.get(&format!("{address}/measurement")).await.body,
        upload
    );
    let file = house.get(&format!("{address}/paint")).await;
    assert!(file.body.starts_with(b"carpaint"));
    let list = house.get("/v1/paints?q=SILVER&limit=1").await.json();
    assert_eq!(list["paints"][0]["id"], id.as_str());
    let next = house
        .get(&format!(
            "/v1/paints?limit=1&cursor={}",
            list["next"].as_str().expect("a cursor")
        ))
        .await
        .json();
    assert_eq!(
        (&next["paints"][0]["id"], &next["next"]),
        (&other.json()["id"], &serde_json::Value::Null)
    );

    assert_eq!(house.ask("DELETE", &address, &[], b"").await.status, 204);
    house.get(&address).await.problem(404, "unknown-paint");
    house
        .get(&format!("{address}/preview.png"))
        .await
        .problem(404, "unknown-paint");
    house
        .ask("DELETE", &address, &[], b"")
        .await
        .problem(404, "unknown-paint");
    let kept = format!(
        "/v1/paints/{}/measurement",
        other.json()["id"].as_str().expect("an id")
    );
    assert_eq!(
        house.get(&kept).await.body,
        upload,
        "another paint still has the same measurement"
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn profiles_are_names_or_knobs_and_targets_are_answered_with_what_was_picked() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = |more: serde_json::Value| {
        let mut body = json!({ "paints": [a, b] });
        body.as_object_mut()
            .expect("an object")
            .extend(more.as_object().expect("an object").clone());
        body.to_string()
    };
    let by_name = house
        .post_json("/v1/blends", &blend(json!({ "profile": "draft" })))
        .await;
    let knobs = json!({ "profile": { "preset": "draft", "samples_per_pixel": 16 } });
    let by_knobs = house.post_json("/v1/blends", &blend(knobs)).await;
    assert_eq!(
        by_name.json()["id"],
        by_knobs.json()["id"],
        "the same settings are the same blend"
    );
    assert_eq!(by_knobs.json()["request"]["profile"], "draft");
    let other = json!({ "profile": { "transport": "sinkhorn", "epsilon": 0.1 } });
    let other = house.post_json("/v1/blends", &blend(other)).await.json();
    assert_ne!(other["id"], by_name.json()["id"]);
    assert_eq!(other["request"]["knobs"]["epsilon"], 0.1);
    for (profile, pointer, accepted) in [
        (json!({ "clusterz": 3 }), "/profile/clusterz", "clusters"),
        (
            json!({ "transport": "magic" }),
            "/profile/transport",
            "sinkhorn",
        ),
        (
            json!({ "samples_per_pixel": 0 }),
            "/profile/samples_per_pixel",
            "1 to 4096",
        ),
        (json!({ "epsilon": 0.1 }), "/profile/epsilon", "sinkhorn"),
        (json!("best"), "/profile", "reference"),
    ] {
        let answer = house
            .post_json("/v1/blends", &blend(json!({ "profile": profile })))
            .await;
        let problem = answer.problem(422, "invalid-value");
        assert_eq!(problem["pointer"], pointer, "{problem}");
        assert!(problem.to_string().contains(accepted), "{problem}");
    }

    let fine = house
        .post_json("/v1/blends", &blend(json!({ "max_error": 0.5 })))
        .await;
    let said = fine
        .header("carpaint-target")
        .expect("what was picked")
        .to_owned();
    assert!(said.starts_with("met; profile=reference"), "{said}");
    assert_eq!(fine.json()["request"]["profile"], "reference");
    let beside = json!({ "max_error": 0.5, "profile": "draft" });
    let problem = house
        .post_json("/v1/blends", &blend(beside))
        .await
        .problem(422, "invalid-value");
    assert_eq!(problem["pointer"], "/max_error");
    let negative = house
        .get(&format!("/v1/paints/{a}/preview.png?max_seconds=-1"))
        .await;
    assert_eq!(
        negative.problem(400, "invalid-parameter")["pointer"],
        "/max_seconds"
    );
    let quick = house
        .get(&format!(
            "/v1/paints/{a}/preview.png?max_seconds=1&size=8x8"
        ))
        .await;
    assert_eq!(
        (quick.status, quick.header("carpaint-accuracy")),
        (200, Some("sampling-mean-de2000=0.5"))
    );
    assert!(
        quick
            .header("carpaint-target")
            .is_some_and(|t| t.contains("draft")),
        "{quick:?}"
    );

    let estimate = json!({ "work": "blend", "paints": [a, b], "profile": "draft" }).to_string();
    let estimate = house.post_json("/v1/estimates", &estimate).await;
    assert_eq!(
        (estimate.status, &estimate.json()["seconds"]),
        (200, &json!(0.5))
    );
    assert_eq!(estimate.json()["profile"], "draft");
    let target = json!({ "work": "preview", "paint": a, "max_error": 0.1 }).to_string();
    assert_eq!(
        house.post_json("/v1/estimates", &target).await.json()["met"],
        true
    );
    let nobody = json!({ "work": "realise", "paint": format!("p_{}", "0".repeat(32)) }).to_string();
    let problem = house
        .post_json("/v1/estimates", &nobody)
        .await
        .problem(422, "invalid-value");
    assert_eq!(problem["pointer"], "/paint");

    let shipped = house.get("/v1/accuracy").await;
    assert_eq!(shipped.json()["format"], "carpaint study");
    std::fs::write(
        data.path().join("study.json"),
        br#"{"format": "of this house"}"#,
    )
    .expect("written");
    assert_eq!(
        house.get("/v1/accuracy").await.json()["format"],
        "of this house"
    );
    house.close().await;
}

/// A request and what refuses it: method, address, content type, body; status, kind, pointer.
type Refusal<'a> = (
    &'a str,
    String,
    &'a str,
    Vec<u8>,
    u16,
    &'a str,
    Option<&'a str>,
);

#[tokio::test(flavor = "multi_thread")]
#[allow(clippy::too_many_lines)] // one line a refusal
async fn every_refusal_is_a_problem_that_says_where_and_what_instead() {
    let data = folder();
    let mut config = ServiceConfig::new(data.path().to_owned());
    config.limits.bytes = 5_000_000;
    let house = House::with(config).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = format!("/v1/blends/{}", house.blend(&[&a, &b]).await);
    let real = format!("{blend}/realisation.zip");
    let nobody = format!("p_{}", "0".repeat(32));
    let json = |value: serde_json::Value| value.to_string().into_bytes();
    let large = vec![b's'; 5_000_001];

    let table: Vec<Refusal<'_>> = vec![
        (
            "GET",
            "/v1/nowhere".into(),
            "",
            vec![],
            404,
            "unknown-address",
            None,
        ),
        (
            "GET",
            "/v1/paints/p_nope".into(),
            "",
            vec![],
            404,
            "unknown-paint",
            None,
        ),
        (
            "GET",
            format!("/v1/paints/{nobody}"),
            "",
            vec![],
            404,
            "unknown-paint",
            None,
        ),
        (
            "GET",
            format!("/v1/paints/{a}%00"),
            "",
            vec![],
            404,
            "unknown-paint",
            None,
        ),
        (
            "GET",
            format!("/v1/paints/{}", blend.rsplit('/').next().expect("an id")),
            "",
            vec![],
            404,
            "unknown-paint",
            None,
        ),
        (
            "GET",
            "/v1/blends/b_nope".into(),
            "",
            vec![],
            404,
            "unknown-blend",
            None,
        ),
        (
            "GET",
            "/v1/jobs/j_nope".into(),
            "",
            vec![],
            404,
            "unknown-job",
            None,
        ),
        (
            "GET",
            "/v1/jobs/j_nope/events".into(),
            "",
            vec![],
            404,
            "unknown-job",
            None,
        ),
        (
            "GET",
            format!("{blend}/realisation.obj?alpha=1&beta=0"),
            "",
            vec![],
            404,
            "unknown-address",
            None,
        ),
        (
            "GET",
            format!("{blend}/realisation?alpha=1&beta=0"),
            "",
            vec![],
            404,
            "unknown-address",
            None,
        ),
        (
            "GET",
            format!("/v1/paints/{a}?verbose=1"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/verbose"),
        ),
        (
            "GET",
            "/v1/paints?limit=0".into(),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/limit"),
        ),
        (
            "GET",
            "/v1/paints?cursor=!".into(),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/cursor"),
        ),
        (
            "GET",
            "/v1/paints?q=a&q=b".into(),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/q"),
        ),
        (
            "GET",
            "/v1/paints?q=%ff".into(),
            "",
            vec![],
            400,
            "malformed-request",
            None,
        ),
        (
            "GET",
            real.clone(),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/weights"),
        ),
        (
            "GET",
            format!("{real}?alpha=nan&beta=0"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/alpha"),
        ),
        (
            "GET",
            format!("{real}?alpha=1&beta=inf"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/beta"),
        ),
        (
            "GET",
            format!("{real}?weights=0.5,0.25,0.25"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/weights"),
        ),
        (
            "GET",
            format!("{real}?weights=0.5,x"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/weights"),
        ),
        (
            "GET",
            format!("{real}?alpha=1&beta=0&surprise=1"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/surprise"),
        ),
        (
            "GET",
            format!("{real}?alpha=1&beta=0&profile=best"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/profile"),
        ),
        (
            "GET",
            format!("{blend}/preview.png?alpha=1&beta=0&scene=cube"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/scene"),
        ),
        (
            "GET",
            format!("{blend}/preview.png?alpha=1&beta=0&size=0x9"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/size"),
        ),
        (
            "GET",
            format!("{blend}/preview.png?alpha=1&beta=0&spp=0"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/spp"),
        ),
        (
            "GET",
            format!("/v1/paints/{a}/preview.png?alpha=1"),
            "",
            vec![],
            400,
            "invalid-parameter",
            Some("/alpha"),
        ),
        (
            "DELETE",
            "/v1/blends".into(),
            "",
            vec![],
            405,
            "method-not-allowed",
            None,
        ),
        (
            "PUT",
            "/v1/paints".into(),
            "",
            vec![],
            405,
            "method-not-allowed",
            None,
        ),
        (
            "POST",
            "/v1/paints".into(),
            "application/zip",
            b"not a paint".to_vec(),
            422,
            "unusable-measurement",
            Some(""),
        ),
        (
            "POST",
            "/v1/paints".into(),
            "application/zip",
            vec![],
            422,
            "unusable-measurement",
            Some(""),
        ),
        (
            "POST",
            "/v1/paints?name=".into(),
            "",
            b"silver".to_vec(),
            400,
            "invalid-parameter",
            Some("/name"),
        ),
        (
            "POST",
            "/v1/paints?layout=cube".into(),
            "",
            b"silver".to_vec(),
            400,
            "invalid-parameter",
            Some("/layout"),
        ),
        (
            "POST",
            "/v1/paints?coat_ior=0.5".into(),
            "",
            b"silver".to_vec(),
            400,
            "invalid-parameter",
            Some("/coat_ior"),
        ),
        (
            "POST",
            "/v1/paints?clusters=0".into(),
            "",
            b"silver".to_vec(),
            400,
            "invalid-parameter",
            Some("/clusters"),
        ),
        (
            "POST",
            "/v1/paints?header_bytes=-1".into(),
            "",
            b"silver".to_vec(),
            400,
            "invalid-parameter",
            Some("/header_bytes"),
        ),
        (
            "POST",
            "/v1/paints".into(),
            "multipart/form-data; boundary=x",
            b"silver".to_vec(),
            415,
            "unsupported-media-type",
            None,
        ),
        (
            "POST",
            "/v1/paints".into(),
            "application/zip",
            large,
            413,
            "too-large",
            None,
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            b"{".to_vec(),
            400,
            "malformed-request",
            Some(""),
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            vec![],
            400,
            "malformed-request",
            None,
        ),
        (
            "POST",
            "/v1/blends".into(),
            "text/plain",
            json(json!({"paints": [a, b]})),
            415,
            "unsupported-media-type",
            None,
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            vec![b' '; 100_000],
            413,
            "too-large",
            None,
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            json(json!({"paints": ["nope"]})),
            422,
            "invalid-value",
            Some("/paints"),
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            json(json!({"paints": [a, "nope"]})),
            422,
            "invalid-value",
            Some("/paints/1"),
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            json(json!({"paints": [a, nobody]})),
            422,
            "invalid-value",
            Some("/paints/1"),
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            json(json!({"paints": [a, 7]})),
            422,
            "invalid-value",
            Some("/paints/1"),
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            json(json!({"paints": [a, b], "surprise": 1})),
            422,
            "invalid-value",
            Some("/surprise"),
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            json(json!({"paints": [a, b], "profile": "best"})),
            422,
            "invalid-value",
            Some("/profile"),
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            json(json!({"paints": [a, b], "clusters": 0})),
            422,
            "invalid-value",
            Some("/clusters"),
        ),
        (
            "POST",
            "/v1/blends".into(),
            "application/json",
            json(json!({"paints": vec![a.clone(); 6]})),
            422,
            "invalid-value",
            Some("/paints"),
        ),
        (
            "POST",
            "/v1/blends?surprise=1".into(),
            "application/json",
            json(json!({"paints": [a, b]})),
            400,
            "invalid-parameter",
            Some("/surprise"),
        ),
    ];
    for (method, path, kind, body, status, problem, pointer) in table {
        let headers = if kind.is_empty() {
            vec![]
        } else {
            vec![("Content-Type", kind)]
        };
        let answer = house.ask(method, &path, &headers, &body).await;
        println!("{method} {path}");
        let told = answer.problem(status, problem);
        assert_eq!(told["pointer"].as_str(), pointer, "{method} {path}: {told}");
        if pointer.is_some() {
            assert!(
                ["query", "body"].contains(&told["in"].as_str().unwrap_or("")),
                "{told}"
            );
        }
        let text = told.to_string();
        assert!(
            !text.contains(data.path().to_str().expect("text")),
            "nothing internal: {text}"
        );
    }
    let allowed = house.ask("DELETE", "/v1/blends", &[], b"").await;
    assert_eq!(
        (allowed.header("allow"), &allowed.json()["accepted"]),
        (Some("POST"), &json!("POST"))
    );
    assert_eq!(
        house.get("/v1/paints").await.json()["paints"]
            .as_array()
            .map(Vec::len),
        Some(2),
        "no partial state"
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bug_is_a_500_that_says_nothing_but_its_request_id() {
    let data = folder();
    let house = House::open(data.path()).await;
    let told = house
        .ask(
            "POST",
            "/v1/paints",
            &[("X-Request-Id", "mine-7")],
            b"panic",
        )
        .await;
    let problem = told.problem(500, "internal");
    assert_eq!(told.header("x-request-id"), Some("mine-7"));
    assert!(!problem.to_string().contains("told to"));
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let broken = format!("/v1/blends/{blend}/realisation.zip?weights=1,0&flake_saturation=666");
    house.get(&broken).await.problem(500, "internal");
    let nasty = [("X-Request-Id", "a b\u{7f}")];
    assert_ne!(
        house
            .ask("GET", "/healthz", &nasty, b"")
            .await
            .header("x-request-id"),
        Some("a b\u{7f}")
    );
    assert_eq!(
        house.get("/healthz").await.status,
        200,
        "the service goes on"
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn sixteen_who_ask_for_the_same_cost_one_computation() {
    let data = folder();
    let house = House::open(data.path()).await;
    let uploads = join_all((0..16).map(|_| house.paint("silver"))).await;
    assert!(uploads.iter().all(|id| *id == uploads[0]));
    assert_eq!(house.count("carpaint_paints_fitted_total").await, 1.0);

    let (a, b) = (uploads[0].clone(), house.paint("blue").await);
    let (forth, back) = ([a.as_str(), b.as_str()], [b.as_str(), a.as_str()]);
    let blends =
        join_all((0..16).map(|k| house.blend(if k % 2 == 0 { &forth } else { &back }))).await;
    assert!((0..16).all(|k| blends[k] == blends[k % 2]) && blends[0] != blends[1]);
    assert_eq!(
        house.count("carpaint_blends_computed_total").await,
        1.0,
        "both orders share one correspondence"
    );

    let address = format!(
        "/v1/blends/{}/realisation.glb?alpha=0.25&beta=0.75",
        blends[0]
    );
    let swapped = format!("/v1/blends/{}/realisation.glb?weights=0.75,0.25", blends[1]);
    let files = join_all((0..16).map(|_| house.get(&address))).await;
    assert!(files.iter().all(|file| file.status == 200
        && file.body == files[0].body
        && file.etag() == files[0].etag()));
    assert_eq!(
        house.count("carpaint_realisations_computed_total").await,
        1.0
    );
    assert_eq!(
        house.get(&swapped).await.body,
        files[0].body,
        "weights follow the order asked for"
    );
    let picture = address.replace("realisation.glb", "preview.png");
    let pictures = join_all((0..16).map(|_| house.get(&picture))).await;
    assert!(
        pictures
            .iter()
            .all(|p| p.status == 200 && p.body == pictures[0].body)
    );
    assert_eq!(house.count("carpaint_previews_rendered_total").await, 1.0);
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_carry_what_caches_need() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let cases = [
        (
            format!("/v1/blends/{blend}/realisation.zip?weights=-2,3"),
            "immutable",
            "application/zip",
        ),
        (
            format!("/v1/blends/{blend}/realisation.json?weights=-2,3"),
            "immutable",
            "application/json",
        ),
        (
            format!("/v1/blends/{blend}/preview.png?weights=-2,3"),
            "immutable",
            "image/png",
        ),
        (
            format!("/v1/paints/{a}/preview.exr?size=64x32&spp=1"),
            "immutable",
            "image/x-exr",
        ),
        (
            format!("/v1/paints/{a}/realisation.glb"),
            "immutable",
            "model/gltf-binary",
        ),
        (
            format!("/v1/paints/{a}/paint"),
            "immutable",
            "application/vnd.carpaint.paint",
        ),
        (
            format!("/v1/paints/{a}/measurement"),
            "private, no-cache",
            "application/octet-stream",
        ),
        (format!("/v1/paints/{a}"), "no-cache", "application/json"),
        (
            format!("/v1/blends/{blend}"),
            "no-cache",
            "application/json",
        ),
        ("/v1/paints".to_owned(), "no-cache", "application/json"),
        ("/openapi.json".to_owned(), "no-cache", "application/json"),
        ("/docs".to_owned(), "no-cache", "text/html; charset=utf-8"),
        (
            "/docs/page.js".to_owned(),
            "no-cache",
            "text/javascript; charset=utf-8",
        ),
        (
            "/docs/page.css".to_owned(),
            "no-cache",
            "text/css; charset=utf-8",
        ),
        (
            "/problems/too-large".to_owned(),
            "no-cache",
            "application/json",
        ),
        ("/healthz".to_owned(), "no-store", "application/json"),
        ("/readyz".to_owned(), "no-store", "application/json"),
    ];
    for (path, keep, kind) in cases {
        let whole = house.get(&path).await;
        assert_eq!(
            (whole.status, whole.header("content-type")),
            (200, Some(kind)),
            "{path}: {whole:?}"
        );
        assert!(
            whole
                .header("cache-control")
                .expect("Cache-Control")
                .contains(keep),
            "{path}"
        );
        assert!(
            whole
                .header("server-timing")
                .expect("Server-Timing")
                .contains("total;dur="),
            "{path}"
        );
        assert!(whole.etag().starts_with('"'), "strong");
        let head = house.ask("HEAD", &path, &[], b"").await;
        assert_eq!((head.status, head.etag()), (200, whole.etag()), "{path}");
        assert_eq!(
            head.header("content-length"),
            Some(whole.body.len().to_string().as_str()),
            "{path}"
        );
        let known = house
            .ask("GET", &path, &[("If-None-Match", whole.etag())], b"")
            .await;
        assert_eq!(
            (known.status, known.etag(), known.body.len()),
            (304, whole.etag(), 0),
            "{path}"
        );
        let stale = house
            .ask(
                "GET",
                &path,
                &[("If-None-Match", "\"something-else\"")],
                b"",
            )
            .await;
        assert_eq!((stale.status, stale.body), (200, whole.body), "{path}");
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn long_work_is_a_job_that_tells_and_can_be_cancelled() {
    let data = folder();
    let house = House::open(data.path()).await;
    let answer = house
        .ask(
            "POST",
            "/v1/paints",
            &[("Prefer", "respond-async")],
            b"slow one",
        )
        .await;
    assert_eq!(answer.status, 202, "{answer:?}");
    let address = answer.header("location").expect("a job").to_owned();
    assert_eq!(
        format!("/v1/jobs/{}", answer.json()["id"].as_str().expect("an id")),
        address
    );

    let other = house
        .ask(
            "POST",
            "/v1/paints",
            &[("Prefer", "respond-async")],
            b"slow one",
        )
        .await;
    assert_eq!(
        other.json()["id"],
        answer.json()["id"],
        "the same upload waits for the same job"
    );

    let events = house.get(&format!("{address}/events")).await;
    assert_eq!(events.header("content-type"), Some("text/event-stream"));
    let text = events.text();
    assert!(
        text.matches("event: progress").count() > 5 && text.matches("event: end").count() == 1,
        "{text}"
    );
    let last = text
        .lines()
        .rfind(|line| line.starts_with("data: "))
        .expect("data");
    let job: serde_json::Value = serde_json::from_str(&last[6..]).expect("JSON");
    assert_eq!(
        (&job["state"], &job["progress"]),
        (&json!("done"), &json!(1.0))
    );
    assert!(text.contains("seconds_left"));
    assert_eq!(house.get(&address).await.json(), job);
    assert_eq!(
        house
            .get(job["result"].as_str().expect("an address"))
            .await
            .status,
        200
    );
    house
        .ask("DELETE", &address, &[], b"")
        .await
        .problem(409, "job-ended");
    assert!(
        house
            .get(&format!("{address}/events"))
            .await
            .text()
            .starts_with("event: end")
    );

    let begun = Instant::now();
    let answer = house
        .ask(
            "POST",
            "/v1/paints",
            &[("Prefer", "respond-async")],
            b"slow two",
        )
        .await;
    let address = answer.header("location").expect("a job").to_owned();
    let cancelled = house.ask("DELETE", &address, &[], b"").await;
    assert_eq!(
        (cancelled.status, &cancelled.json()["state"]),
        (200, &json!("cancelled")),
        "{cancelled:?}"
    );
    assert!(begun.elapsed() < Duration::from_secs(3));
    assert_eq!(house.get(&address).await.json()["state"], "cancelled");

    let failed = house
        .ask(
            "POST",
            "/v1/paints",
            &[("Prefer", "respond-async")],
            b"not one",
        )
        .await;
    let address = failed.header("location").expect("a job").to_owned();
    while !["failed"].contains(
        &house.get(&address).await.json()["state"]
            .as_str()
            .expect("a state"),
    ) {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let problem = house.get(&address).await.json()["problem"].clone();
    assert_eq!(problem["type"], "/problems/unusable-measurement");
    assert_eq!(problem["detail"], "the upload: this is no measurement");
    let blobs = walk(&data.path().join("blobs"));
    assert_eq!(
        blobs, 2,
        "one paint and its upload: what came to nothing is not kept"
    );
    house.close().await;
}

/// Files under a folder.
fn walk(folder: &std::path::Path) -> usize {
    let entries = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").path());
    entries
        .map(|path| if path.is_dir() { walk(&path) } else { 1 })
        .sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_changes_nothing_and_goes_on_with_what_was_under_way() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let addresses = [
        format!("/v1/paints/{a}"),
        format!("/v1/blends/{blend}"),
        format!("/v1/blends/{blend}/realisation.zip?alpha=0.25&beta=0.75"),
        format!("/v1/blends/{blend}/preview.png?alpha=0.25&beta=0.75"),
    ];
    let before = join_all(addresses.iter().map(|path| house.get(path))).await;
    let answer = house
        .ask(
            "POST",
            "/v1/paints",
            &[("Prefer", "respond-async")],
            b"slow three",
        )
        .await;
    let job = answer.header("location").expect("a job").to_owned();
    tokio::time::sleep(Duration::from_millis(100)).await;
    assert_eq!(house.get(&job).await.json()["state"], "running");
    house.close().await;

    let house = House::open(data.path()).await;
    let after = join_all(addresses.iter().map(|path| house.get(path))).await;
    for ((before, after), path) in before.iter().zip(&after).zip(&addresses) {
        assert_eq!(
            (after.status, after.etag(), &after.body),
            (200, before.etag(), &before.body),
            "{path}"
        );
    }
    assert_eq!(
        house.count("carpaint_realisations_computed_total").await,
        0.0,
        "results are kept"
    );
    assert_eq!(house.count("carpaint_blends_computed_total").await, 0.0);
    assert_eq!(house.blend(&[&b, &a]).await.len(), blend.len());
    assert_eq!(
        house.count("carpaint_blends_computed_total").await,
        0.0,
        "the other order shares the kept correspondence"
    );
    let begun = Instant::now();
    while house.get(&job).await.json()["state"] != "done" {
        assert!(
            begun.elapsed() < Duration::from_secs(30),
            "{:?}",
            house.get(&job).await
        );
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_data_folder_serves_one_process() {
    let data = folder();
    let house = House::open(data.path()).await;
    let second = carpaint::service::open(
        ServiceConfig::new(data.path().to_owned()),
        std::sync::Arc::new(house::Pretend),
    );
    assert!(
        second
            .await
            .expect_err("in use")
            .to_string()
            .contains("in use")
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn too_much_work_is_turned_away_with_a_time_to_come_back() {
    let data = folder();
    let config = ServiceConfig {
        most_waiting: 1,
        most_jobs: 1,
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let asked = (0..24).map(|k| format!("/v1/blends/{blend}/realisation.zip?alpha={k}&beta=1"));
    let answers = join_all(asked.map(|path| {
        let house = &house;
        async move { house.get(&path).await }
    }))
    .await;
    let refused: Vec<_> = answers
        .iter()
        .filter(|answer| answer.status != 200)
        .collect();
    assert!(
        !refused.is_empty() && refused.len() < 24,
        "{} of 24",
        refused.len()
    );
    for answer in refused {
        answer.problem(503, "overloaded");
        assert!(answer.header("retry-after").is_some());
    }
    let first = house
        .ask(
            "POST",
            "/v1/paints",
            &[("Prefer", "respond-async")],
            b"slow four",
        )
        .await;
    assert_eq!(first.status, 202);
    house
        .ask(
            "POST",
            "/v1/paints",
            &[("Prefer", "respond-async")],
            b"slow five",
        )
        .await
        .problem(503, "overloaded");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_header_that_never_ends_is_not_waited_for() {
    let data = folder();
    let config = ServiceConfig {
        header_time: Duration::from_millis(300),
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let half = b"GET /healthz HTTP/1.1\r\nHost: x\r\nX-Half".as_slice();
    for silent in [half, b"", b"G", b"PRI * HTTP/2.0\r\n"] {
        let answer = tokio::time::timeout(Duration::from_secs(5), raw(house.address, silent)).await;
        assert!(answer.is_ok(), "{:?}", String::from_utf8_lossy(silent));
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_breaks_off_leaves_nothing() {
    let data = folder();
    let house = House::open(data.path()).await;
    {
        use tokio::io::AsyncWriteExt;
        let mut stream = tokio::net::TcpStream::connect(house.address)
            .await
            .expect("connects");
        let head = "POST /v1/paints HTTP/1.1\r\nHost: x\r\nContent-Length: 9000000\r\n\r\n";
        stream.write_all(head.as_bytes()).await.expect("sends");
        stream
            .write_all(&vec![b's'; 4_000_000])
            .await
            .expect("sends half");
    }
    for _ in 0..200 {
        if walk(&data.path().join("incoming")) == 0 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(
        (
            walk(&data.path().join("incoming")),
            walk(&data.path().join("blobs"))
        ),
        (0, 0)
    );
    assert_eq!(house.get("/v1/paints").await.json()["paints"], json!([]));
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_has_its_report_beside_it_and_a_whole_scene_is_posted() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let query = "weights=0.25,0.75&size=32x16&spp=3&light=0,1,1";
    let picture = house
        .get(&format!("/v1/blends/{blend}/preview.png?{query}"))
        .await;
    let link = picture.header("link").expect("a link").to_owned();
    let report = link
        .split_once('>')
        .map(|(address, _)| &address[1..])
        .expect("an address");
    assert!(report.ends_with(&format!("preview.json?{query}")), "{link}");
    let report = house.get(report).await;
    assert_eq!(report.json()["clamps"], json!([]));
    assert_eq!(house.count("carpaint_previews_rendered_total").await, 1.0);

    let scene = json!({
        "blend": blend, "weights": [0.25, 0.75], "size": [32, 16], "samples_per_pixel": 3,
        "lights": [{"towards": [0, 1, 1]}],
    });
    let posted = house.post_json("/v1/previews", &scene.to_string()).await;
    assert_eq!((posted.status, &posted.body), (200, &picture.body));
    assert_eq!(house.count("carpaint_previews_rendered_total").await, 1.0);
    let refusals = [
        (json!({"paint": a, "blend": blend}), "/paint"),
        (json!({}), "/paint"),
        (json!({"paint": "nobody"}), "/paint"),
        (json!({"paint": a, "weights": [1, 0]}), "/weights"),
        (json!({"blend": blend}), "/weights"),
        (json!({"blend": blend, "weights": [1]}), "/weights"),
        (
            json!({"paint": a, "samples_per_pixel": 0}),
            "/samples_per_pixel",
        ),
        (json!({"paint": a, "size": [0, 9]}), "/size"),
        (
            json!({"paint": a, "lights": [{"towards": [0, 0, 0]}]}),
            "/lights/0",
        ),
        (json!({"paint": a, "format": "gif"}), "/format"),
        (json!({"paint": a, "profile": "best"}), "/profile"),
    ];
    for (scene, pointer) in refusals {
        let answer = house.post_json("/v1/previews", &scene.to_string()).await;
        let problem = answer.problem(422, "invalid-value");
        assert_eq!(problem["pointer"], pointer, "{scene}: {problem}");
        assert!(problem["accepted"].is_string(), "{scene}: {problem}");
    }
    let problem = house
        .get(&format!("/v1/paints/{a}/preview.gif"))
        .await
        .problem(404, "unknown-address");
    assert_eq!(problem["accepted"], "png, exr, json");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_that_nobody_waits_for_is_called_off() {
    use tokio::io::AsyncWriteExt;
    let data = folder();
    let house = House::open(data.path()).await;
    let paint = house.paint("silver").await;
    let slow = format!("/v1/paints/{paint}/preview.png?size=8x4000&spp=1");
    {
        let mut stream = tokio::net::TcpStream::connect(house.address)
            .await
            .expect("connects");
        let request = format!("GET {slow} HTTP/1.1\r\nHost: x\r\n\r\n");
        stream.write_all(request.as_bytes()).await.expect("sends");
        tokio::time::sleep(Duration::from_millis(300)).await;
    }
    tokio::time::sleep(Duration::from_secs(5)).await;
    assert_eq!(house.count("carpaint_previews_rendered_total").await, 0.0);
    assert_eq!(house.get(&slow).await.status, 200, "who waits gets it");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_idempotency_key_is_one_request() {
    let data = folder();
    let house = House::open(data.path()).await;
    let keyed = |body: &'static [u8], key: &'static str| {
        let house = &house;
        async move {
            let headers = [("Prefer", "wait=30"), ("Idempotency-Key", key)];
            house.ask("POST", "/v1/paints", &headers, body).await
        }
    };
    let first = keyed(b"silver", "k-1").await;
    assert_eq!(first.status, 201);
    let again = keyed(b"silver", "k-1").await;
    assert_eq!((again.status, again.json()), (200, first.json()));
    let problem = keyed(b"blue", "k-1")
        .await
        .problem(422, "idempotency-key-used");
    assert_eq!(
        (&problem["in"], &problem["pointer"]),
        (&json!("header"), &json!("/Idempotency-Key"))
    );
    assert_eq!(walk(&data.path().join("blobs")), 2, "nothing is kept of it");
    assert_eq!(keyed(b"blue", "k-2").await.status, 201);
    keyed(b"blue", "").await.problem(400, "invalid-parameter");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_private_paint_is_left_out_of_lists() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let address = format!("/v1/paints/{a}");
    let published = house.get(&address).await;
    assert_eq!(published.json()["visibility"], "published");
    let change = |body: &'static str| {
        let (house, address) = (&house, &address);
        async move {
            let headers = [("Content-Type", "application/json")];
            house.ask("PATCH", address, &headers, body.as_bytes()).await
        }
    };
    let private = change(r#"{"visibility": "private"}"#).await;
    assert_eq!(
        (private.status, &private.json()["visibility"]),
        (200, &json!("private"))
    );
    assert_ne!(private.etag(), published.etag());
    let ids = |list: serde_json::Value| -> Vec<String> {
        let paints = list["paints"].as_array().expect("a list").clone();
        let id = |paint: &serde_json::Value| paint["id"].as_str().expect("an id").to_owned();
        paints.iter().map(id).collect()
    };
    assert_eq!(ids(house.get("/v1/paints").await.json()), [b]);
    let hidden = house.get("/v1/paints?visibility=private").await.json();
    assert_eq!(ids(hidden), std::slice::from_ref(&a));
    let problem = change(r#"{"visibility": "secret"}"#)
        .await
        .problem(422, "invalid-value");
    assert_eq!(
        (&problem["pointer"], &problem["accepted"]),
        (&json!("/visibility"), &json!("published or private"))
    );
    assert_eq!(
        change(r#"{"visibility": "published"}"#).await.json(),
        published.json()
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_never_ends_is_not_waited_for() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let data = folder();
    let config = ServiceConfig {
        body_time: Duration::from_millis(300),
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let mut stream = tokio::net::TcpStream::connect(house.address)
        .await
        .expect("connects");
    let head = "POST /v1/blends HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: 50\r\n\r\n{";
    stream.write_all(head.as_bytes()).await.expect("sends");
    let mut answer = Vec::new();
    let read = tokio::time::timeout(Duration::from_secs(5), stream.read_to_end(&mut answer));
    let _ = read.await.expect("is answered in time");
    let answer = String::from_utf8_lossy(&answer);
    assert!(answer.starts_with("HTTP/1.1 408"), "{answer}");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_interface_is_the_committed_one_and_all_of_it_is_served() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi/openapi.json");
    let text = carpaint::service::interface();
    if std::env::var_os("CARPAINT_BLESS").is_some() {
        std::fs::create_dir_all(concat!(env!("CARGO_MANIFEST_DIR"), "/openapi"))
            .expect("makes the folder");
        std::fs::write(file, text).expect("writes the interface");
    }
    let committed = std::fs::read_to_string(file).unwrap_or_default();
    assert!(
        committed == text,
        "openapi/openapi.json is not what the code says: CARPAINT_BLESS=1 cargo test --test http"
    );

    let data = folder();
    let house = House::open(data.path()).await;
    let api = house.get("/openapi.json").await.json();
    let mut names: Vec<&str> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("\"operationId\": "))
        .collect();
    let all = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all, "every operation has a name of its own");
    assert!(
        api["openapi"]
            .as_str()
            .expect("a version")
            .starts_with("3.1")
    );
    for (path, item) in api["paths"].as_object().expect("paths") {
        for method in item.as_object().expect("operations").keys() {
            let real = path
                .replace(
                    "{format}",
                    if path.contains("preview") {
                        "png"
                    } else {
                        "zip"
                    },
                )
                .replace("{id}", "x");
            let answer = house.ask(&method.to_uppercase(), &real, &[], b"").await;
            let kind = if answer.status >= 400 {
                answer.json()["type"].as_str().unwrap_or("").to_owned()
            } else {
                String::new()
            };
            assert!(
                answer.status != 405 && kind != "/problems/unknown-address",
                "{method} {path} is documented and not served: {answer:?}"
            );
        }
    }
    house.close().await;
}
