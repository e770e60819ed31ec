//! Readings in `CxF3`, the color exchange format (ISO 17972-1).
//!
//! A reading is a `ColorCIELab`, `ColorCIELCh`, `ColorCIEXYZ`, `ReflectanceSpectrum` or `CustomSpectrum` whose
//! `ColorSpecification` has the geometry `MultiAngle`: one `BRDFAngle` for each specification, or several of which the
//! value names one, its `Name` being their `Notation`. A `SingleAngle` of 45° and 0° is a reading at 45°. Angles out of
//! the plane of incidence, spheres and transmission are none, and are told.
//!
//! A paint is an object with a value for each angle, or the objects of one type and name with an angle each; and where
//! each object of a document has one angle that no other has, all of them. Of a document with several paints one must be
//! asked for. Where an angle has several values, spectra win, then D65, then the 2° observer; all angles of a paint are
//! read in one of them, and under one light.

mod document;
mod specification;
mod value;

use std::collections::BTreeMap;

use self::document::{Element, read_document};
use self::specification::Specification;
use self::value::{Kind, Value, values_of};
use super::{ReadingsFile, as_name, told};
use crate::color::{Illuminant, Observer};
use crate::measurement::MultiAngle;
use crate::measurement::multi_angle::ASPECULAR_COLUMN;
use crate::paint::Limits;

/// Kinds of color that every angle of a paint may be given in.
const KINDS: usize = 16;
/// Paints that an error names.
const NAMED: usize = 8;
/// Characters of a note.
const NOTE_CHARACTERS: usize = 200;

/// Why a document holds no readings of a paint.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CxfError {
    /// No well-formed XML.
    #[error("the document is damaged near byte {position}: {reason}")]
    Xml {
        /// Where, about.
        position: u64,
        /// What is wrong.
        reason: String,
    },
    /// A document type declaration, which could define entities.
    #[error("the document declares a document type, accepted is a document without <!DOCTYPE")]
    DocumentType,
    /// An entity that XML does not know by itself.
    #[error(
        "the document uses the entity &{name};, accepted are lt, gt, amp, apos, quot and characters by number"
    )]
    Entity {
        /// Its name.
        name: String,
    },
    /// Elements too deep inside each other.
    #[error("elements stand more than {accepted} deep inside each other, accepted are {accepted}")]
    Depth {
        /// The limit.
        accepted: usize,
    },
    /// Too many elements.
    #[error("the document has more than {accepted} elements")]
    Elements {
        /// The limit.
        accepted: usize,
    },
    /// Another kind of document.
    #[error(
        "the root is <{found}>, accepted is one CxF of the namespace {}",
        document::NAMESPACE
    )]
    Root {
        /// Name of the root.
        found: String,
    },
    /// No object.
    #[error("the document holds no Object in Resources/ObjectCollection")]
    NoObject,
    /// No object with a reading.
    #[error("no object holds a reading of a multi-angle instrument; {object}: {reason}")]
    NoReading {
        /// The first object.
        object: String,
        /// Why its first value is none.
        reason: String,
    },
    /// More than one paint, and none was asked for.
    #[error(
        "the document holds {count} paints, accepted is one, or the name or Id of one of them: {names}"
    )]
    Several {
        /// How many.
        count: usize,
        /// What the first of them are called.
        names: String,
    },
    /// Too many readings.
    #[error("{object} holds {found} readings, accepted are {accepted}")]
    Rows {
        /// The paint.
        object: String,
        /// How many there are.
        found: usize,
        /// The limit.
        accepted: usize,
    },
}

/// Specifications by their id.
type Specifications<'a> = BTreeMap<&'a str, Specification<'a>>;

/// Objects that are one paint.
struct Group<'a> {
    objects: Vec<&'a Element>,
    values: Vec<Value>,
}

