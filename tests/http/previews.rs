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
        (json!({"paint": a, "show": "gloss"}), "/show"),
        (
            json!({"paint": a, "show": "aspecular", "samples_per_pixel": 4}),
            "/samples_per_pixel",
        ),
        (
            json!({"paint": a, "show": "aspecular", "profile": "draft"}),
            "/profile",
        ),
        (json!({"paint": a, "format": "gif"}), "/format"),
        (json!({"paint": a, "profile": "best"}), "/profile"),
        (
            json!({"blend": blend, "weights": [0.5, 0.5], "profile": {"clusters": 7}}),
            "/profile/clusters",
        ),
        (
            json!({"paint": a, "samples_per_pixel": 4, "profile": {"samples_per_pixel": 5}}),
            "/samples_per_pixel",
        ),
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
async fn angles_are_the_same_for_every_paint_and_other_than_the_paint() {
    let data = folder();
    let house = House::real(data.path()).await;
    let mut paints = Vec::new();
    for name in ["white", "2k_acrylack"] {
        paints.push(house.sample(name).await);
    }
    let blend = house.blend(&[&paints[0], &paints[1]]).await;
    let query = "size=48x32&show=aspecular";
    let of = async |path: &str| {
        let answer = house.get(path).await;
        assert_eq!(
            answer.status,
            200,
            "{path}: {:?}",
            answer.header("x-request-id")
        );
        answer
    };
    let png = of(&format!("/v1/paints/{}/preview.png?{query}", paints[0])).await;
    assert_eq!(png.header("carpaint-accuracy"), None, "nothing is sampled");
    for same in [
        format!("/v1/paints/{}/preview.png?{query}", paints[1]),
        format!("/v1/blends/{blend}/preview.png?{query}&weights=0.2,0.8"),
        // The studio's key is stronger than any light of usual strength, wherever that is.
        format!("/v1/paints/{}/preview.png?{query}&light=0,0,1", paints[0]),
    ] {
        assert!(of(&same).await.body == png.body, "{same}");
    }
    let path = format!("/v1/paints/{}/preview.png?size=48x32&spp=1", paints[0]);
    assert!(of(&path).await.body != png.body, "the paint");
    let strong = json!({
        "paint": paints[0], "size": [48, 32], "show": "aspecular",
        "lights": [{"towards": [0, 0, 1]}, {"towards": [0, 1, 1], "irradiance": [5, 5, 5]}],
    });
    let strong = house.post_json("/v1/previews", &strong.to_string()).await;
    assert!(
        strong.status == 200 && strong.body != png.body,
        "a stronger light"
    );
    let posted = json!({"paint": paints[0], "size": [48, 32], "show": "aspecular"});
    let posted = house.post_json("/v1/previews", &posted.to_string()).await;
    assert!(posted.body == png.body, "posted");
    let exr = of(&format!("/v1/paints/{}/preview.exr?{query}", paints[0])).await;
    assert!(exr.body.windows(14).any(|at| at == b"aspecular_deg\0"));
    let report = of(&format!("/v1/paints/{}/preview.json?{query}", paints[0])).await;
    let map = &report.json()["aspecular"];
    assert_eq!(map["main_light"], "environment");
    let candidates = map["candidates"].as_array().expect("candidates");
    let lights: Vec<_> = candidates.iter().map(|of| &of["light"]).collect();
    assert_eq!(lights, ["directional_light", "environment"]);
    let strength = |k: usize| candidates[k]["irradiance"][1].as_f64().expect("light");
    assert!(strength(0) < strength(1), "{map}");
    let borders: Vec<f64> = map["bands"]
        .as_array()
        .expect("bands")
        .iter()
        .map(|band| band["to_deg"].as_f64().expect("a number"))
        .collect();
    assert_eq!(borders, [15.0, 25.0, 45.0, 75.0, 110.0, 180.0]);
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
