//! What carpaint's steps cost, each beside its limit or its peer, measured in the same run.
//!
//! ```text
//! cargo run --release --example ratios -- A.zip B.zip [--only realise|bundle|glb|blend|disk]
//! ```
//!
//! Processor time of this thread comes from the scheduler's own account, since wall time says little on a busy machine;
//! where that account is missing (other systems than Linux), wall time stands in and the head of the table says so.
//! Every figure is the median of several runs.

use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use carpaint::accuracy::Profile;
use carpaint::blend::{Blend, RealisationWeights};
use carpaint::export::{About, bundle, glb};
use carpaint::paint::{Flakes, PaintFile, Provenance};
use carpaint::workshop::{IngestOptions, blend_paints, ingest};

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let only = words
        .iter()
        .position(|w| w == "--only")
        .and_then(|k| words.get(k + 1))
        .cloned();
    let inputs: Vec<&String> = words.iter().take_while(|w| *w != "--only").collect();
    if inputs.len() < 2 {
        return Err("usage: ratios A.zip B.zip [C.zip] [--only STEP]".into());
    }
    let wanted = |step: &str| only.as_deref().is_none_or(|only| only == step);
    println!("| step | measured | beside it | ratio | clock |");
    println!("|---|---|---|---|---|");
    if wanted("disk") {
        from_disk(&inputs)?;
    }
    let paints = ingest_all(&inputs)?;
    if wanted("blend") {
        again(&paints)?;
    }
    let blend = blended(&paints)?;
    if wanted("realise") {
        realise(&blend)?;
    }
    let even = RealisationWeights::uniform(vec![1.0 / inputs.len() as f64; inputs.len()]);
    let realised = blend.realise(&even)?.paint;
    let about = About {
        name: "bench".to_owned(),
        provenance: Provenance::default(),
        report: serde_json::Value::Null,
    };
    let settings = Profile::standard().export;
    if wanted("bundle") {
        let bytes = bundle(&realised, &about, &settings)?;
        let ours = cpu(9, || bundle(&realised, &about, &settings).map(|b| b.len()));
        let copy = cpu(9, || black_box(black_box(&bytes).clone()).len());
        row("realisation to bundle bytes", ours, "copying them", copy);
    }
    if wanted("glb") {
        let bytes = glb(&realised, &about)?;
        let ours = cpu(9, || glb(&realised, &about).map(|b| b.len()));
        let copy = cpu(9, || black_box(black_box(&bytes).clone()).len());
        row("realisation to GLB bytes", ours, "copying them", copy);
    }
    Ok(())
}

fn row(step: &str, ours: f64, beside: &str, limit: f64) {
    println!(
        "| {step} | {:.3} ms | {beside} {:.3} ms | {:.2} | {} |",
        ours * 1e3,
        limit * 1e3,
        ours / limit,
        if thread_seconds().is_some() {
            "processor"
        } else {
            "wall"
        }
    );
}

/// Two packages on disk to a blend on disk, beside reading and inflating them.
fn from_disk(inputs: &[&String]) -> Outcome<()> {
    let out = tempfile::NamedTempFile::new()?;
    let mut seconds = Vec::new();
    for _ in 0..7 {
        let begin = Instant::now();
        let paints = ingest_all(inputs)?;
        std::fs::write(out.path(), blended(&paints)?.to_bytes()?)?;
        seconds.push(begin.elapsed().as_secs_f64());
    }
    let mut limit = Vec::new();
    for _ in 0..7 {
        let begin = Instant::now();
        for input in inputs {
            black_box(std::fs::read(input)?);
        }
        limit.push(begin.elapsed().as_secs_f64());
    }
    let (ours, limit) = (median(seconds), median(limit));
    println!(
        "| packages on disk to a blend on disk | {:.1} ms | reading them {:.1} ms | {:.1} | wall |",
        ours * 1e3,
        limit * 1e3,
        ours / limit
    );
    Ok(())
}

fn ingest_all(inputs: &[&String]) -> Outcome<Vec<PaintFile>> {
    let options = IngestOptions::default();
    Ok(inputs
        .iter()
        .map(|input| ingest(Path::new(input), &options, &|_| ()))
        .collect::<Result<_, _>>()?)
}

fn blended(paints: &[PaintFile]) -> Outcome<Blend> {
    let paints: Vec<&PaintFile> = paints.iter().collect();
    Ok(blend_paints(&paints, &Profile::standard(), &|_| ())?.blend)
}

