//! Silly values of every field and parameter: each is refused with where it stands, what it was, and what is accepted.

use serde_json::json;

use crate::folder;
use crate::house::House;

#[tokio::test(flavor = "multi_thread")]
async fn a_silly_field_is_refused_with_its_place_its_value_and_what_is_accepted() {
    let data = folder();
    let house = House::open(data.path()).await;
    let (a, b) = (house.paint("a").await, house.paint("b").await);
    let whole = "a whole number from 1 to 4096";
    let blend = |more: &str| format!(r#"{{"paints":["{a}","{b}"],{more}}}"#);
    let drawn = |more: &str| format!(r#"{{"paint":"{a}",{more}}}"#);
    let estimated = |more: &str| format!(r#"{{"work":"preview","paint":"{a}",{more}}}"#);
    let cases = [
        (
            "/v1/blends",
            String::new(),
            "",
            "The body is empty.",
            "JSON: an object with paints",
        ),
        (
            "/v1/blends",
            " \n".to_owned(),
            "",
            "The body is empty.",
            "JSON: an object with paints",
        ),
        (
            "/v1/blends",
            "[]".to_owned(),
            "",
            "The body is [].",
            "an object with paints",
        ),
        (
            "/v1/blends",
            blend(r#""clusters":1e99"#),
            "/clusters",
            "clusters is 1e+99.",
            whole,
        ),
        (
            "/v1/blends",
            blend(r#""clusters":-3"#),
            "/clusters",
            "clusters is -3.",
            whole,
        ),
        (
            "/v1/blends",
            blend(r#""clusters":0"#),
            "/clusters",
            "clusters is 0.",
            whole,
        ),
        (
            "/v1/blends",
            blend(r#""clusters":"50""#),
            "/clusters",
            "clusters is \"50\".",
            whole,
        ),
        (
            "/v1/blends",
            blend(r#""max_error":1e999"#),
            "/max_error",
            "max_error is a number out of range.",
            "a number above 0",
        ),
        (
            "/v1/blends",
            blend(r#""max_error":"low""#),
            "/max_error",
            "max_error is \"low\".",
            "a number above 0",
        ),
        (
            "/v1/blends",
            blend(r#""profile":{"clusters":1e99}"#),
            "/profile/clusters",
            "clusters is 1e+99, accepted is a whole number from 1 to 4096.",
            whole,
        ),
        (
            "/v1/blends",
            blend(r#""profile":{"clusters":0}"#),
            "/profile/clusters",
            "clusters is 0.",
            whole,
        ),
        (
            "/v1/blends",
            blend(r#""profile":{"cost":[]}"#),
            "/profile/cost",
            "cost is [], accepted is distance or squared.",
            "distance or squared",
        ),
        (
            "/v1/previews",
            drawn(r#""size":[8]"#),
            "/size",
            "size is [8].",
            "a list of 2",
        ),
        (
            "/v1/previews",
            drawn(r#""size":[8,1e99]"#),
            "/size/1",
            "size/1 is 1e+99.",
            whole,
        ),
        (
            "/v1/previews",
            drawn(r#""size":[0,8]"#),
            "/size",
            "size is 0x8.",
            "1 to 4096 each",
        ),
        (
            "/v1/previews",
            drawn(r#""samples_per_pixel":0"#),
            "/samples_per_pixel",
            "samples_per_pixel is 0.",
            "1 to 4096",
        ),
        (
            "/v1/previews",
            drawn(r#""lights":[{"towards":[0,0,0]}]"#),
            "/lights/0",
            "lights/0 is towards [0.0, 0.0, 0.0].",
            "a direction of some length, and an irradiance of 0 to 65504 per channel",
        ),
        (
            "/v1/previews",
            drawn(r#""lights":[{"towards":[0,1]}]"#),
            "/lights/0/towards",
            "lights/0/towards is [0,1].",
            "a list of 3",
        ),
        (
            "/v1/previews",
            drawn(r#""scene":7"#),
            "/scene",
            "scene is 7.",
            "sphere, capsule, panel",
        ),
        (
            "/v1/estimates",
            estimated(r#""size":[0,8]"#),
            "/size",
            "size is 0x8.",
            "1 to 4096 each",
        ),
        (
            "/v1/estimates",
            estimated(r#""format":"zip""#),
            "/format",
            "A preview is a picture; the work for other files is realise.",
            "png or exr",
        ),
        (
            "/v1/estimates",
            estimated(r#""paints":[]"#),
            "/paints",
            "The work preview, of a paint, takes no paints.",
            "paint, format, scene, size, show, environment, lights",
        ),
    ];
    for (path, body, pointer, detail, accepted) in cases {
        let answer = house.ask(
            "POST",
            path,
            &[("Content-Type", "application/json")],
            body.as_bytes(),
        );
        let problem = answer.await.json();
        assert_eq!(
            [
                &problem["pointer"],
                &problem["detail"],
                &problem["accepted"]
            ],
            [pointer, detail, accepted],
            "{path} {body}: {problem}"
        );
    }
    let json = [("Content-Type", "application/json")];
    let address = format!("/v1/paints/{a}");
    let visible = house.ask("PATCH", &address, &json, br#"{"visibility":3}"#);
    let problem = visible.await.problem(422, "invalid-value");
    assert_eq!(problem["detail"], "visibility is 3.");
    assert_eq!(problem["accepted"], "published, private");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_silly_parameter_is_refused_with_its_name_its_value_and_what_is_accepted() {
    let data = folder();
    let house = House::open(data.path()).await;
    let paint = house.paint("a").await;
    let size = "WxH such as 512x512, up to 4096 each";
    let cases = [
        (
            "preview.png?spp=1e99",
            "/spp",
            "a whole number from 1 to 4096",
        ),
        ("preview.png?spp=", "/spp", "a whole number from 1 to 4096"),
        ("preview.png?spp=0", "/spp", "1 to 4096"),
        ("preview.png?size=0x8", "/size", size),
        ("preview.png?size=", "/size", size),
        ("preview.png?scene=cube", "/scene", "sphere, capsule, panel"),
        ("preview.png?light=nan,0,0", "/light", "a finite number"),
        ("preview.png?max_error=", "/max_error", "a number above 0"),
        ("preview.png?max_error=-1", "/max_error", "a number above 0"),
        (
            "preview.png?max_seconds=inf",
            "/max_seconds",
            "a number above 0",
        ),
        (
            "realisation.zip?profile=clusters=nan",
            "/profile",
            "a whole number from 1 to 4096",
        ),
        (
            "realisation.zip?profile=angle_step=99999999999",
            "/profile",
            "a whole number from 1 to 16",
        ),
        (
            "preview.png?spp=4&profile=samples_per_pixel=5",
            "/spp",
            "one of the two",
        ),
    ];
    for (path, pointer, accepted) in cases {
        let answer = house.get(&format!("/v1/paints/{paint}/{path}")).await;
        let problem = answer.problem(400, "invalid-parameter");
        assert_eq!(
            (&problem["pointer"], &problem["accepted"]),
            (&json!(pointer), &json!(accepted)),
            "{path}: {problem}"
        );
    }
    for (query, accepted) in [
        ("clusters=99999999999", "a whole number from 1 to 4096"),
        ("header_bytes=-1", "a whole number from 0 to 1048576"),
        ("coat_ior=nan", "a number from 1 to 4"),
        ("coat_ior=0", "1 to 4"),
        ("layout=", "rgl, mpi-2005, merl, package, csv, cxf"),
    ] {
        let answer = house
            .ask("POST", &format!("/v1/paints?{query}"), &[], b"x")
            .await;
        assert_eq!(
            answer.problem(400, "invalid-parameter")["accepted"],
            accepted,
            "{query}"
        );
    }
}
