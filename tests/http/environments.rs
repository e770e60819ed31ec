//! Panoramas: uploaded, told, drawn with, deleted.

use std::path::PathBuf;

use carpaint::accuracy::Profile;
use carpaint::service::ServiceConfig;
use carpaint::workshop::sample_by_name;
use serde_json::json;

use crate::house::House;
use crate::{folder, walk};

/// A Radiance picture of 8 x 4 pixels of one light.
fn panorama(rgbe: [u8; 4]) -> Vec<u8> {
    let head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n";
    [&head[..], &rgbe.repeat(32)].concat()
}

async fn upload(house: &House, bytes: &[u8], status: u16) -> String {
    let answer = house.ask("POST", "/v1/environments", &[], bytes).await;
    assert_eq!(answer.status, status, "{}", answer.text());
    let id = answer.json()["id"].as_str().expect("an id").to_owned();
    let address = format!("/v1/environments/{id}");
    assert_eq!(answer.header("location"), Some(address.as_str()));
    id
}

#[tokio::test(flavor = "multi_thread")]
async fn a_panorama_is_its_bytes_and_survives_until_it_is_deleted() {
    let data = folder();
    let house = House::open(data.path()).await;
    let bytes = panorama([128, 128, 128, 129]);
    let id = upload(&house, &bytes, 201).await;
    assert_eq!(upload(&house, &bytes, 200).await, id, "the same bytes");
    let other = upload(&house, &panorama([128, 64, 32, 129]), 201).await;
    assert_ne!(other, id);
    house.close().await;

    let house = House::open(data.path()).await;
    let address = format!("/v1/environments/{id}");
    let told = house.get(&address).await;
    assert_eq!(
        told.json(),
        json!({
            "id": id, "width": 8, "height": 4, "format": "hdr",
            "links": {"self": address, "file": format!("{address}/file")},
        })
    );
    let file = house.get(&format!("{address}/file")).await;
    assert_eq!(file.header("content-type"), Some("image/vnd.radiance"));
    assert_eq!(file.body, bytes);
    for id in [&id, &other] {
        let address = format!("/v1/environments/{id}");
        assert_eq!(house.ask("DELETE", &address, &[], b"").await.status, 204);
        let problem = house
            .get(&address)
            .await
            .problem(404, "unknown-environment");
        assert!(problem["accepted"].is_string());
        let gone = house.ask("DELETE", &address, &[], b"").await;
        gone.problem(404, "unknown-environment");
    }
    house.close().await;
    assert_eq!(walk(&data.path().join("blobs")), 0, "their files are gone");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_panorama_is_refused_and_not_kept() {
    let data = folder();
    let mut config = ServiceConfig::new(data.path().to_owned());
    (config.limits.bytes, config.limits.pixels) = (1000, 32);
    let house = House::with(config).await;
    let large = [&b"#?RADIANCE\n\n-Y 4 +X 9\n"[..], &[9; 144]].concat();
    for body in [&b""[..], b"PK zip", b"#?RADIANCE\n\n-Y 4 +X 8\n123", &large] {
        let answer = house.ask("POST", "/v1/environments", &[], body).await;
        let problem = answer.problem(422, "unusable-environment");
        assert_eq!(
            (&problem["in"], &problem["pointer"]),
            (&json!("body"), &json!(""))
        );
        let accepted = problem["accepted"].as_str().expect("says what instead");
        assert!(
            accepted.contains(".hdr") && accepted.contains(".exr"),
            "{accepted}"
        );
    }
    let answer = house
        .ask("POST", "/v1/environments", &[], &[b'#'; 1001])
        .await;
    answer.problem(413, "too-large");
    let query = house
        .ask("POST", "/v1/environments?name=sky", &[], b"#?")
        .await;
    assert_eq!(query.problem(400, "invalid-parameter")["pointer"], "/name");
    house.close().await;
    assert_eq!(walk(&data.path().join("blobs")), 0, "nothing was kept");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_is_lit_by_the_panorama_that_is_asked_for() {
    let data = folder();
    let house = House::real(data.path()).await;
    let sample = sample_by_name("white").expect("a sample");
    let paint = sample.build(&Profile::draft(), &|_| ()).expect("builds");
    let headers = [("Prefer", "wait=300")];
    let uploaded = house
        .ask(
            "POST",
            "/v1/paints",
            &headers,
            &paint.to_bytes().expect("finite"),
        )
        .await;
    let paint = uploaded.json()["id"].as_str().expect("an id").to_owned();
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

#[tokio::test(flavor = "multi_thread")]
async fn a_real_sky_is_read() {
    let sky = std::env::var_os("CARPAINT_DATA")
        .map(|data| PathBuf::from(data).join("data/environments/sky.hdr"));
    let Some(sky) = sky.filter(|sky| sky.exists()) else {
        eprintln!("skipped: no data/environments/sky.hdr under CARPAINT_DATA");
        return;
    };
    let data = folder();
    let house = House::open(data.path()).await;
    let bytes = std::fs::read(sky).expect("the sky");
    let id = upload(&house, &bytes, 201).await;
    let told = house.get(&format!("/v1/environments/{id}")).await.json();
    let side = |name: &str| told[name].as_u64().expect("a side");
    assert_eq!(side("width"), 2 * side("height"), "{told}");
    house.close().await;
}
