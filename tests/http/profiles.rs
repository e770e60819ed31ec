//! Profiles and targets in requests.

use serde_json::json;

use crate::folder;
use crate::house::House;

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
