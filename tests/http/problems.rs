//! Refusals: each a problem that says where and what instead.

use carpaint::service::ServiceConfig;
use serde_json::{Value, json};

use crate::folder;
use crate::house::House;

/// Most bytes of an upload here.
const MOST: u32 = 5_000_000;

/// A house with two paints and their blend, where much is refused.
struct Door {
    house: House,
    data: tempfile::TempDir,
    paints: [String; 2],
    /// Address of the blend.
    blend: String,
}

/// What a request is refused with: status, kind of problem, pointer.
type Refusal<'a> = (u16, &'a str, Option<&'a str>);

impl Door {
    async fn open() -> Self {
        let data = folder();
        let mut config = ServiceConfig::new(data.path().to_owned());
        config.limits.bytes = MOST.into();
        let house = House::with(config).await;
        let paints = [house.paint("silver").await, house.paint("blue").await];
        let blend = house.blend(&[&paints[0], &paints[1]]).await;
        Self {
            house,
            data,
            paints,
            blend: format!("/v1/blends/{blend}"),
        }
    }

    /// Asks, and checks the problem that comes back.
    async fn refuses(
        &self,
        (method, path): (&str, &str),
        media_type: &str,
        body: &[u8],
        (status, kind, pointer): Refusal<'_>,
    ) {
        println!("{method} {path}");
        let headers = [("Content-Type", media_type)];
        let headers = if media_type.is_empty() {
            &[]
        } else {
            &headers[..]
        };
        let answer = self.house.ask(method, path, headers, body).await;
        let told = answer.problem(status, kind);
        assert_eq!(told["pointer"].as_str(), pointer, "{method} {path}: {told}");
        if pointer.is_some() {
            assert!(
                ["query", "body"].contains(&told["in"].as_str().unwrap_or("")),
                "{told}"
            );
        }
        let text = told.to_string();
        assert!(
            !text.contains(self.data.path().to_str().expect("text")),
            "nothing internal: {text}"
        );
    }

    async fn refuses_to_give(&self, path: &str, refusal: Refusal<'_>) {
        self.refuses(("GET", path), "", b"", refusal).await;
    }

    /// Of a JSON body.
    async fn refuses_to_blend(&self, body: &Value, refusal: Refusal<'_>) {
        let (asked, body) = (("POST", "/v1/blends"), body.to_string());
        self.refuses(asked, "application/json", body.as_bytes(), refusal)
            .await;
    }

