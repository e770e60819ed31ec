//! Refusals: each a problem that says where and what instead.

use carpaint::service::ServiceConfig;
use serde_json::json;

use crate::folder;
use crate::house::House;

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
            Some(""),
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
