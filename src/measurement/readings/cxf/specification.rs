//! What a `ColorSpecification` of `CxF3` says: light, observer, geometry, wavelengths, instrument.

use super::document::Element;
use crate::color::{Illuminant, Observer};
use crate::measurement::readings::told;

/// Most angles of one specification.
const MOST_ANGLES: usize = 256;

/// Angles of one geometry, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Angles {
    pub illumination_deg: f64,
    pub aspecular_deg: f64,
}

/// A specification that values of objects refer to.
pub(super) struct Specification<'a>(pub &'a Element);

impl<'a> Specification<'a> {
    pub fn id(&self) -> &'a str {
        self.0.attribute("Id").unwrap_or_default()
    }

    /// Light that L, a, b hold for, or why it cannot be used.
    pub fn illuminant(&self) -> Result<Illuminant, String> {
        match self
            .0
            .at(&["TristimulusSpec"])
            .and_then(|spec| spec.said("Illuminant"))
        {
            Some("D65") => Ok(Illuminant::D65),
            Some("D50") => Ok(Illuminant::D50),
            other => Err(format!(
                "its illuminant is {}, accepted are D65 and D50",
                or_missing(other)
            )),
        }
    }

    /// Observer that L, a, b hold for, or why it cannot be used.
    pub fn observer(&self) -> Result<Observer, String> {
        match self
            .0
            .at(&["TristimulusSpec"])
            .and_then(|spec| spec.said("Observer"))
        {
            Some("2_Degree") => Ok(Observer::Two),
            Some("10_Degree") => Ok(Observer::Ten),
            other => Err(format!(
                "its observer is {}, accepted are 2_Degree and 10_Degree",
                or_missing(other)
            )),
        }
    }

    /// First wavelength and step of spectra, nm.
    pub fn wavelengths(&self) -> Option<(f64, f64)> {
        let range = self.0.at(&["MeasurementSpec", "WavelengthRange"])?;
        let number = |name| range.attribute(name)?.parse().ok();
        Some((number("StartWL")?, number("Increment")?))
    }

    /// Maker, model and serial number of the instrument.
    pub fn instrument(&self) -> Option<String> {
        let device = self.0.at(&["MeasurementSpec", "Device"])?;
        let said: Vec<&str> = ["Manufacturer", "Model", "SerialNumber"]
            .iter()
            .filter_map(|name| device.said(name))
            .collect();
        (!said.is_empty()).then(|| said.join(" "))
    }

    /// Angles at which the value of this name was read, or why it cannot be used. Of a specification that lists several,
    /// a value names one by its notation.
    pub fn angles(&self, value: Option<&str>) -> Result<Angles, String> {
        let measured = self.0.child("MeasurementSpec");
        let kind = measured.and_then(|spec| spec.said("MeasurementType"));
        if !kind
            .is_some_and(|kind| matches!(kind, "Spectrum_Reflectance" | "Colorimetric_Reflectance"))
        {
            return Err(format!(
                "its measurement is {}, accepted are Spectrum_Reflectance and Colorimetric_Reflectance",
                or_missing(kind)
            ));
        }
        let geometry = measured.and_then(|spec| spec.child("GeometryChoice"));
        let Some(choice) = geometry.and_then(|geometry| geometry.children.first()) else {
            return Err(
                "it says no geometry, accepted are MultiAngle, and SingleAngle of 45 and 0"
                    .to_owned(),
            );
        };
        match choice.name.as_str() {
            "MultiAngle" => multi_angle(choice, value),
            "SingleAngle" => single_angle(choice),
            other => Err(format!(
                "its geometry is {}, accepted are MultiAngle, and SingleAngle of 45 and 0",
                told(other)
            )),
        }
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

fn multi_angle(choice: &Element, value: Option<&str>) -> Result<Angles, String> {
    let angles: Vec<&Element> = choice.all("BRDFAngle").collect();
    let chosen = match angles[..] {
        [] => return Err("its MultiAngle holds no BRDFAngle".to_owned()),
        [only] => only,
        _ if angles.len() > MOST_ANGLES => {
            return Err(format!(
                "it lists {} angles, accepted are {MOST_ANGLES}",
                angles.len()
            ));
        }
        _ => {
            let named = |angle: &&Element| {
                angle
                    .attribute("Notation")
                    .is_some_and(|notation| Some(notation) == value)
            };
            let mut named = angles.iter().copied().filter(named);
            match (named.next(), named.next()) {
                (Some(angle), None) => angle,
                _ => {
                    return Err(format!(
                        "it lists {} angles and the value's Name is {}: accepted is a Name that is the Notation of one of \
                         them, or a specification for each angle",
                        angles.len(),
                        or_missing(value)
                    ));
                }
            }
        }
    };
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
