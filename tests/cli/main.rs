//! The real binary, as scripts call it.

mod arguments;
mod asking;
mod bundle;
mod desk;
mod making;
mod mistakes;
mod output;
mod profiles;
