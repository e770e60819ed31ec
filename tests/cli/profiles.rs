//! Knobs, targets and estimates.

use std::fs;

use crate::desk::{Desk, json};

#[test]
fn knobs_are_turned_by_name_and_unknown_ones_are_refused_with_what_there_is() {
    let desk = Desk::new();
    let export = |more: &[&'static str]| {
        [
            &["samples", "export", "bmw339"],
            more,
            &["--out", "p.paint"],
        ]
        .concat()
    };
    let few = [
        "--profile",
        "draft",
        "--knob",
        "clusters=9",
        "--knob",
        "angle_step=4",
    ];
    desk.ok(&export(&few));
    let about = json(&desk.ok(&["show", "p.paint", "--json"]).stdout);
    let clustering = &about["flakes"]["clustering"];
    assert_eq!(
        (&clustering["clusters"], &clustering["angle_step"]),
        (&9.into(), &4.into())
    );
    assert_eq!(about["flakes"]["slices"], 49);
    let error = clustering["error"]["lightness_w1"]["p90"]
        .as_f64()
        .expect("measured");
    assert_eq!(about["error"]["lab"].as_f64(), Some(error));
    fs::write(
        desk.path("k.json"),
        r#"{"preset": "draft", "clusters": 9, "angle_step": 4}"#,
    )
    .expect("written");
    let first = desk.read("p.paint");
    desk.ok(&export(&["--profile", "k.json"]));
    assert_eq!(desk.read("p.paint"), first, "a file of knobs says the same");
    let said = desk.refused(2, &export(&["--knob", "cluster=9"]));
    assert!(
        said.contains("cluster") && said.contains("samples_per_pixel"),
        "{said}"
    );
    assert!(
        desk.refused(2, &export(&["--knob", "clusters=0"]))
            .contains("1 to 4096")
    );
    let twice = ["--knob", "clusters=9", "--knob", "clusters=10"];
    let said = desk.refused(2, &export(&twice));
    assert!(said.contains("to 9 and to 10"), "{said}");
    desk.refused(2, &export(&["--knob", "clusters=9", "--clusters", "10"]));
    desk.ok(&export(&["--knob", "clusters=9", "--clusters", "9"]));
    let said = desk.refused(2, &export(&["--knob", "clusters"]));
    assert!(said.contains("clusters has no value"), "{said}");
    fs::write(
        desk.path("bad.json"),
        r#"{"preset": "draft", "samples": 9}"#,
    )
    .expect("written");
    assert!(
        desk.refused(3, &export(&["--profile", "bad.json"]))
            .contains("samples_per_pixel")
    );
}

#[test]
fn a_target_names_the_profile_that_was_picked_for_it() {
    let desk = Desk::with_blend();
    let realise = |error: &'static str| {
        let words = [
            "realise",
            "b.blend",
            "--weights",
            "0.5,0.5",
            "--json",
            "--max-error",
            error,
        ];
        [&words[..], &["--out", "r.json"]].concat()
    };
    let met = json(&desk.ok(&realise("1000")).stdout);
    assert_eq!(met["picked"]["met"], true);
    let missed = json(&desk.ok(&realise("1e-9")).stdout);
    assert_eq!(missed["picked"]["met"], false);
    assert_eq!(
        missed["picked"]["estimate"]["knobs"]["precision"], "f32",
        "the best there is"
    );
    let made = json(&desk.read("r.json"));
    assert_eq!(made["settings"]["precision"], "f32");
    let stated = &missed["picked"]["estimate"]["error"]["value"];
    assert_eq!(&made["report"]["accuracy"]["error"]["lab"], stated);
    let knobs = ["--max-seconds", "1", "--profile", "draft"];
    desk.refused(2, &[&realise("1")[..], &knobs].concat());
    assert!(desk.refused(2, &realise("0")).contains("--max-error"));
}

#[test]
fn a_picture_takes_the_fewest_samples_that_are_enough() {
    let desk = Desk::new();
    let picked = |target: [&'static str; 2]| {
        let words = [
            "preview",
            "sample:white",
            "--size",
            "24x24",
            "--json",
            "--out",
            "p.png",
        ];
        let made = json(&desk.ok(&[&words[..], &target].concat()).stdout);
        let samples = &made["picked"]["estimate"]["knobs"]["samples_per_pixel"];
        (
            made["picked"]["met"] == true,
            samples.as_u64().expect("samples"),
        )
    };
    assert_eq!(picked(["--max-error", "100"]), (true, 1));
    assert_eq!(picked(["--max-error", "1e-9"]), (false, 4096));
    assert_eq!(picked(["--max-seconds", "1e-6"]), (false, 1));
    let (met, samples) = picked(["--max-error", "1"]);
    assert!(met && (1..=1024).contains(&samples), "{samples}");
}

