//! The command line: one file per command, all of them calling the workshop.
//!
//! Scripts call these commands, so they are kept stable: exit codes are 2 for usage, 3 for input, 4 for output and 1 for
//! a bug; `--json` prints one object on stdout; progress and errors go to stderr; files appear whole or not at all.

mod blend;
mod bundle;
mod estimate;
mod evaluate;
mod ingest;
mod made;
mod number;
mod output;
mod preview;
mod profile;
mod progress;
mod realise;
mod samples;
mod selftest;
mod serve;
mod show;
mod study;
mod texels;
mod weights;

use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};

use crate::workshop::{Fault, WorkshopError};

/// Material synthesis for car paints: measured metallic paints in, new, realistic paints out.
#[derive(Parser, Debug)]
#[command(name = "carpaint", version, about, propagate_version = true, after_help = EXAMPLES)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

/// What every command takes.
#[derive(Args, Clone, Copy, Debug)]
struct Common {
    /// Print one JSON object on stdout; progress and errors stay on stderr.
    #[arg(long, global = true)]
    json: bool,
    #[allow(clippy::doc_markdown)] // a help text, printed as it stands
    /// Threads to compute with, in place of RAYON_NUM_THREADS, in place of all. Results are the same with any number.
    #[arg(long, global = true, value_name = "N", value_parser = number::whole(1..=1024_usize),
        allow_hyphen_values = true)]
    threads: Option<usize>,
}

#[derive(Subcommand, Debug)]
enum Command {
    Serve(serve::Serve),
    Ingest(ingest::Ingest),
    Show(show::Show),
    Blend(blend::Blend),
    Realise(realise::Realise),
    Bundle(bundle::Bundle),
    Preview(preview::Preview),
    Texels(texels::Texels),
    Evaluate(evaluate::Evaluate),
    Estimate(estimate::Estimate),
    Study(study::Study),
    Samples(samples::Samples),
    Selftest(selftest::Selftest),
}

const EXAMPLES: &str = "\
Examples:
  carpaint blend sample:polaris_silber sample:ford_f8 --out two.blend
  carpaint preview two.blend --weights 0.5,0.5 --out between.png
  carpaint realise two.blend --weights 0.5,0.5 --out between.zip
  carpaint bundle two.blend --out sliders.zip
  carpaint serve";

/// Runs the command line of this process.
#[must_use]
pub fn run() -> ExitCode {
    let cli = Cli::parse();
    match start(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("carpaint: {error}");
            ExitCode::from(match error.fault {
                Fault::Usage => 2,
                Fault::Input => 3,
                Fault::Output => 4,
                Fault::Internal => 1,
            })
        }
    }
}

/// Refuses a number of threads in the environment that is none; rayon would pass over it.
fn check_threads_of_environment() -> Result<(), WorkshopError> {
    let Some(said) = std::env::var_os("RAYON_NUM_THREADS") else {
        return Ok(());
    };
    let text = said.to_string_lossy();
    if text.is_empty() || text.trim().parse::<usize>().is_ok() {
        return Ok(());
    }
    let problem = format!(
        "RAYON_NUM_THREADS is {text:?}, accepted is a number of threads, or 0 for all cores"
    );
    Err(WorkshopError::usage("RAYON_NUM_THREADS", problem))
}

fn start(cli: Cli) -> Result<(), WorkshopError> {
    if cli.common.threads.is_none() {
        check_threads_of_environment()?;
    }
    rayon::ThreadPoolBuilder::new()
        // 0 leaves it to rayon, which reads RAYON_NUM_THREADS, where 0 and nothing mean all.
        .num_threads(cli.common.threads.unwrap_or(0))
        .build_global()
        .map_err(WorkshopError::internal)?;
    let json = cli.common.json;
    match cli.command {
        Command::Serve(command) => command.run(json),
        Command::Ingest(command) => command.run(json),
        Command::Show(command) => command.run(json),
        Command::Blend(command) => command.run(json),
        Command::Realise(command) => command.run(json),
        Command::Bundle(command) => command.run(json),
        Command::Preview(command) => command.run(json),
        Command::Texels(command) => command.run(json),
        Command::Evaluate(command) => command.run(json),
        Command::Estimate(command) => command.run(json),
        Command::Study(command) => command.run(json),
        Command::Samples(command) => command.run(json),
        Command::Selftest(command) => command.run(json),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn negative_weights_need_no_equals_sign() {
        let cli = Cli::try_parse_from([
            "carpaint",
            "realise",
            "b.blend",
            "--weights",
            "-2,3",
            "--out",
            "x.zip",
        ]);
        assert!(cli.is_ok(), "{:?}", cli.err());
    }
}
