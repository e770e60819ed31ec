//! White points: the XYZ of a perfect diffuser, normalised to Y = 1.
//!
//! Source: ASTM E308 tables as summed in the model description, section 8. Paint laboratories read D65 with the 10°
//! observer, eyedroppers D50 with the 2°, renderers D65 with the 2°.

use serde::{Deserialize, Serialize};

/// Relative spectral power a color was seen under.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Illuminant {
    /// Average daylight, 6504 K.
    D65,
    /// Horizon daylight, 5003 K, the graphic arts' light.
    D50,
}

/// Field of view of the standard observer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Observer {
    /// CIE 1931.
    #[serde(rename = "2")]
    Two,
    /// CIE 1964.
    #[serde(rename = "10")]
    Ten,
}

/// XYZ of the perfect diffuser, `Y = 1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WhitePoint {
    /// X over Y of white.
    pub x: f64,
    /// Always 1.
    pub y: f64,
    /// Z over Y of white.
    pub z: f64,
}

/// White of linear sRGB and of every Lab value inside carpaint.
pub const D65_2: WhitePoint = white(95.047, 108.883);

const fn white(x: f64, z: f64) -> WhitePoint {
    WhitePoint {
        x: x / 100.0,
        y: 1.0,
        z: z / 100.0,
    }
}

impl WhitePoint {
    /// White point of an illuminant seen by an observer.
    #[must_use]
    pub const fn of(illuminant: Illuminant, observer: Observer) -> Self {
        match (illuminant, observer) {
            (Illuminant::D65, Observer::Two) => D65_2,
            (Illuminant::D65, Observer::Ten) => white(94.811, 107.304),
            (Illuminant::D50, Observer::Two) => white(96.422, 82.521),
            (Illuminant::D50, Observer::Ten) => white(96.720, 81.427),
        }
    }
}
