//! What is computed once, and what caches may keep.

use futures::future::join_all;
use serde_json::json;

use crate::house::House;
use crate::{folder, walk};

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
