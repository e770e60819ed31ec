//! Pictures lit by panoramas, and the angles in them.

use std::path::{Path, PathBuf};

use carpaint::service::ServiceConfig;
use serde_json::json;

use crate::client::Answer;
use crate::environments::{panorama, upload};
use crate::folder;
use crate::house::House;

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_is_lit_by_the_panorama_that_is_asked_for() {
    let data = folder();
    let house = House::real(data.path()).await;
    let paint = house.sample("white").await;
    let red = upload(&house, &panorama([128, 16, 16, 129]), 201).await;
    let blue = upload(&house, &panorama([16, 16, 128, 129]), 201).await;
    let lit = async |by: &str| {
        let path = format!("/v1/paints/{paint}/preview.png?size=24x16&spp=2{by}");
        house.get(&path).await
    };
    let studio = lit("").await;
    let in_red = lit(&format!("&environment={red}")).await;
    assert_eq!((studio.status, in_red.status), (200, 200));
    assert_eq!(lit("&environment=studio").await.body, studio.body);
    assert_eq!(house.count("carpaint_previews_rendered_total").await, 2.0);
    let in_blue = lit(&format!("&environment={blue}")).await;
    assert!(studio.body != in_red.body && in_red.body != in_blue.body);
    let order = json!({
        "paint": paint, "size": [24, 16], "samples_per_pixel": 2, "environment": red,
    });
    let posted = house.post_json("/v1/previews", &order.to_string()).await;
    assert_eq!(posted.body, in_red.body);
    assert_eq!(house.count("carpaint_previews_rendered_total").await, 3.0);
    let estimate =
        async |order: serde_json::Value| house.post_json("/v1/estimates", &order.to_string()).await;
    let order = json!({
        "work": "preview", "paint": paint, "size": [24, 16], "environment": blue,
        "profile": "draft",
    });
    let told = estimate(order).await;
    assert_eq!(told.status, 200, "{}", told.text());
    assert_eq!(told.json()["kept"], false, "it was drawn with two samples");
    let order = json!({
        "work": "preview", "paint": paint, "size": [24, 16], "environment": blue,
        "profile": { "samples_per_pixel": 2 },
    });
    assert_eq!(estimate(order).await.json()["kept"], true);
    let order = json!({
        "work": "preview", "paint": paint, "size": [24, 16], "environment": blue,
        "show": "aspecular",
    });
    let told = estimate(order.clone()).await.json();
    assert_eq!(told["error"]["value"], 0.0, "{told}");
    for (field, value) in [
        ("profile", json!("draft")),
        ("max_error", json!(1.0)),
        ("environment", json!("nope")),
    ] {
        let mut order = order.clone();
        order[field] = value;
        let problem = estimate(order).await.problem(422, "invalid-value");
        assert_eq!(problem["pointer"], format!("/{field}"), "{problem}");
        assert!(problem["accepted"].is_string(), "{problem}");
    }
    let written = async |work: &str, format: &str| {
        let order = match work {
            "preview" => {
                json!({ "work": work, "paint": paint, "size": [24, 16], "format": format })
            }
            _ => json!({ "work": work, "paint": paint, "format": format }),
        };
        estimate(order).await
    };
    let (screen, linear) = (
        written("preview", "png").await,
        written("preview", "exr").await,
    );
    let bytes = |told: &Answer| told.json()["bytes"].as_u64().expect("bytes");
    assert!(bytes(&linear) > bytes(&screen), "{}", linear.text());
    for (work, format, accepted) in [
        ("preview", "zip", "png or exr"),
        ("realise", "png", "zip, glb, json or paint"),
    ] {
        let problem = written(work, format).await.problem(422, "invalid-value");
        assert_eq!(
            (&problem["pointer"], &problem["accepted"]),
            (&json!("/format"), &json!(accepted))
        );
    }
    let lit_from_above = json!({
        "work": "preview", "paint": paint, "size": [24, 16], "lights": [{"towards": [0, 1, 0]}],
    });
    assert_eq!(estimate(lit_from_above.clone()).await.status, 200);
    let mut unlit = lit_from_above;
    unlit["lights"][0]["towards"] = json!([0, 0, 0]);
    let problem = estimate(unlit).await.problem(422, "invalid-value");
    assert_eq!(problem["pointer"], "/lights/0", "{problem}");
    let order = json!({"work": "realise", "paint": paint, "environment": blue});
    let problem = estimate(order).await.problem(422, "invalid-value");
    assert_eq!(problem["pointer"], "/environment");

    let deleted = house
        .ask("DELETE", &format!("/v1/environments/{red}"), &[], b"")
        .await;
    assert_eq!(deleted.status, 204);
    for id in [red.as_str(), "nope", "e_", "p_0"] {
        let problem = lit(&format!("&environment={id}")).await;
        let problem = problem.problem(400, "invalid-parameter");
        assert_eq!(problem["pointer"], "/environment");
        let accepted = problem["accepted"].as_str().expect("says what instead");
        assert!(accepted.starts_with("studio, or"), "{accepted}");
        let order = json!({"paint": paint, "environment": id}).to_string();
        let problem = house.post_json("/v1/previews", &order).await;
        let problem = problem.problem(422, "invalid-value");
        assert_eq!(problem["pointer"], "/environment");
    }
    house.close().await;
}

