//! Paints in the order of how near they are to a color.

use carpaint::color::{Lab, ciede2000};
use serde_json::Value;

use crate::folder;
use crate::house::House;

fn ids(list: &Value) -> Vec<String> {
    let paints = list["paints"].as_array().expect("a list").iter();
    paints
        .map(|paint| paint["id"].as_str().expect("an id").to_owned())
        .collect()
}

fn lab(values: &Value) -> Lab {
    Lab::from(serde_json::from_value::<[f64; 3]>(values.clone()).expect("three numbers"))
}

/// L, a, b of a paint at an angle, as its readings have them.
async fn reading(house: &House, id: &str, angle: f64) -> String {
    let address = format!("/v1/paints/{id}/readings?angles={angle}");
    let readings = house.get(&address).await.json();
    let row: [f64; 4] = serde_json::from_value(readings["rows"][0].clone()).expect("a row");
    format!("{},{},{}", row[1], row[2], row[3])
}

#[tokio::test(flavor = "multi_thread")]
async fn paints_are_listed_by_their_difference_to_a_color_at_an_angle() {
    let data = folder();
    let house = House::open(data.path()).await;
    for words in ["silver", "blue", "red", "green", "white", "black"] {
        house.paint(words).await;
    }
    // The same bytes under another name are another paint of the same colors.
    let twin = house.ask(
        "POST",
        "/v1/paints?name=twin",
        &[("Prefer", "wait=60")],
        b"silver",
    );
    let twin = twin.await.json()["id"].as_str().expect("an id").to_owned();
    for (angle, given) in [(45.0, ""), (15.0, "&angle=15"), (-15.0, "&angle=-15")] {
        let near = reading(&house, &twin, angle).await;
        let address = format!("/v1/paints?near={near}{given}");
        let list = house.get(&address).await.json();
        let (wanted, paints) = (
            lab(&serde_json::from_str(&format!("[{near}]")).expect("JSON")),
            list["paints"].as_array().expect("a list"),
        );
        assert_eq!((paints.len(), &list["next"]), (7, &Value::Null));
        let mut before = (0.0, String::new());
        for paint in paints {
            let id = paint["id"].as_str().expect("an id").to_owned();
            let there = lab(&paint["lab"]);
            let read = reading(&house, &id, angle).await;
            let read = lab(&serde_json::from_str(&format!("[{read}]")).expect("JSON"));
            assert!(ciede2000(there, read) < 1e-9, "{paint}");
            let delta_e = paint["delta_e"].as_f64().expect("a number");
            assert!((delta_e - ciede2000(wanted, read)).abs() < 1e-6, "{paint}");
            let rank = (delta_e, id);
            assert!(before < rank, "nearest first, then by id: {paint}");
            before = rank;
        }
        let equal = paints.iter().filter(|paint| paint["delta_e"] == 0.0);
        let equal = equal.count();
        assert!(equal > 1 && ids(&list)[..equal].contains(&twin), "{list}");

        let mut seen = Vec::new();
        let mut cursor = String::new();
        loop {
            let page = house
                .get(&format!("{address}&limit=2{cursor}"))
                .await
                .json();
            seen.extend(ids(&page));
            match page["next"].as_str() {
                Some(next) => cursor = format!("&cursor={next}"),
                None => break,
            }
        }
        assert_eq!(seen, ids(&list), "pages are parts of the whole list");
    }
    let found = house.get("/v1/paints?near=50,0,0&q=TWIN").await.json();
    assert_eq!(ids(&found), [twin.as_str()]);
    let plain = house.get("/v1/paints?limit=1").await.json();
    assert!(plain["paints"][0].get("delta_e").is_none(), "{plain}");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_order_is_the_same_after_a_restart_and_in_a_catalogue_of_before() {
    let data = folder();
    let house = House::open(data.path()).await;
    for words in ["silver", "blue", "red"] {
        house.paint(words).await;
    }
    let address = "/v1/paints?near=40,20,-10&angle=25";
    let first = house.get(address).await.json();
    let cursor = house.get(&format!("{address}&limit=1")).await.json()["next"].clone();
    house.close().await;

    let file = data.path().join("catalogue.sqlite");
    let address_of_file = format!("sqlite://{}", file.display());
    let catalogue = sqlx::SqlitePool::connect(&address_of_file);
    let catalogue = catalogue.await.expect("opens");
    let gone = sqlx::query("DELETE FROM notes").execute(&catalogue).await;
    assert_ne!(gone.expect("deletes").rows_affected(), 0);
    catalogue.close().await;

    let house = House::open(data.path()).await;
    assert_eq!(house.get(address).await.json(), first);
    let cursor = cursor.as_str().expect("a cursor");
    let rest = house
        .get(&format!("{address}&cursor={cursor}"))
        .await
        .json();
    assert_eq!(ids(&rest), ids(&first)[1..]);
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_color_that_is_none_is_refused_with_what_would_be_accepted() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (one, two) = (house.paint("silver").await, house.paint("blue").await);
    assert_ne!(one, two);
    let next = |list: Value| list["next"].as_str().expect("a cursor").to_owned();
    let of_list = next(house.get("/v1/paints?limit=1").await.json());
    let of_color = next(house.get("/v1/paints?near=1,2,3&limit=1").await.json());
    for (query, pointer, accepted) in [
        ("near=50,0".to_owned(), "/near", "3 numbers"),
        ("near=50,0,0,0".to_owned(), "/near", "3 numbers"),
        ("near=".to_owned(), "/near", "a finite number"),
        ("near=50,x,0".to_owned(), "/near", "a finite number"),
        ("near=nan,0,0".to_owned(), "/near", "a finite number"),
        ("near=-1,0,0".to_owned(), "/near", "L from 0 to 2000"),
        ("near=50,0,1e9".to_owned(), "/near", "-2000 to 2000"),
        ("near=50,0,0&angle=30".to_owned(), "/angle", "-15, 15, 25"),
        ("near=50,0,0&angle=x".to_owned(), "/angle", "number"),
        ("angle=45".to_owned(), "/angle", "near=L,a,b"),
        (format!("near=50,0,0&cursor={of_list}"), "/cursor", "next"),
        (format!("cursor={of_color}"), "/cursor", "next"),
    ] {
        let refused = house.get(&format!("/v1/paints?{query}")).await;
        let problem = refused.problem(400, "invalid-parameter");
        assert_eq!(problem["pointer"], pointer, "{query}: {problem}");
        let told = problem["accepted"].as_str().unwrap_or_default();
        assert!(told.contains(accepted), "{query}: {problem}");
    }
    house.close().await;
}
