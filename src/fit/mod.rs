//! From measurement to paint.
//!
//! [`fit_base`] turns a measured reflectance into diffuse, lobes and color table, with an explicit coat where the
//! measurement asks for one: the lobes carry the shape, the table carries the color. It says how far the result is
//! from the measurement and how near anything of its form could come. [`fit_flakes`] turns pictures of flakes into color
//! clusters per angle pair, with their grain and lifetime; [`simulate_flakes`] makes such pictures up where none were
//! taken. [`paint_from_readings`] makes a base of half a dozen readings of a hand-held instrument, [`against_readings`]
//! says how far any paint is from such.
//!
//! Nothing here draws random numbers from outside: the same measurement gives the same bits on any machine of one
//! kind, whatever the number of threads. Left to others: reading files (`measurement`), the reflectance itself
//! (`paint`).

mod base;
mod boxes;
mod clusters;
mod color_table;
mod directions;
mod flake_patch;
mod flakes;
mod from_readings;
mod grain;
mod least_squares;
mod lifetime;
mod lobes;
mod readings;
mod reduce;
mod residual;
mod simulate;
mod steps;
mod stream;
mod texels;
mod thinned;

pub use base::{CoatChoice, FitError, FittedBase, fit_base, fit_base_telling};
pub use boxes::BoxRule;
pub use clusters::{ClusterSettings, Clusterer, NoTexel, SliceClusters};
pub use color_table::FITTED_ANGLES;
pub use flake_patch::SimulatedPatch;
pub use flakes::{FittedFlakes, FlakeFitError, Progress, fit_flakes};
pub use from_readings::{PaintFromReadings, ReadingsFitError, paint_from_readings};
pub use readings::against_readings;
pub use reduce::reduce_clusters;
pub use simulate::{FlakeRecipe, simulate_flakes};
pub use stream::Stream;
pub use thinned::Thinned;
