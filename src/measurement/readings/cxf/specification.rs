//! What a `ColorSpecification` of `CxF3` says: light, observer, geometry, wavelengths, instrument.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::document::Element;
use crate::color::{Illuminant, Observer};
use crate::measurement::multi_angle::WAVELENGTHS_NM;
use crate::measurement::readings::{NOTE_CHARACTERS, told};

/// Most angles of one specification.
const MOST_ANGLES: usize = 256;

/// Angles of one geometry, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Angles {
    pub illumination_deg: f64,
    pub aspecular_deg: f64,
}

/// A specification that values of objects refer to, read once; of each part what it says, or why it cannot be used.
pub(super) struct Specification {
    /// Light that L, a, b hold for.
    pub illuminant: Result<Illuminant, String>,
    /// Observer that L, a, b hold for.
    pub observer: Result<Observer, String>,
    /// First wavelength and step of spectra, nm.
    pub wavelengths: Result<(f64, f64), String>,
    /// Maker, model and serial number of the instrument.
    pub instrument: Option<Rc<str>>,
    geometry: Result<Geometry, String>,
}

/// Angles at which values are read.
enum Geometry {
    One(Angles),
    /// Several by their notation, and how many they are.
    Several(BTreeMap<String, Result<Angles, String>>, usize),
}

impl Specification {
    pub fn read(of: &Element) -> Self {
        let color = of.child("TristimulusSpec");
        let measured = of.child("MeasurementSpec");
        Self {
            illuminant: match color.and_then(|spec| spec.said("Illuminant")) {
                Some("D65") => Ok(Illuminant::D65),
                Some("D50") => Ok(Illuminant::D50),
                other => Err(format!(
                    "its illuminant is {}, accepted are D65 and D50",
                    or_missing(other)
                )),
            },
            observer: match color.and_then(|spec| spec.said("Observer")) {
                Some("2_Degree") => Ok(Observer::Two),
                Some("10_Degree") => Ok(Observer::Ten),
                other => Err(format!(
                    "its observer is {}, accepted are 2_Degree and 10_Degree",
                    or_missing(other)
                )),
            },
            wavelengths: wavelengths(measured),
            instrument: measured.and_then(instrument),
            geometry: geometry(measured),
        }
    }

    /// Angles at which the value of this name was read, or why it cannot be used. Of a specification that lists several,
    /// a value names one by its notation.
    pub fn angles(&self, value: Option<&str>) -> Result<Angles, String> {
        match self.geometry.as_ref().map_err(Clone::clone)? {
            Geometry::One(angles) => Ok(*angles),
            Geometry::Several(named, count) => {
                let chosen = value.and_then(|value| named.get(value));
                chosen.cloned().unwrap_or_else(|| {
                    Err(format!(
                        "it lists {count} angles and the value's Name is {}: accepted is a Name that is the Notation of \
                         one of them, or a specification for each angle",
                        or_missing(value)
                    ))
                })
            }
        }
    }
}

/// A wavelength in nm that a document names.
pub(super) fn wavelength(text: &str, what: &str) -> Result<f64, String> {
    let nm: Option<f64> = text.parse().ok();
    nm.filter(|nm| WAVELENGTHS_NM.contains(nm)).ok_or_else(|| {
        format!(
            "{what} is {:?}, accepted is a wavelength in nm from {} to below {}",
            told(text),
            WAVELENGTHS_NM.start,
            WAVELENGTHS_NM.end
        )
    })
}

fn wavelengths(measured: Option<&Element>) -> Result<(f64, f64), String> {
    let range = measured.and_then(|spec| spec.child("WavelengthRange"));
    let said = |name| range.and_then(|range| range.attribute(name));
    let (Some(start), Some(step)) = (said("StartWL"), said("Increment")) else {
        return Err(
            "it has no WavelengthRange, accepted is one with StartWL and Increment".to_owned(),
        );
    };
    let start = wavelength(start, "its StartWL")?;
    let nm = step.parse().ok().filter(|step| (0.5..=20.0).contains(step));
    let step = nm.ok_or_else(|| {
        format!(
            "its Increment is {:?}, accepted are steps from 0.5 to 20 nm",
            told(step)
        )
    })?;
    Ok((start, step))
}