/// Blending again what is already ingested; all cores.
fn again(paints: &[PaintFile]) -> Outcome<()> {
    let slices = blended(paints)?.report().slices;
    let (mut seconds, mut busy) = (Vec::new(), Vec::new());
    for _ in 0..15 {
        let (begin, before) = (Instant::now(), seconds_of_all_threads());
        black_box(blended(paints)?);
        seconds.push(begin.elapsed().as_secs_f64());
        busy.extend(
            before
                .zip(seconds_of_all_threads())
                .map(|(before, after)| after - before),
        );
    }
    let limit = 0.030 * slices as f64 / 576.0;
    println!(
        "| ingested paints to a blend, {slices} slices | {:.1} ms | allowed {:.1} ms | {:.2} | wall, all cores |",
        median(seconds.clone()) * 1e3,
        limit * 1e3,
        median(seconds) / limit
    );
    if !busy.is_empty() {
        let each = median(busy) * 1e3;
        println!(
            "| of which processor time, all threads together | {each:.1} ms | | | processor |"
        );
    }
    Ok(())
}

/// Realisations in memory, each beside a·X + b·Y over the same bytes: the boxes of every paint are read and one set of
/// boxes, six numbers a cluster, is written. Peers write to new memory where ours does, and else to memory used before.
fn realise(blend: &Blend) -> Outcome<()> {
    let count = blend.len();
    let even = 1.0 / count as f64;
    let mut outside = vec![-0.3 / (count - 1) as f64; count];
    outside[0] = 1.3;
    let weights = RealisationWeights::uniform(vec![even; count]);
    let first = blend.realise(&weights)?;
    let clusters = first.paint.flakes.as_ref().map_or(0, Flakes::clusters);
    let inputs: Vec<Vec<f32>> = (0..count)
        .map(|k| (0..clusters * 6).map(|i| (i % 97 + k) as f32).collect())
        .collect();
    let w = even as f32;

    let ours = cpu(25, || black_box(blend.realise(&weights)).is_ok());
    let peer = cpu(25, || {
        // Two lists, as a paint has them: what the system takes back and clears depends on their sizes.
        let halves = [0..3 * clusters, 3 * clusters..6 * clusters].map(|half| {
            let (x, y) = (black_box(&inputs[0]), black_box(&inputs[1]));
            let pairs = x[half.clone()].iter().zip(&y[half.clone()]);
            let mut out: Vec<f32> = pairs.map(|(x, y)| w * x + w * y).collect();
            for z in &inputs[2..] {
                add(&mut out, &z[half.clone()], w);
            }
            out
        });
        black_box(halves).len()
    });
    let label = format!("one realisation, {clusters} clusters, in new memory");
    row(&label, ours, "a·X + b·Y", peer);

    let mut out = vec![0.0; 6 * clusters];
    let peer = cpu(25, || {
        let (x, y) = (black_box(&inputs[0]), black_box(&inputs[1]));
        for ((out, x), y) in out.iter_mut().zip(x).zip(y) {
            *out = w * x + w * y;
        }
        for z in &inputs[2..] {
            add(&mut out, z, w);
        }
        black_box(&out).len()
    });
    let pale = RealisationWeights {
        flake_saturation: 0.5,
        ..weights.clone()
    };
    let mut old = Some(first);
    for (what, weights) in [
        ("", weights),
        (
            ", weights outside 0..1",
            RealisationWeights::uniform(outside),
        ),
        (", half the saturation", pale),
    ] {
        let ours = cpu(25, || {
            old = old
                .take()
                .and_then(|old| blend.realise_over(&weights, old).ok());
            old.is_some()
        });
        row(
            &format!("the next realisation{what}"),
            ours,
            "a·X + b·Y",
            peer,
        );
    }
    Ok(())
}

fn add(out: &mut [f32], z: &[f32], weight: f32) {
    for (out, z) in out.iter_mut().zip(black_box(z)) {
        *out += weight * z;
    }
}

/// Seconds of processor time of a step: the median of `batches`, each of as many runs as fill 60 ms, for the scheduler
/// keeps its account in ticks.
fn cpu<T>(batches: usize, mut step: impl FnMut() -> T) -> f64 {
    black_box(step());
    let seconds = (0..batches).map(|_| {
        let wall = Instant::now();
        let before = thread_seconds();
        let mut runs = 0.0;
        while wall.elapsed().as_secs_f64() < 0.06 {
            black_box(step());
            runs += 1.0;
        }
        match (before, thread_seconds()) {
            (Some(before), Some(after)) => (after - before) / runs,
            _ => wall.elapsed().as_secs_f64() / runs,
        }
    });
    median(seconds.collect())
}

/// Processor seconds of this thread so far.
fn thread_seconds() -> Option<f64> {
    seconds_of(Path::new("/proc/thread-self"))
}

/// Processor seconds of all threads so far, as long as none has ended.
fn seconds_of_all_threads() -> Option<f64> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?;
    threads.map(|thread| seconds_of(&thread.ok()?.path())).sum()
}

fn seconds_of(thread: &Path) -> Option<f64> {
    let account = std::fs::read_to_string(thread.join("schedstat")).ok()?;
    let nanoseconds: u64 = account.split_whitespace().next()?.parse().ok()?;
    Some(nanoseconds as f64 * 1e-9)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
