//! The real program, killed in the middle: what it acknowledged is there again, and the bytes are the same.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::client::{Answer, ask};
use crate::house::sample_file;

struct Program {
    child: Child,
    address: SocketAddr,
}

impl Program {
    fn start(data: &Path) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_carpaint"))
            .args([
                "serve",
                "--json",
                "--no-samples",
                "--listen",
                "127.0.0.1:0",
                "--data",
            ])
            .arg(data)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("its stdout"))
            .read_line(&mut line)
            .expect("says where it listens");
        let told: Value = serde_json::from_str(&line).expect("JSON");
        let address = told["listening"]
            .as_str()
            .and_then(|url| url.strip_prefix("http://"))
            .expect("an address");
        Self {
            child,
            address: address.parse().expect("an address"),
        }
    }

    /// As `kill -9` does.
    fn kill(mut self) {
        self.child.kill().expect("kills");
        self.child.wait().expect("is dead");
    }

    async fn get(&self, path: &str) -> Answer {
        ask(self.address, "GET", path, &[], b"").await
    }

    async fn until_done(&self, job: &str) -> Value {
        let begun = Instant::now();
        loop {
            let told = self.get(job).await.json();
            match told["state"].as_str() {
                Some("queued" | "running") if begun.elapsed() < Duration::from_mins(1) => {}
                Some("done") => return told,
                _ => panic!("{told}"),
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_acknowledged_survives_a_kill() {
    let data = tempfile::tempdir().expect("temporary folder");
    let (white, at_once) = (sample_file("white"), [("Prefer", "respond-async")]);
    let mut jobs = Vec::new();
    for round in 0..6 {
        let program = Program::start(data.path());
        let path = format!("/v1/paints?name=round%20{round}");
        let answer = ask(program.address, "POST", &path, &at_once, &white).await;
        assert_eq!(answer.status, 202, "{answer:?}");
        jobs.push(answer.header("location").expect("a job").to_owned());
        // Sometimes at once, sometimes in the middle of the work, sometimes after it.
        tokio::time::sleep(Duration::from_millis(round * round)).await;
        program.kill();
    }
    let program = Program::start(data.path());
    for job in &jobs {
        let paint = program.until_done(job).await["result"]
            .as_str()
            .expect("an address")
            .to_owned();
        assert_eq!(
            program.get(&format!("{paint}/measurement")).await.body,
            white
        );
    }
    assert_eq!(
        program.get("/v1/paints").await.json()["paints"]
            .as_array()
            .map(Vec::len),
        Some(jobs.len())
    );
    program.kill();
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_bytes_come_after_a_kill_and_a_term_ends_it_quietly() {
    let data = tempfile::tempdir().expect("temporary folder");
    let mut program = Program::start(data.path());
    let wait = [("Prefer", "wait=60"), ("Content-Type", "application/json")];
    let mut ids = Vec::new();
    for name in ["white", "blue"] {
        let answer = ask(
            program.address,
            "POST",
            &format!("/v1/paints?name={name}"),
            &wait,
            &sample_file(name),
        )
        .await;
        assert_eq!(answer.status, 201, "{answer:?}");
        ids.push(answer.json()["id"].as_str().expect("an id").to_owned());
    }
    let body = json!({ "paints": ids }).to_string();
    let blend = ask(
        program.address,
        "POST",
        "/v1/blends",
        &wait,
        body.as_bytes(),
    )
    .await;
    let blend = blend.header("location").expect("an address").to_owned();
    let mut sky = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n".to_vec();
    sky.extend([60, 80, 128, 128].repeat(32));
    let lit = ask(program.address, "POST", "/v1/environments", &[], &sky).await;
    assert_eq!(lit.status, 201, "{lit:?}");
    let lit = lit.json()["id"].as_str().expect("an id").to_owned();
    let paths: Vec<String> = [
        "realisation.zip?",
        "realisation.json?",
        "realisation.paint?",
        "preview.png?size=48x32&spp=2&",
    ]
    .iter()
    .map(|what| format!("{blend}/{what}weights=0.25,0.75"))
    .chain([
        blend.clone(),
        format!("/v1/paints/{}", ids[0]),
        format!("/v1/environments/{lit}"),
        format!("/v1/environments/{lit}/file"),
        format!(
            "/v1/paints/{}/preview.png?size=24x16&spp=2&environment={lit}",
            ids[0]
        ),
    ])
    .collect();
    let mut before = Vec::new();
    for path in &paths {
        before.push(program.get(path).await);
    }
    // Once with what is kept on disk, once without.
    for keep in [true, false] {
        program.kill();
        if !keep {
            std::fs::remove_dir_all(data.path().join("results")).expect("removes");
        }
        program = Program::start(data.path());
        for (path, before) in paths.iter().zip(&before) {
            let after = program.get(path).await;
            assert_eq!(
                (before.status, after.status, after.etag()),
                (200, 200, before.etag()),
                "{path}"
            );
            assert!(after.body == before.body, "{path}");
        }
    }
    let told = Command::new("kill")
        .args(["-TERM", &program.child.id().to_string()])
        .status()
        .expect("sends");
    assert!(told.success());
    let begun = Instant::now();
    let status = program.child.wait().expect("ends");
    assert!(
        status.success() && begun.elapsed() < Duration::from_secs(8),
        "{status} after {:?}",
        begun.elapsed()
    );
}
