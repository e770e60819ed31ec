//! The service with the real workshop behind it: uploads that are fitted, grids that differ, work that is called off.

use std::io::{Cursor, Write};
use std::time::{Duration, Instant};

use carpaint::accuracy::Profile;
use carpaint::fit::ClusterSettings;
use carpaint::workshop::sample_by_name;
use serde_json::{Value, json};

use crate::client::Answer;
use crate::house::House;
use crate::walk;

/// A table in the layout of the MPI car paints: a wide lobe over a diffuse base.
fn table(diffuse: f32) -> Vec<u8> {
    let mut bytes = vec![0; 84];
    for _channel in 0..3 {
        for h in 0..90_u16 {
            let lobe = 0.4 * (-f32::from(h * h) / 400.0).exp();
            for _ in 0..90 * 180 {
                bytes.extend_from_slice(&(diffuse + lobe).to_le_bytes());
            }
        }
    }
    bytes
}

/// A metallic sample of few clusters, at every so many-th angle.
fn metallic(name: &str, angle_step: usize) -> Vec<u8> {
    let draft = Profile::draft();
    let profile = Profile {
        flakes: ClusterSettings {
            clusters: 8,
            angle_step,
            ..draft.flakes
        },
        ..draft
    };
    let sample = sample_by_name(name).expect("a sample");
    let paint = sample.build(&profile, &|_| ()).expect("builds");
    paint.to_bytes().expect("finite")
}

async fn upload(house: &House, bytes: &[u8]) -> Value {
    let headers = [("Prefer", "wait=300")];
    let answer = house.ask("POST", "/v1/paints", &headers, bytes).await;
    assert_eq!(
        answer.status,
        201,
        "{}",
        String::from_utf8_lossy(&answer.body)
    );
    answer.json()
}

