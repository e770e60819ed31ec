//! A page for people: what something is on the left, how it is on the right.

use std::fmt::{Display, Write as _};

use crate::accuracy::ResultError;
use crate::paint::AngleGrid;

/// Lines of a page: a word on the left, what it is on the right.
#[derive(Default)]
pub struct Page(String);

impl Page {
    pub fn line(&mut self, word: &str, text: impl Display) {
        let _ = writeln!(self.0, "{word:<14} {text}");
    }

    pub fn table(&mut self, word: &str, head: &str, rows: impl IntoIterator<Item = String>) {
        self.line(word, head);
        for row in rows {
            self.line("", row);
        }
    }

    /// How far a result is from the reference, term by term.
    pub fn error(&mut self, error: &ResultError) {
        for term in &error.terms {
            let how_far = term
                .lab
                .map_or("not known".to_owned(), |lab| format!("{lab:.3} Lab"));
            self.line("error", format!("{}: {how_far} ({})", term.what, term.how));
        }
    }

    pub fn text(self) -> String {
        self.0
    }
}

/// How many angles, and from where to where.
pub fn range(grid: &AngleGrid) -> String {
    let angles = grid.degrees();
    format!(
        "{} of {:.1}..{:.1}°",
        angles.len(),
        angles[0],
        angles[angles.len() - 1]
    )
}
