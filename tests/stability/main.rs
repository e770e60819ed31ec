//! Hard cases, in one suite that a sceptical reader can run: `cargo test --test stability`.
//!
//! Every case ends finite and in range, equals an independently known value, or is refused with its own named error.
//! Each tolerance follows from an argument that stands beside it; `EPS` there is `f64::EPSILON`, 2.2e-16, and one
//! rounding is at most half of it. What another program, a closed form or a second implementation says is computed
//! in this folder, never by the code under test.
//!
//! `CARPAINT_FUZZ` says how many random transport problems are solved; with `CI=true` it is all of them and nothing skips.

mod blends;
mod bounds;
mod clusters;
mod color;
mod export;
mod files;
mod fit;
mod machine;
mod paints;
mod realisation;
mod reflectance;
mod samplers;
mod transport;
