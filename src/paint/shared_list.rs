//! A list that its clones share until one of them is changed.
//!
//! Probabilities of clusters are the same in every realisation of a blend; half a megabyte that is copied with each would
//! cost as much as mixing the boxes. Reading is reading a [`Vec`]; the first change after a clone copies.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// A list that is cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedList<T>(Arc<Vec<T>>);

impl<T> From<Vec<T>> for SharedList<T> {
    fn from(list: Vec<T>) -> Self {
        Self(Arc::new(list))
    }
}

impl<T> FromIterator<T> for SharedList<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Self {
        items.into_iter().collect::<Vec<T>>().into()
    }
}

impl<T> Default for SharedList<T> {
    fn default() -> Self {
        Vec::new().into()
    }
}

impl<T> Deref for SharedList<T> {
    type Target = Vec<T>;

    fn deref(&self) -> &Vec<T> {
        &self.0
    }
}

impl<T: Clone> DerefMut for SharedList<T> {
    fn deref_mut(&mut self) -> &mut Vec<T> {
        Arc::make_mut(&mut self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clones_share_until_one_is_changed() {
        let list: SharedList<u32> = vec![1, 2].into();
        let mut other = list.clone();
        assert!(std::ptr::eq(list.as_ptr(), other.as_ptr()));
        other.push(3);
        assert_eq!(
            (list.as_slice(), other.as_slice()),
            (&[1, 2][..], &[1, 2, 3][..])
        );
    }
}
