//! What goes wrong in a use case, told so that the caller can mend it.

use std::fmt::Display;

/// Whose fault it is: decides the exit code and the HTTP status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The request asks for something that is not offered or does not fit together.
    Usage,
    /// A file or an upload is not what it should be.
    Input,
    /// The answer could not be written.
    Output,
    /// A bug, or a machine that fails us.
    Internal,
}

/// A use case that failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct WorkshopError {
    /// Whose fault it is.
    pub fault: Fault,
    /// The field or option that is wrong, where one can be named.
    pub field: Option<String>,
    /// What is wrong, with the value and what would be accepted.
    pub message: String,
}

/// What a message says would be accepted: all of this crate's errors end in it, as "…, accepted is 1 to 4".
#[must_use]
pub fn accepted(message: &str) -> Option<&str> {
    [
        "accepted is ",
        "accepted are ",
        "; there are ",
        "ends in neither ",
        "ends in none of ",
    ]
    .iter()
    .find_map(|words| message.rsplit_once(words))
    .map(|(_, what)| what.split(';').next().unwrap_or(what).trim_end_matches('.'))
    .filter(|what| !what.is_empty())
}

impl WorkshopError {
    /// A request that does not fit together.
    pub fn usage(field: &str, message: impl Display) -> Self {
        Self {
            fault: Fault::Usage,
            field: Some(field.to_owned()),
            message: message.to_string(),
        }
    }

    /// A file that is not what it should be; `name` is what the caller knows it by.
    pub fn input(name: impl Display, problem: impl Display) -> Self {
        Self {
            fault: Fault::Input,
            field: None,
            message: format!("{name}: {problem}"),
        }
    }

    /// An answer that could not be written.
    pub fn output(name: impl Display, problem: impl Display) -> Self {
        Self {
            fault: Fault::Output,
            field: None,
            message: format!("{name}: {problem}"),
        }
    }

    /// A bug.
    pub fn internal(problem: impl Display) -> Self {
        Self {
            fault: Fault::Internal,
            field: None,
            message: problem.to_string(),
        }
    }
}

impl From<crate::blend::WeightError> for WorkshopError {
    fn from(error: crate::blend::WeightError) -> Self {
        use crate::blend::WeightError as W;
        let field = match &error {
            W::Count { field, .. } | W::Value { field, .. } => field,
        };
        Self::usage(field, &error)
    }
}

impl From<crate::paint::NotFinite> for WorkshopError {
    fn from(error: crate::paint::NotFinite) -> Self {
        Self::internal(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_be_accepted_is_found_in_the_message() {
        let cases = [
            ("coat_ior is 5, accepted is 1 to 4", Some("1 to 4")),
            (
                "there is no scene 'cube'; there are sphere, capsule and panel",
                Some("sphere, capsule and panel"),
            ),
            (
                "12 pixels, accepted are up to 9: try less",
                Some("up to 9: try less"),
            ),
            ("the archive is cut", None),
        ];
        for (message, what) in cases {
            assert_eq!(accepted(message), what);
        }
    }
}
