//! The studio: the page a newcomer meets, with three paints and the one between them.
//!
//! Plain HTML, CSS and JavaScript without dependencies; it talks to the same HTTP interface as everybody else and needs
//! nothing from the internet. Serving it is left to `service`.

/// The page.
pub const PAGE: &str = include_str!("page.html");
/// Its script.
pub const SCRIPT: &str = include_str!("page.js");
/// Its looks.
pub const STYLE: &str = include_str!("page.css");
