//! The study: what accuracy costs, as measured.
//!
//! Pure data and arithmetic: [`Study`] is what was measured, [`Front`] the points of one kind of work with their Pareto
//! front and its knee, [`Growth`] a curve of time against size with its fitted exponent. [`page`] writes it for people,
//! [`plots`] draws it. Measuring, which needs a clock, is the workshop's.

mod front;
mod growth;
mod machine;
mod page;
mod plot;

pub use front::{Front, Point};
pub use growth::Growth;
pub use machine::Machine;
pub use page::page;
pub use plot::plots;

use serde::{Deserialize, Serialize};

/// What was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// `carpaint study`.
    pub format: String,
    /// Version of this form.
    pub version: u32,
    /// Version of the program.
    pub program: String,
    /// Threads that it computed with.
    pub threads: usize,
    /// What its times are.
    pub clock: String,
    /// Names of the paints, and how many slices and texels they have.
    pub paints: Vec<String>,
    /// Whether fewer points were measured.
    pub quick: bool,
    /// Seconds that the study took.
    pub seconds: f64,
    /// What this machine takes for steps that depend on it alone; the cost model of estimates takes it from here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub machine: Option<Machine>,
    /// Error against time, one for each kind of work.
    pub fronts: Vec<Front>,
    /// Time against size.
    pub growth: Vec<Growth>,
}
