//! Readings over HTTP.

use crate::{folder, house::House};

#[tokio::test(flavor = "multi_thread")]
async fn a_paint_is_read_at_any_angle_above_it() {
    let data = folder();
    let house = House::open(data.path()).await;
    let id = house.paint("silver").await;
    let address = format!("/v1/paints/{id}/readings");
    let six = house.get(&address).await;
    assert_eq!(six.status, 200, "{six:?}");
    let angles: Vec<f64> = rows(&six.json()).map(|row| row[0]).collect();
    assert_eq!(angles, [-15.0, 15.0, 25.0, 45.0, 75.0, 110.0]);
    for angle in ["20", "60", "85"] {
        let gloss = six.json()["gloss"][angle].as_f64().expect("a number");
        assert!((0.0..100.0).contains(&gloss), "{angle}: {gloss}");
    }
    let two = house.get(&format!("{address}?angles=45,-15")).await;
    let table = house.get(&format!("{address}.csv?angles=45,-15")).await;
    assert_eq!(table.header("content-type"), Some("text/csv"));
    let table = table.text();
    let lines: Vec<&str> = table.split("\r\n").collect();
    assert_eq!((lines[0], lines.len()), ("aspecular_deg,L,a,b", 4));
    for (line, row) in lines[1..].iter().zip(rows(&two.json())) {
        let values: Vec<f64> = line
            .split(',')
            .map(|v| v.parse().expect("a number"))
            .collect();
        assert_eq!(values, row);
    }
    let document = house.get(&format!("{address}.cxf?angles=45,-15")).await;
    assert_eq!(document.header("content-type"), Some("application/xml"));
    let saved = format!("attachment; filename=\"{id}.readings.cxf\"");
    assert_eq!(document.header("content-disposition"), Some(saved.as_str()));
    let document = document.text();
    for row in rows(&two.json()) {
        let [angle, l, a, b] = row[..] else {
            panic!("{row:?}")
        };
        for said in [
            format!("<cc:Aspecular>{angle}</cc:Aspecular>"),
            format!("<cc:L>{l}</cc:L><cc:A>{a}</cc:A><cc:B>{b}</cc:B>"),
        ] {
            assert!(document.contains(&said), "{said}: {document}");
        }
    }
    house
        .get(&format!("{address}.cxf?angles=135"))
        .await
        .problem(400, "invalid-parameter");
    let tag = [("If-None-Match", six.etag())];
    assert_eq!(house.ask("GET", &address, &tag, &[]).await.status, 304);

    for (angles, names) in [
        ("135", "135"),
        ("-45,15", "-45"),
        ("", "number"),
        ("x", "x"),
        ("nan", "nan"),
    ] {
        let refused = house.get(&format!("{address}?angles={angles}")).await;
        let problem = refused.problem(400, "invalid-parameter");
        assert!(
            problem["detail"]
                .as_str()
                .is_some_and(|d| d.contains(names))
                || problem["accepted"]
                    .as_str()
                    .is_some_and(|d| d.contains(names)),
            "{problem}"
        );
    }
    house
        .get("/v1/paints/p_none/readings")
        .await
        .problem(404, "unknown-paint");
}

fn rows(readings: &serde_json::Value) -> impl Iterator<Item = Vec<f64>> {
    let rows = readings["rows"].as_array().expect("rows").clone();
    rows.into_iter()
        .map(|row| serde_json::from_value(row).expect("numbers"))
}