/// No number of samples mends a paint that is off: a target counts both.
#[test]
fn a_picture_is_as_far_off_as_its_samples_and_its_paint_together() {
    let desk = Desk::new();
    let few =
        "blend sample:bmw339 sample:ford_f8 --knob clusters=4 --knob angle_step=16 --out b.blend";
    desk.ok(&few.split(' ').collect::<Vec<_>>());
    let drawn = |weights: &'static str, more: &[&'static str]| {
        let words = [
            "preview",
            "b.blend",
            "--weights",
            weights,
            "--size",
            "24x24",
            "--json",
        ];
        json(
            &desk
                .ok(&[&words[..], more, &["--out", "p.png"]].concat())
                .stdout,
        )
    };
    let made = drawn("0.5,0.5", &["--max-error", "1"]);
    assert_eq!(made["picked"]["met"], false, "{made}");
    let error = &made["report"]["picture_error"];
    let [all, samples, paint] =
        ["delta_e_2000", "samples", "paint"].map(|part| error[part].as_f64().expect("measured"));
    assert!(
        paint > 1.0 && (all - samples - paint).abs() < 1e-12,
        "{error}"
    );
    assert_eq!(
        drawn("0.5,0.5", &["--max-error", "100"])["picked"]["met"],
        true
    );
    // Solid colors are exact at any weights.
    desk.ok(&["blend", "sample:white", "sample:blue", "--out", "s.blend"]);
    let solid =
        "preview s.blend --weights -0.5,1.5 --size 24x24 --max-error 100 --json --out p.png";
    let solid = json(&desk.ok(&solid.split(' ').collect::<Vec<_>>()).stdout);
    assert_eq!(solid["picked"]["met"], true, "{solid}");
    // Beyond the paints nobody has measured it, and that is said.
    let beyond = drawn("-0.5,1.5", &["--max-error", "100"]);
    let estimated = &beyond["picked"]["estimate"]["error"];
    assert_eq!(
        (&beyond["picked"]["met"], &estimated["value"]),
        (&false.into(), &serde_json::Value::Null)
    );
    assert!(
        estimated["unknown"]
            .as_str()
            .is_some_and(|why| why.contains("beyond")),
        "{estimated}"
    );
}

/// A realised paint goes on with the error of its blend, and what taking fewer clusters costs is measured.
#[test]
fn what_is_realised_and_reduced_is_known_to_be_off() {
    let desk = Desk::new();
    let made = |words: &str| json(&desk.ok(&words.split(' ').collect::<Vec<_>>()).stdout);
    made("blend sample:bmw339 sample:ford_f8 --profile draft --out b.blend --json");
    let realised = made("realise b.blend --weights 0.5,0.5 --out r.paint --json");
    let error = &realised["report"]["accuracy"]["error"];
    let shown = made("show r.paint --json");
    assert_eq!(
        shown["error"]["seen"]["delta_e_2000"],
        error["seen"]["delta_e_2000"]
    );
    made("realise b.blend --weights=-0.5,1.5 --out beyond.paint --json");
    let beyond = made("show beyond.paint --json");
    let why = beyond["error"]["unseen"].as_str().expect("a reason");
    assert!(why.contains("beyond its paints"), "{why}");
    let again = made("blend r.paint sample:bmw339 --knob clusters=12 --out c.blend --json");
    let error = &again["error"];
    let reduction = error["terms"].as_array().expect("terms").iter();
    let reduction = reduction.clone().find(|term| term["what"] == "reduction");
    let lab = reduction.and_then(|term| term["lab"].as_f64());
    assert!(lab.is_some_and(|lab| lab > 0.0), "{error}");
    assert!(
        error["lab"].as_f64() > lab && error["seen"].is_object(),
        "{error}"
    );
}

/// Bytes and error; what seconds are worth is measured by `tests/bench/estimates.rs`, beside nothing else.
#[test]
fn an_estimate_knows_the_bytes_and_the_error_of_what_then_happens() {
    let desk = Desk::new();
    let asked = ["blend", "sample:bmw339", "sample:ford_f8"];
    let estimate = [&["estimate"], &asked[..], &["--json"]].concat();
    let estimate = json(&desk.ok(&estimate).stdout);
    assert!(estimate["seconds"].as_f64().expect("seconds") > 0.0);
    let turned = [
        "estimate",
        "blend",
        "sample:white",
        "sample:blue",
        "--knob",
        "cost=squared",
    ];
    let told = desk.ok(&turned).stdout;
    let told = String::from_utf8(told).expect("text");
    assert!(
        told.starts_with("profile: standard,cost=squared\n"),
        "{told}"
    );
    let made = [&asked[..], &["--json", "--out", "x.blend"]].concat();
    let made = json(&desk.ok(&made).stdout);
    let bytes = desk.read("x.blend").len() as f64;
    let ratio = estimate["bytes"].as_f64().expect("bytes") / bytes;
    assert!((0.8..1.25).contains(&ratio), "{estimate} {bytes}");
    // Of the same slices, so the same but for the transport's gap.
    let stated = estimate["error"]["value"].as_f64().expect("a number");
    let lab = made["error"]["lab"].as_f64().expect("a number");
    assert!((stated - lab).abs() < 1e-6, "{stated} {lab}");
}

