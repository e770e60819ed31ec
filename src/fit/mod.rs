//! Measurement to paint.

#![allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

mod clusters;
mod flakes;
mod grain;
mod lifetime;

pub use clusters::{BoxRule, ClusterSettings, Clusterer, NoTexel, SliceClusters};
pub use flakes::{FittedFlakes, FlakeFitError, Progress, fit_flakes};
