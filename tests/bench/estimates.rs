//! Estimates beside what then happens: a mixed set of commands, estimated and then run by the release binary.
//!
//! ```text
//! cargo build --release && cargo run --release --example estimates -- [PACKAGE.zip ...]
//! ```
//!
//! Prints a table, and fails when fewer than nine of ten estimated times are within a factor of 1.5.

use std::error::Error;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use serde_json::Value;

type Outcome<T> = Result<T, Box<dyn Error>>;

#[allow(clippy::too_many_lines)] // a list of requests
fn main() -> Outcome<()> {
    let packages: Vec<String> = std::env::args().skip(1).collect();
    let folder = tempfile::tempdir()?;
    let carpaint = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/release/carpaint");
    let run = |words: &[String]| -> Outcome<Vec<u8>> {
        let output = Command::new(&carpaint)
            .current_dir(folder.path())
            .args(words)
            .output()?;
        if !output.status.success() {
            return Err(format!("{words:?}: {}", String::from_utf8_lossy(&output.stderr)).into());
        }
        Ok(output.stdout)
    };
    let words = |text: &str| -> Vec<String> { text.split(' ').map(str::to_owned).collect() };
    for name in ["polaris_silber", "ford_f8", "bmw339"] {
        run(&words(&format!("samples export {name} --out {name}.paint")))?;
    }
    run(&words(
        "blend polaris_silber.paint ford_f8.paint --out two.blend",
    ))?;

    // What is estimated, and what else the command itself takes.
    let mut set: Vec<(String, String)> = [
        ("blend polaris_silber.paint ford_f8.paint", "--out x.blend"),
        (
            "blend polaris_silber.paint ford_f8.paint bmw339.paint",
            "--out x.blend",
        ),
        (
            "blend polaris_silber.paint ford_f8.paint --profile draft",
            "--out x.blend",
        ),
        (
            "blend polaris_silber.paint ford_f8.paint --knob cost=squared",
            "--out x.blend",
        ),
        (
            "blend polaris_silber.paint ford_f8.paint --knob transport=sinkhorn --knob epsilon=0.02",
            "--out x.blend",
        ),
        (
            "blend sample:polaris_silber sample:opel_titan",
            "--out x.blend",
        ),
        (
            "blend sample:polaris_silber sample:bmw339 --profile reference",
            "--out x.blend",
        ),
        (
            "realise two.blend --weights 0.5,0.5 --format zip",
            "--out x.zip",
        ),
        (
            "realise two.blend --weights 0.3,0.7 --format glb",
            "--out x.glb",
        ),
        (
            "realise two.blend --weights 0.3,0.7 --knob precision=f32 --format json",
            "--out x.json",
        ),
        ("bundle two.blend", "--out x.zip"),
        (
            "preview two.blend --weights 0.5,0.5 --size 256x256",
            "--out x.png",
        ),
        (
            "preview polaris_silber.paint --size 400x300 --spp 16 --scene capsule",
            "--out x.png",
        ),
        (
            "preview sample:white --size 512x512 --spp 8 --scene panel",
            "--out x.png",
        ),
        (
            "preview bmw339.paint --size 300x300 --format exr",
            "--out x.exr",
        ),
        (
            "preview bmw339.paint --size 1200x900 --show aspecular --format png",
            "--out x.png",
        ),
    ]
    .map(|(asked, out)| (asked.to_owned(), out.to_owned()))
    .into();
    for package in &packages {
        let package = std::fs::canonicalize(package)?.display().to_string();
        set.push((format!("ingest {package}"), "--out x.paint".to_owned()));
        set.push((
            format!("blend {package} polaris_silber.paint --profile draft"),
            "--out x.blend".to_owned(),
        ));
    }

    println!("| request | estimated | took | ratio | bytes estimated | bytes | error estimated |");
    println!("|---|---:|---:|---:|---:|---:|---:|");
    let mut within = 0;
    for (asked, out) in &set {
        let estimate = [words("estimate"), words(asked), words("--json")].concat();
        let estimate: Value = serde_json::from_slice(&run(&estimate)?)?;
        let seconds = estimate["seconds"].as_f64().ok_or("no seconds")?;
        // The format is in the ending of the file.
        let command = asked.split(" --format ").next().unwrap_or(asked).to_owned();
        let begun = Instant::now();
        run(&words(&format!("{command} {out}")))?;
        let took = begun.elapsed().as_secs_f64();
        let file = out.trim_start_matches("--out ");
        let bytes = std::fs::metadata(folder.path().join(file))?.len();
        let ratio = seconds / took;
        within += usize::from((1.0 / 1.5..=1.5).contains(&ratio));
        println!(
            "| {asked} | {:.0} ms | {:.0} ms | {ratio:.2} | {} | {bytes} | {:.3} {} |",
            seconds * 1e3,
            took * 1e3,
            estimate["bytes"],
            estimate["error"]["value"].as_f64().unwrap_or(f64::NAN),
            estimate["error"]["unit"].as_str().unwrap_or("")
        );
    }
    println!("\n{within} of {} within a factor of 1.5", set.len());
    if within * 10 < set.len() * 9 {
        return Err("fewer than nine of ten are within a factor of 1.5".into());
    }
    Ok(())
}
