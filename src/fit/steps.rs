//! The share done of work whose steps end on any thread.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Hears the share done, 0 to 1. It does not return when the work was called off.
pub(super) type Tell<'a> = &'a (dyn Fn(f32) + Sync);

/// Counts steps of equal weight and tells the share done after each.
pub(super) struct Steps<'a> {
    tell: Tell<'a>,
    done: AtomicUsize,
    all: usize,
}

impl<'a> Steps<'a> {
    /// So many steps.
    pub fn new(all: usize, tell: Tell<'a>) -> Self {
        Self {
            tell,
            done: AtomicUsize::new(0),
            all: all.max(1),
        }
    }

    /// So many more steps are done.
    pub fn done(&self, steps: usize) {
        let done = self.done.fetch_add(steps, Ordering::Relaxed) + steps;
        #[allow(clippy::cast_precision_loss)] // a progress bar
        (self.tell)(done.min(self.all) as f32 / self.all as f32);
    }
}
