//! Why a parameter's value is refused, while serde reads it.

use std::fmt::{self, Display};

use serde::de;

use crate::service::http::{Kind, Problem};
use crate::workshop::accepted;

/// What is accepted where nothing says more.
pub const ANY_NUMBER: &str = "a finite number";
pub const ANY_WHOLE: &str = "a whole number in range";

/// What a field of a struct made of the query refuses.
#[derive(Debug)]
pub struct Refusal {
    pub name: Option<String>,
    pub message: String,
    pub accepted: Option<String>,
}

impl Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Refusal {}

impl de::Error for Refusal {
    fn custom<T: Display>(message: T) -> Self {
        let message = message.to_string();
        let accepted = accepted(&message).map(str::to_owned);
        Self {
            name: None,
            message,
            accepted,
        }
    }

    fn missing_field(field: &'static str) -> Self {
        Self {
            name: Some(field.to_owned()),
            message: format!("The parameter {field} is missing."),
            accepted: None,
        }
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        let message = format!("{variant:?} is not offered.");
        Self {
            name: None,
            message,
            accepted: Some(expected.join(", ")),
        }
    }
}

impl Refusal {
    pub fn of(self, name: &str) -> Self {
        Self {
            name: Some(self.name.unwrap_or_else(|| name.to_owned())),
            ..self
        }
    }

    /// With what would be accepted in place of a value of another type.
    pub fn documented(mut self, documented: impl FnOnce(&str) -> Option<String>) -> Self {
        if let (Some(ANY_NUMBER | ANY_WHOLE), Some(name)) = (self.accepted.as_deref(), &self.name) {
            self.accepted = documented(name).or(self.accepted);
        }
        self
    }

    pub fn problem(self) -> Problem {
        let problem = match &self.name {
            Some(name) => Problem::parameter(name, self.message),
            None => Problem::new(Kind::InvalidParameter, self.message),
        };
        match self.accepted {
            Some(accepted) => problem.accepting(accepted),
            None => problem,
        }
    }
}
