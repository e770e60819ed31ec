//! Numbers on the command line: what is none, or out of range, is refused with what would be accepted.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Reads a whole number of a range.
pub fn whole<T>(range: RangeInclusive<T>) -> impl Fn(&str) -> Result<T, String> + Clone
where
    T: FromStr + PartialOrd + Display + Clone,
{
    move |text| {
        text.parse()
            .ok()
            .filter(|number| range.contains(number))
            .ok_or_else(|| {
                let (start, end) = (range.start(), range.end());
                format!("accepted is a whole number from {start} to {end}")
            })
    }
}

/// Reads a finite number of a range.
pub fn real(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        text.parse()
            .ok()
            .filter(|number| range.contains(number))
            .ok_or_else(|| format!("accepted is {} to {}", range.start(), range.end()))
    }
}

/// Reads a finite number.
pub fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| "accepted is a finite number".to_owned())
}

/// Reads a finite number above 0.
pub fn above_zero(text: &str) -> Result<f64, String> {
    let number = finite(text).ok().filter(|number| *number > 0.0);
    number.ok_or_else(|| "accepted is a number above 0".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_of_the_range_is_refused_with_the_range() {
        let clusters = whole(1..=4096_u32);
        assert_eq!(clusters("4096"), Ok(4096));
        for text in ["0", "4097", "-3", "1.5", "nan", "", "1e99", "99999999999"] {
            assert_eq!(
                clusters(text),
                Err("accepted is a whole number from 1 to 4096".to_owned())
            );
        }
        assert_eq!(real(1.0..=4.0)("1.5"), Ok(1.5));
        for text in ["0.9", "4.1", "nan", "inf", "", "glass"] {
            assert_eq!(real(1.0..=4.0)(text), Err("accepted is 1 to 4".to_owned()));
        }
        assert_eq!(above_zero("1e-9"), Ok(1e-9));
        for text in ["0", "-1", "nan", "inf", "", "soon"] {
            assert!(above_zero(text).is_err(), "{text}");
        }
    }
}
