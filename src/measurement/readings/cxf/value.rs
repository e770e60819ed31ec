//! The colors of an object of `CxF3` that are readings of a paint at an angle.

use std::rc::Rc;

use super::Specifications;
use super::document::Element;
use super::specification::{Angles, Specification, wavelength};
use crate::color::{Illuminant, Lab, Observer, Wavelengths, WhitePoint};
use crate::measurement::readings::told;

/// Most values of one spectrum.
const MOST_BANDS: usize = 1000;
/// Names of colors that are readings.
const COLORS: [&str; 5] = [
    "ColorCIELab",
    "ColorCIELCh",
    "ColorCIEXYZ",
    "ReflectanceSpectrum",
    "CustomSpectrum",
];

/// In what a color is given.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// Reflectance factors at wavelengths in nm.
    Spectrum(Vec<f64>),
    /// L, a, b.
    Lab(Illuminant, Observer),
}

impl Kind {
    /// What tells it from other kinds.
    pub fn bits(&self) -> Vec<u64> {
        match self {
            Self::Spectrum(nm) => nm.iter().map(|nm| nm.to_bits()).collect(),
            Self::Lab(..) => vec![self.rank().into()],
        }
    }

    /// Which kind is preferred where several tell as many angles: what needs the fewest assumptions, first.
    pub fn rank(&self) -> u8 {
        match self {
            Self::Spectrum(_) => 0,
            Self::Lab(Illuminant::D65, Observer::Two) => 1,
            Self::Lab(Illuminant::D65, Observer::Ten) => 2,
            Self::Lab(Illuminant::D50, Observer::Two) => 3,
            Self::Lab(Illuminant::D50, Observer::Ten) => 4,
        }
    }
}

/// One color at one angle.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Value {
    pub kind: Kind,
    pub angles: Angles,
    pub numbers: Vec<f64>,
    pub instrument: Option<Rc<str>>,
}

/// Colors of an object that are no readings: how many, and why the first is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Unusable {
    pub count: usize,
    pub reason: Option<String>,
}

/// The colors of an object.
pub(super) fn colors_of(object: &Element) -> impl Iterator<Item = &Element> {
    object
        .all("ColorValues")
        .flat_map(|of| &of.children)
        .filter(|entry| COLORS.contains(&entry.name.as_str()))
}

/// The values of an object that are readings, and why others are none.
pub(super) fn values_of(
    object: &Element,
    specifications: &Specifications,
) -> (Vec<Value>, Unusable) {
    let (mut values, mut unusable) = (Vec::new(), Unusable::default());
    for entry in colors_of(object) {
        match value(entry, specifications) {
            Ok(value) => values.push(value),
            Err(reason) => {
                unusable.count += 1;
                let reason = || format!("{} {reason}", entry.name);
                unusable.reason.get_or_insert_with(reason);
            }
        }
    }
    (values, unusable)
}

fn value(entry: &Element, specifications: &Specifications) -> Result<Value, String> {
    let id = entry.attribute("ColorSpecification").unwrap_or_default();
    let Some(of) = specifications.get(id) else {
        return Err(format!(
            "refers to ColorSpecification {:?}, which is not there",
            told(id)
        ));
    };
    let placed = |reason: String| format!("of ColorSpecification {:?}: {reason}", told(id));
    let angles = of.angles(entry.attribute("Name")).map_err(placed)?;
    let (kind, numbers) = match entry.name.as_str() {
        "ReflectanceSpectrum" => spectrum(entry, of).map_err(placed)?,
        "CustomSpectrum" => points(entry).map_err(placed)?,
        _ => {
            let light = (
                of.illuminant.clone().map_err(placed)?,
                of.observer.clone().map_err(placed)?,
            );
            let lab = lab(entry, WhitePoint::of(light.0, light.1)).map_err(placed)?;
            (Kind::Lab(light.0, light.1), lab.to_array().to_vec())
        }
    };
    Ok(Value {
        kind,
        angles,
        numbers,
        instrument: of.instrument.clone(),
    })
}

fn number(text: &str, what: &str) -> Result<f64, String> {
    let value = text
        .trim()
        .parse()
        .ok()
        .filter(|v| (-1e6..=1e6).contains(v));
    value.ok_or_else(|| {
        format!(
            "{what} is {:?}, accepted is a number from -1000000 to 1000000",
            told(text)
        )
    })
}

fn lab(entry: &Element, white: WhitePoint) -> Result<Lab, String> {
    let part = |name: &str| number(entry.said(name).unwrap_or_default(), name);
    Ok(match entry.name.as_str() {
        "ColorCIEXYZ" => {
            let xyz = [part("X")?, part("Y")?, part("Z")?];
            Lab::from_xyz(xyz.map(|v| v / 100.0), white)
        }
        "ColorCIELCh" => {
            let (c, h) = (part("C")?, part("H")?.to_radians());
            Lab::from([part("L")?, c * h.cos(), c * h.sin()])
        }
        _ => Lab::from([part("L")?, part("A")?, part("B")?]),
    })
}

fn spectrum(entry: &Element, of: &Specification) -> Result<(Kind, Vec<f64>), String> {
    let start = entry
        .attribute("StartWL")
        .map(|text| wavelength(text, "StartWL"))
        .transpose()?;
    let (first, step) = of.wavelengths.clone()?;
    let start = start.unwrap_or(first);
    let factors = entry.text.split_ascii_whitespace().take(MOST_BANDS + 1);
    let factors = factors
        .map(|text| number(text, "a value"))
        .collect::<Result<Vec<f64>, _>>()?;
    if factors.len() > MOST_BANDS {
        return Err(too_many());
    }
    let nm: Vec<f64> = (0..factors.len())
        .map(|k| start + step * k as f64)
        .collect();
    spectral(nm, factors)
}

fn too_many() -> String {
    format!("it has more than {MOST_BANDS} values, accepted are {MOST_BANDS}")
}

fn points(entry: &Element) -> Result<(Kind, Vec<f64>), String> {
    let mut points = Vec::new();
    for point in entry.all("SpectralPoint") {
        let wavelength = wavelength(point.attribute("WL").unwrap_or_default(), "WL")?;
        points.push((wavelength, number(&point.text, "SpectralPoint")?));
    }
    if points.len() > MOST_BANDS {
        return Err(too_many());
    }
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (nm, factors) = points.into_iter().unzip();
    spectral(nm, factors)
}

/// A spectrum whose wavelengths have a color; of one that has none another value of the angle may do.
fn spectral(nm: Vec<f64>, factors: Vec<f64>) -> Result<(Kind, Vec<f64>), String> {
    Wavelengths::new(&nm).map_err(|e| e.to_string())?;
    Ok((Kind::Spectrum(nm), factors))
}
