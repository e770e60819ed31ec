//! From measurement to paint.
//!
//! [`fit_base`] turns a measured reflectance into diffuse, lobes and color table, with an explicit coat where the
//! measurement asks for one: the lobes carry the shape, the table carries the color. It says how far the result is
//! from the measurement and how near anything of its form could come.
//!
//! Nothing here draws random numbers from outside: the same measurement gives the same bits on any machine of one
//! kind, whatever the number of threads. Left to others: reading files (`measurement`), the reflectance itself
//! (`paint`).

mod base;
mod color_table;
mod directions;
mod least_squares;
mod lobes;
mod residual;

pub use base::{CoatChoice, FitError, FittedBase, fit_base};
