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
    let stages = quick.header("server-timing").expect("stages");
    assert!(stages.contains("search;dur="), "{stages}");
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
    let told = estimate.json();
    assert_eq!(
        (&told["profile"], &told["kept"]),
        (&json!("draft"), &json!(true))
    );
    let greedy = json!({ "work": "blend", "paints": [a, b], "profile": { "transport": "greedy" } });
    let greedy = house.post_json("/v1/estimates", &greedy.to_string()).await;
    assert_eq!(greedy.json()["kept"], false, "{}", greedy.text());
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

    // How the blend was made is not changed by what is made of it.
    let id = by_name.json()["id"].as_str().expect("an id").to_owned();
    let written = |cost: &str| {
        let path = format!("/v1/blends/{id}/realisation.zip?weights=0.5,0.5&profile=cost={cost}");
        let house = &house;
        async move { house.get(&path).await }
    };
    let file = written("distance").await;
    assert_eq!(
        (file.status, file.header("carpaint-accuracy")),
        (200, Some("flakes-lab=0.25"))
    );
    for (format, kept) in [("zip", true), ("glb", false)] {
        let order = json!({ "work": "realise", "blend": id, "format": format });
        let told = house.post_json("/v1/estimates", &order.to_string()).await;
        assert_eq!(told.json()["kept"], kept, "{format}: {}", told.text());
    }
    let settled = written("squared").await;
    let settled = settled.problem(400, "invalid-parameter");
    assert_eq!(
        (&settled["pointer"], &settled["accepted"]),
        (
            &json!("/profile"),
            &json!("cost=distance, or a profile without cost")
        )
    );
    let estimate = json!({ "work": "realise", "blend": id, "profile": { "cost": "squared" } });
    let estimate = house
        .post_json("/v1/estimates", &estimate.to_string())
        .await;
    assert_eq!(
        estimate.problem(422, "invalid-value")["pointer"],
        "/profile/cost"
    );

    let shipped = house.get("/v1/accuracy").await;
    assert_eq!(shipped.json()["format"], "carpaint study");
    assert_eq!(shipped.header("carpaint-study"), Some("shipped"));
    let mut own = shipped.json();
    own["program"] = json!("of this house");
    let write = |text: &str| std::fs::write(data.path().join("study.json"), text).expect("written");
    write(&own.to_string());
    let served = house.get("/v1/accuracy").await;
    assert_eq!(served.header("carpaint-study"), Some("installation"));
    assert_eq!(served.json()["program"], "of this house");
    for none in ["{}", "[1, 2", r#"{"format": "of this house"}"#] {
        write(none);
        let served = house.get("/v1/accuracy").await;
        assert_eq!(served.json(), shipped.json(), "{none} is no study");
        assert_eq!(served.header("carpaint-study"), Some("shipped"), "{none}");
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_target_is_searched_for_once_and_told_in_the_answer() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = json!({ "paints": [a, b], "max_error": 0.5 }).to_string();
    let (first, again) = tokio::join!(
        house.post_json("/v1/blends", &blend),
        house.post_json("/v1/blends", &blend)
    );
    for answer in [&first, &again] {
        let target = &answer.json()["target"];
        assert_eq!(target["asked"], json!({ "max_error": 0.5 }), "{target}");
        assert_eq!(
            (&target["met"], &target["profile"]),
            (&json!(true), &json!("reference"))
        );
        assert_eq!(target["error"], json!({ "value": 0.25, "unit": "Lab" }));
    }
    let later = house.post_json("/v1/blends", &blend).await;
    assert_eq!(
        (later.status, &later.json()["target"]["met"]),
        (200, &json!(true))
    );
    assert_eq!(house.count("carpaint_targets_searched_total").await, 1.0);
    // What is told to everybody says nothing of one caller's target.
    let id = first.json()["id"].as_str().expect("an id").to_owned();
    let shown = house.get(&format!("/v1/blends/{id}")).await.json();
    assert_eq!(shown.get("target"), None);

    let at_once = [("Prefer", "respond-async")];
    let job = house
        .ask("POST", "/v1/paints?max_error=0.5", &at_once, b"red")
        .await;
    assert_eq!(
        (job.status, &job.json()["target"]["met"]),
        (202, &json!(true)),
        "{}",
        job.text()
    );

    let scene = |more: serde_json::Value| {
        let mut scene = json!({ "paint": a, "size": [8, 8] });
        let more = more.as_object().expect("an object").clone();
        scene.as_object_mut().expect("an object").extend(more);
        scene.to_string()
    };
    let before = house.count("carpaint_targets_searched_total").await;
    for _ in 0..2 {
        let drawn = scene(json!({ "max_seconds": 2 }));
        let drawn = house.post_json("/v1/previews", &drawn).await;
        assert_eq!(drawn.status, 200, "{}", drawn.text());
        assert!(
            drawn
                .header("carpaint-target")
                .is_some_and(|t| t.contains("draft"))
        );
    }
    let searched = house.count("carpaint_targets_searched_total").await - before;
    assert_eq!(
        searched, 1.0,
        "a picture that is kept is not searched for again"
    );
    for (wrong, pointer) in [
        (json!({ "max_seconds": 0 }), "/max_seconds"),
        (json!({ "max_error": 1, "profile": "draft" }), "/max_error"),
        (
            json!({ "max_seconds": 1, "samples_per_pixel": 4 }),
            "/max_seconds",
        ),
        (
            json!({ "max_seconds": 1, "show": "aspecular" }),
            "/max_seconds",
        ),
    ] {
        let refused = house.post_json("/v1/previews", &scene(wrong)).await;
        assert_eq!(refused.problem(422, "invalid-value")["pointer"], pointer);
    }
    house.close().await;
}
