//! What a portable multi-angle instrument would read of a paint.
//!
//! Light at 45° in air, the viewer in the plane of incidence, flakes at their mean, the coat's mirror image left out. A
//! reading is the Lab of the reflectance factor `π f` under D65 for the 2° observer, white the perfect diffuser.
//! Model description, section 5. The JSON is the `multi_angle` part of a measured-paint package.

use std::f64::consts::PI;

use serde::Serialize;

use crate::color::Lab;
use crate::paint::{CarPaint, Chi, Reflectance};

/// Angle of the light from the normal, degrees.
const ILLUMINATION_DEG: f64 = 45.0;

/// Readings of one paint, a row for each angle in the order asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Readings {
    pub(super) illumination_deg: f64,
    pub(super) illuminant: &'static str,
    pub(super) observer: &'static str,
    columns: [&'static str; 4],
    /// Aspecular angle in degrees, L, a, b.
    pub rows: Vec<[f64; 4]>,
}

/// An aspecular angle whose viewer stands at or below the horizon.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the aspecular angle is {0}°, accepted is above -45 and below 135")]
pub struct AngleError(pub f64);

/// Reads a paint at these aspecular angles, degrees from the mirror direction towards the light.
///
/// # Errors
///
/// [`AngleError`] for an angle that is not finite, or whose viewer is not above the paint.
pub fn readings(paint: &CarPaint, aspecular_deg: &[f64]) -> Result<Readings, AngleError> {
    let reflectance = Reflectance::new(paint);
    let light = ILLUMINATION_DEG.to_radians();
    let wi = [-light.sin(), 0.0, light.cos()];
    let row = |&aspecular: &f64| {
        let view_deg = ILLUMINATION_DEG - aspecular;
        // Also false for what is no number.
        if view_deg.abs() < 90.0 {
            let view = view_deg.to_radians();
            let f = reflectance.evaluate(wi, [view.sin(), 0.0, view.cos()], Chi::Table);
            let lab = Lab::from_rgb(f.map(|f| f * PI));
            Ok([aspecular, lab.l, lab.a, lab.b])
        } else {
            Err(AngleError(aspecular))
        }
    };
    Ok(Readings {
        illumination_deg: ILLUMINATION_DEG,
        illuminant: "D65",
        observer: "2",
        columns: ["aspecular_deg", "L", "a", "b"],
        rows: aspecular_deg.iter().map(row).collect::<Result<_, _>>()?,
    })
}

impl Readings {
    /// Comma-separated, a line of column names first; lines end in CR LF (RFC 4180).
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = self.columns.join(",");
        text.push_str("\r\n");
        for row in &self.rows {
            text.push_str(&row.map(|value| value.to_string()).join(","));
            text.push_str("\r\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{ASPECULAR_DEG, ColorTable};

    fn grey() -> CarPaint {
        CarPaint {
            coat: None,
            diffuse: [0.184_186_517; 3],
            lobes: Vec::new(),
            color_table: ColorTable::white(),
            flakes: None,
        }
    }

    #[test]
    fn a_lambertian_grey_of_eighteen_per_cent_reads_fifty_everywhere() {
        let read = readings(&grey(), &ASPECULAR_DEG).expect("all above the paint");
        for (row, angle) in read.rows.iter().zip(ASPECULAR_DEG) {
            assert_eq!(row[0], angle);
            // Y = ((50 + 16)/116)³ is L = 50; sRGB's own white is D65 to some 1e-4.
            assert!((row[1] - 50.0).abs() < 1e-6, "{row:?}");
            assert!(row[2].hypot(row[3]) < 0.02, "{row:?}");
        }
    }

    #[test]
    fn the_table_names_its_columns_and_keeps_the_order() {
        let csv = readings(&grey(), &[110.0, -15.0]).expect("fine").to_csv();
        let lines: Vec<&str> = csv.split("\r\n").collect();
        assert_eq!(lines[0], "aspecular_deg,L,a,b");
        assert!(lines[1].starts_with("110,") && lines[2].starts_with("-15,"));
        assert_eq!(lines[3..], [""]);
    }

    #[test]
    fn an_angle_below_the_horizon_is_refused_with_its_value() {
        for angle in [-45.0, 135.0, 1e300, f64::INFINITY] {
            assert_eq!(readings(&grey(), &[15.0, angle]), Err(AngleError(angle)));
        }
        assert!(readings(&grey(), &[f64::NAN]).is_err());
        assert!(readings(&grey(), &[-44.999, 134.999]).is_ok());
    }
}
