//! Panoramas: uploaded, told, drawn with, deleted.

use std::path::PathBuf;

use carpaint::service::ServiceConfig;
use serde_json::json;

use crate::house::House;
use crate::{folder, walk};

/// A Radiance picture of 8 x 4 pixels of one light.
pub fn panorama(rgbe: [u8; 4]) -> Vec<u8> {
    let head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n";
    [&head[..], &rgbe.repeat(32)].concat()
}

pub async fn upload(house: &House, bytes: &[u8], status: u16) -> String {
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
    (config.limits.table_bytes, config.limits.pixels) = (1000, 32);
    let house = House::with(config).await;
    let large = [&b"#?RADIANCE\n\n-Y 4 +X 9\n"[..], &[9; 144]].concat();
    let square = [&b"#?RADIANCE\n\n-Y 4 +X 4\n"[..], &[9; 64]].concat();
    for body in [
        &b""[..],
        b"PK zip",
        b"#?RADIANCE\n\n-Y 4 +X 8\n123",
        &large,
        &square,
    ] {
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
    let problem = answer.problem(413, "too-large");
    assert_eq!(problem["accepted"], "up to 1000 bytes of such a file");
    let query = house
        .ask("POST", "/v1/environments?name=sky", &[], b"#?")
        .await;
    assert_eq!(query.problem(400, "invalid-parameter")["pointer"], "/name");
    house.close().await;
    assert_eq!(walk(&data.path().join("blobs")), 0, "nothing was kept");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refused_upload_takes_nothing_from_another_of_the_same_bytes() {
    let data = folder();
    let house = House::open(data.path()).await;
    let other = panorama([1, 2, 3, 128]);
    let key = [("Idempotency-Key", "taken")];
    let first = house.ask("POST", "/v1/environments", &key, &other).await;
    assert_eq!(first.status, 201);
    for round in 0..20_u8 {
        let bytes = panorama([round, 200, 30, 129]);
        let refused = house.ask("POST", "/v1/environments", &key, &bytes);
        let (refused, good, same) = tokio::join!(
            refused,
            house.ask("POST", "/v1/environments", &[], &bytes),
            house.ask("POST", "/v1/environments", &[], &bytes),
        );
        refused.problem(422, "idempotency-key-used");
        let mut statuses = [good.status, same.status];
        statuses.sort_unstable();
        assert_eq!(statuses, [200, 201], "{}", good.text());
        let file = good.json()["links"]["file"]
            .as_str()
            .expect("a link")
            .to_owned();
        assert_eq!(house.get(&file).await.body, bytes);
    }
    house.close().await;
    assert_eq!(walk(&data.path().join("blobs")), 21);
}

#[tokio::test(flavor = "multi_thread")]
async fn environments_are_listed_in_pages() {
    let data = folder();
    let house = House::open(data.path()).await;
    let mut ids = Vec::new();
    for red in 1..=5 {
        ids.push(upload(&house, &panorama([red, 9, 9, 129]), 201).await);
    }
    let (mut listed, mut cursor) = (Vec::new(), String::new());
    for last in [false, false, true] {
        let page = house
            .get(&format!("/v1/environments?limit=2{cursor}"))
            .await;
        let page = page.json();
        let of = page["environments"].as_array().expect("a list");
        assert!(of.iter().all(|one| one["width"] == 8));
        listed.extend(
            of.iter()
                .map(|one| one["id"].as_str().expect("an id").to_owned()),
        );
        let next = page["next"].as_str();
        assert_eq!(next.is_none(), last, "{page}");
        cursor = format!("&cursor={}", next.unwrap_or_default());
    }
    assert_eq!(listed, ids);
    for (query, pointer) in [
        ("limit=0", "/limit"),
        ("limit=201", "/limit"),
        ("cursor=!", "/cursor"),
    ] {
        let answer = house.get(&format!("/v1/environments?{query}")).await;
        let problem = answer.problem(400, "invalid-parameter");
        assert_eq!(problem["pointer"], pointer);
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_real_sky_is_read() {
    let root = std::env::var_os("CARPAINT_DATA");
    let root = root.map_or_else(|| PathBuf::from("../shared"), PathBuf::from);
    let sky = root.join("data/environments/sky.hdr");
    if !sky.exists() {
        let told = format!("no {}, set CARPAINT_DATA", sky.display());
        assert!(std::env::var_os("CI").is_none(), "{told}");
        eprintln!("SKIPPED: {told}");
        return;
    }
    let data = folder();
    let house = House::open(data.path()).await;
    let bytes = std::fs::read(sky).expect("the sky");
    let id = upload(&house, &bytes, 201).await;
    let told = house.get(&format!("/v1/environments/{id}")).await.json();
    let side = |name: &str| told[name].as_u64().expect("a side");
    assert_eq!(side("width"), 2 * side("height"), "{told}");
    house.close().await;
}
