//! carpaint: material synthesis for car paints.
//!
//! A paint walks through the crate once, from the door where a lab hands it in to the door where a website picks it up:
//!
//! ```text
//! measurement ─▶ fit ─▶ paint ─▶ blend ─▶ (realised) paint ─▶ export ─▶ bundle, GLB
//!                                  ▲                 │
//!                              transport             └────────▶ render ─▶ PNG, EXR
//! ```

pub mod accuracy;
pub mod blend;
pub mod cli;
pub mod color;
pub mod descent;
pub mod export;
pub mod fit;
pub mod measurement;
pub mod paint;
pub mod render;
pub mod service;
pub mod store;
pub mod studio;
pub mod transport;
pub mod workshop;