fn instrument(measured: &Element) -> Option<Rc<str>> {
    let device = measured.child("Device")?;
    let said: Vec<String> = ["Manufacturer", "Model", "SerialNumber"]
        .iter()
        .filter_map(|name| device.said(name))
        .map(|text| text.chars().take(NOTE_CHARACTERS).collect())
        .collect();
    (!said.is_empty()).then(|| said.join(" ").into())
}

fn geometry(measured: Option<&Element>) -> Result<Geometry, String> {
    let kind = measured.and_then(|spec| spec.said("MeasurementType"));
    if !kind.is_some_and(|kind| matches!(kind, "Spectrum_Reflectance" | "Colorimetric_Reflectance"))
    {
        return Err(format!(
            "its measurement is {}, accepted are Spectrum_Reflectance and Colorimetric_Reflectance",
            or_missing(kind)
        ));
    }
    let choice = measured
        .and_then(|spec| spec.child("GeometryChoice"))
        .and_then(|geometry| geometry.children.first());
    let Some(choice) = choice else {
        return Err(
            "it says no geometry, accepted are MultiAngle, and SingleAngle of which one angle is 0"
                .to_owned(),
        );
    };
    match choice.name.as_str() {
        "MultiAngle" => multi_angle(choice),
        "SingleAngle" => single_angle(choice).map(Geometry::One),
        other => Err(format!(
            "its geometry is {}, accepted are MultiAngle, and SingleAngle of which one angle is 0",
            told(other)
        )),
    }
}

fn or_missing(said: Option<&str>) -> String {
    said.map_or_else(|| "missing".to_owned(), told)
}

fn degrees(of: &Element, name: &str) -> Result<f64, String> {
    let said = of.said(name);
    said.and_then(|text| text.parse().ok())
        .filter(|angle| (-360.0..=360.0).contains(angle))
        .ok_or_else(|| format!("its {name} is {}, accepted are degrees", or_missing(said)))
}

fn multi_angle(choice: &Element) -> Result<Geometry, String> {
    let count = choice.all("BRDFAngle").count();
    if count > MOST_ANGLES {
        return Err(format!(
            "it lists {count} angles, accepted are {MOST_ANGLES}"
        ));
    }
    let mut angles = choice.all("BRDFAngle");
    match (angles.next(), count) {
        (None, _) => {
            Err("its MultiAngle holds no BRDFAngle, accepted is one for each angle".to_owned())
        }
        (Some(only), 1) => brdf_angle(only).map(Geometry::One),
        _ => {
            let mut named = BTreeMap::new();
            for angle in choice.all("BRDFAngle") {
                let notation = angle.attribute("Notation").unwrap_or_default();
                let read = if named.contains_key(notation) {
                    Err(format!(
                        "several of its angles have the Notation {:?}, accepted is one",
                        told(notation)
                    ))
                } else {
                    brdf_angle(angle)
                };
                named.insert(notation.to_owned(), read);
            }
            named.remove("");
            Ok(Geometry::Several(named, count))
        }
    }
}

fn brdf_angle(chosen: &Element) -> Result<Angles, String> {
    if chosen.child("Azimuth").is_some() && degrees(chosen, "Azimuth")? != 0.0 {
        return Err(
            "its angle lies out of the plane of incidence, accepted is no Azimuth, or 0".to_owned(),
        );
    }
    let (illumination_deg, aspecular_deg) = (
        degrees(chosen, "IlluminationAngle")?,
        degrees(chosen, "Aspecular")?,
    );
    if !(0.0..90.0).contains(&illumination_deg) || !(-90.0..=180.0).contains(&aspecular_deg) {
        return Err(format!(
            "its angles are {illumination_deg}° and {aspecular_deg}° aspecular, accepted are 0 to below 90 and -90 to 180"
        ));
    }
    Ok(Angles {
        illumination_deg,
        aspecular_deg,
    })
}

/// 45/0 and 0/45 are one geometry: light and viewer can be exchanged.
fn single_angle(choice: &Element) -> Result<Angles, String> {
    let mut angles = [
        degrees(choice, "IlluminationAngle")?,
        degrees(choice, "MeasurementAngle")?,
    ];
    angles.sort_by(f64::total_cmp);
    match angles {
        [0.0, other] if other > 0.0 && other < 90.0 => Ok(Angles {
            illumination_deg: other,
            aspecular_deg: other,
        }),
        [a, b] => Err(format!(
            "its SingleAngle is of {a}° and {b}°, accepted is one of which either is 0"
        )),
    }
}
