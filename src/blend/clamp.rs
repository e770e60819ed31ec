//! What a realisation had to clamp: nothing is clamped silently.

pub use crate::paint::Clamp;

/// Holds numbers to their bounds and keeps the account.
#[derive(Debug, Default)]
pub(super) struct Ledger {
    entries: Vec<Clamp>,
}

impl Ledger {
    /// Holds one number to a range.
    pub fn hold(&mut self, field: &str, value: f64, low: f64, high: f64) -> f64 {
        let held = value.clamp(low, high);
        let beyond = if held == value {
            0.0
        } else {
            (value - held).abs()
        };
        self.record(
            field,
            &format!("held to {low}..{high}"),
            usize::from(held != value),
            1,
            beyond,
        );
        held
    }

    /// Adds to the account of a field.
    pub fn record(&mut self, field: &str, bound: &str, count: usize, of: usize, worst: f64) {
        if let Some(entry) = self
            .entries
            .iter_mut()
            .find(|e| e.field == field && e.bound == bound)
        {
            entry.count += count;
            entry.of += of;
            entry.worst = entry.worst.max(worst);
        } else {
            self.entries.push(Clamp {
                field: field.to_owned(),
                bound: bound.to_owned(),
                count,
                of,
                worst,
            });
        }
    }

    /// The bounds that bit.
    pub fn close(self) -> Vec<Clamp> {
        self.entries
            .into_iter()
            .filter(|entry| entry.count > 0)
            .collect()
    }
}
