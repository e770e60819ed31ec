//! Solves the problems of a folder one at a time on one thread and says what each cost and took.
//!
//! `cargo run --release --example transport -- DIR` reads `slices.json` (`{"n", "ns": [..], "nt": [..], "offset": [..]}`)
//! and `slices.bin` (for each problem at its byte offset, little-endian f64: source masses, target masses, source points,
//! target points) and prints a JSON array of `{"cost": …, "microseconds": …}`, one a problem in order. The time runs from
//! points and masses in memory to plan and duals, checks, rescaling and cost matrix included.

use std::error::Error;
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use carpaint::transport::{Cost, Plan, Problem, Solver, TransportSimplex, Workspace};

#[derive(serde::Deserialize)]
struct Index {
    n: usize,
    ns: Vec<usize>,
    nt: Vec<usize>,
    offset: Vec<usize>,
}

#[derive(serde::Serialize)]
struct Solved {
    cost: f64,
    microseconds: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args_os().nth(1).ok_or("usage: transport DIR")?);
    let index: Index = serde_json::from_slice(&std::fs::read(folder.join("slices.json"))?)?;
    let bytes = std::fs::read(folder.join("slices.bin"))?;
    let mut problem = Problem::default();
    let mut workspace = Workspace::default();
    let mut plan = Plan::default();
    let mut solved = Vec::with_capacity(index.n);
    for k in 0..index.n {
        let (Some(&ns), Some(&nt), Some(&offset)) =
            (index.ns.get(k), index.nt.get(k), index.offset.get(k))
        else {
            return Err(format!("slices.json lists no problem {k}").into());
        };
        let values = bytes
            .get(offset..offset + 32 * (ns + nt))
            .ok_or_else(|| format!("slices.bin ends before problem {k}"))?
            .as_chunks::<8>()
            .0
            .iter()
            .map(|value| f64::from_le_bytes(*value))
            .collect::<Vec<_>>();
        let (masses, points) = values.split_at(ns + nt);
        let (from_masses, to_masses) = masses.split_at(ns);
        let (from, to) = points.as_chunks::<3>().0.split_at(ns);

        let begin = Instant::now();
        problem.refill_slices(from, from_masses, to, to_masses)?;
        TransportSimplex.solve_into(&problem, Cost::Distance, &mut workspace, &mut plan)?;
        let microseconds = begin.elapsed().as_secs_f64() * 1e6;

        solved.push(Solved {
            cost: plan.cost,
            microseconds,
        });
    }
    let mut out = std::io::stdout().lock();
    serde_json::to_writer(&mut out, &solved)?;
    writeln!(out)?;
    Ok(())
}
