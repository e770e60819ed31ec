//! Pages of lists: how long they are, and where they begin.

use crate::service::http::Problem;

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
    let begin = cursor.map(|cursor| i64::from_str_radix(cursor, 36));
    begin.transpose().map_err(|_| {
        Problem::parameter("cursor", "The cursor was not made here.")
            .accepting("`next` of the page before")
    })
}

/// The cursor of a page: it says nothing to who holds it.
#[must_use]
pub fn cursor(mut begin: i64) -> String {
    let mut digits = Vec::new();
    while begin > 0 {
        digits.push(char::from_digit(u32::try_from(begin % 36).unwrap_or(0), 36).unwrap_or('0'));
        begin /= 36;
    }
    digits.iter().rev().collect()
}
