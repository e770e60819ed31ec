//! Numbers that are none, in what is about to be written.
//!
//! JSON has no NaN and would hold `null` in its place, which no reader takes for a number; lists would hold it as it is.
//! So it is looked for before a file is made, and named by its path.

use std::fmt::{Display, Write};

use serde::ser::{self, Serialize, Serializer};

use super::largest_magnitude;

/// A number that no file is written with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{field} is {value} and cannot be written, accepted is a finite number")]
pub struct NotFinite {
    /// Path of the field.
    pub field: String,
    /// The offending value.
    pub value: f64,
}

/// Refuses a value with a number that is none in it.
pub(super) fn check(value: &impl Serialize) -> Result<(), NotFinite> {
    match value.serialize(&mut Search::default()) {
        Err(Stop::Found(found)) => Err(found),
        // What does not serialise is told by who writes it.
        Ok(()) | Err(Stop::Other) => Ok(()),
    }
}

/// Refuses a list with a number that is none in it.
pub(crate) fn check_list(field: &str, numbers: &[f64]) -> Result<(), NotFinite> {
    let place = numbers.iter().position(|v| !v.is_finite());
    place.map_or(Ok(()), |k| {
        let (field, value) = (format!("{field}[{k}]"), numbers[k]);
        Err(NotFinite { field, value })
    })
}

/// Refuses corners of which one is none.
pub(crate) fn check_corners(field: &str, corners: &[[f32; 3]]) -> Result<(), NotFinite> {
    let numbers = corners.as_flattened();
    if largest_magnitude(numbers).is_finite() {
        return Ok(());
    }
    let place = numbers.iter().position(|v| !v.is_finite());
    place.map_or(Ok(()), |k| {
        let field = format!("{field}[{}][{}]", k / 3, k % 3);
        let value = f64::from(numbers[k]);
        Err(NotFinite { field, value })
    })
}

/// Goes through a value the way a writer would, and keeps the path it stands at.
#[derive(Default)]
struct Search {
    path: String,
}

/// Fields, elements or entries of one value.
struct Parts<'a> {
    search: &'a mut Search,
    next: usize,
}

#[derive(Debug)]
enum Stop {
    Found(NotFinite),
    Other,
}

impl Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Found(found) => found.fmt(f),
            Self::Other => f.write_str("no value"),
        }
    }
}

impl std::error::Error for Stop {}

impl ser::Error for Stop {
    fn custom<T: Display>(_: T) -> Self {
        Self::Other
    }
}

impl Parts<'_> {
    fn part(&mut self, step: &str, value: &(impl Serialize + ?Sized)) -> Result<(), Stop> {
        let length = self.search.path.len();
        self.search.path.push_str(step);
        value.serialize(&mut *self.search)?;
        self.search.path.truncate(length);
        Ok(())
    }

    fn element(&mut self, value: &(impl Serialize + ?Sized)) -> Result<(), Stop> {
        let mut step = String::new();
        write!(step, "[{}]", self.next).map_err(|_| Stop::Other)?;
        self.next += 1;
        self.part(&step, value)
    }

    fn field(&mut self, name: &str, value: &(impl Serialize + ?Sized)) -> Result<(), Stop> {
        if self.search.path.is_empty() {
            return self.part(name, value);
        }
        self.part(&format!(".{name}"), value)
    }
}

macro_rules! never_in_question {
    ($($method:ident($type:ty)),*) => {
        $(fn $method(self, _: $type) -> Result<(), Stop> {
            Ok(())
        })*
    };
}

impl<'a> Serializer for &'a mut Search {
    type Ok = ();
    type Error = Stop;
    type SerializeSeq = Parts<'a>;
    type SerializeTuple = Parts<'a>;
    type SerializeTupleStruct = Parts<'a>;
    type SerializeTupleVariant = Parts<'a>;
    type SerializeMap = Parts<'a>;
    type SerializeStruct = Parts<'a>;
    type SerializeStructVariant = Parts<'a>;

    never_in_question!(
        serialize_bool(bool),
        serialize_i8(i8),
        serialize_i16(i16),
        serialize_i32(i32),
        serialize_i64(i64),
        serialize_u8(u8),
        serialize_u16(u16),
        serialize_u32(u32),
        serialize_u64(u64),
        serialize_char(char),
        serialize_str(&str),
        serialize_bytes(&[u8]),
        serialize_unit_struct(&'static str)
    );

    fn serialize_f32(self, value: f32) -> Result<(), Stop> {
        self.serialize_f64(f64::from(value))
    }

    fn serialize_f64(self, value: f64) -> Result<(), Stop> {
        if value.is_finite() {
            return Ok(());
        }
        let field = std::mem::take(&mut self.path);
        Err(Stop::Found(NotFinite { field, value }))
    }

    fn serialize_none(self) -> Result<(), Stop> {
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), Stop> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<(), Stop> {
        Ok(())
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, _: &'static str) -> Result<(), Stop> {
        Ok(())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), Stop> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        value: &T,
    ) -> Result<(), Stop> {
        value.serialize(self)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Parts<'a>, Stop> {
        let search = self;
        Ok(Parts { search, next: 0 })
    }

