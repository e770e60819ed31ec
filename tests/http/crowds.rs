//! Too much work, and callers who never end what they begin.

use std::time::{Duration, Instant};

use carpaint::service::ServiceConfig;
use futures::future::join_all;
use tokio::io::AsyncWriteExt;

use crate::client::raw;
use crate::folder;
use crate::house::House;

#[tokio::test(flavor = "multi_thread")]
async fn too_much_work_is_turned_away_with_a_time_to_come_back() {
    let data = folder();
    let config = ServiceConfig {
        most_waiting: 1,
        most_jobs: 1,
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let (a, b) = (house.paint("silver").await, house.paint("blue").await);
    let blend = house.blend(&[&a, &b]).await;
    let processors = std::thread::available_parallelism().map_or(64, usize::from);
    let crowd = 2 * processors + 24;
    let asked = (0..crowd).map(|k| format!("/v1/blends/{blend}/realisation.zip?alpha={k}&beta=1"));
    let answers = join_all(asked.map(|path| {
        let house = &house;
        async move { house.get(&path).await }
    }))
    .await;
    let refused: Vec<_> = answers
        .iter()
        .filter(|answer| answer.status != 200)
        .collect();
    assert!(
        !refused.is_empty() && refused.len() < crowd,
        "{} of {crowd}",
        refused.len()
    );
    for answer in refused {
        answer.problem(503, "overloaded");
        assert!(answer.header("retry-after").is_some());
    }
    let first = house.submit(b"slow four").await;
    assert_eq!(first.status, 202);
    house.submit(b"slow five").await.problem(503, "overloaded");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_header_that_never_ends_is_not_waited_for() {
    let data = folder();
    let config = ServiceConfig {
        header_time: Duration::from_millis(300),
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let half = b"GET /healthz HTTP/1.1\r\nHost: x\r\nX-Half".as_slice();
    for silent in [half, b"", b"G", b"PRI * HTTP/2.0\r\n"] {
        let answer = tokio::time::timeout(Duration::from_secs(5), raw(house.address, silent)).await;
        assert!(answer.is_ok(), "{:?}", String::from_utf8_lossy(silent));
    }
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_never_ends_is_not_waited_for() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let data = folder();
    let config = ServiceConfig {
        body_time: Duration::from_millis(300),
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let mut stream = tokio::net::TcpStream::connect(house.address)
        .await
        .expect("connects");
    let head = "POST /v1/blends HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: 50\r\n\r\n{";
    stream.write_all(head.as_bytes()).await.expect("sends");
    let mut answer = Vec::new();
    let read = tokio::time::timeout(Duration::from_secs(5), stream.read_to_end(&mut answer));
    let _ = read.await.expect("is answered in time");
    let answer = String::from_utf8_lossy(&answer);
    assert!(answer.starts_with("HTTP/1.1 408"), "{answer}");
    house.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn more_requests_than_are_taken_are_refused_at_once_and_health_answers_still() {
    let data = folder();
    let config = ServiceConfig {
        most_requests: 1,
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let deadline = Instant::now() + Duration::from_secs(20);
    let (slow, refused) = loop {
        // The upload that finds the place taken by a question is refused itself.
        let slow = half_an_upload(house.address).await;
        let answer = house.get("/v1/paints").await;
        if answer.status != 200 {
            break (slow, answer);
        }
        assert!(Instant::now() < deadline, "the upload holds its place");
    };
    refused.problem(503, "overloaded");
    assert!(refused.header("retry-after").is_some(), "{refused:?}");
    for page in ["/healthz", "/metrics", "/docs"] {
        assert_eq!(house.get(page).await.status, 200, "{page}");
    }
    drop(slow);
    while house.get("/v1/paints").await.status != 200 {
        assert!(Instant::now() < deadline, "the place is free again");
    }
    house.close().await;
}

async fn half_an_upload(address: std::net::SocketAddr) -> tokio::net::TcpStream {
    let mut slow = tokio::net::TcpStream::connect(address)
        .await
        .expect("connects");
    let begin = b"POST /v1/paints HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nhalf";
    slow.write_all(begin).await.expect("sent");
    // Time to be taken in before the next question comes.
    tokio::time::sleep(Duration::from_millis(50)).await;
    slow
}

#[tokio::test(flavor = "multi_thread")]
async fn who_asks_and_does_not_read_is_not_waited_for() {
    let data = folder();
    let config = ServiceConfig {
        most_connections: 1,
        write_time: Duration::from_millis(300),
        // Not what frees the connection.
        header_time: Duration::from_mins(10),
        ..ServiceConfig::new(data.path().to_owned())
    };
    let house = House::with(config).await;
    let mut deaf = tokio::net::TcpStream::connect(house.address)
        .await
        .expect("connects");
    // More than the buffers of both ends hold.
    let page = "GET /openapi.json HTTP/1.1\r\nHost: x\r\n\r\n".repeat(400);
    let _ = tokio::time::timeout(Duration::from_secs(1), deaf.write_all(page.as_bytes())).await;
    let next = tokio::time::timeout(Duration::from_secs(20), house.get("/healthz")).await;
    assert_eq!(next.expect("the only connection is free again").status, 200);
    drop(deaf);
    house.close().await;
}
