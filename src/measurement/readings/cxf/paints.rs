//! Which objects of a document are one paint, and which paint is read.
//!
//! Objects of one type and name are one paint where no angle is read by two of them; where one is, each is a paint of its
//! own. So are objects without a name, of an angle each. Objects of an angle each whose names end with it, `Silver 15`,
//! `Silver_45as45`, are one paint of the name before it.

use std::collections::BTreeMap;

use super::document::Element;
use super::error::CxfError;
use super::specification::Angles;
use super::value::{Unusable, Value};
use crate::measurement::readings::{counted, told};

/// Paints that an error names.
const NAMED: usize = 8;
/// How far the angle of a name may be from the one that was read, degrees: names have nominal ones.
const NOMINAL_DEG: f64 = 0.5;

/// An object, and what was read of it.
pub(super) struct Read<'a> {
    pub object: &'a Element,
    pub values: Vec<Value>,
    pub unusable: Unusable,
}

/// Objects that are one paint.
pub(super) struct Paint<'a> {
    pub name: &'a str,
    pub parts: Vec<Read<'a>>,
}

impl<'a> Read<'a> {
    fn attribute(&self, key: &str) -> &'a str {
        self.object.attribute(key).unwrap_or_default()
    }

    fn is(&self, wanted: &str) -> bool {
        [self.attribute("Id"), self.attribute("Name")].contains(&wanted)
    }

    /// Angles of its values, each once.
    fn angles(&self) -> Vec<[f64; 2]> {
        let angles = self.values.iter().map(|value| pair(value.angles));
        once(angles.collect()).0
    }

    /// Why it holds no readings.
    fn reason(&self) -> String {
        let none =
            "it has none of ColorCIELab, ColorCIELCh, ColorCIEXYZ and spectra, which are accepted";
        let reason = self.unusable.reason.clone();
        reason.unwrap_or_else(|| none.to_owned())
    }
}

impl<'a> Paint<'a> {
    pub fn values(&self) -> impl Iterator<Item = &Value> {
        self.parts.iter().flat_map(|part| &part.values)
    }

    /// Whether one of its objects has this Id, which is not empty.
    pub fn has_id(&self, id: &str) -> bool {
        !id.is_empty() && self.parts.iter().any(|part| part.attribute("Id") == id)
    }

    /// How it is called in a message.
    pub fn called(&self) -> String {
        match &self.parts[..] {
            [only] => called(only.object),
            parts => format!("{:?} ({} objects)", told(self.name), parts.len()),
        }
    }

    pub fn warn_of_unusable(&self, warnings: &mut Vec<String>) {
        let count = self.parts.iter().map(|part| part.unusable.count).sum();
        let unusable = self.parts.iter().find(|part| part.unusable.count > 0);
        if let Some(first) = unusable {
            warnings.push(format!(
                "{count} {} not read, {} {}: {}",
                counted(
                    count,
                    "value is no reading and was",
                    "values are no readings and were"
                ),
                counted(count, "that of", "the first of"),
                called(first.object),
                first.reason()
            ));
        }
    }

    fn of(part: Read<'a>) -> Self {
        Self {
            name: part.attribute("Name"),
            parts: vec![part],
        }
    }

    /// Type and name, of which objects are one paint.
    fn key(&self) -> Option<Key<'a>> {
        let first = self.parts.first()?;
        Some((first.attribute("ObjectType"), self.name))
    }

    /// Type, and the name before the angle that it ends with, of an object with that angle alone.
    fn stem(&self) -> Option<Key<'a>> {
        let [only] = &self.parts[..] else { return None };
        let [angle] = only.angles()[..] else {
            return None;
        };
        Some((
            only.attribute("ObjectType"),
            before_angle(self.name, angle)?,
        ))
    }
}

/// Type and name.
type Key<'a> = (&'a str, &'a str);

fn pair(angles: Angles) -> [f64; 2] {
    [angles.illumination_deg, angles.aspecular_deg]
}

/// Angles, each once, and whether each was once before.
fn once(mut angles: Vec<[f64; 2]>) -> (Vec<[f64; 2]>, bool) {
    let all = angles.len();
    angles.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    angles.dedup();
    let was_once = angles.len() == all;
    (angles, was_once)
}

