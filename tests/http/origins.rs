//! Pages of other addresses, as browsers ask for them.

use carpaint::service::ServiceConfig;

use crate::folder;
use crate::house::House;

const SHOP: &str = "https://cars.example";

#[tokio::test(flavor = "multi_thread")]
async fn pages_of_a_named_address_may_ask_and_make_and_no_others() {
    let data = folder();
    let config = ServiceConfig {
        origins: vec![SHOP.parse().expect("an origin")],
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let from = |origin| [("origin", origin)];
    let allowed = "access-control-allow-origin";

    let list = house.ask("GET", "/v1/paints", &from(SHOP), b"").await;
    assert_eq!((list.status, list.header(allowed)), (200, Some(SHOP)));
    assert!(list.header("x-request-id").is_some());
    let readable = list.header("access-control-expose-headers").expect("some");
    for header in [
        "etag",
        "location",
        "carpaint-accuracy",
        "carpaint-study",
        "x-request-id",
    ] {
        assert!(readable.contains(header), "{readable}");
    }
    let refusal = house.ask("GET", "/v1/paints/no", &from(SHOP), b"").await;
    assert_eq!((refusal.status, refusal.header(allowed)), (404, Some(SHOP)));
    for other in ["https://other.example", "http://cars.example", "null"] {
        let list = house.ask("GET", "/v1/paints", &from(other), b"").await;
        assert_eq!((list.status, list.header(allowed)), (200, None), "{other}");
    }

    let before = |method| {
        [
            ("origin", SHOP),
            ("access-control-request-method", method),
            (
                "access-control-request-headers",
                "content-type,prefer,idempotency-key",
            ),
        ]
    };
    let asked = house
        .ask("OPTIONS", "/v1/blends", &before("POST"), b"")
        .await;
    assert_eq!((asked.status, asked.header(allowed)), (200, Some(SHOP)));
    let methods = asked.header("access-control-allow-methods").expect("some");
    assert!(methods.contains("POST") && !methods.contains("DELETE"));
    let headers = asked.header("access-control-allow-headers").expect("some");
    assert!(headers.contains("content-type") && headers.contains("prefer"));
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_page_of_another_address_may_ask_unless_it_was_named() {
    let data = folder();
    let house = House::open(data.path()).await;
    let list = house
        .ask("GET", "/v1/paints", &[("origin", SHOP)], b"")
        .await;
    let told = |name: &str| name.starts_with("access-control");
    assert!(!list.headers.iter().any(|(name, _)| told(name)), "{list:?}");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_another_address_makes_nothing_unless_it_was_named() {
    let data = folder();
    let config = ServiceConfig {
        origins: vec![SHOP.parse().expect("an origin")],
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let paint = house.paint("silver").await;
    let path = format!("/v1/paints/{paint}");
    let page = |site, origin| {
        [
            ("sec-fetch-site", site),
            ("origin", origin),
            ("prefer", "wait=60"),
        ]
    };
    let other = "https://other.example";
    for site in ["cross-site", "same-site"] {
        let upload = house
            .ask("POST", "/v1/paints", &page(site, other), b"silver")
            .await;
        let problem = upload.problem(403, "other-origin");
        let accepted = problem["accepted"].as_str().expect("what is");
        assert!(accepted.contains("--allow-origin"), "{problem}");
        let read = house.ask("GET", &path, &page(site, other), b"").await;
        assert_eq!(
            read.status, 200,
            "what cannot be read back may be asked for"
        );
    }
    // Where a browser does not trust the address it says the origin alone.
    let plain = [("origin", other), ("prefer", "wait=60")];
    let upload = house.ask("POST", "/v1/paints", &plain, b"silver").await;
    upload.problem(403, "other-origin");
    let own = format!("http://{}", house.address);
    let own = [("origin", own.as_str()), ("prefer", "wait=60")];
    let upload = house.ask("POST", "/v1/paints", &own, b"green").await;
    assert_eq!(upload.status, 201, "{upload:?}");
    for origin in [other, SHOP] {
        let gone = house
            .ask("DELETE", &path, &page("cross-site", origin), b"")
            .await;
        gone.problem(403, "other-origin");
    }
    let upload = house
        .ask("POST", "/v1/paints", &page("cross-site", SHOP), b"blue")
        .await;
    assert_eq!(upload.status, 201, "{upload:?}");
    let own = page("same-origin", "http://localhost:8080");
    assert_eq!(house.ask("DELETE", &path, &own, b"").await.status, 204);
    house.close().await;
}