/// The file of the only blob that begins so.
fn blob_of(data: &Path, bytes: &[u8]) -> PathBuf {
    let name = blake3::hash(bytes).to_hex();
    data.join("blobs").join(&name[..2]).join(name.as_str())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_that_was_drawn_needs_no_environment_read_again() {
    let data = folder();
    let house = House::open(data.path()).await;
    let paint = house.paint("silver").await;
    let bytes = panorama([128, 128, 128, 129]);
    let sky = upload(&house, &bytes, 201).await;
    let file = blob_of(data.path(), &bytes);
    let path = format!("/v1/paints/{paint}/preview.png?size=24x16&environment={sky}");
    let drawn = house.get(&path).await;
    assert_eq!(drawn.status, 200);
    house.close().await;

    // Another process has nothing of it in memory.
    std::fs::remove_file(&file).expect("is there");
    let house = House::open(data.path()).await;
    let again = house.get(&path).await;
    assert_eq!((again.status, &again.body), (200, &drawn.body));
    let etag = drawn.etag().to_owned();
    let known = [("If-None-Match", etag.as_str())];
    assert_eq!(house.ask("GET", &path, &known, b"").await.status, 304);
    // What needs the file, which is on record, says that this is our own fault; the record can still be told.
    house
        .get(&format!("{path}&spp=3"))
        .await
        .problem(500, "internal");
    let address = format!("/v1/environments/{sky}");
    house
        .get(&format!("{address}/file"))
        .await
        .problem(500, "internal");
    assert_eq!(house.get(&address).await.status, 200);
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_environment_beyond_todays_limits_is_told_by_its_limit() {
    let data = folder();
    let house = House::open(data.path()).await;
    let paint = house.paint("silver").await;
    let sky = upload(&house, &panorama([128, 128, 128, 129]), 201).await;
    house.close().await;
    let mut config = ServiceConfig::new(data.path().to_owned());
    config.limits.pixels = 31;
    let house = House::with(config).await;
    let path = format!("/v1/paints/{paint}/preview.png?size=4x4&environment={sky}");
    let problem = house.get(&path).await.problem(400, "invalid-parameter");
    assert_eq!(problem["pointer"], "/environment");
    let detail = problem["detail"].as_str().expect("a detail");
    assert!(
        detail.contains("8 x 4") && detail.contains("31"),
        "{detail}"
    );
    let order = json!({"paint": paint, "size": [4, 4], "environment": sky});
    let problem = house.post_json("/v1/previews", &order.to_string()).await;
    let problem = problem.problem(422, "invalid-value");
    assert_eq!(problem["pointer"], "/environment");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn light_that_is_not_drawn_as_it_was_is_told_wherever_it_matters() {
    let data = folder();
    let house = House::real(data.path()).await;
    let paint = house.sample("white").await;
    // 128/256 times 2^(148 - 128) is 2^19 in one channel of each of 32 pixels.
    let sun = panorama([128, 0, 0, 148]);
    let sky = upload(&house, &sun, 201).await;
    let held = json!({
        "too_bright": 32, "brightest": 524_288.0, "negative": 0, "lowest": 0.0,
    });
    for status in [200, 200] {
        let answer = house.ask("POST", "/v1/environments", &[], &sun).await;
        assert_eq!(answer.status, status);
        assert_eq!(answer.json()["held"], held);
    }
    let told = house.get(&format!("/v1/environments/{sky}")).await.json();
    assert_eq!(told["held"], held);
    for show in ["paint", "aspecular"] {
        let path =
            format!("/v1/paints/{paint}/preview.json?size=8x8&show={show}&environment={sky}");
        let report = house.get(&path).await.json();
        assert_eq!(report["environment"], held, "{show}: {report}");
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn angles_are_drawn_once_for_all_paints() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let query = "preview.png?size=8x8&show=aspecular";
    let first = house.get(&format!("/v1/paints/{a}/{query}")).await;
    for path in [
        format!("/v1/paints/{b}/{query}"),
        format!("/v1/blends/{blend}/{query}&weights=0.1,0.9"),
        format!("/v1/blends/{blend}/{query}&weights=0.5,0.5"),
    ] {
        let same = house.get(&path).await;
        assert_eq!((same.status, same.etag()), (200, first.etag()), "{path}");
    }
    assert_eq!(house.count("carpaint_previews_rendered_total").await, 1.0);
    // Who may not ask for a paint is not told its angles, and a private one's are not for all caches.
    house
        .get(&format!("/v1/paints/p_0/{query}"))
        .await
        .problem(404, "unknown-paint");
    let change = json!({"visibility": "private"}).to_string();
    let headers = [("Content-Type", "application/json")];
    let path = format!("/v1/paints/{b}");
    let changed = house.ask("PATCH", &path, &headers, change.as_bytes()).await;
    assert_eq!(changed.status, 200);
    let own = house.get(&format!("/v1/paints/{b}/{query}")).await;
    assert_eq!(own.header("cache-control"), Some("private, no-cache"));
    house.close().await;
}
