//! Queries: strict reading of `?a=1&b=2` into the fields of a struct.
//!
//! Unknown and repeated parameters are refused, so that a typing error is not an answer to another question. Numbers are
//! finite, lists are separated by commas.

mod refusal;
mod text;

use std::cell::Cell;

use serde::de::value::MapAccessDeserializer;
use serde::de::{self, DeserializeOwned, DeserializeSeed, IntoDeserializer, MapAccess, Visitor};
use serde::forward_to_deserialize_any;

use self::refusal::Refusal;
use self::text::Text;
use super::kind::Kind;
use super::problem::Problem;

/// A parameter as it stands in the address, decoded.
pub type Pair = (String, String);

/// Splits and decodes a query. Repeated parameters are refused.
pub fn pairs(query: &str) -> Result<Vec<Pair>, Problem> {
    let mut pairs: Vec<Pair> = Vec::new();
    for part in query.split('&').filter(|part| !part.is_empty()) {
        let (name, value) = part.split_once('=').unwrap_or((part, ""));
        let (name, value) = (decode(name)?, decode(value)?);
        if pairs.iter().any(|(other, _)| *other == name) {
            return Err(Problem::parameter(
                &name,
                format!("The parameter {name} stands twice in the query."),
            )
            .accepting("each parameter once"));
        }
        pairs.push((name, value));
    }
    Ok(pairs)
}

fn decode(text: &str) -> Result<String, Problem> {
    let broken = || {
        Problem::new(
            Kind::MalformedRequest,
            format!("{text:?} in the query is not percent-encoded UTF-8."),
        )
    };
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'+' => b' ',
            b'%' => {
                let mut digit = || rest.next().and_then(|digit| char::from(digit).to_digit(16));
                let (high, low) = (digit().ok_or_else(broken)?, digit().ok_or_else(broken)?);
                u8::try_from(high * 16 + low).map_err(|_| broken())?
            }
            byte => byte,
        });
    }
    String::from_utf8(bytes).map_err(|_| broken())
}

/// Refuses parameters whose names are none of these.
pub fn refuse_unknown(pairs: &[Pair], known: &[&str]) -> Result<(), Problem> {
    let Some((name, _)) = pairs
        .iter()
        .find(|(name, _)| !known.contains(&name.as_str()))
    else {
        return Ok(());
    };
    let problem = Problem::parameter(name, format!("There is no parameter {name:?} here."));
    Err(problem.accepting(if known.is_empty() {
        "no parameters".to_owned()
    } else {
        known.join(", ")
    }))
}

/// Reads the parameters that `T` has; others are left to others. What a parameter accepts is asked for by its name.
pub fn read<T: DeserializeOwned>(
    pairs: &[Pair],
    documented: impl FnOnce(&str) -> Option<String>,
) -> Result<T, Problem> {
    let names = names::<T>();
    let own = pairs
        .iter()
        .filter(|(name, _)| names.contains(&name.as_str()));
    T::deserialize(MapAccessDeserializer::new(Own {
        rest: own,
        value: None,
    }))
    .map_err(|refusal| refusal.documented(documented).problem())
}

/// The parameters of one struct. Whatever a value is refused for carries its name.
struct Own<'a, I> {
    rest: I,
    value: Option<Text<'a>>,
}

impl<'de, 'a, I: Iterator<Item = &'a Pair>> MapAccess<'de> for Own<'a, I> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Refusal> {
        let Some((name, text)) = self.rest.next() else {
            return Ok(None);
        };
        self.value = Some(Text { name, text });
        seed.deserialize(name.as_str().into_deserializer())
            .map(Some)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refusal> {
        let Some(value) = self.value.take() else {
            return Err(de::Error::custom("a value before its name"));
        };
        seed.deserialize(value)
            .map_err(|error| error.of(value.name))
    }
}

/// Names of the fields of a struct, as serde knows them.
pub fn names<T: DeserializeOwned>() -> &'static [&'static str] {
    let names = Cell::new(&[][..]);
    // Asks the struct what it would read, and reads nothing.
    let _ = T::deserialize(Asking(&names));
    names.get()
}

struct Asking<'a>(&'a Cell<&'static [&'static str]>);

impl<'de> de::Deserializer<'de> for Asking<'_> {
    type Error = Refusal;

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, Refusal> {
        self.0.set(fields);
        Err(de::Error::custom("only asked"))
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Refusal> {
        Err(de::Error::custom("only asked"))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 u8 u16 u32 u64 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize, PartialEq)]
    #[serde(rename_all = "kebab-case")]
    enum Scene {
        Sphere,
        FlatPanel,
    }

    #[derive(Debug, Deserialize, PartialEq)]
    struct Asked {
        weights: Option<Vec<f64>>,
        scene: Option<Scene>,
        spp: Option<u32>,
        name: Option<String>,
    }

    fn ask(query: &str) -> Result<Asked, serde_json::Value> {
        let read = || {
            let pairs = pairs(query)?;
            refuse_unknown(&pairs, names::<Asked>())?;
            read(&pairs, |name| {
                (name == "spp").then(|| "a whole number from 1 to 64".to_owned())
            })
        };
        read().map_err(|problem| serde_json::to_value(problem.document(None)).expect("serialises"))
    }

    #[test]
    fn a_query_becomes_a_struct() {
        let asked = ask("weights=-2,3e0&scene=flat-panel&name=m%C3%A9tal+blue&spp=16")
            .expect("is accepted");
        let name = Some("métal blue".to_owned());
        assert_eq!(
            asked,
            Asked {
                weights: Some(vec![-2.0, 3.0]),
                scene: Some(Scene::FlatPanel),
                spp: Some(16),
                name
            }
        );
        assert_eq!(ask("").expect("all are optional").weights, None);
    }

    #[test]
    fn what_is_not_accepted_is_named() {
        let cases = [
            ("weights=0.5,nan", "/weights", "a finite number"),
            ("weights=", "/weights", "a finite number"),
            ("scene=cube", "/scene", "sphere, flat-panel"),
            ("spp=-1", "/spp", "a whole number from 1 to 64"),
            ("surprise=1", "/surprise", "weights, scene, spp, name"),
            ("spp=1&spp=2", "/spp", "each parameter once"),
        ];
        for (query, pointer, accepted) in cases {
            let problem = ask(query).expect_err(query);
            assert_eq!(problem["pointer"], pointer, "{query}: {problem}");
            assert_eq!(problem["accepted"], accepted, "{query}: {problem}");
            assert_eq!(problem["in"], "query");
        }
        for query in ["name=%", "name=%4", "name=%zz", "name=%ff"] {
            assert_eq!(ask(query).expect_err(query)["status"], 400);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn any_query_is_read_or_refused(query in "\\PC{0,40}") {
            let _ = ask(&query);
        }

        #[test]
        fn numbers_arrive_as_they_were_sent(w in proptest::collection::vec(-1e12..1e12_f64, 1..6)) {
            let text = w.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
            prop_assert_eq!(ask(&format!("weights={text}")).expect("is accepted").weights, Some(w));
        }
    }
}
