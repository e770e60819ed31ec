//! Progress on a terminal: a bar on stderr, and nothing where stderr is a file or a pipe.

use std::io::IsTerminal as _;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar for one piece of long work.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar, if stderr is a terminal.
    pub fn new(what: &str) -> Self {
        let target = if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(1000), target).with_message(what.to_owned());
        if let Ok(style) = ProgressStyle::with_template("{msg} {bar:30} {percent:>3} % {eta}") {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// A bar for reading an input, which for a measurement is a fit.
    pub fn reading(input: &str) -> Self {
        Self::new(&format!("reading {input}"))
    }

    /// Says what is being done now.
    pub fn says(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    /// Moves the bar to a share of 0 to 1.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a bar of a thousand steps
    pub fn at(&self, share: f32) {
        self.bar
            .set_position((share.clamp(0.0, 1.0) * 1000.0) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