/// How an object is called in a message.
pub(super) fn called(object: &Element) -> String {
    let said = |key| told(object.attribute(key).unwrap_or_default());
    format!("{:?} (Id {})", said("Name"), said("Id"))
}

/// The one paint, or the one that is wanted; with a warning where it is of several objects, and of objects left out.
pub(super) fn one_of<'a>(
    read: Vec<Read<'a>>,
    unread: &[Read<'a>],
    wanted: Option<&str>,
    warnings: &mut Vec<String>,
) -> Result<Paint<'a>, CxfError> {
    let wanted = wanted.map(str::trim).filter(|wanted| !wanted.is_empty());
    let (paint, is_only) = chosen(read, unread, wanted)?;
    if paint.parts.len() > 1 {
        warnings.push(format!(
            "{} objects were joined as one paint, {:?}: each was read at angles of its own",
            paint.parts.len(),
            told(paint.name)
        ));
    }
    let left_out = || unread.iter().filter(|object| object.unusable.count > 0);
    if let Some(first) = left_out().next().filter(|_| is_only) {
        let count = left_out().count();
        warnings.push(format!(
            "{count} {} left out, {} {}: {}",
            counted(
                count,
                "object holds no readings and was",
                "objects hold no readings and were"
            ),
            counted(count, "which is", "the first"),
            called(first.object),
            first.reason()
        ));
    }
    Ok(paint)
}

/// The one paint, or the one that is wanted, and whether there is no other.
fn chosen<'a>(
    read: Vec<Read<'a>>,
    unread: &[Read<'a>],
    wanted: Option<&str>,
) -> Result<(Paint<'a>, bool), CxfError> {
    if read.is_empty() {
        let first = unread.first().ok_or(CxfError::NoObject)?;
        let told = unread.iter().find(|of| of.unusable.count > 0);
        let object = told.unwrap_or(first);
        return Err(CxfError::NoReading {
            object: called(object.object),
            reason: object.reason(),
        });
    }
    let mut paints: Vec<Paint> = read.into_iter().map(Paint::of).collect();
    if let Some(wanted) = wanted {
        let has_id = |paint: &Paint| paint.has_id(wanted);
        if paints.iter().any(has_id) {
            return the_only(paints, has_id, wanted);
        }
        let is_called = |paint: &Paint| paint.name == wanted;
        paints = joined(paints, Paint::key);
        if !paints.iter().any(is_called) {
            paints = joined(paints, Paint::stem);
        }
        if paints.iter().any(is_called) {
            return the_only(paints, is_called, wanted);
        }
        if let Some(object) = unread.iter().find(|object| object.is(wanted)) {
            return Err(CxfError::Unread {
                object: called(object.object),
                reason: object.reason(),
            });
        }
    } else {
        paints = joined(joined(paints, Paint::key), Paint::stem);
    }
    let (count, names) = (paints.len(), names_of(&paints));
    match (paints.pop(), wanted) {
        (Some(only), _) if paints.is_empty() => Ok((only, true)),
        (_, Some(wanted)) => Err(CxfError::NotFound {
            wanted: told(wanted),
            count,
            names,
        }),
        _ => Err(CxfError::Several { count, names }),
    }
}

/// The one of these paints that is wanted.
fn the_only<'a>(
    mut paints: Vec<Paint<'a>>,
    is_wanted: impl Fn(&Paint) -> bool,
    wanted: &str,
) -> Result<(Paint<'a>, bool), CxfError> {
    let all = paints.len();
    paints.retain(is_wanted);
    let (count, names) = (paints.len(), names_of(&paints));
    match paints.pop() {
        Some(only) if paints.is_empty() => Ok((only, all == 1)),
        _ => Err(CxfError::Ambiguous {
            wanted: told(wanted),
            count,
            names,
        }),
    }
}

fn names_of(paints: &[Paint]) -> String {
    let names: Vec<String> = paints.iter().take(NAMED).map(Paint::called).collect();
    let more = if paints.len() > NAMED { ", …" } else { "" };
    names.join(", ") + more
}

