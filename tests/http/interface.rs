//! The interface as it is documented and committed.

use crate::folder;
use crate::house::House;

#[tokio::test(flavor = "multi_thread")]
async fn the_interface_is_the_committed_one_and_all_of_it_is_served() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi/openapi.json");
    let text = carpaint::service::interface();
    if std::env::var_os("CARPAINT_BLESS").is_some() {
        std::fs::create_dir_all(concat!(env!("CARGO_MANIFEST_DIR"), "/openapi"))
            .expect("makes the folder");
        std::fs::write(file, text).expect("writes the interface");
    }
    let committed = std::fs::read_to_string(file).unwrap_or_default();
    assert!(
        committed == text,
        "openapi/openapi.json is not what the code says: CARPAINT_BLESS=1 cargo test --test http"
    );

    let data = folder();
    let house = House::open(data.path()).await;
    let api = house.get("/openapi.json").await.json();
    let mut names: Vec<&str> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("\"operationId\": "))
        .collect();
    let all = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all, "every operation has a name of its own");
    assert!(
        api["openapi"]
            .as_str()
            .expect("a version")
            .starts_with("3.1")
    );
    for (path, item) in api["paths"].as_object().expect("paths") {
        for method in item.as_object().expect("operations").keys() {
            let real = path
                .replace(
                    "{format}",
                    if path.contains("preview") {
                        "png"
                    } else {
                        "zip"
                    },
                )
                .replace("{id}", "x");
            let answer = house.ask(&method.to_uppercase(), &real, &[], b"").await;
            let kind = if answer.status >= 400 {
                answer.json()["type"].as_str().unwrap_or("").to_owned()
            } else {
                String::new()
            };
            assert!(
                answer.status < 500 && answer.status != 405 && kind != "/problems/unknown-address",
                "{method} {path} is documented and not served: {answer:?}"
            );
        }
    }
    house.close().await;
}
