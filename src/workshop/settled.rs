//! Knobs that a finished paint or blend cannot be turned by any more.

use serde_json::{Map, Value};

use super::{Thing, WorkshopError};
use crate::accuracy::{Knobs, Profile};
use crate::blend::Blend;
use crate::paint::{Clustering, PaintFile};

/// A knob by which a thing was made, and by which it is asked for otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settled {
    /// Its name.
    pub knob: String,
    /// How the thing was made.
    pub made: String,
    /// What was asked for.
    pub asked: String,
}

/// The first knob, of those turned by name, by which a thing was made otherwise: boxes and angles of a paint, and the
/// correspondence of a blend. `None` too where it is not known how the thing was made, as of a realised paint.
///
/// # Examples
///
/// ```
/// # use carpaint::workshop::{IngestOptions, open, settled};
/// let thing = open("sample:white", &IngestOptions::default(), &|_| ())?;
/// // A solid color has neither boxes nor angles.
/// assert_eq!(settled(&thing, &"box_rule=tight".parse()?), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn settled(thing: &Thing, asked: &Knobs) -> Option<Settled> {
    let made = by_name(&match thing {
        Thing::Paint(paint) => of_paint(paint),
        Thing::Blend(blend) => of_blend(blend),
    });
    by_name(asked).into_iter().find_map(|(knob, asked)| {
        let made = made.get(&knob).filter(|made| **made != asked)?;
        Some(Settled {
            made: text(made),
            asked: text(&asked),
            knob,
        })
    })
}

/// Refuses to make something of a thing by a knob that is settled.
pub(super) fn refuse_settled(
    name: &str,
    thing: &Thing,
    asked: &Knobs,
) -> Result<(), WorkshopError> {
    let Some(settled) = settled(thing, asked) else {
        return Ok(());
    };
    let Settled { knob, made, asked } = settled;
    let again = match thing {
        Thing::Paint(_) => "ingest its measurement",
        Thing::Blend(_) => "blend its paints",
    };
    let problem = format!(
        "{name} was made with {knob}={made}, {asked} was asked for: {again} again with --knob {knob}={asked}, or leave it \
         out"
    );
    Err(WorkshopError::usage(&knob, problem))
}

fn of_paint(paint: &PaintFile) -> Knobs {
    if paint.provenance.is_blend() {
        return Knobs::default();
    }
    of_clusterings([paint.clustering.as_ref()].into_iter())
}

fn of_blend(blend: &Blend) -> Knobs {
    let of = Knobs::of(&Profile {
        blend: *blend.settings(),
        ..Profile::standard()
    });
    Knobs {
        transport: of.transport,
        epsilon: of.epsilon,
        cost: of.cost,
        // Two paints have one order only.
        order: of.order.filter(|_| blend.len() > 2),
        ..of_clusterings(blend.clusterings())
    }
}

/// What all have in common.
fn of_clusterings<'a>(all: impl Iterator<Item = Option<&'a Clustering>> + Clone) -> Knobs {
    fn common<T: PartialEq>(mut values: impl Iterator<Item = Option<T>>) -> Option<T> {
        let first = values.next()??;
        values
            .all(|value| value.as_ref() == Some(&first))
            .then_some(first)
    }
    let box_rule = common(all.clone().map(|own| own.map(|c| c.box_rule.clone())));
    let angle_step = common(all.map(|own| own.map(|c| c.angle_step)));
    Knobs {
        box_rule: box_rule.and_then(|rule| serde_json::from_value(Value::String(rule)).ok()),
        angle_step: angle_step.and_then(|step| u32::try_from(step).ok()),
        ..Knobs::default()
    }
}

fn by_name(knobs: &Knobs) -> Map<String, Value> {
    match serde_json::to_value(knobs) {
        Ok(Value::Object(knobs)) => knobs,
        _ => Map::new(),
    }
}

fn text(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}
