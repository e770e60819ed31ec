//! Pages of lists: how long they are, and where they begin.

use crate::service::http::Problem;
use crate::store::Hash;

/// Longest page of a list.
const LONGEST_PAGE: u32 = 200;

/// How many a page has, 50 unless given.
///
/// # Errors
///
/// [`Problem`] that names the parameter.
pub fn limit(asked: Option<u32>) -> Result<u32, Problem> {
    let limit = asked.unwrap_or(50);
    if (1..=LONGEST_PAGE).contains(&limit) {
        return Ok(limit);
    }
    let accepted = format!("1 to {LONGEST_PAGE}");
    Err(Problem::parameter("limit", format!("limit is {limit}.")).accepting(accepted))
}

/// Where a page begins that is asked for by `next` of the page before.
///
/// # Errors
///
/// [`Problem`] for a cursor that was not made here.
pub fn begin(cursor: Option<&str>) -> Result<Option<i64>, Problem> {
    let Some(text) = cursor else {
        return Ok(None);
    };
    // One that was made here reads the same when it is made again.
    let begin = (text.get(..16))
        .and_then(|digits| i64::from_str_radix(digits, 16).ok())
        .filter(|&begin| self::cursor(begin) == text);
    begin.map(Some).ok_or_else(|| {
        Problem::parameter("cursor", "The cursor was not made here.")
            .accepting("`next` of the page before")
    })
}

/// The cursor of a page: its beginning and a check, which say nothing to those who hold it.
#[must_use]
pub fn cursor(begin: i64) -> String {
    let check = Hash::of(format!("cursor {begin}").as_bytes()).to_string();
    format!("{begin:016x}{}", &check[..8])
}
