//! What a realisation had to clamp: nothing is clamped silently.

pub use crate::paint::Clamp;

/// Holds numbers to their bounds and keeps the account.
#[derive(Debug, Default)]
pub(super) struct Ledger {
    entries: Vec<Entry>,
}

/// A clamp that nobody has read yet. Most bounds do not bite: none is put into words before it is known to.
#[derive(Debug)]
struct Entry {
    field: &'static str,
    bound: Bound,
    count: usize,
    of: usize,
    worst: f64,
}

/// What numbers were held to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bound {
    Range(f64, f64),
    Rule(&'static str),
}

impl Ledger {
    /// Holds one number to a range.
    pub fn hold(&mut self, field: &'static str, value: f64, low: f64, high: f64) -> f64 {
        let held = value.clamp(low, high);
        let beyond = if held == value {
            0.0
        } else {
            (value - held).abs()
        };
        let bound = Bound::Range(low, high);
        self.add(field, bound, usize::from(held != value), 1, beyond);
        held
    }

    /// Adds to the account of a field.
    pub fn record(
        &mut self,
        field: &'static str,
        rule: &'static str,
        count: usize,
        of: usize,
        worst: f64,
    ) {
        self.add(field, Bound::Rule(rule), count, of, worst);
    }

    fn add(&mut self, field: &'static str, bound: Bound, count: usize, of: usize, worst: f64) {
        if let Some(entry) = self
            .entries
            .iter_mut()
            .find(|e| e.field == field && e.bound == bound)
        {
            entry.count += count;
            entry.of += of;
            entry.worst = entry.worst.max(worst);
        } else {
            self.entries.push(Entry {
                field,
                bound,
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
            .map(|entry| Clamp {
                field: entry.field.to_owned(),
                bound: match entry.bound {
                    Bound::Range(low, high) => format!("held to {low}..{high}"),
                    Bound::Rule(rule) => rule.to_owned(),
                },
                count: entry.count,
                of: entry.of,
                worst: entry.worst,
            })
            .collect()
    }
}