    async fn close(self) {
        let list = self.house.get("/v1/paints").await.json();
        let paints = list["paints"].as_array().map(Vec::len);
        assert_eq!(paints, Some(2), "no partial state");
        self.house.close().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_not_there_is_refused_by_the_kind_of_thing_it_would_be() {
    let door = Door::open().await;
    let ([paint, _], blend) = (&door.paints, &door.blend);
    let nobody = "0".repeat(32);
    let of_blend = blend.rsplit('/').next().expect("an id");
    for (path, kind) in [
        ("/v1/nowhere".to_owned(), "unknown-address"),
        ("/v1/paints/p_nope".to_owned(), "unknown-paint"),
        (format!("/v1/paints/p_{nobody}"), "unknown-paint"),
        (format!("/v1/paints/{paint}%00"), "unknown-paint"),
        (format!("/v1/paints/{of_blend}"), "unknown-paint"),
        ("/v1/blends/b_nope".to_owned(), "unknown-blend"),
        ("/v1/jobs/j_nope".to_owned(), "unknown-job"),
        ("/v1/jobs/j_nope/events".to_owned(), "unknown-job"),
        (
            format!("{blend}/realisation.obj?alpha=1&beta=0"),
            "unknown-address",
        ),
        (
            format!("{blend}/realisation?alpha=1&beta=0"),
            "unknown-address",
        ),
    ] {
        door.refuses_to_give(&path, (404, kind, None)).await;
    }
    for asked in [("DELETE", "/v1/blends"), ("PUT", "/v1/paints")] {
        let refusal = (405, "method-not-allowed", None);
        door.refuses(asked, "", b"", refusal).await;
    }
    let allowed = door.house.ask("DELETE", "/v1/blends", &[], b"").await;
    assert_eq!(
        (allowed.header("allow"), &allowed.json()["accepted"]),
        (Some("POST"), &json!("POST"))
    );
    door.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_parameter_that_is_not_accepted_is_pointed_at() {
    let door = Door::open().await;
    let ([paint, _], blend) = (&door.paints, &door.blend);
    let file = format!("{blend}/realisation.zip");
    let picture = format!("{blend}/preview.png?alpha=1&beta=0");
    for (path, pointer) in [
        (format!("/v1/paints/{paint}?verbose=1"), "/verbose"),
        ("/v1/paints?limit=0".to_owned(), "/limit"),
        ("/v1/paints?cursor=!".to_owned(), "/cursor"),
        ("/v1/paints?cursor=zz".to_owned(), "/cursor"),
        ("/v1/paints?q=a&q=b".to_owned(), "/q"),
        (file.clone(), "/weights"),
        (format!("{file}?alpha=nan&beta=0"), "/alpha"),
        (format!("{file}?alpha=1&beta=inf"), "/beta"),
        (format!("{file}?weights=0.5,0.25,0.25"), "/weights"),
        (format!("{file}?weights=0.5,x"), "/weights"),
        (format!("{file}?alpha=1&beta=0&surprise=1"), "/surprise"),
        (format!("{file}?alpha=1&beta=0&profile=best"), "/profile"),
        (format!("{picture}&scene=cube"), "/scene"),
        (format!("{picture}&show=gloss"), "/show"),
        (format!("{picture}&show=aspecular&spp=4"), "/spp"),
        (
            format!("{picture}&show=aspecular&profile=draft"),
            "/profile",
        ),
        (
            format!("{picture}&show=aspecular&max_error=1"),
            "/max_error",
        ),
        (
            format!("{picture}&show=aspecular&max_seconds=1"),
            "/max_seconds",
        ),
        (format!("{picture}&size=0x9"), "/size"),
        (format!("{picture}&spp=0"), "/spp"),
        (format!("/v1/paints/{paint}/preview.png?alpha=1"), "/alpha"),
    ] {
        let refusal = (400, "invalid-parameter", Some(pointer));
        door.refuses_to_give(&path, refusal).await;
    }
    let refusal = (400, "malformed-request", None);
    door.refuses_to_give("/v1/paints?q=%ff", refusal).await;
    door.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_is_no_measurement_or_asked_for_wrongly_is_refused() {
    let door = Door::open().await;
    for pointer in ["name=", "layout=cube", "coat_ior=0.5", "clusters=0"]
        .into_iter()
        .chain(["header_bytes=-1"])
    {
        let path = format!("/v1/paints?{pointer}");
        let field = pointer.split('=').next().map(|name| format!("/{name}"));
        let refusal = (400, "invalid-parameter", field.as_deref());
        door.refuses(("POST", &path), "", b"silver", refusal).await;
    }
    let unusable = (422, "unusable-measurement", Some(""));
    let form = (415, "unsupported-media-type", None);
    let large = vec![b's'; MOST as usize + 1];
    for (media_type, body, refusal) in [
        ("application/zip", &b"not a paint"[..], unusable),
        ("application/zip", b"", unusable),
        ("multipart/form-data; boundary=x", b"silver", form),
        ("application/zip", &large, (413, "too-large", None)),
    ] {
        let asked = ("POST", "/v1/paints");
        door.refuses(asked, media_type, body, refusal).await;
    }
    door.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_is_not_accepted_is_pointed_into() {
    let door = Door::open().await;
    let [a, b] = &door.paints;
    let nobody = format!("p_{}", "0".repeat(32));
    for (body, pointer) in [
        (json!({"paints": ["nope"]}), "/paints"),
        (json!({"paints": [a, "nope"]}), "/paints/1"),
        (json!({"paints": [a, nobody]}), "/paints/1"),
        (json!({"paints": [a, 7]}), "/paints/1"),
        (json!({"paints": [a, b], "surprise": 1}), "/surprise"),
        (json!({"paints": [a, b], "profile": "best"}), "/profile"),
        (json!({"paints": [a, b], "clusters": 0}), "/clusters"),
        (json!({"paints": vec![a.clone(); 6]}), "/paints"),
    ] {
        let refusal = (422, "invalid-value", Some(pointer));
        door.refuses_to_blend(&body, refusal).await;
    }
    let good = json!({"paints": [a, b]}).to_string();
    let malformed = (400, "malformed-request", Some(""));
    let large = vec![b' '; 100_000];
    let surprising = (400, "invalid-parameter", Some("/surprise"));
    for (path, media_type, body, refusal) in [
        ("/v1/blends", "application/json", &b"{"[..], malformed),
        ("/v1/blends", "application/json", b"", malformed),
        (
            "/v1/blends",
            "text/plain",
            good.as_bytes(),
            (415, "unsupported-media-type", None),
        ),
        (
            "/v1/blends",
            "application/json",
            &large,
            (413, "too-large", None),
        ),
        (
            "/v1/blends?surprise=1",
            "application/json",
            good.as_bytes(),
            surprising,
        ),
    ] {
        let asked = ("POST", path);
        door.refuses(asked, media_type, body, refusal).await;
    }
    door.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bug_is_a_500_that_says_nothing_but_its_request_id() {
    let data = folder();
    let house = House::open(data.path()).await;
    let told = house
        .ask(
            "POST",
            "/v1/paints",
            &[("X-Request-Id", "mine-7"), ("Prefer", "wait=60")],
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