    fn serialize_tuple(self, _: usize) -> Result<Parts<'a>, Stop> {
        self.serialize_seq(None)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Parts<'a>, Stop> {
        self.serialize_seq(None)
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Parts<'a>, Stop> {
        self.serialize_seq(None)
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Parts<'a>, Stop> {
        self.serialize_seq(None)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Parts<'a>, Stop> {
        self.serialize_seq(None)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Parts<'a>, Stop> {
        self.serialize_seq(None)
    }
}

macro_rules! elements {
    ($($part:ident::$method:ident),*) => {
        $(impl ser::$part for Parts<'_> {
            type Ok = ();
            type Error = Stop;
            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Stop> {
                self.element(value)
            }
            fn end(self) -> Result<(), Stop> {
                Ok(())
            }
        })*
    };
}

elements!(
    SerializeSeq::serialize_element,
    SerializeTuple::serialize_element,
    SerializeTupleStruct::serialize_field,
    SerializeTupleVariant::serialize_field
);

macro_rules! fields {
    ($($part:ident),*) => {
        $(impl ser::$part for Parts<'_> {
            type Ok = ();
            type Error = Stop;
            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                name: &'static str,
                value: &T,
            ) -> Result<(), Stop> {
                self.field(name, value)
            }
            fn end(self) -> Result<(), Stop> {
                Ok(())
            }
        })*
    };
}

fields!(SerializeStruct, SerializeStructVariant);

impl ser::SerializeMap for Parts<'_> {
    type Ok = ();
    type Error = Stop;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, _: &T) -> Result<(), Stop> {
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Stop> {
        self.element(value)
    }

    fn end(self) -> Result<(), Stop> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[derive(serde::Serialize)]
    enum Solver {
        Exact,
        Within { epsilon: f64 },
        Of(f32, f64),
    }

    #[derive(serde::Serialize)]
    struct Everything {
        name: String,
        count: Option<u32>,
        some: Option<f64>,
        rows: Vec<[f64; 2]>,
        solvers: Vec<Solver>,
        notes: BTreeMap<String, f64>,
    }

    type Change = fn(&mut Everything);

    fn everything() -> Everything {
        Everything {
            name: "NaN".into(),
            count: None,
            some: Some(1.0),
            rows: vec![[1.0, f64::MAX], [-0.0, 3.0]],
            solvers: vec![
                Solver::Exact,
                Solver::Within { epsilon: 0.1 },
                Solver::Of(1.0, 2.0),
            ],
            notes: BTreeMap::from([("a".into(), 1.0), ("b".into(), 2.0)]),
        }
    }

    #[test]
    fn numbers_that_are_none_are_found_wherever_they_stand() {
        assert_eq!(check(&everything()), Ok(()));
        let cases: [(&str, Change); 5] = [
            ("some", |e| e.some = Some(f64::NAN)),
            ("rows[1][0]", |e| e.rows[1][0] = f64::INFINITY),
            ("solvers[1].epsilon", |e| {
                e.solvers[1] = Solver::Within { epsilon: f64::NAN };
            }),
            ("solvers[2][0]", |e| {
                e.solvers[2] = Solver::Of(f32::NAN, 0.0);
            }),
            ("notes[1]", |e| {
                e.notes.insert("b".into(), f64::NEG_INFINITY);
            }),
        ];
        for (field, change) in cases {
            let mut spoiled = everything();
            change(&mut spoiled);
            let found = check(&spoiled).expect_err(field);
            assert_eq!(found.field, field);
            assert!(!found.value.is_finite());
        }
    }

    #[test]
    fn lists_and_corners_name_the_place() {
        assert_eq!(check_list("p", &[0.0, f64::MAX]), Ok(()));
        let found = check_list("p", &[0.0, f64::INFINITY]).expect_err("refused");
        assert_eq!(
            found.to_string(),
            "p[1] is inf and cannot be written, accepted is a finite number"
        );
        assert_eq!(check_corners("lower", &[[f32::MAX; 3]; 40]), Ok(()));
        let mut corners = [[0.0_f32; 3]; 40];
        corners[39][2] = f32::NAN;
        let found = check_corners("lower", &corners).expect_err("refused");
        assert!(found.field == "lower[39][2]" && found.value.is_nan());
    }
}
