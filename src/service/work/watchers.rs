//! Who still waits for a result: work that nobody waits for any more is called off.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::store::Hash;

/// How many wait for each result.
#[derive(Clone, Debug, Default)]
pub struct Watchers(Arc<Mutex<HashMap<Hash, usize>>>);

/// One who waits, until dropped.
#[derive(Debug)]
pub struct Watching {
    watchers: Watchers,
    key: Hash,
}

impl Watchers {
    fn all(&self) -> MutexGuard<'_, HashMap<Hash, usize>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a result.
    #[must_use]
    pub fn watch(&self, key: Hash) -> Watching {
        *self.all().entry(key).or_default() += 1;
        Watching {
            watchers: self.clone(),
            key,
        }
    }

    /// Whether anybody waits for a result.
    #[must_use]
    pub fn any(&self, key: Hash) -> bool {
        self.all().contains_key(&key)
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        let mut all = self.watchers.all();
        if let Some(count) = all.get_mut(&self.key) {
            *count -= 1;
            if *count == 0 {
                all.remove(&self.key);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_is_waited_for_until_the_last_leaves() {
        let (watchers, key) = (Watchers::default(), Hash::of(b"a picture"));
        let (first, second) = (watchers.watch(key), watchers.watch(key));
        drop(first);
        assert!(watchers.any(key) && !watchers.any(Hash::of(b"another")));
        drop(second);
        assert!(!watchers.any(key));
    }
}
