//! What holds for every request, whatever it is about.
//!
//! Each passes the `envelope` (id, time, counts, panics); browsers are told by `origins` whose pages may call. What it
//! says is read strictly in `extract` and `query`, what it prefers in `waiting` and `idempotency`, and an upload comes in
//! through `receiving`. What is wrong with it becomes a problem in `problem`, which says what is `accepted` instead, and
//! all else an `answer` with an `ETag` and how long it keeps.
//!
//! Promised: unknown fields and parameters are refused; nothing internal leaves in an error. Left to others: what a
//! request is about (`resources`).

mod accepted;
mod answer;
mod documented;
mod envelope;
mod extract;
mod idempotency;
mod kind;
mod origins;
mod problem;
mod query;
pub mod receiving;
mod waiting;

pub use answer::{Answer, Keep, Stages};
pub use documented::{BlendProblems, EnvironmentProblems, JobProblems, PaintProblems, Problems};
pub use envelope::envelope;
pub use extract::{Address, JSON_BYTES, Json, NoQuery, Query, QueryOfTwo};
pub use idempotency::Idempotency;
pub use kind::Kind;
pub use origins::{Origin, cors, held_to_pages};
pub use problem::{Place, Problem, ProblemDocument};
pub use waiting::Prefer;
