//! Longer work, and what becomes of it over a restart.

use carpaint::service::ServiceConfig;
use futures::future::join_all;
use serde_json::json;

use crate::house::House;
use crate::{folder, walk};

#[tokio::test(flavor = "multi_thread")]
async fn who_waits_for_a_job_is_told_the_seconds_of_its_stages() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let order = json!({ "paints": [a, b] }).to_string();
    let made = house.post_json("/v1/blends", &order).await;
    assert_eq!(made.status, 201, "{}", made.text());
    let timing = made.header("server-timing").expect("stages");
    for stage in ["waiting", "read", "blend", "store", "job", "total"] {
        assert!(timing.contains(&format!("{stage};dur=")), "{timing}");
    }
    let again = house.post_json("/v1/blends", &order).await;
    let timing = again.header("server-timing").expect("stages");
    assert!(
        again.status == 200 && !timing.contains("read;dur="),
        "{timing}"
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn long_work_is_a_job_that_tells_and_can_be_cancelled() {
    let data = folder();
    let house = House::open(data.path()).await;
    let answer = house.submit(b"slow one").await;
    assert_eq!(answer.status, 202, "{answer:?}");
    let address = answer.header("location").expect("a job").to_owned();
    assert_eq!(
        format!("/v1/jobs/{}", answer.json()["id"].as_str().expect("an id")),
        address
    );

    let other = house.submit(b"slow one").await;
    assert_eq!(
        other.json()["id"],
        answer.json()["id"],
        "the same upload waits for the same job"
    );

    let events = house.get(&format!("{address}/events")).await;
    assert_eq!(events.header("content-type"), Some("text/event-stream"));
    let text = events.text();
    assert!(
        text.matches("event: progress").count() > 5 && text.matches("event: end").count() == 1,
        "{text}"
    );
    let last = text
        .lines()
        .rfind(|line| line.starts_with("data: "))
        .expect("data");
    let job: serde_json::Value = serde_json::from_str(&last[6..]).expect("JSON");
    assert_eq!(
        (&job["state"], &job["progress"]),
        (&json!("done"), &json!(1.0))
    );
    assert!(text.contains("seconds_left"));
    let took = |stage: &str| {
        let stages = job["stages"].as_array().expect("a list");
        let own = stages.iter().find(|own| own["stage"] == stage);
        own.and_then(|own| own["seconds"].as_f64()).expect("told")
    };
    assert!(took("waiting") < 4.0 && took("store") < 4.0, "{job}");
    assert!((3.9..20.0).contains(&took("fit")), "{job}");
    assert_eq!(house.get(&address).await.json(), job);
    assert_eq!(
        house
            .get(job["result"].as_str().expect("an address"))
            .await
            .status,
        200
    );
    house
        .ask("DELETE", &address, &[], b"")
        .await
        .problem(409, "job-ended");
    assert!(
        house
            .get(&format!("{address}/events"))
            .await
            .text()
            .starts_with("event: end")
    );

    let answer = house.submit(b"slow two").await;
    let address = answer.header("location").expect("a job").to_owned();
    let cancelled = house.ask("DELETE", &address, &[], b"").await;
    assert_eq!(
        (cancelled.status, &cancelled.json()["state"]),
        (200, &json!("cancelled")),
        "{cancelled:?}"
    );
    assert_eq!(house.get(&address).await.json()["state"], "cancelled");

    let failed = house.submit(b"not one").await;
    let address = failed.header("location").expect("a job").to_owned();
    let failed = house.until(&address, |job| job["state"] == "failed").await;
    let problem = &failed["problem"];
    assert_eq!(problem["type"], "/problems/unusable-measurement");
    assert_eq!(problem["detail"], "the upload: this is no measurement");
    let blobs = walk(&data.path().join("blobs"));
    assert_eq!(
        blobs, 2,
        "one paint and its upload: what came to nothing is not kept"
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_changes_nothing_and_goes_on_with_what_was_under_way() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let addresses = [
        format!("/v1/paints/{a}"),
        format!("/v1/blends/{blend}"),
        format!("/v1/blends/{blend}/realisation.zip?alpha=0.25&beta=0.75"),
        format!("/v1/blends/{blend}/preview.png?alpha=0.25&beta=0.75"),
    ];
    let before = join_all(addresses.iter().map(|path| house.get(path))).await;
    let answer = house.submit(b"slow three").await;
    let job = answer.header("location").expect("a job").to_owned();
    let begun = house.until(&job, |job| job["state"] != "queued").await;
    assert_eq!(begun["state"], "running");
    house.close().await;

    let house = House::open(data.path()).await;
    let after = join_all(addresses.iter().map(|path| house.get(path))).await;
    for ((before, after), path) in before.iter().zip(&after).zip(&addresses) {
        assert_eq!(
            (after.status, after.etag(), &after.body),
            (200, before.etag(), &before.body),
            "{path}"
        );
    }
    assert_eq!(
        house.count("carpaint_realisations_computed_total").await,
        0.0,
        "results are kept"
    );
    assert_eq!(house.count("carpaint_blends_computed_total").await, 0.0);
    assert_eq!(house.blend(&[&b, &a]).await.len(), blend.len());
    assert_eq!(
        house.count("carpaint_blends_computed_total").await,
        0.0,
        "the other order shares the kept correspondence"
    );
    house.until(&job, |job| job["state"] == "done").await;
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_data_folder_serves_one_process() {
    let data = folder();
    let house = House::open(data.path()).await;
    let second = carpaint::service::open(
        ServiceConfig::new(data.path().to_owned()),
        std::sync::Arc::new(crate::house::Pretend),
    );
    assert!(
        second
            .await
            .expect_err("in use")
            .to_string()
            .contains("in use")
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_paint_that_cannot_be_stored_waits_for_the_store() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (incoming, away) = (data.path().join("incoming"), data.path().join("away"));
    let answer = house.submit(b"slow six").await;
    let address = answer.header("location").expect("a job").to_owned();
    house.until(&address, |job| job["progress"] != 0.0).await;
    // Nothing can be written from now on.
    std::fs::rename(&incoming, &away).expect("moves");
    let stage = |job: &serde_json::Value| job["stage"] == "waiting for the store";
    let waiting = house.until(&address, stage).await;
    assert_eq!(waiting["state"], "running", "{waiting}");
    std::fs::rename(&away, &incoming).expect("moves back");
    let job = house.until(&address, |job| job["state"] != "running").await;
    assert_eq!(job["state"], "done", "{job}");
    let paint = job["result"].as_str().expect("an address");
    assert_eq!(house.get(paint).await.status, 200);
    assert_eq!(house.count("carpaint_paints_fitted_total").await, 1.0);
    house.close().await;
}