pub(super) fn read_cxf(
    text: &str,
    wanted: Option<&str>,
    limits: &Limits,
) -> Result<ReadingsFile, CxfError> {
    let root = read_document(text)?;
    let none = Element::default();
    let resources = root.child("Resources").unwrap_or(&none);
    let specifications: Specifications = resources
        .child("ColorSpecificationCollection")
        .map_or_else(BTreeMap::new, |of| {
            of.all("ColorSpecification")
                .map(Specification)
                .map(|of| (of.id(), of))
                .collect()
        });
    let collection = resources.child("ObjectCollection").unwrap_or(&none);
    let first = collection.all("Object").next().ok_or(CxfError::NoObject)?;
    let (mut groups, mut unusable): (Vec<Group>, Vec<(&Element, String)>) =
        (Vec::new(), Vec::new());
    let mut places: BTreeMap<[Option<&str>; 2], usize> = BTreeMap::new();
    for object in collection.all("Object") {
        let (values, reasons) = values_of(object, &specifications);
        unusable.extend(reasons.into_iter().map(|reason| (object, reason)));
        if values.is_empty() {
            continue;
        }
        let key = ["ObjectType", "Name"].map(|key| object.attribute(key));
        let at = *places.entry(key).or_insert(groups.len());
        match groups.get_mut(at) {
            Some(group) => {
                group.objects.push(object);
                group.values.extend(values);
            }
            None => groups.push(Group {
                objects: vec![object],
                values,
            }),
        }
    }
    if groups.is_empty() {
        let none = || {
            let reason = "it has no ColorCIELab, ColorCIELCh, ColorCIEXYZ or spectrum";
            (first, reason.to_owned())
        };
        let (object, reason) = unusable.into_iter().next().unwrap_or_else(none);
        return Err(CxfError::NoReading {
            object: called(object),
            reason,
        });
    }
    let group = one_of(groups, wanted, limits)?;
    let mut warnings = Vec::new();
    if let Some((object, reason)) = unusable.first() {
        warnings.push(format!(
            "{} values are no readings and were not read, the first of {}: {reason}",
            unusable.len(),
            called(object)
        ));
    }
    let readings = readings_of(&group, limits, &mut warnings)?;
    let mut notes = notes_of(&root, &group);
    notes.retain(|_, note| !note.trim().is_empty());
    for note in notes.values_mut() {
        *note = note
            .chars()
            .filter(|c| !c.is_control())
            .take(NOTE_CHARACTERS)
            .collect();
    }
    Ok(ReadingsFile {
        name: name_of(&group)
            .or_else(|| as_name(root.at(&["FileInformation"])?.said("Description")?)),
        notes,
        readings,
        warnings,
    })
}

/// The one paint, or the one that is wanted.
fn one_of<'a>(
    mut groups: Vec<Group<'a>>,
    wanted: Option<&str>,
    limits: &Limits,
) -> Result<Group<'a>, CxfError> {
    let mut seen: Vec<f64> = Vec::new();
    let an_angle_each = (2..=limits.angles).contains(&groups.len())
        && groups.iter().all(|group| {
            let mut angles: Vec<f64> = group
                .values
                .iter()
                .map(|v| v.angles.aspecular_deg)
                .collect();
            angles.dedup();
            let new = angles.len() == 1 && !seen.contains(&angles[0]);
            seen.extend(angles);
            new
        });
    if an_angle_each {
        let mut all = groups.into_iter();
        let mut one = all.next().ok_or(CxfError::NoObject)?;
        for group in all {
            one.objects.extend(group.objects);
            one.values.extend(group.values);
        }
        return Ok(one);
    }
    if groups.len() == 1 {
        return groups.pop().ok_or(CxfError::NoObject);
    }
    let count = groups.len();
    let names: Vec<String> = groups
        .iter()
        .filter_map(|group| group.objects.first())
        .take(NAMED)
        .map(|object| called(object))
        .collect();
    let is_wanted = |group: &Group| {
        let keys = group
            .objects
            .iter()
            .flat_map(|of| [of.attribute("Name"), of.attribute("Id")]);
        wanted.is_some() && keys.into_iter().any(|key| key == wanted)
    };
    let mut found = groups.into_iter().filter(is_wanted);
    match (found.next(), found.next()) {
        (Some(group), None) => Ok(group),
        _ => Err(CxfError::Several {
            count,
            names: names.join(", ") + if count > NAMED { ", …" } else { "" },
        }),
    }
}

/// How an object is called in a message.
fn called(object: &Element) -> String {
    let said = |key| told(object.attribute(key).unwrap_or_default());
    format!("{:?} (Id {})", said("Name"), said("Id"))
}

