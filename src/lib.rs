//! carpaint: material synthesis for car paints.
//!
//! A paint walks through the crate once, from the door where a lab hands it in to the door where a website picks it up:
//!
//! ```text
//! measurement ─▶ fit ─▶ paint ─▶ blend ─▶ (realised) paint ─▶ export ─▶ bundle, GLB
//!                                  ▲                 │
//!                              transport             └────────▶ render ─▶ PNG, EXR
//! ```
//!
//! | room | what lives there |
//! |---|---|
//! | [`color`] | white points, XYZ, Lab, color differences |
//! | [`transport`] | optimal transport of point clouds: numbers only, no paint |
//! | [`descent`] | damped least squares, as several fits take their steps |
//! | [`paint`] | what a paint is: coat, lobes, color table, flakes, their reflectance and their file |
//! | [`measurement`] | what labs hand in: bytes in, tables and pictures out |
//! | [`fit`] | measurement to paint: lobes, color table, clusters of flakes, grain, lifetime |
//! | [`blend`] | which flakes of one paint become which of another, and paints at any weights of it |
//! | [`render`] | scene, shading, film: the preview |
//! | [`export`] | texture bundle, glTF, readings |
//! | [`accuracy`] | profiles, and how far a result is from the most accurate one |
//! | [`workshop`] | the use cases, which read files and know the clock; what both doors call |
//! | [`store`] | what outlives the process: blobs, catalogue, results |
//! | [`service`], [`studio`], [`cli`] | the doors: HTTP, its web page, the command line |
//!
//! Rooms up to [`accuracy`] are pure: no clock, no network, no files, no chance; the same arguments give the same bytes
//! on any number of threads. Which room may use which stands in `tests/architecture.rs`, where it is tested.

// A realisation makes and drops megabytes. glibc hands their pages back and asks for new ones, which the kernel clears
// each time: two fifths of a bundle's time in `tests/bench/ratios.rs`. It stands here and not in `main`, so that benches
// and tests run on what the program runs on. Huge pages are left out: clearing one costs a short command more than it saves.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

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
