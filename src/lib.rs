//! carpaint: material synthesis for car paints.
//!
//! A paint walks through the crate once, from the door where a lab hands it in to the door where a website picks it up:
//!
//! ```text
//! measurement ─▶ fit ─▶ paint ─▶ blend ─▶ (realised) paint ─▶ export ─▶ bundle, GLB
//!                                  ▲                 │
//!                              transport             └────────▶ render ─▶ PNG, EXR
//! ```

pub mod color;
pub mod paint;
pub mod store;