#[tokio::test(flavor = "multi_thread")]
async fn paints_on_differing_grids_are_blended_realised_drawn_and_uploaded_again() {
    let data = tempfile::tempdir().expect("temporary folder");
    let house = House::real(data.path()).await;
    let fine = upload(&house, &metallic("bmw339", 1)).await;
    let coarse = upload(&house, &metallic("ford_f8", 2)).await;
    assert_eq!(fine["provenance"]["simulated_flakes"], true);
    // Every angle that was measured is used: draft leaves out every second, and the grids would be the same.
    let order = json!({ "paints": [fine["id"], coarse["id"]], "profile": { "clusters": 8 } });
    let blend = house.post_json("/v1/blends", &order.to_string()).await;
    assert_eq!(blend.status, 201, "{blend:?}");
    let blend = blend.json();
    let notes = blend["notes"].to_string();
    assert!(notes.contains("ford_f8: its angles differ"), "{notes}");
    let correspondence = &blend["correspondence"];
    assert_eq!(correspondence["order"], "content hash");
    assert_eq!(correspondence["mixed"][0]["name"], "ford_f8");
    assert_eq!(correspondence["mixed"][0]["place"], 1);

    let base = blend["links"]["self"].as_str().expect("an address");
    let picture = "weights=3,-2&size=24x24&spp=1";
    let drawn = house.get(&format!("{base}/preview.png?{picture}")).await;
    assert_eq!((drawn.status, &drawn.body[..4]), (200, &b"\x89PNG"[..]));
    let timed = |answer: &Answer, stages: &[&str]| {
        let timing = answer.header("server-timing").expect("Server-Timing");
        let named: Vec<&str> = timing
            .split(", ")
            .filter_map(|stage| stage.split(';').next())
            .collect();
        assert_eq!(named, stages);
    };
    timed(&drawn, &["realise", "draw", "encode", "preview", "total"]);
    let again = house.get(&format!("{base}/preview.png?{picture}")).await;
    timed(&again, &["preview", "total"]);
    let whole = house.get(&format!("{base}/bundle.zip")).await;
    timed(&whole, &["error", "encode", "bundle", "total"]);
    let lab = blend["error"]["lab"].as_f64().expect("a known error");
    let told = |answer: &Answer, name: &str| -> Option<f64> {
        let header = answer.header("carpaint-accuracy")?;
        let figure = header.split(", ").find_map(|f| f.strip_prefix(name))?;
        figure.strip_prefix('=')?.parse().ok()
    };
    // What textures round comes on top.
    let written = |error: Option<f64>| error.is_some_and(|e| e > lab - 1e-4 && e < lab + 0.5);
    assert!(written(told(&whole, "flakes-lab")), "{lab} {whole:?}");
    for format in ["zip", "json", "glb"] {
        let address = format!("{base}/realisation.{format}?weights=0.5,0.5");
        let first = house.get(&address).await;
        assert!(written(told(&first, "flakes-lab")), "{lab} {first:?}");
        let loss = told(&first, "gltf-median-de2000");
        assert_eq!(loss.is_some_and(|loss| loss > 0.0), format == "glb");
        let kept = house.get(&address).await;
        let header = |answer: &Answer| answer.header("carpaint-accuracy").map(str::to_owned);
        assert_eq!(header(&kept), header(&first));
        assert_eq!(kept.body, first.body);
    }
    let report = house.get(&format!("{base}/preview.json?{picture}")).await;
    let report = report.json();
    let effects = report["rendering"]["effects"].as_array();
    assert!(effects.is_some_and(|list| list.len() > 3), "{report}");
    let clamps = &report["realisation"]["clamps"];
    assert!(
        clamps.as_array().is_some_and(|list| !list.is_empty()),
        "{report}"
    );

    let file = house
        .get(&format!("{base}/realisation.paint?weights=3,-2"))
        .await;
    timed(
        &file,
        &[
            "realise",
            "error",
            "certificate",
            "encode",
            "realisation",
            "total",
        ],
    );
    let again = upload(&house, &file.body).await;
    assert_eq!(again["provenance"]["simulated_flakes"], true);
    assert_eq!(
        again["provenance"]["realisation"]["base"],
        json!([3.0, -2.0])
    );
    assert_eq!(&again["clamps"], clamps);
    let order = json!({ "paints": [again["id"], fine["id"]], "clusters": 8 });
    let blend = house.post_json("/v1/blends", &order.to_string()).await;
    let reduced = blend.json()["correspondence"]["reduced"].clone();
    assert_eq!(
        (&reduced[0]["place"], &reduced[0]["to"]),
        (&json!(0), &json!(8))
    );
    let order = json!({ "paints": [fine["id"], coarse["id"]], "profile": "reference" });
    let finest = house.post_json("/v1/blends", &order.to_string()).await;
    let notes = finest.json()["notes"].to_string();
    assert!(
        notes.contains("bmw339: is clustered as it was ingested, with 8 clusters"),
        "{notes}"
    );
    let order = json!({ "paints": [fine["id"], coarse["id"]], "clusters": 7 });
    let refused = house.post_json("/v1/blends", &order.to_string()).await;
    let problem = refused.problem(422, "invalid-value");
    assert_eq!(problem["pointer"], "/clusters", "{problem}");
    let address = format!("{base}/realisation.zip?weights=1,0&profile=clusters%3D7");
    house.get(&address).await.problem(400, "invalid-parameter");
    house
        .get(&format!("{base}/bundle.zip?max_error=0"))
        .await
        .problem(400, "invalid-parameter");
    for option in [
        "coat_ior=1.5",
        "layout=merl",
        "theta_h=sqrt",
        "header_bytes=12",
    ] {
        let address = format!("/v1/paints?{option}");
        let refused = house.ask("POST", &address, &[], &file.body).await;
        refused.problem(400, "invalid-parameter");
    }
    let fitted = house.count("carpaint_paints_fitted_total").await;
    assert_eq!(fitted, 0.0, "a .paint is taken as it is");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_table_is_fitted_with_progress_and_its_fit_can_be_called_off() {
    let data = tempfile::tempdir().expect("temporary folder");
    let house = House::real(data.path()).await;
    let at_once = [("Prefer", "respond-async")];
    let answer = house.ask("POST", "/v1/paints", &at_once, &table(0.1)).await;
    let job = answer.header("location").expect("a job").to_owned();
    let begun = Instant::now();
    loop {
        let told = house.get(&job).await.json();
        assert!(
            told["state"] == "queued" || told["state"] == "running",
            "{told}"
        );
        if told["progress"].as_f64() > Some(0.1) {
            break;
        }
        assert!(begun.elapsed() < Duration::from_mins(2), "{told}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let cancelled = house.ask("DELETE", &job, &[], b"").await;
    assert_eq!(cancelled.status, 200, "{cancelled:?}");
    let begun = Instant::now();
    while house.get(&job).await.json()["state"] != "cancelled" {
        assert!(begun.elapsed() < Duration::from_mins(1));
        tokio::time::sleep(Duration::from_millis(20)).await;
    }

    let bytes = table(0.2);
    let paint = upload(&house, &bytes).await;
    assert_eq!(paint["name"], "unnamed mpi-2005");
    assert_eq!(house.count("carpaint_paints_fitted_total").await, 1.0);
    assert_eq!(paint["provenance"]["source"], "mpi-2005");
    let hash = blake3::hash(&bytes).to_hex().to_string();
    assert_eq!(paint["provenance"]["hashes"], json!([hash]));

    let wait = [("Prefer", "wait=60")];
    let unknown = house
        .ask("POST", "/v1/paints", &wait, b"neither this nor that")
        .await;
    let problem = unknown.problem(422, "unusable-measurement");
    assert_eq!(problem["pointer"], "/layout");
    assert_eq!(
        problem["accepted"],
        "rgl, mpi-2005, merl, package, csv or cxf"
    );
    house.close().await;
}

/// Largest distance in L, a, b between two answers of readings.
fn apart(x: &Value, y: &Value) -> f64 {
    let numbers = |of: &Value| -> Vec<f64> {
        let rows: Vec<Vec<f64>> = serde_json::from_value(of["rows"].clone()).expect("numbers");
        rows.concat()
    };
    let (x, y) = (numbers(x), numbers(y));
    assert_eq!(x.len(), y.len());
    let off = x.iter().zip(&y).map(|(a, b)| (a - b).abs());
    off.fold(0.0, f64::max)
}

#[tokio::test(flavor = "multi_thread")]
async fn readings_that_were_taken_here_come_back_as_a_paint_that_reads_the_same() {
    let data = tempfile::tempdir().expect("temporary folder");
    let house = House::real(data.path()).await;
    let metal = upload(&house, &metallic("bmw339", 2)).await;
    let of = |paint: &Value| {
        format!(
            "/v1/paints/{}/readings",
            paint["id"].as_str().expect("an id")
        )
    };
    let read = house.get(&of(&metal)).await.json();
    for ending in ["csv", "cxf"] {
        let table = house.get(&format!("{}.{ending}", of(&metal))).await.body;
        // Whatever coat is assumed, the paint reads what was read.
        for query in ["", "?coat_ior=1", "?coat_ior=1.7"] {
            let headers = [("Prefer", "wait=300")];
            let answer = house
                .ask("POST", &format!("/v1/paints{query}"), &headers, &table)
                .await;
            assert_eq!(
                answer.status,
                201,
                "{}",
                String::from_utf8_lossy(&answer.body)
            );
            let paint = answer.json();
            assert_eq!(paint["provenance"]["source"], ending);
            assert!(
                paint["multi_angle"]["worst"]
                    .as_f64()
                    .is_some_and(|worst| worst < 0.1)
            );
            let assumed = paint["warnings"].to_string().contains("clear coat");
            assert_eq!(assumed, query.is_empty(), "{paint}");
            let off = apart(&house.get(&of(&paint)).await.json(), &read);
            assert!(off < 0.1, "{ending}{query}: {off}");
        }
    }
    for (body, said) in [
        ("aspecular_deg,L,a,b\n15,50,x,0\n", "line 2, column a"),
        (
            "aspecular_deg,L,a,b\n15,0,0,0\n",
            "no reading reflects any light",
        ),
        ("<CxF/>", "the root is <CxF>"),
        ("<!DOCTYPE CxF []><CxF/>", "document type"),
    ] {
        let answer = house
            .ask(
                "POST",
                "/v1/paints",
                &[("Prefer", "wait=60")],
                body.as_bytes(),
            )
            .await;
        let problem = answer.problem(422, "unusable-measurement");
        assert!(
            problem["detail"].as_str().is_some_and(|d| d.contains(said)),
            "{problem}"
        );
    }
    house.close().await;
}

/// A package of a manifest alone.
fn package(manifest: &Value) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let stored = zip::write::SimpleFileOptions::default();
    zip.start_file("paint.json", stored).expect("an entry");
    zip.write_all(manifest.to_string().as_bytes())
        .expect("written");
    zip.finish().expect("a package").into_inner()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refused_package_is_pointed_into() {
    let data = tempfile::tempdir().expect("temporary folder");
    let house = House::real(data.path()).await;
    let lobe = json!({ "weight": 0.1, "alpha": 0.2, "f0": 0.5 });
    let manifest = json!({
        "format": "measured-paint", "version": 1, "name": "one", "color_space": "linear-srgb-d65",
        "base": { "model": { "diffuse": 0.2, "lobes": [lobe] } },
        "flakes": { "slices": "s_{h:02}_{i:02}.exr", "theta_h_deg": [0.0, 5.0], "theta_i_deg": [0.0, 5.0],
            "texel_um": 10.0, "size_px": [8, 8] },
    });
    let with = |pointer: &str, value: Value| {
        let mut other = manifest.clone();
        *other.pointer_mut(pointer).expect("a field") = value;
        other
    };
    for (wrong, file, pointer) in [
        (
            with("/base/model/lobes/0/alpha", json!(-1)),
            "paint.json",
            "/base/model/lobes/0/alpha",
        ),
        (
            with("/flakes/theta_h_deg", json!([5.0, 0.0])),
            "paint.json",
            "/flakes/theta_h_deg/1",
        ),
        (with("/version", json!(9)), "paint.json", "/version"),
        (manifest.clone(), "s_00_00.exr", ""),
    ] {
        let answer = house
            .ask(
                "POST",
                "/v1/paints",
                &[("Prefer", "wait=60")],
                &package(&wrong),
            )
            .await;
        let problem = answer.problem(422, "unusable-measurement");
        assert_eq!(problem["file"], file, "{problem}");
        assert_eq!(problem["pointer"], pointer, "{problem}");
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_ingest_of_a_new_measurement_is_estimated_and_nothing_of_it_is_kept() {
    let data = tempfile::tempdir().expect("temporary folder");
    let house = House::real(data.path()).await;
    let estimate = async |query: &str, bytes: &[u8]| {
        let path = format!("/v1/estimates/ingest?{query}");
        house.ask("POST", &path, &[], bytes).await
    };
    let new = table(0.1);
    let told = estimate("profile=draft", &new).await;
    assert_eq!(told.status, 200, "{}", told.text());
    let told = told.json();
    assert_eq!(told["profile"], "draft");
    assert!(told.get("kept").is_none(), "{told}");
    assert!(told["seconds"].as_f64().is_some_and(|s| s > 0.0), "{told}");
    assert!(told["bytes"].as_u64().is_some_and(|b| b > 100), "{told}");
    let met = estimate("max_seconds=100", &new).await.json();
    assert_eq!(met["met"], true, "{met}");
    assert_eq!(walk(&data.path().join("blobs")), 0, "nothing is kept");
    assert_eq!(house.get("/v1/paints").await.json()["paints"], json!([]));

    // What is there already stays.
    let kept = upload(&house, &new).await;
    let before = walk(&data.path().join("blobs"));
    assert_eq!(estimate("", &new).await.status, 200);
    assert_eq!(walk(&data.path().join("blobs")), before);
    let measurement = format!(
        "/v1/paints/{}/measurement",
        kept["id"].as_str().expect("an id")
    );
    assert_eq!(house.get(&measurement).await.body, new);

    // A .paint is taken as it is.
    let paint = metallic("bmw339", 2);
    let told = estimate("profile=draft", &paint).await.json();
    let bytes = told["bytes"].as_u64().expect("a size") as usize;
    assert!((paint.len()..paint.len() + 1000).contains(&bytes), "{told}");
    let measured = estimate("coat_ior=1.5", &paint).await;
    measured.problem(400, "invalid-parameter");

    let none = estimate("", b"no measurement").await;
    none.problem(422, "unusable-measurement");
    let knob = estimate("profile=clusters=0", &new).await;
    let problem = knob.problem(400, "invalid-parameter");
    assert_eq!(problem["pointer"], "/profile");
    assert_eq!(walk(&data.path().join("blobs")), before);
    house.close().await;
}
