//! Hard cases, in one suite that a sceptical reader can run: `cargo test --test stability`.
//!
//! Every case ends finite and in range, equals an independently known value, or is refused with its own named error.
//! Each tolerance follows from an argument that stands beside it.

mod color;
mod reflectance;