/// How a blend was made is not changed by what is made of it: who asks for that is told, and not answered with something
/// else.
#[test]
fn a_settled_knob_is_refused_with_its_value_and_that_value_is_not() {
    let desk = Desk::new();
    let blend = "blend sample:bmw339 sample:ford_f8 --profile draft --out d.blend";
    desk.ok(&blend.split(' ').collect::<Vec<_>>());
    let realise = "realise d.blend --weights 0.5,0.5 --out x.json";
    let realise: Vec<&str> = realise.split(' ').collect();
    for (asked, made) in [
        ("transport=greedy", "transport=exact"),
        ("cost=squared", "cost=distance"),
        ("angle_step=1", "angle_step=2"),
        ("box_rule=tight", "box_rule=moments"),
    ] {
        let refused = desk.refused(2, &[&realise[..], &["--knob", asked]].concat());
        assert!(refused.contains(made), "{asked}: {refused}");
    }
    let same = "transport=exact,cost=distance,angle_step=2,box_rule=moments,order=cheapest";
    let same = same.split(',').flat_map(|knob| ["--knob", knob]);
    desk.ok(&realise.iter().copied().chain(same).collect::<Vec<_>>());
    // A preset is a whole: as much of it is taken as there is left to choose.
    desk.ok(&[&realise[..], &["--profile", "reference"]].concat());
}

#[test]
fn what_cannot_be_made_is_refused_and_a_small_picture_is_estimated_by_drawing_it() {
    let desk = Desk::with_blend();
    let steps = "bundle b.blend --knob draw=inverse_cdf --out x.zip";
    let refused = desk.refused(2, &steps.split(' ').collect::<Vec<_>>());
    assert!(refused.contains("draw=alias or draw=both"), "{refused}");
    desk.ok(&["samples", "export", "white", "--out", "white.paint"]);
    for name in ["white.paint", "sample:white"] {
        desk.refused(3, &["estimate", "ingest", name]);
    }
    // A file is opened whole, so that the picture is the very one; of a sample a few angles are made to estimate it.
    desk.ok(&["samples", "export", "bmw339", "--out", "p.paint"]);
    let picture = ["p.paint", "--size", "40x24"];
    let estimate = [&["estimate", "preview"], &picture[..], &["--json"]].concat();
    let estimate = json(&desk.ok(&estimate).stdout);
    desk.ok(&[&["preview"], &picture[..], &["--out", "x.png"]].concat());
    assert_eq!(estimate["bytes"], desk.read("x.png").len());
}

/// Samples of paints have other hashes than the paints: their canonical order may be another.
#[test]
fn an_estimate_does_not_guess_the_error_of_a_canonical_order() {
    let desk = Desk::new();
    let paints = ["sample:bmw339", "sample:ford_f8", "sample:opel_titan"];
    let error_by = |order: &str| {
        let knob = format!("order={order}");
        let words = ["--knob", "clusters=12", "--knob", &knob, "--json"];
        let asked = [&["estimate", "blend"], &paints[..], &words].concat();
        json(&desk.ok(&asked).stdout)["error"]["value"].clone()
    };
    assert!(error_by("canonical").is_null());
    assert!(error_by("sampled").as_f64().is_some_and(|lab| lab > 0.0));
}

/// Files of angles grow more slowly than their pixels, those in linear light as fast.
#[test]
fn an_estimate_knows_the_bytes_of_every_picture() {
    let desk = Desk::new();
    for (show, ending) in [("aspecular", "png"), ("aspecular", "exr"), ("paint", "exr")] {
        let scene = ["sample:bmw339", "--show", show, "--size", "400x300"];
        let scene = match show {
            "paint" => [&scene[..], &["--spp", "4"]].concat(),
            _ => scene.to_vec(),
        };
        let estimate = [
            &["estimate", "preview"],
            &scene[..],
            &["--format", ending, "--json"],
        ];
        let estimate = json(&desk.ok(&estimate.concat()).stdout);
        let out = format!("x.{ending}");
        desk.ok(&[&["preview"], &scene[..], &["--out", &out]].concat());
        let ratio = estimate["bytes"].as_f64().expect("bytes") / desk.read(&out).len() as f64;
        assert!((0.7..1.4).contains(&ratio), "{show} {ending}: {ratio}");
    }
    let aside = "estimate preview sample:bmw339 --show aspecular --spp 4";
    let refused = desk.refused(2, &aside.split(' ').collect::<Vec<_>>());
    assert!(refused.contains("--spp"), "{refused}");
}
