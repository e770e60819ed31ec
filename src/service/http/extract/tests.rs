//! What is refused of a JSON body, and how that is told.

use super::*;
use crate::service::Shape;
use serde::Deserialize;
use utoipa::ToSchema;

#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Order {
    #[allow(dead_code)] // read by the reader only
    #[schema(min_items = 2, max_items = 5)]
    paints: Vec<String>,
    #[allow(dead_code)] // read by the reader only
    #[schema(minimum = 1, maximum = 4096)]
    clusters: Option<u32>,
    #[allow(dead_code)] // read by the reader only
    scene: Option<Shape>,
    #[allow(dead_code)] // read by the reader only
    size: Option<[u32; 2]>,
    #[allow(dead_code)] // read by the reader only
    #[schema(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    #[allow(dead_code)] // read by the reader only
    light: Option<Towards>,
}

#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Towards {
    #[allow(dead_code)] // read by the reader only
    towards: f64,
}

#[test]
fn a_json_problem_says_what_would_be_accepted() {
    let cases = [
        (r#"{"paints": 3}"#, "paints is 3.", "a list of 2 to 5"),
        (r#"{"paints": ["", 7]}"#, "paints/1 is 7.", "text"),
        (
            r#"{"paints": [], "clusters": 1e99}"#,
            "clusters is 1e+99.",
            "a whole number from 1 to 4096",
        ),
        (
            r#"{"paints": [], "size": [8, -1]}"#,
            "size/1 is -1.",
            "a whole number from 0",
        ),
        (
            r#"{"paints": [], "max_error": 1e999}"#,
            "max_error is a number out of range.",
            "a number above 0",
        ),
        (
            r#"{"paints": [], "scene": "cube"}"#,
            "Unknown variant `cube`, expected one of `sphere`, `capsule`, `panel`.",
            "sphere, capsule, panel",
        ),
        (
            r#"{"paints": [], "scene": 3}"#,
            "scene is 3.",
            "sphere, capsule, panel",
        ),
        (
            r#"{"paints": [], "surprise": 1}"#,
            "Unknown field `surprise`, expected one of `paints`, `clusters`, `scene`, `size`, `max_error`, `light`.",
            "paints, clusters, scene, size, max_error, light",
        ),
        (
            r"{}",
            "Missing field `paints`.",
            "an object with the field paints",
        ),
        (
            r#"{"paints": [], "paints": []}"#,
            "paints is given twice, at last as [].",
            "one of the two",
        ),
        (
            r#"{"paints": [], "light": {"towards": 1, "towards": 2}}"#,
            "light/towards is given twice, at last as 2.",
            "one of the two",
        ),
        (" [1e999] ", "The body is [1e999].", "an object with paints"),
        ("[[]]", "The body is [[]].", "an object with paints"),
        (
            r#""paints""#,
            "The body is \"paints\".",
            "an object with paints",
        ),
        ("", "The body is empty.", "JSON: an object with paints"),
    ];
    for (body, detail, accepted) in cases {
        let problem = read_json::<Order>(body.as_bytes())
            .expect_err(body)
            .document(None);
        assert_eq!(
            (problem.detail.as_str(), problem.accepted.as_deref()),
            (detail, Some(accepted)),
            "{body}"
        );
    }
}

#[test]
fn a_json_problem_points_at_the_field() {
    let cases = [
        (r#"{"paints": ["a", 3]}"#, 422, "/paints/1"),
        (r#"{"paints": [], "surprise": 1}"#, 422, "/surprise"),
        (r#"{"paints": [], "paints": []}"#, 422, "/paints"),
        (r"{}", 422, "/paints"),
        (r"[]", 422, ""),
    ];
    for (body, status, pointer) in cases {
        let problem = read_json::<Order>(body.as_bytes())
            .expect_err(body)
            .document(None);
        assert_eq!(
            (problem.status, problem.pointer.as_deref()),
            (status, Some(pointer)),
            "{body}: {problem:?}"
        );
    }
    for body in ["", "{", "[]x", "{\"paints\": []} x", "\u{1}"] {
        let problem = read_json::<Order>(body.as_bytes()).expect_err(body);
        assert!(
            matches!(problem.kind(), Kind::MalformedRequest | Kind::InvalidValue),
            "{body}: {problem:?}"
        );
    }
}
