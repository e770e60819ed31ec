//! Readings in `CxF3`, the color exchange format (ISO 17972-1).
//!
//! A reading is a `ColorCIELab`, `ColorCIELCh`, `ColorCIEXYZ`, `ReflectanceSpectrum` or `CustomSpectrum` whose
//! `ColorSpecification` has the geometry `MultiAngle`: one `BRDFAngle` for each specification, or several of which the
//! value names one, its `Name` being their `Notation`. A `SingleAngle` with light or viewer at 0°, such as 45/0, is a reading at the other angle. Angles out of
//! the plane of incidence, spheres and transmission are none, and are told.
//!
//! A paint is an object with a value for each angle, or objects of one type and name whose angles are not each other's;
//! objects of an angle each may end their names with it (`paints`). Of a document with several paints one must be asked
//! for. Where an angle has several values, spectra win, then D65, then the 2° observer; all angles of a paint are read in
//! one of them, and under one light.

mod document;
mod error;
mod paints;
mod specification;
mod value;

use std::collections::BTreeMap;

use self::document::{Element, read_document};
pub use self::error::CxfError;
use self::paints::{Paint, Read, one_of};
use self::specification::Specification;
use self::value::{Kind, Value, colors_of, values_of};
use super::{NOTE_CHARACTERS, ReadingsFile, as_name, counted, told};
use crate::color::{Illuminant, Observer};
use crate::measurement::MultiAngle;
use crate::measurement::multi_angle::{ASPECULAR_COLUMN, most_readings};
use crate::paint::Limits;

/// Kinds of color that every angle of a paint may be given in.
const KINDS: usize = 16;
/// Colors of all objects of a document.
const VALUES: usize = 10_000;

/// Specifications by their id.
type Specifications<'a> = BTreeMap<&'a str, Specification>;

pub(super) fn read_cxf(
    text: &str,
    wanted: Option<&str>,
    limits: &Limits,
) -> Result<ReadingsFile, CxfError> {
    let root = read_document(text)?;
    let none = Element::default();
    let resources = root.child("Resources").unwrap_or(&none);
    let collection = resources.child("ObjectCollection").unwrap_or(&none);
    let found = collection.all("Object").flat_map(colors_of).count();
    if found > VALUES {
        let accepted = VALUES;
        return Err(CxfError::Values { found, accepted });
    }
    let specifications = specifications_of(resources)?;
    let (mut read, mut unread) = (Vec::new(), Vec::new());
    for object in collection.all("Object") {
        let (values, unusable) = values_of(object, &specifications);
        let of = if values.is_empty() {
            &mut unread
        } else {
            &mut read
        };
        of.push(Read {
            object,
            values,
            unusable,
        });
    }
    let mut warnings = Vec::new();
    let paint = one_of(read, &unread, wanted, &mut warnings)?;
    paint.warn_of_unusable(&mut warnings);
    let readings = readings_of(&paint, limits, &mut warnings)?;
    let mut notes = notes_of(&root, &paint);
    notes.retain(|_, note| !note.trim().is_empty());
    for note in notes.values_mut() {
        *note = note
            .chars()
            .filter(|c| !c.is_control())
            .take(NOTE_CHARACTERS)
            .collect();
    }
    Ok(ReadingsFile {
        asked_by_id: wanted.is_some_and(|wanted| paint.has_id(wanted.trim())),
        name: as_name(paint.name)
            .or_else(|| as_name(root.at(&["FileInformation"])?.said("Description")?)),
        notes,
        readings,
        warnings,
    })
}

fn specifications_of(resources: &Element) -> Result<Specifications<'_>, CxfError> {
    let mut specifications = BTreeMap::new();
    let of = resources.child("ColorSpecificationCollection");
    for of in of.iter().flat_map(|of| of.all("ColorSpecification")) {
        // No value can refer to one without.
        let Some(id) = of.attribute("Id").filter(|id| !id.is_empty()) else {
            continue;
        };
        if specifications.insert(id, Specification::read(of)).is_some() {
            return Err(CxfError::Specification { id: told(id) });
        }
    }
    Ok(specifications)
}

/// Readings of a paint in the kind that most of its angles are given in, under the light of most of them.
fn readings_of(
    paint: &Paint,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<MultiAngle, CxfError> {
    let most = most_readings(limits);
    let check = |found: usize, accepted: usize| {
        if found <= accepted {
            return Ok(());
        }
        Err(CxfError::Rows {
            object: paint.called(),
            found,
            accepted,
        })
    };
    check(paint.values().count(), KINDS * most)?;
    let mut choices: Vec<(&Kind, f64, Vec<f64>)> = Vec::new();
    // Thousands of them with as many wavelengths each would be compared for a long time.
    let mut places: BTreeMap<(u64, Vec<u64>), usize> = BTreeMap::new();
    for value in paint.values() {
        let (kind, light) = (&value.kind, value.angles.illumination_deg);
        let angle = value.angles.aspecular_deg;
        let place = *places
            .entry((light.to_bits(), kind.bits()))
            .or_insert(choices.len());
        if place == choices.len() {
            choices.push((kind, light, Vec::new()));
        }
        choices[place].2.push(angle);
    }
    for (_, _, angles) in &mut choices {
        angles.sort_by(f64::total_cmp);
        angles.dedup();
    }
    // Most angles first, then the better kind, then light nearer to the usual 45°.
    choices.sort_by(|a, b| {
        let light = |of: &(&Kind, f64, Vec<f64>)| (of.1 - 45.0).abs();
        let angles = b.2.len().cmp(&a.2.len());
        angles
            .then(a.0.rank().cmp(&b.0.rank()))
            .then(light(a).total_cmp(&light(b)))
    });
    let Some(&(kind, illumination_deg, _)) = choices.first() else {
        return Err(CxfError::NoObject);
    };
    let chosen =
        |value: &&Value| value.angles.illumination_deg == illumination_deg && value.kind == *kind;
    let rows: Vec<Vec<f64>> = paint
        .values()
        .filter(chosen)
        .map(|value| {
            let angle = std::iter::once(value.angles.aspecular_deg);
            angle.chain(value.numbers.iter().copied()).collect()
        })
        .collect();
    check(rows.len(), most)?;
    let told_elsewhere = |value: &&Value| {
        !rows
            .iter()
            .any(|row| row.first() == Some(&value.angles.aspecular_deg))
            || value.angles.illumination_deg != illumination_deg
    };
    let left_out = paint.values().filter(told_elsewhere).count();
    if left_out > 0 {
        warnings.push(format!(
            "{left_out} {} of {} {} under other light than at {illumination_deg}°, or in another kind of color than the \
             rest, and {} not read",
            counted(left_out, "value", "values"),
            paint.called(),
            counted(left_out, "is", "are"),
            counted(left_out, "was", "were"),
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

fn notes_of(root: &Element, paint: &Paint) -> BTreeMap<String, String> {
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
    let object = paint.parts.first().map(|part| part.object);
    if let Some(date) = object.and_then(|object| object.said("CreationDate")) {
        notes.insert("measured_on".to_owned(), date.to_owned());
    }
    if let Some(instrument) = paint.values().find_map(|value| value.instrument.as_deref()) {
        notes.insert("instrument".to_owned(), instrument.to_owned());
    }
    notes
}
