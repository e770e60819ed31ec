//! What goes wrong in a use case, told so that the caller can mend it.

use std::fmt::Display;

use crate::fit::FlakeFitError;
use crate::measurement::{MANIFEST, PackageError};

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

/// Where in what was handed in something is wrong.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inside {
    /// File in a package.
    pub file: Option<String>,
    /// Field of that file as a JSON pointer.
    pub pointer: Option<String>,
}

/// Why something that was handed in becomes no paint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    message: String,
    inside: Inside,
}

impl Refusal {
    /// A file of a package is not what it should be; the message names it.
    pub(super) fn in_file(file: &str, message: String) -> Self {
        let inside = Inside {
            file: Some(file.to_owned()),
            pointer: None,
        };
        Self { message, inside }
    }

    /// A part of a package's manifest is not what it should be.
    pub(super) fn in_manifest(field: &str, problem: impl Display) -> Self {
        let inside = Inside {
            file: Some(MANIFEST.to_owned()),
            pointer: Some(format!("/{field}")),
        };
        let message = format!("{MANIFEST}: {field}: {problem}");
        Self { message, inside }
    }
}

impl From<String> for Refusal {
    fn from(message: String) -> Self {
        let inside = Inside::default();
        Self { message, inside }
    }
}

impl From<PackageError> for Refusal {
    fn from(error: PackageError) -> Self {
        Self {
            message: error.to_string(),
            inside: Inside {
                file: error.file().map(str::to_owned),
                pointer: error.pointer(),
            },
        }
    }
}

impl From<FlakeFitError> for Refusal {
    fn from(error: FlakeFitError) -> Self {
        match error {
            FlakeFitError::Picture(error) => error.into(),
            FlakeFitError::NoTexel { ref slice, .. } => Self::in_file(slice, error.to_string()),
            _ => error.to_string().into(),
        }
    }
}

/// A use case that failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct WorkshopError {
    /// Whose fault it is.
    pub fault: Fault,
    /// The field or option that is wrong, where one can be named.
    pub field: Option<String>,
    /// Where in what was handed in, where that can be said.
    pub inside: Inside,
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
    /// The same without the name of the file that an upload is kept in, which its owner does not know.
    #[must_use]
    pub fn without(self, file: &str) -> Self {
        Self {
            message: self.message.replace(file, "the upload"),
            ..self
        }
    }

    /// A request that does not fit together.
    pub fn usage(field: &str, message: impl Display) -> Self {
        Self {
            fault: Fault::Usage,
            field: Some(field.to_owned()),
            inside: Inside::default(),
            message: message.to_string(),
        }
    }

    /// A file that is not what it should be; `name` is what the caller knows it by.
    pub fn input(name: impl Display, problem: impl Display) -> Self {
        Self {
            fault: Fault::Input,
            field: None,
            inside: Inside::default(),
            message: format!("{name}: {problem}"),
        }
    }

    /// A measurement that becomes no paint; `name` is what the caller knows it by.
    pub(super) fn refused(name: impl Display, refusal: Refusal) -> Self {
        Self {
            inside: refusal.inside,
            ..Self::input(name, refusal.message)
        }
    }

    /// An answer that could not be written.
    pub fn output(name: impl Display, problem: impl Display) -> Self {
        Self {
            fault: Fault::Output,
            field: None,
            inside: Inside::default(),
            message: format!("{name}: {problem}"),
        }
    }

    /// A bug.
    pub fn internal(problem: impl Display) -> Self {
        Self {
            fault: Fault::Internal,
            field: None,
            inside: Inside::default(),
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

impl From<crate::export::ExportError> for WorkshopError {
    fn from(error: crate::export::ExportError) -> Self {
        match error {
            crate::export::ExportError::TooMany { .. } => Self::usage("paint", error),
            error => Self::internal(error),
        }
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
