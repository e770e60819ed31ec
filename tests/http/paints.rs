//! Paints: uploaded, read, taken back, deleted, published.

use std::time::Duration;

use serde_json::json;

use crate::house::House;
use crate::{folder, walk};

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_becomes_a_paint_that_can_be_read_taken_back_and_deleted() {
    let data = folder();
    let house = House::open(data.path()).await;
    let upload = vec![b's'; 3_000_000];
    let headers = [("Prefer", "wait=30"), ("Content-Type", "application/zip")];
    let made = house
        .ask("POST", "/v1/paints?name=Silver%20one", &headers, &upload)
        .await;
    assert_eq!(made.status, 201, "{made:?}");
    assert_eq!(made.header("preference-applied"), Some("wait=30"));
    let id = made.json()["id"].as_str().expect("an id").to_owned();
    let address = format!("/v1/paints/{id}");
    assert_eq!(made.header("location"), Some(address.as_str()));
    assert_eq!(made.json()["name"], "Silver one");

    let again = house
        .ask("POST", "/v1/paints?name=Silver%20one", &headers, &upload)
        .await;
    assert_eq!(
        (again.status, again.json()),
        (200, made.json()),
        "the same upload is the same paint"
    );
    let other = house
        .ask(
            "POST",
            "/v1/paints?name=Silver%20one&clusters=24",
            &headers,
            &upload,
        )
        .await;
    assert_ne!(
        other.json()["id"],
        made.json()["id"],
        "other options are another paint"
    );
    assert_eq!(house.count("carpaint_paints_fitted_total").await, 2.0);

    let shown = house.get(&address).await;
    assert_eq!((shown.status, shown.etag()), (200, made.etag()));
    assert_eq!(
        house.get(&format!("{address}/measurement")).await.body,
        upload
    );
    let file = house.get(&format!("{address}/paint")).await;
    assert!(file.body.starts_with(b"carpaint"));
    let list = house.get("/v1/paints?q=SILVER&limit=1").await.json();
    assert_eq!(list["paints"][0]["id"], id.as_str());
    let next = house
        .get(&format!(
            "/v1/paints?limit=1&cursor={}",
            list["next"].as_str().expect("a cursor")
        ))
        .await
        .json();
    assert_eq!(
        (&next["paints"][0]["id"], &next["next"]),
        (&other.json()["id"], &serde_json::Value::Null)
    );

    assert_eq!(house.ask("DELETE", &address, &[], b"").await.status, 204);
    house.get(&address).await.problem(404, "unknown-paint");
    house
        .get(&format!("{address}/preview.png"))
        .await
        .problem(404, "unknown-paint");
    house
        .ask("DELETE", &address, &[], b"")
        .await
        .problem(404, "unknown-paint");
    let kept = format!(
        "/v1/paints/{}/measurement",
        other.json()["id"].as_str().expect("an id")
    );
    assert_eq!(
        house.get(&kept).await.body,
        upload,
        "another paint still has the same measurement"
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_breaks_off_leaves_nothing() {
    let data = folder();
    let house = House::open(data.path()).await;
    {
        use tokio::io::AsyncWriteExt;
        let mut stream = tokio::net::TcpStream::connect(house.address)
            .await
            .expect("connects");
        let head = "POST /v1/paints HTTP/1.1\r\nHost: x\r\nContent-Length: 9000000\r\n\r\n";
        stream.write_all(head.as_bytes()).await.expect("sends");
        stream
            .write_all(&vec![b's'; 4_000_000])
            .await
            .expect("sends half");
    }
    for _ in 0..200 {
        if walk(&data.path().join("incoming")) == 0 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(
        (
            walk(&data.path().join("incoming")),
            walk(&data.path().join("blobs"))
        ),
        (0, 0)
    );
    assert_eq!(house.get("/v1/paints").await.json()["paints"], json!([]));
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_private_paint_is_left_out_of_lists() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let address = format!("/v1/paints/{a}");
    let published = house.get(&address).await;
    assert_eq!(published.json()["visibility"], "published");
    let change = |body: &'static str| {
        let (house, address) = (&house, &address);
        async move {
            let headers = [("Content-Type", "application/json")];
            house.ask("PATCH", address, &headers, body.as_bytes()).await
        }
    };
    let private = change(r#"{"visibility": "private"}"#).await;
    assert_eq!(
        (private.status, &private.json()["visibility"]),
        (200, &json!("private"))
    );
    assert_ne!(private.etag(), published.etag());
    let ids = |list: serde_json::Value| -> Vec<String> {
        let paints = list["paints"].as_array().expect("a list").clone();
        let id = |paint: &serde_json::Value| paint["id"].as_str().expect("an id").to_owned();
        paints.iter().map(id).collect()
    };
    assert_eq!(ids(house.get("/v1/paints").await.json()), [b]);
    let hidden = house.get("/v1/paints?visibility=private").await.json();
    assert_eq!(ids(hidden), std::slice::from_ref(&a));
    let problem = change(r#"{"visibility": "secret"}"#)
        .await
        .problem(422, "invalid-value");
    assert_eq!(
        (&problem["pointer"], &problem["accepted"]),
        (&json!("/visibility"), &json!("published or private"))
    );
    assert_eq!(
        change(r#"{"visibility": "published"}"#).await.json(),
        published.json()
    );
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_blend_stays_private_when_its_private_paint_is_deleted() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = format!("/v1/blends/{}", house.blend(&[&a, &b]).await);
    let picture = format!("{blend}/realisation.zip?weights=1,0");
    let kept = async |path: &str| {
        let answer = house.get(path).await;
        assert_eq!(answer.status, 200, "{answer:?}");
        answer.header("cache-control").expect("says").to_owned()
    };
    assert!(kept(&picture).await.starts_with("public"));
    let headers = [("Content-Type", "application/json")];
    let address = format!("/v1/paints/{a}");
    let private = br#"{"visibility": "private"}"#;
    house.ask("PATCH", &address, &headers, private).await;
    assert!(kept(&picture).await.starts_with("private"));
    let gone = house.ask("DELETE", &address, &[], b"").await;
    assert_eq!(gone.status, 204, "{gone:?}");
    for path in [&blend, &picture] {
        assert!(kept(path).await.starts_with("private"), "{path}");
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_blend_that_is_deleted_is_gone_with_its_file_and_can_be_made_again() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let before = walk(&data.path().join("blobs"));
    let blend = house.blend(&[&a, &b]).await;
    let path = format!("/v1/blends/{blend}");
    assert_eq!(walk(&data.path().join("blobs")), before + 1);
    assert_eq!(house.ask("DELETE", &path, &[], b"").await.status, 204);
    assert_eq!(walk(&data.path().join("blobs")), before);
    house.get(&path).await.problem(404, "unknown-blend");
    let preview = house
        .get(&format!("{path}/preview.png?alpha=0.5&beta=0.5"))
        .await;
    preview.problem(404, "unknown-blend");
    let again = house.ask("DELETE", &path, &[], b"").await;
    again.problem(404, "unknown-blend");
    assert_eq!(house.blend(&[&a, &b]).await, blend);
    assert_eq!(house.get(&path).await.status, 200);
    house.close().await;
}
