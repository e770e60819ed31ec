//! Pictures, their reports, and whole scenes.

use std::time::Duration;

use serde_json::json;

use crate::folder;
use crate::house::House;

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