/// Readings of a paint in the kind that most of its angles are given in, under the light of most of them.
fn readings_of(
    group: &Group,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<MultiAngle, CxfError> {
    let object = group
        .objects
        .first()
        .map_or_else(String::new, |object| called(object));
    let (found, accepted) = (group.values.len(), KINDS * limits.angles);
    if found > accepted {
        return Err(CxfError::Rows {
            object,
            found,
            accepted,
        });
    }
    let mut choices: Vec<(&Kind, f64, usize)> = Vec::new();
    for value in &group.values {
        let (kind, light) = (&value.kind, value.angles.illumination_deg);
        match choices.iter_mut().find(|of| of.0 == kind && of.1 == light) {
            Some(choice) => choice.2 += 1,
            None => choices.push((kind, light, 1)),
        }
    }
    // Most angles first, then the better kind, then light nearer to the usual 45°.
    choices.sort_by(|a, b| {
        let light = |of: &(&Kind, f64, usize)| (of.1 - 45.0).abs();
        b.2.cmp(&a.2)
            .then(a.0.rank().cmp(&b.0.rank()))
            .then(light(a).total_cmp(&light(b)))
    });
    let Some(&(kind, illumination_deg, found)) = choices.first() else {
        return Err(CxfError::NoObject);
    };
    if found > limits.angles {
        return Err(CxfError::Rows {
            object,
            found,
            accepted: limits.angles,
        });
    }
    let chosen =
        |value: &&Value| value.kind == *kind && value.angles.illumination_deg == illumination_deg;
    let rows: Vec<Vec<f64>> = group
        .values
        .iter()
        .filter(chosen)
        .map(|value| {
            let angle = std::iter::once(value.angles.aspecular_deg);
            angle.chain(value.numbers.iter().copied()).collect()
        })
        .collect();
    let told_elsewhere = |value: &&Value| {
        !rows
            .iter()
            .any(|row| row.first() == Some(&value.angles.aspecular_deg))
            || value.angles.illumination_deg != illumination_deg
    };
    let left_out = group.values.iter().filter(told_elsewhere).count();
    if left_out > 0 {
        warnings.push(format!(
            "{left_out} values of {object} are under other light than at {illumination_deg}°, or in another kind of color \
             than the rest, and were not read"
        ));
    }
    let (columns, (illuminant, observer)) = match kind {
        Kind::Spectrum(nm) => (
            nm.iter().map(|nm| format!("nm{nm}")).collect(),
            (Illuminant::D65, Observer::Two),
        ),
        Kind::Lab(illuminant, observer) => (
            ["L", "a", "b"].map(str::to_owned).to_vec(),
            (*illuminant, *observer),
        ),
    };
    let first = std::iter::once(ASPECULAR_COLUMN.to_owned());
    Ok(MultiAngle {
        illumination_deg,
        illuminant,
        observer,
        columns: first.chain::<Vec<String>>(columns).collect(),
        rows,
    })
}

/// Name of a paint: its objects', or what their names begin with.
fn name_of(group: &Group) -> Option<String> {
    let mut names = group
        .objects
        .iter()
        .map(|object| object.attribute("Name").unwrap_or_default());
    let first = names.next()?;
    let common = names.fold(first, |common, name| {
        let same = common
            .char_indices()
            .zip(name.chars())
            .find(|((_, a), b)| a != b);
        let end = same.map_or(common.len().min(name.len()), |((at, _), _)| at);
        common.get(..end).unwrap_or_default()
    });
    let trimmed = if common == first {
        common
    } else {
        common.trim_end_matches(|c: char| !c.is_alphabetic())
    };
    as_name(trimmed.trim())
}

fn notes_of(root: &Element, group: &Group) -> BTreeMap<String, String> {
    let mut notes = BTreeMap::new();
    let about = root.child("FileInformation");
    for (key, name) in [
        ("creator", "Creator"),
        ("description", "Description"),
        ("comment", "Comment"),
    ] {
        if let Some(text) = about.and_then(|about| about.said(name)) {
            notes.insert(key.to_owned(), text.to_owned());
        }
    }
    let object = group.objects.first();
    if let Some(date) = object.and_then(|object| object.said("CreationDate")) {
        notes.insert("measured_on".to_owned(), date.to_owned());
    }
    if let Some(instrument) = group
        .values
        .iter()
        .find_map(|value| value.instrument.clone())
    {
        notes.insert("instrument".to_owned(), instrument);
    }
    notes
}
