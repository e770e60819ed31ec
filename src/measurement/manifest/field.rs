//! A field of the manifest: its value as what it should be, or a refusal by its path.

use serde_json::Value;

use super::MANIFEST;
use crate::color::LinearRgb;
use crate::measurement::package::PackageError;
use crate::paint::{AngleGrid, AngleGridError, LEAST_STEP_DEG, Limits, MAX_WEIGHT};

/// Unknown keys of one object that are told one by one.
const UNKNOWN_TOLD: usize = 8;

/// A value of the manifest and the path to it.
pub(super) struct Field<'a> {
    pub(super) path: String,
    pub(super) value: &'a Value,
}

impl<'a> Field<'a> {
    pub(super) fn refuse<T>(&self, accepted: impl Into<String>) -> Result<T, PackageError> {
        let mut value = self.value.to_string();
        if value.len() > 60 {
            value = value.chars().take(57).chain("...".chars()).collect();
        }
        Err(PackageError::Field {
            field: self.path.clone(),
            value,
            accepted: accepted.into(),
        })
    }

    pub(super) fn get(&self, key: &str) -> Option<Field<'a>> {
        let value = self.value.get(key).filter(|v| !v.is_null())?;
        let path = if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        };
        Some(Field { path, value })
    }

    pub(super) fn want(&self, key: &str, accepted: &str) -> Result<Field<'a>, PackageError> {
        let field = if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        };
        let missing = || PackageError::Field {
            field,
            value: "missing".into(),
            accepted: accepted.into(),
        };
        self.get(key).ok_or_else(missing)
    }

    pub(super) fn object(
        &self,
        keys: &[&str],
        warnings: &mut Vec<String>,
    ) -> Result<(), PackageError> {
        let Value::Object(map) = self.value else {
            return self.refuse(format!("an object with {}", keys.join(", ")));
        };
        let place = if self.path.is_empty() {
            String::new()
        } else {
            format!(" in {}", self.path)
        };
        let mut unknown = map.keys().filter(|key| !keys.contains(&key.as_str()));
        for key in unknown.by_ref().take(UNKNOWN_TOLD) {
            let key: String = key.chars().take(80).collect();
            warnings.push(format!(
                "{MANIFEST}: {key:?}{place} is no key of the format and was not read"
            ));
        }
        let more = unknown.count();
        if more > 0 {
            warnings.push(format!(
                "{MANIFEST}: {more} more keys{place} are none of the format and were not read"
            ));
        }
        Ok(())
    }

    pub(super) fn list(&self, most: usize, what: &str) -> Result<Vec<Field<'a>>, PackageError> {
        let Value::Array(items) = self.value else {
            return self.refuse(format!("a list of {what}"));
        };
        if items.len() > most {
            let value = format!("{} entries", items.len());
            return Err(PackageError::Field {
                field: self.path.clone(),
                value,
                accepted: format!("at most {most}"),
            });
        }
        let item = |(k, value)| Field {
            path: format!("{}[{k}]", self.path),
            value,
        };
        Ok(items.iter().enumerate().map(item).collect())
    }

    pub(super) fn text(&self) -> Result<&'a str, PackageError> {
        self.value
            .as_str()
            .map_or_else(|| self.refuse("a string"), Ok)
    }

    pub(super) fn number(&self, low: f64, high: f64, accepted: &str) -> Result<f64, PackageError> {
        match self.value.as_f64() {
            Some(value) if (low..=high).contains(&value) => Ok(value),
            _ => self.refuse(accepted),
        }
    }

    pub(super) fn whole(&self, low: u64, high: u64) -> Result<u64, PackageError> {
        match self.value.as_u64() {
            Some(value) if (low..=high).contains(&value) => Ok(value),
            _ => self.refuse(format!("a whole number from {low} to {high}")),
        }
    }

    /// A number for all channels, or three.
    pub(super) fn channels(&self) -> Result<LinearRgb, PackageError> {
        let accepted = "a number from 0 to 1000, or three of them";
        match self.value {
            Value::Array(items) if items.len() == 3 => {
                let items = self.list(3, "numbers")?;
                let mut rgb = [0.0; 3];
                for (channel, item) in rgb.iter_mut().zip(items) {
                    *channel = item.number(0.0, MAX_WEIGHT, accepted)?;
                }
                Ok(rgb)
            }
            _ => Ok([self.number(0.0, MAX_WEIGHT, accepted)?; 3]),
        }
    }

    pub(super) fn angles(&self, limits: &Limits) -> Result<AngleGrid, PackageError> {
        let mut degrees = Vec::new();
        for item in self.list(limits.angles, "angles in degrees")? {
            degrees.push(item.number(0.0, 90.0, "an angle from 0 to 90 degrees")?);
        }
        AngleGrid::new(degrees).map_err(|error| match error {
            AngleGridError::Order {
                index,
                value,
                before,
            } => PackageError::Field {
                field: format!("{}[{index}]", self.path),
                value: format!("{value} after {before}"),
                accepted: format!("at least {LEAST_STEP_DEG} degrees above the angle before it"),
            },
            AngleGridError::Range { index, value } => PackageError::Field {
                field: format!("{}[{index}]", self.path),
                value: value.to_string(),
                accepted: "an angle from 0 to 90 degrees".into(),
            },
            AngleGridError::Empty => PackageError::Field {
                field: self.path.clone(),
                value: "empty".into(),
                accepted: "at least one angle".into(),
            },
        })
    }

    /// Name of a file of the package.
    pub(super) fn file(&self) -> Result<String, PackageError> {
        let name = self.text()?;
        if name.is_empty() || name.len() > 1000 {
            return self.refuse("the name of a file in the package");
        }
        Ok(name.to_owned())
    }
}
