//! Knobs as they are written: text, an object, or the name of a preset.

use std::fmt;
use std::str::FromStr;

use serde::de::{self, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use super::{Knobs, ProfileError};
use crate::accuracy::profile::PRESETS;

/// Up to here every whole number is one of f64.
const MOST_WHOLE: f64 = 9_007_199_254_740_992.0;

impl Knobs {
    /// These knobs, and where they say nothing the others.
    ///
    /// # Errors
    ///
    /// [`ProfileError::Knob`] never: both are knobs already.
    pub fn over(&self, other: &Self) -> Result<Self, ProfileError> {
        let object = |knobs: &Self| match serde_json::to_value(knobs) {
            Ok(Value::Object(map)) => map,
            _ => Map::new(),
        };
        let mut all = object(other);
        all.extend(object(self));
        Self::of_object(all)
    }

    /// The first knob that both turn, and to different values: its name, this value and the other's.
    #[must_use]
    pub fn contradicted_by(&self, other: &Self) -> Option<(String, Value, Value)> {
        let (Ok(Value::Object(own)), Ok(Value::Object(other))) =
            (serde_json::to_value(self), serde_json::to_value(other))
        else {
            return None;
        };
        own.into_iter().find_map(|(knob, value)| {
            let beside = other.get(&knob)?.clone();
            (value != beside).then_some((knob, value, beside))
        })
    }

    fn of_object(object: Map<String, Value>) -> Result<Self, ProfileError> {
        serde_json::from_value(Value::Object(object)).map_err(|e| ProfileError::Knob(e.to_string()))
    }

    /// Reads a preset's name, knobs as text, or knobs as an object.
    ///
    /// # Errors
    ///
    /// What the deserializer refuses, naming the knob and what would be accepted.
    pub fn of_name_or_object<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrObject;
        impl<'de> Visitor<'de> for NameOrObject {
            type Value = Knobs;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a profile or an object of knobs")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Knobs, E> {
                text.parse().map_err(E::custom)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Knobs, A::Error> {
                Knobs::deserialize(MapAccessDeserializer::new(map))
            }
        }
        deserializer.deserialize_any(NameOrObject)
    }
}

/// Whether there is a knob of this name; nothing is a value that any knob takes.
fn is_knob(name: &str) -> bool {
    let nothing = Map::from_iter([(name.to_owned(), Value::Null)]);
    Knobs::of_object(nothing).is_ok()
}

impl FromStr for Knobs {
    type Err = ProfileError;

    /// A preset, knobs, or both, separated by commas.
    fn from_str(text: &str) -> Result<Self, ProfileError> {
        let mut object = Map::new();
        for part in text.split(',').map(str::trim) {
            let (name, value) = match part.split_once('=') {
                Some((name, value)) => (name.trim(), value.trim()),
                None if PRESETS.contains(&part) => ("preset", part),
                None if is_knob(part) => {
                    let accepted = super::accepted(part);
                    return Err(ProfileError::Knob(format!(
                        "{part} has no value, accepted is {part}= and {accepted}"
                    )));
                }
                None => return Err(ProfileError::Name(part.to_owned())),
            };
            let read = match value.parse::<f64>() {
                Ok(number) if number.fract() == 0.0 && number.abs() <= MOST_WHOLE => {
                    Value::from(number as i64)
                }
                // JSON has no other numbers, and would take them for nothing.
                Ok(number) if number.is_finite() => Value::from(number),
                _ => Value::from(value),
            };
            if let Some(before) = object.insert(name.to_owned(), read.clone()) {
                return Err(ProfileError::Knob(format!(
                    "{name} is set twice, to {before} and to {read}, accepted is one of the two"
                )));
            }
        }
        Self::of_object(object)
    }
}
