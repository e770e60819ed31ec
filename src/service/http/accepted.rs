//! What a field accepts, in words: as the interface documents it, so that a refusal and the documentation agree.

use std::sync::LazyLock;

use serde_json::Value;
use utoipa::openapi::path::ParameterIn;
use utoipa::{IntoParams, PartialSchema};

use crate::service::resources::docs;

/// What the field at a JSON pointer of a body accepts.
#[must_use]
pub fn in_body<T: PartialSchema>(pointer: &str) -> Option<String> {
    let body = serde_json::to_value(T::schema()).ok()?;
    let mut schema = resolved(&body)?;
    for token in pointer.split('/').skip(1) {
        let field = schema.pointer(&format!("/properties/{token}"));
        schema = resolved(field.or_else(|| schema.get("items"))?)?;
    }
    words(schema)
}

/// What a parameter of a query accepts.
#[must_use]
pub fn in_query<T: IntoParams>(name: &str) -> Option<String> {
    let parameters = T::into_params(|| Some(ParameterIn::Query)).into_iter();
    let schema = parameters
        .filter(|parameter| parameter.name == name)
        .find_map(|parameter| parameter.schema)?;
    let schema = serde_json::to_value(schema).ok()?;
    let schema = resolved(&schema)?;
    // A list in a query is refused number by number.
    words(match schema.get("items") {
        Some(item) => resolved(item)?,
        None => schema,
    })
}

/// Follows references, and passes over what may be nothing instead.
fn resolved(mut schema: &Value) -> Option<&Value> {
    static INTERFACE: LazyLock<Value> =
        LazyLock::new(|| serde_json::from_str(docs::interface()).unwrap_or_default());
    loop {
        if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
            schema = INTERFACE.pointer(reference.strip_prefix('#')?)?;
        } else if let Some(choices) = schema.get("oneOf").and_then(Value::as_array) {
            let mut some = choices.iter().filter(|choice| choice["type"] != "null");
            match (some.next(), some.next()) {
                (Some(only), None) => schema = only,
                _ => return Some(schema),
            }
        } else {
            return Some(schema);
        }
    }
}

fn words(schema: &Value) -> Option<String> {
    let list = |key: &str| schema.get(key).and_then(Value::as_array);
    if let Some(choices) = list("enum") {
        let names: Vec<&str> = choices.iter().filter_map(Value::as_str).collect();
        return Some(names.join(", "));
    }
    let kinds = match schema.get("type")? {
        Value::Array(kinds) => kinds.iter().filter_map(Value::as_str).collect(),
        kind => vec![kind.as_str()?],
    };
    Some(match *kinds.iter().find(|kind| **kind != "null")? {
        "integer" => format!("a whole number{}", range(schema)),
        "number" if range(schema).is_empty() => "a finite number".to_owned(),
        "number" => format!("a number{}", range(schema)),
        "array" => format!("a list{}", lengths(schema)),
        "object" => match list("required") {
            Some(fields) => {
                let names: Vec<&str> = fields.iter().filter_map(Value::as_str).collect();
                format!("an object with {}", names.join(", "))
            }
            None => "an object".to_owned(),
        },
        "boolean" => "true or false".to_owned(),
        "string" => "text".to_owned(),
        _ => return None,
    })
}

fn range(schema: &Value) -> String {
    match ["minimum", "maximum", "exclusiveMinimum"].map(|key| schema.get(key)) {
        [Some(least), Some(most), _] => format!(" from {least} to {most}"),
        [Some(least), None, _] => format!(" from {least}"),
        [None, _, Some(below)] => format!(" above {below}"),
        [None, Some(most), None] => format!(" up to {most}"),
        [None, None, None] => String::new(),
    }
}

fn lengths(schema: &Value) -> String {
    match ["minItems", "maxItems"].map(|key| schema.get(key)) {
        [Some(least), Some(most)] if least == most => format!(" of {least}"),
        [Some(least), Some(most)] => format!(" of {least} to {most}"),
        [None, Some(most)] => format!(" of up to {most}"),
        [_, None] => String::new(),
    }
}
