//! The bundle of a whole blend.

use futures::future::join_all;
use serde_json::json;

use super::house::House;

#[tokio::test(flavor = "multi_thread")]
async fn the_bundle_of_a_blend_is_made_once_and_kept_for_ever() {
    let data = tempfile::tempdir().expect("a folder");
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let address = format!("/v1/blends/{blend}/bundle.zip");
    assert_eq!(
        house.get(&format!("/v1/blends/{blend}")).await.json()["links"]["bundle"],
        address
    );
    let answers = join_all((0..8).map(|_| house.get(&address))).await;
    let first = &answers[0];
    assert_eq!(first.header("content-type"), Some("application/zip"));
    assert!(first.body.starts_with(b"PK"), "an archive");
    assert!(
        answers
            .iter()
            .all(|a| a.status == 200 && a.body == first.body && a.etag() == first.etag())
    );
    let kept = first.header("cache-control").expect("how long it keeps");
    assert!(kept.contains("immutable"), "{kept}");
    let etag = first.etag().to_owned();
    let known = [("If-None-Match", etag.as_str())];
    assert_eq!(house.ask("GET", &address, &known, b"").await.status, 304);
    assert_eq!(
        house.count("carpaint_blend_bundles_computed_total").await,
        1.0
    );
    let finer = house
        .get(&format!("{address}?profile=standard,precision=f32"))
        .await;
    assert!(finer.status == 200 && finer.body != first.body);
    assert_eq!(
        house.count("carpaint_blend_bundles_computed_total").await,
        2.0
    );
    let aimed = house.get(&format!("{address}?max_error=0.5")).await;
    assert_eq!(aimed.status, 200, "{}", aimed.text());
    let target = aimed.header("carpaint-target").expect("what was picked");
    assert!(target.contains("profile=reference"), "{target}");
    assert!(
        aimed
            .header("cache-control")
            .is_some_and(|kept| !kept.contains("immutable"))
    );
    house
        .get(&format!("{address}?max_error=0.5&profile=draft"))
        .await
        .problem(400, "invalid-parameter");
    let estimate = |order: serde_json::Value| {
        let (house, text) = (&house, order.to_string());
        async move { house.post_json("/v1/estimates", &text).await }
    };
    let told = estimate(json!({"work": "bundle", "blend": blend})).await;
    assert_eq!(
        (told.status, &told.json()["kept"]),
        (200, &json!(true)),
        "{}",
        told.text()
    );
    let other = json!({"work": "bundle", "blend": blend, "profile": {"draw": "alias"}});
    assert_eq!(estimate(other).await.json()["kept"], false);
    for (order, pointer) in [
        (json!({"work": "bundle"}), "/blend"),
        (json!({"work": "bundle", "blend": "b_1"}), "/blend"),
        (
            json!({"work": "bundle", "blend": blend, "weights": [1, 0]}),
            "/weights",
        ),
        (
            json!({"work": "realise", "paint": a, "lights": []}),
            "/lights",
        ),
        (
            json!({"work": "realise", "paint": a, "blend": blend}),
            "/paint",
        ),
    ] {
        let problem = estimate(order).await.problem(422, "invalid-value");
        assert_eq!(problem["pointer"], pointer, "{problem}");
    }
    house
        .get(&format!("{address}?weights=1,0"))
        .await
        .problem(400, "invalid-parameter");
    let nobody = format!("/v1/blends/b_{}/bundle.zip", "0".repeat(32));
    house.get(&nobody).await.problem(404, "unknown-blend");
    house.close().await;
}
