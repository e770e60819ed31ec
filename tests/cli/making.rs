//! Blends, realisations, pictures and texels as files.

use crate::desk::{Desk, json};

#[test]
fn a_blend_is_realised_as_everything_the_same_on_any_number_of_threads() {
    let desk = Desk::with_blend();
    for name in ["r.zip", "r.glb", "r.json", "r.paint"] {
        let mut seen = Vec::new();
        for threads in ["1", "2", "8"] {
            desk.ok(&[
                "realise",
                "b.blend",
                "--weights",
                "0.3,0.7",
                "--threads",
                threads,
                "--out",
                name,
            ]);
            seen.push(desk.read(name));
        }
        assert!(
            seen[0].len() > 500 && seen.windows(2).all(|w| w[0] == w[1]),
            "{name} differs"
        );
    }
    assert_eq!(
        json(&desk.read("r.json"))["format"]
            .as_str()
            .map(|f| f.starts_with("carpaint")),
        Some(true)
    );
    desk.ok(&[
        "blend",
        "r.paint",
        "sample:white",
        "--profile",
        "draft",
        "--out",
        "again.blend",
    ]);
}

#[test]
fn weights_are_asked_for_and_checked() {
    let desk = Desk::with_blend();
    let out = ["--out", "x.json"];
    let with = |words: &[&'static str]| [&["realise", "b.blend"], words, &out].concat();
    let said = desk.refused(2, &with(&[]));
    assert!(
        said.contains("2 numbers") && said.contains("bmw339, blue"),
        "{said}"
    );
    for weights in ["nan,1", "inf,0", "1", "a,b", "1,2,3", ""] {
        desk.refused(
            2,
            &[
                "realise",
                "b.blend",
                "--weights",
                weights,
                "--out",
                "x.json",
            ],
        );
    }
    assert_eq!(desk.files(), ["b.blend"]);
    for weights in ["-2,3", "0,0", "1e6,-1e6"] {
        desk.ok(&[
            "realise",
            "b.blend",
            "--weights",
            weights,
            "--out",
            "x.json",
        ]);
    }
    desk.refused(
        2,
        &[
            "preview",
            "sample:white",
            "--weights",
            "1,0",
            "--out",
            "x.png",
        ],
    );
}

#[test]
fn previews_are_drawn_in_the_size_asked_for() {
    let desk = Desk::with_blend();
    desk.ok(&[
        "preview",
        "b.blend",
        "--weights",
        "0.5,0.5",
        "--size",
        "40x30",
        "--spp",
        "2",
        "--out",
        "p.png",
    ]);
    let png = desk.read("p.png");
    assert_eq!(
        (&png[..4], &png[16..24]),
        (&b"\x89PNG"[..], &[0, 0, 0, 40, 0, 0, 0, 30][..])
    );
    desk.ok(&[
        "preview",
        "sample:white",
        "--scene",
        "panel",
        "--size",
        "16x16",
        "--spp",
        "1",
        "--out",
        "p.exr",
    ]);
    assert_eq!(desk.read("p.exr")[..4], [0x76, 0x2f, 0x31, 0x01]);
    assert!(
        desk.refused(
            2,
            &[
                "preview",
                "sample:white",
                "--scene",
                "cube",
                "--out",
                "p.png"
            ]
        )
        .contains("capsule")
    );
    desk.refused(
        2,
        &["preview", "sample:white", "--size", "0x5", "--out", "p.png"],
    );
    desk.refused(2, &["preview", "sample:white", "--out", "p.gif"]);
}

#[test]
fn texels_are_flakes_at_one_angle_pair() {
    let desk = Desk::with_blend();
    let words = [
        "texels",
        "b.blend",
        "--weights",
        "1,0",
        "--theta-h",
        "3",
        "--theta-d",
        "10",
        "--size",
        "32x16",
    ];
    desk.ok(&[&words[..], &["--seed", "4", "--out", "t.exr"]].concat());
    desk.ok(&[&words[..], &["--seed", "5", "--out", "u.exr"]].concat());
    assert_ne!(desk.read("t.exr"), desk.read("u.exr"));
    // What has to be clamped far outside is told, as it is of a realisation.
    let far: Vec<&str> = words
        .iter()
        .map(|word| if *word == "1,0" { "-2,3" } else { *word })
        .collect();
    let far = json(
        &desk
            .ok(&[&far[..], &["--json", "--out", "t.exr"]].concat())
            .stdout,
    );
    assert!(
        far["clamps"]
            .as_array()
            .is_some_and(|told| !told.is_empty()),
        "{far}"
    );
    desk.refused(
        2,
        &[
            "texels",
            "b.blend",
            "--weights",
            "1,0",
            "--theta-h",
            "95",
            "--theta-d",
            "0",
            "--out",
            "t.exr",
        ],
    );
}

#[test]
fn a_blend_names_the_paints_it_speaks_of_whatever_their_order() {
    let desk = Desk::new();
    for pair in [["blue", "bmw339"], ["bmw339", "blue"]] {
        let words = ["blend", pair[0], pair[1], "--profile", "draft", "--json"];
        let told = json(
            &desk
                .ok(&[&words[..], &["--out", "b.blend"]].concat())
                .stdout,
        );
        let shown = json(&desk.ok(&["show", "b.blend", "--json"]).stdout);
        for correspondence in [&told["correspondence"], &shown["correspondence"]] {
            assert_eq!(
                correspondence["without_flakes"][0]["name"], "blue",
                "{correspondence}"
            );
            let place = correspondence["without_flakes"][0]["place"].as_u64();
            assert_eq!(
                place.and_then(|k| usize::try_from(k).ok()).map(|k| pair[k]),
                Some("blue")
            );
        }
    }
}

#[test]
fn a_realised_paint_remembers_its_weights_and_that_its_flakes_were_simulated() {
    let desk = Desk::with_blend();
    let own = ["--base", "3,-2", "--flake-lightness", "0.5,0.5"];
    let color = ["--flake-color", "1,0", "--out", "r.paint"];
    desk.ok(&[&["realise", "b.blend"][..], &own, &color].concat());
    let about = json(&desk.ok(&["show", "r.paint", "--json"]).stdout);
    let provenance = &about["provenance"];
    assert_eq!(provenance["simulated_flakes"], true);
    let realisation = &provenance["realisation"];
    assert_eq!(
        (&realisation["base"], &realisation["flake_color"]),
        (
            &serde_json::json!([3.0, -2.0]),
            &serde_json::json!([1.0, 0.0])
        )
    );
    let clamps = about["clamps"].as_array().expect("a list");
    assert!(!clamps.is_empty() && about["clamps"] == realisation["clamps"]);
    let text = String::from_utf8(desk.ok(&["show", "r.paint"]).stdout).expect("text");
    assert!(text.contains("\nclamped        "), "{text}");

    // Blended again its clusters are reduced, which the blend keeps.
    let again = ["blend", "sample:white", "r.paint", "--clusters", "5"];
    desk.ok(&[&again[..], &["--out", "again.blend"]].concat());
    let shown = json(&desk.ok(&["show", "again.blend", "--json"]).stdout);
    let reduced = &shown["correspondence"]["reduced"][0];
    assert_eq!((&reduced["place"], &reduced["to"]), (&1.into(), &5.into()));
    assert!(reduced["from"].as_u64() > Some(5), "{reduced}");
    assert_eq!(shown["paints"][1]["simulated_flakes"], true);
}

#[test]
fn angles_are_drawn_the_same_for_every_paint_and_take_no_samples() {
    let desk = Desk::new();
    let draw = |paint, out, more: &[&'static str]| {
        let asked = ["preview", paint, "--size", "40x30", "--show", "aspecular"];
        [&asked[..], more, &["--out", out]].concat()
    };
    desk.ok(&draw("sample:white", "a.png", &[]));
    desk.ok(&draw(
        "sample:2k_acrylack",
        "b.png",
        &["--profile", "draft"],
    ));
    assert_eq!(desk.read("a.png"), desk.read("b.png"));
    desk.ok(&draw("sample:white", "c.png", &["--scene", "panel"]));
    assert_ne!(desk.read("a.png"), desk.read("c.png"));
    for option in ["--spp", "--max-error", "--max-seconds"] {
        let said = desk.refused(2, &draw("sample:white", "d.png", &[option, "1"]));
        assert!(
            said.contains(option) && said.contains("--show aspecular"),
            "{said}"
        );
    }
    desk.ok(&[
        "blend",
        "sample:white",
        "sample:blue",
        "--profile",
        "draft",
        "--out",
        "two.blend",
    ]);
    desk.ok(&draw("two.blend", "e.png", &["--weights", "0.5,0.5"]));
    assert_eq!(desk.read("e.png"), desk.read("a.png"));
    let said = desk.refused(2, &draw("two.blend", "d.png", &["--weights", "1"]));
    assert!(said.contains("weights has 1 numbers"), "{said}");
    for (input, option, more) in [
        (
            "sample:white",
            "samples_per_pixel=400",
            ["--knob", "samples_per_pixel=400"],
        ),
        (
            "sample:white",
            "samples_per_pixel=9",
            ["--profile", "draft,samples_per_pixel=9"],
        ),
        ("two.blend", "--profile", ["--profile", "reference"]),
        ("two.blend", "--profile", ["--knob", "precision=f32"]),
    ] {
        let weights: &[&str] = if input == "two.blend" {
            &["--weights", "0.5,0.5"]
        } else {
            &[]
        };
        let said = desk.refused(2, &[&draw(input, "d.png", &more)[..], weights].concat());
        assert!(
            said.contains(option) && said.contains("--show aspecular"),
            "{said}"
        );
    }
}

#[test]
fn readings_alone_are_ingested_shown_blended_and_drawn() {
    let desk = Desk::new();
    let table = "# name: my silver\n# observer: 10\naspecular_deg,L,a,b,graininess\n-15,103.2,-0.9,1.1,4\n\
                 15,112.9,-1,1.4,4\n25,92.3,-0.9,0.2,4\n45,61.1,-0.7,-0.9,4\n75,44.8,-0.5,-1.4,4\n110,37.6,-0.3,-1.5,4\n";
    std::fs::write(desk.path("silver.csv"), table).expect("written");
    let said = desk.ok(&["ingest", "silver.csv", "--json", "--out", "silver.paint"]);
    let paint = &json(&said.stdout)["paint"];
    assert_eq!(paint["name"], "my silver");
    assert_eq!(paint["provenance"]["source"], "csv");
    assert_eq!(
        paint["provenance"]["notes"]["graininess"],
        "-15°: 4, 15°: 4, 25°: 4, 45°: 4, 75°: 4, 110°: 4"
    );
    assert_eq!(paint["multi_angle"]["approximate"], true);
    assert!(
        paint["multi_angle"]["worst"]
            .as_f64()
            .is_some_and(|worst| worst < 0.1),
        "{paint}"
    );
    assert_eq!(paint["energy"]["conserves"], true);
    let page = desk.ok(&["show", "silver.paint"]).stdout;
    let page = String::from_utf8_lossy(&page).into_owned();
    assert!(
        page.contains("ior 1.5000") && page.contains("flakes         none"),
        "{page}"
    );

    // The same readings in a package, which says that there is no coat by saying nothing.
    let rows: Vec<&str> = table.lines().skip(3).collect();
    let package = format!(
        r#"{{"format": "measured-paint", "version": 1, "name": "packed", "color_space": "linear-srgb-d65",
            "multi_angle": {{"illumination_deg": 45, "illuminant": "D65", "observer": "10",
            "columns": ["aspecular_deg", "L", "a", "b", "graininess"], "rows": [[{}]]}}}}"#,
        rows.join("],[")
    );
    std::fs::create_dir(desk.path("packed")).expect("a folder");
    std::fs::write(desk.path("packed/paint.json"), package).expect("written");
    let said = desk.ok(&["ingest", "packed", "--json", "--out", "packed.paint"]);
    let packed = &json(&said.stdout)["paint"];
    assert_eq!(packed["parameters"]["coat"], serde_json::Value::Null);
    assert!(
        packed["multi_angle"]["worst"]
            .as_f64()
            .is_some_and(|worst| worst < 0.1),
        "{packed}"
    );

    desk.ok(&[
        "blend",
        "silver.csv",
        "packed",
        "sample:blue",
        "--profile",
        "draft",
        "--out",
        "b.blend",
    ]);
    desk.ok(&[
        "preview",
        "b.blend",
        "--weights",
        "0.4,0.3,0.3",
        "--size",
        "16x16",
        "--spp",
        "2",
        "--out",
        "b.png",
    ]);
    desk.ok(&["estimate", "ingest", "silver.csv"]);

    std::fs::write(desk.path("d.json"), r#"{"pairs": [[[0,0,1],[0,0,1]]]}"#).expect("written");
    for input in ["silver.csv", "packed"] {
        let said = desk.refused(
            3,
            &[
                "evaluate",
                "--raw",
                input,
                "--directions",
                "d.json",
                "--out",
                "v.json",
            ],
        );
        assert!(said.contains("nothing but readings"), "{said}");
    }
    let said = desk.refused(
        2,
        &[
            "ingest",
            "silver.csv",
            "--theta-h",
            "sqrt",
            "--out",
            "x.paint",
        ],
    );
    assert!(said.contains("layout csv"), "{said}");
}
