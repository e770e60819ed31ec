//! Addresses: what names a paint, a blend, a job, a request.
//!
//! A paint's id is made of its upload and the options it was ingested with, a blend's of its paints in the order asked
//! for and its options: the same request has the same address for ever. An environment's is that of its bytes. Ids begin with a
//! letter that says of what.

use serde::Serialize;

use crate::store::Hash;
use crate::workshop::companions_hash;

/// Counts up when the same request would give other bytes: addresses and kept results of before are not met again.
pub const MODEL: u32 = 14;

/// Hexadecimal digits after the prefix: 128 bits.
const DIGITS: usize = 32;

/// The id of what these parts make.
#[must_use]
pub fn made_of(prefix: &str, parts: &impl Serialize) -> String {
    let hash = key(prefix, parts).to_string();
    format!("{prefix}{}", &hash[..DIGITS])
}

/// The id of these very bytes, whatever the model makes of them.
#[must_use]
pub fn of_content(prefix: &str, content: Hash) -> String {
    format!("{prefix}{}", &content.to_string()[..DIGITS])
}

/// The hash of what these parts make. Parts serialise in a fixed order, so equal parts have equal hashes.
///
/// # Panics
///
/// When the parts do not serialise, which plain data does.
#[must_use]
pub fn key(what: &str, parts: &impl Serialize) -> Hash {
    let parts = serde_json::to_vec(&(what, MODEL, parts)).expect("plain data serialises");
    Hash::of(&parts)
}

/// The hash of a file that these parts make. Beside the model the program's version and the files that every bundle has
/// are part of it: what an earlier version wrote is not handed out by a later one.
///
/// # Panics
///
/// As [`key`].
#[must_use]
pub fn result(what: &str, parts: &impl Serialize) -> Hash {
    let version = (env!("CARGO_PKG_VERSION"), companions_hash());
    key(what, &(version, parts))
}

/// The name of a request, by what its caller said: the same before and after an upgrade, as an idempotency key is.
///
/// # Panics
///
/// When the parts do not serialise, which plain data does.
#[must_use]
pub fn asked(what: &str, parts: &impl Serialize) -> String {
    let parts = serde_json::to_vec(&(what, parts)).expect("plain data serialises");
    Hash::of(&parts).to_string()
}

/// An id that nobody can guess.
///
/// # Panics
///
/// When the system gives no random numbers.
#[must_use]
pub fn random(prefix: &str) -> String {
    let mut bytes = [0; DIGITS / 2];
    getrandom::fill(&mut bytes).expect("the system gives random numbers");
    let mut id = String::with_capacity(prefix.len() + DIGITS);
    id.push_str(prefix);
    for byte in bytes {
        for digit in [byte >> 4, byte & 15] {
            id.push(char::from_digit(u32::from(digit), 16).unwrap_or('0'));
        }
    }
    id
}

/// Whether a text is an id of this prefix at all, before the catalogue is asked.
#[must_use]
pub fn is(prefix: &str, text: &str) -> bool {
    text.strip_prefix(prefix).is_some_and(|rest| {
        rest.len() == DIGITS
            && rest
                .bytes()
                .all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_the_same_for_the_same_and_other_for_other() {
        let id = made_of("p_", &("upload", 1));
        assert!(is("p_", &id) && !is("b_", &id), "{id}");
        assert_eq!(id, made_of("p_", &("upload", 1)));
        assert_ne!(id, made_of("p_", &("upload", 2)));
        assert_ne!(random("j_"), random("j_"));
        assert!(is("j_", &random("j_")));
        assert!(!is("p_", "p_nope") && !is("p_", "../etc/passwd"));
    }
}
