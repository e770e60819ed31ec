//! What requests for several resources ask for in the same words: accuracy, targets, a paint or a blend, weights,
//! views, pages.
//!
//! Promised: a refusal names the parameter or the field and what would be accepted. Left to others: what it means
//! (`accuracy`, `blend`), and what is done with it (`resources`).

mod named;
pub mod page;
mod profile;
mod profile_query;
pub mod targets;
pub mod view;
mod weights;

pub use named::{Named, of_field};
pub use profile::{KnobsDocument, ProfileDocument, ProfileText};
pub use profile_query::ProfileQuery;
pub use weights::WeightQuery;