/// Paints of one key as one, where their angles are not each other's.
fn joined<'a>(
    paints: Vec<Paint<'a>>,
    key: impl Fn(&Paint<'a>) -> Option<Key<'a>>,
) -> Vec<Paint<'a>> {
    let mut places: BTreeMap<Key, usize> = BTreeMap::new();
    let mut alike: Vec<(Option<Key>, Vec<Paint>)> = Vec::new();
    for paint in paints {
        let key = key(&paint);
        let new = alike.len();
        let at = key.map_or(new, |key| *places.entry(key).or_insert(new));
        match alike.get_mut(at) {
            Some((_, paints)) => paints.push(paint),
            None => alike.push((key, vec![paint])),
        }
    }
    let mut all = Vec::new();
    for (key, paints) in alike {
        match key {
            Some((_, name)) if paints.len() > 1 && are_one(name, &paints) => {
                let parts = paints.into_iter().flat_map(|paint| paint.parts).collect();
                all.push(Paint { name, parts });
            }
            _ => all.extend(paints),
        }
    }
    all
}

fn are_one(name: &str, paints: &[Paint]) -> bool {
    let parts = || paints.iter().flat_map(|paint| &paint.parts);
    let is_apart = once(parts().flat_map(Read::angles).collect()).1;
    is_apart && (!name.is_empty() || parts().all(|part| part.angles().len() == 1))
}

/// What a name says before the angle that it ends with, if that is the angle: `Silver` of `Silver 15`, `Silver_45as15` and
/// `Silver r45as15°` at 15°.
fn before_angle(name: &str, [light, aspecular]: [f64; 2]) -> Option<&str> {
    let text = name.trim_end_matches(|c: char| c == ')' || c == '°' || c.is_whitespace());
    let text = text.strip_suffix("deg").unwrap_or(text).trim_end();
    let (before, number) = number_at_end(text)?;
    let is = |number: f64, angle: f64| (number - angle).abs() <= NOMINAL_DEG;
    let before = match before.strip_suffix('-') {
        Some(before) if is(-number, aspecular) => before,
        _ if is(number, aspecular) => before.strip_suffix('+').unwrap_or(before),
        _ => return None,
    };
    let before = match before.strip_suffix("as") {
        Some(named) => match number_at_end(named) {
            Some((named, number)) if is(number, light) => {
                let unmarked = named.strip_suffix('r').unwrap_or(named);
                let is_mark = !unmarked.ends_with(char::is_alphanumeric);
                if is_mark { unmarked } else { named }
            }
            Some(_) => return None,
            None if named.ends_with(char::is_alphabetic) => before,
            None => named,
        },
        None => before,
    };
    Some(before.trim_end_matches(|c: char| !c.is_alphanumeric()))
}

/// The decimal number that a text ends with, without its sign, and what is before it.
fn number_at_end(text: &str) -> Option<(&str, f64)> {
    let before = text.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.');
    let number = text.get(before.len()..)?.parse().ok()?;
    Some((before, number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_end_with_the_angle_that_was_read() {
        for (name, aspecular, stem) in [
            ("Silver 15", 15.0, Some("Silver")),
            ("Silver_45as15", 15.0, Some("Silver")),
            ("Silver r45as-15", -15.0, Some("Silver")),
            ("Silver (110°)", 110.0, Some("Silver")),
            ("Silver-15", 15.0, Some("Silver")),
            ("Silver -15", -15.0, Some("Silver")),
            ("Silver as25", 25.0, Some("Silver")),
            ("Brass15", 15.0, Some("Brass")),
            ("Silver 15 deg", 15.0, Some("Silver")),
            ("45as75", 75.0, Some("")),
            ("Silver 15", 45.0, None),
            ("Silver_30as15", 15.0, None),
            ("RAL 9015", 15.0, None),
            ("Silver", 15.0, None),
            ("", 15.0, None),
        ] {
            let found = before_angle(name, [45.0, aspecular]);
            assert_eq!(found, stem, "{name:?} at {aspecular}°");
        }
    }
}
