//! What a cached answer costs, beside a bare axum server that holds the same bytes.
//!
//! ```text
//! cargo build --release && cargo run --release --example cached [-- REQUESTS]
//! ```
//!
//! Starts the service and, as another process, an axum server that does nothing else; asks both for the same bundle over
//! one connection, in turns; and compares the processor time of the two processes, from `/proc` (Linux only).

use std::error::Error;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Clock ticks of a second in `/proc`, on every Linux that matters.
const TICKS: f64 = 100.0;
/// Times the two servers take turns.
const TURNS: usize = 10;

fn main() -> Outcome<()> {
    let word = std::env::args().nth(1);
    if let Some(file) = word.as_deref().and_then(|w| w.strip_prefix("bare:")) {
        return bare(std::fs::read(file)?);
    }
    let requests: usize = word.map_or(Ok(10_000), |n| n.parse())?;
    let data = tempfile::tempdir()?;
    let carpaint = std::env::current_exe()?
        .ancestors()
        .nth(2)
        .map(|target| target.join("carpaint"))
        .filter(|file| file.exists())
        .ok_or("run `cargo build --release` first")?;
    let service = Server::start(
        Command::new(carpaint)
            .args(["serve", "--json", "--listen", "127.0.0.1:0", "--data"])
            .arg(data.path().join("data")),
    )?;
    let path = blend_of_samples(&service)?;
    let body = service.connect()?.get(&path)?;
    let held: PathBuf = data.path().join("body");
    std::fs::write(&held, &body)?;
    let axum = Server::start(
        Command::new(std::env::current_exe()?).arg(format!("bare:{}", held.display())),
    )?;
    let (mut ours, mut theirs) = (service.connect()?, axum.connect()?);
    let (mut cost, mut peer) = (0.0, 0.0);
    for _ in 0..TURNS {
        for (server, connection, path, seconds) in [
            (&service, &mut ours, path.as_str(), &mut cost),
            (&axum, &mut theirs, "/", &mut peer),
        ] {
            let before = server.seconds()?;
            for _ in 0..requests / TURNS {
                if connection.get(path)? != body {
                    return Err("the bytes differ".into());
                }
            }
            *seconds += server.seconds()? - before;
        }
    }
    let each = |seconds: f64| seconds / requests as f64 * 1e6;
    println!(
        "a cached bundle of {} bytes: {:.0} us of processor time, bare axum {:.0} us, ratio {:.2}",
        body.len(),
        each(cost),
        each(peer),
        cost / peer
    );
    Ok(())
}

/// The address of a realisation of two samples, blended.
fn blend_of_samples(service: &Server) -> Outcome<String> {
    let mut connection = service.connect()?;
    let paints: Value = loop {
        let list: Value = serde_json::from_slice(&connection.get("/v1/paints")?)?;
        if list["paints"].as_array().is_some_and(|p| p.len() >= 8) {
            break list;
        }
        std::thread::sleep(std::time::Duration::from_millis(200));
    };
    let id = |name: &str| {
        let list = paints["paints"].as_array()?;
        list.iter().find(|p| p["name"] == name)?["id"].as_str()
    };
    let body = json!({ "paints": [id("polaris_silber"), id("ford_f8")] }).to_string();
    let made: Value = serde_json::from_slice(&connection.send(
        "POST",
        "/v1/blends",
        "Content-Type: application/json\r\nPrefer: wait=60\r\n",
        body.as_bytes(),
    )?)?;
    let id = made["id"].as_str().ok_or("the blend has no id")?;
    Ok(format!("/v1/blends/{id}/realisation.zip?weights=0.5,0.5"))
}

/// A server in a process of its own, that says where it listens.
struct Server {
    child: Child,
    address: String,
}

impl Server {
    fn start(command: &mut Command) -> Outcome<Self> {
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let mut line = String::new();
        let out = child.stdout.take().ok_or("no stdout")?;
        BufReader::new(out).read_line(&mut line)?;
        let told: Value = serde_json::from_str(&line)?;
        let url = told["listening"].as_str().ok_or("no address")?;
        Ok(Self {
            child,
            address: url.trim_start_matches("http://").to_owned(),
        })
    }

    fn connect(&self) -> Outcome<Connection> {
        let stream = TcpStream::connect(&self.address)?;
        stream.set_nodelay(true)?;
        Ok(Connection(BufReader::with_capacity(1 << 16, stream)))
    }

    /// Processor seconds so far.
    fn seconds(&self) -> Outcome<f64> {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id()))?;
        let fields: Vec<&str> = stat
            .rsplit(')')
            .next()
            .ok_or("no fields")?
            .split_whitespace()
            .collect();
        let ticks = |k: usize| fields.get(k).and_then(|f| f.parse::<f64>().ok());
        let (user, system) = (ticks(11).ok_or("no time")?, ticks(12).ok_or("no time")?);
        Ok((user + system) / TICKS)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// One connection that is kept.
struct Connection(BufReader<TcpStream>);

impl Connection {
    fn get(&mut self, path: &str) -> Outcome<Vec<u8>> {
        self.send("GET", path, "", b"")
    }

    fn send(&mut self, method: &str, path: &str, headers: &str, body: &[u8]) -> Outcome<Vec<u8>> {
        let length = body.len();
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: bench\r\nContent-Length: {length}\r\n{headers}\r\n"
        );
        self.0
            .get_mut()
            .write_all(&[head.as_bytes(), body].concat())?;
        let (mut line, mut length) = (String::new(), None);
        loop {
            line.clear();
            if self.0.read_line(&mut line)? == 0 {
                return Err("the connection was closed".into());
            }
            let lower = line.trim_end().to_ascii_lowercase();
            if let Some(value) = lower.strip_prefix("content-length: ") {
                length = Some(value.parse()?);
            }
            if lower.is_empty() {
                break;
            }
        }
        let mut answer = vec![0; length.ok_or("no length")?];
        self.0.read_exact(&mut answer)?;
        Ok(answer)
    }
}

/// An axum server that answers everything with these bytes.
fn bare(body: Vec<u8>) -> Outcome<()> {
    let body = bytes::Bytes::from(body);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async move {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
        println!(
            "{}",
            json!({ "listening": format!("http://{}", listener.local_addr()?) })
        );
        let router = axum::Router::new().fallback(move || {
            let body = body.clone();
            async move { body }
        });
        Ok(axum::serve(listener, router).await?)
    })
}
