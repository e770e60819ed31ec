//! Readings of a portable multi-angle instrument, and the colors that they are.
//!
//! A reading is the color of the reflectance factor `π f`: L, a, b under the light and for the observer that the readings
//! name, or a spectrum `nm400` … `nm700` (1 is the perfect diffuser), which needs neither and wins where both stand.
//! Light comes from `illumination_deg`, the viewer stands in the plane of incidence. Aspecular angles count from the
//! mirror direction towards the light.

use std::collections::BTreeMap;

use crate::color::{
    D65_2, Illuminant, Lab, LinearRgb, Observer, SpectrumError, Wavelengths, WhitePoint, adapted,
    xyz_to_rgb,
};
use crate::paint::{Limits, MAX_LAB};

/// First column of all readings.
pub const ASPECULAR_COLUMN: &str = "aspecular_deg";
/// Columns that are kept beside the colors and not fitted.
pub const TEXTURE_COLUMNS: [&str; 3] = ["sparkle_intensity", "sparkle_area", "graininess"];

/// Reflectance factors of a spectrum; noise may be below 0.
const SPECTRAL: (f64, f64) = (-1.0, 1000.0);
/// Median of all factors above which they are taken for percent. Metallics reach it near the mirror, and there alone.
const PERCENT: f64 = 5.0;
/// Wavelengths that a column may name, nm.
pub(super) const WAVELENGTHS_NM: std::ops::Range<f64> = 1.0..1e5;
/// Readings of one paint that are accepted under any limits: as many as are written of one.
const READINGS: usize = 256;

/// Most readings of one paint.
pub(super) fn most_readings(limits: &Limits) -> usize {
    limits.angles.max(READINGS)
}

/// Readings of a portable multi-angle instrument, as they came.
#[derive(Clone, Debug, PartialEq)]
pub struct MultiAngle {
    /// Angle of the light from the normal, in air, degrees.
    pub illumination_deg: f64,
    /// Light that L, a, b hold for.
    pub illuminant: Illuminant,
    /// Observer that L, a, b hold for.
    pub observer: Observer,
    /// Names of the columns; the first is `aspecular_deg`.
    pub columns: Vec<String>,
    /// One number per column; of texture, which an instrument reads at some angles only, NaN where there was none.
    pub rows: Vec<Vec<f64>>,
}

/// The colors of readings.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadColors {
    /// White of the colors.
    pub white: WhitePoint,
    /// Whether they hold for another observer than the 2°; their numbers are kept, since to convert them takes spectra.
    pub approximate: bool,
    /// Why L, a, b were taken where there are spectral columns too.
    pub warning: Option<String>,
    /// Aspecular angle in degrees, and what was read there, row by row.
    pub rows: Vec<(f64, Lab)>,
}

/// Why readings have no colors.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadColorsError {
    /// Neither kind of columns.
    #[error(
        "the columns are {columns}, accepted are aspecular_deg first, then L, a, b or spectral columns nm400 to nm700"
    )]
    Columns {
        /// Their names.
        columns: String,
    },
    /// A spectral column that names no wavelength.
    #[error("the column {column} names no wavelength, accepted are nm400, nm410 and so on")]
    Wavelength {
        /// Its name.
        column: String,
    },
    /// Wavelengths that are no spectrum.
    #[error("spectral columns: {0}")]
    Spectrum(#[from] SpectrumError),
    /// Spectra in percent.
    #[error(
        "the median of the spectral values is {median}, which looks like percent, accepted are factors, 1 is white"
    )]
    Percent {
        /// The median.
        median: f64,
    },
    /// A value that no reading has.
    #[error("{column} at {aspecular_deg}° is {value}, accepted is {accepted}")]
    Value {
        /// Name of the column.
        column: String,
        /// Angle of the row.
        aspecular_deg: f64,
        /// What stands there.
        value: f64,
        /// What may stand there.
        accepted: &'static str,
    },
}

impl ReadColors {
    /// The color of a reading in linear sRGB, adapted to its white.
    #[must_use]
    pub fn rgb(&self, read: Lab) -> LinearRgb {
        xyz_to_rgb(adapted(read.to_xyz(self.white), self.white, D65_2))
    }
}

impl MultiAngle {
    /// Whether columns of these names hold readings: the angle first, then colors.
    pub(super) fn are_readings(columns: &[String]) -> bool {
        let has = |name: &str| columns.iter().any(|c| c == name);
        columns.first().is_some_and(|c| c == ASPECULAR_COLUMN)
            && (has("L") && has("a") && has("b") || columns.iter().any(|c| c.starts_with("nm")))
    }

    /// The colors that were read, of spectra where there are usable ones.
    ///
    /// # Errors
    ///
    /// [`ReadColorsError`] naming the column and what would be accepted.
    pub fn colors(&self) -> Result<ReadColors, ReadColorsError> {
        if !self.has_spectra() {
            return self.lab_colors();
        }
        self.spectral_colors().or_else(|why| {
            // Of what has no L, a, b either, the spectrum is what was meant.
            let Ok(colors) = self.lab_colors() else {
                return Err(why);
            };
            let warning = format!("L, a, b were taken, the spectra are not usable: {why}");
            Ok(ReadColors {
                warning: Some(warning),
                ..colors
            })
        })
    }

    fn has_spectra(&self) -> bool {
        self.columns.iter().any(|column| column.starts_with("nm"))
    }

    /// Whether [`MultiAngle::colors`] come from spectra, which no illuminant or observer belongs to.
    pub(super) fn takes_spectra(&self) -> bool {
        self.has_spectra() && (self.spectral_colors().is_ok() || self.lab_colors().is_err())
    }

    /// Place and wavelength of the spectral columns, ascending.
    fn bands(&self) -> Result<Vec<(usize, f64)>, ReadColorsError> {
        let mut bands = Vec::new();
        for (at, column) in self.columns.iter().enumerate() {
            if let Some(nm) = column.strip_prefix("nm") {
                let nm: Option<f64> = nm.parse().ok().filter(|nm| WAVELENGTHS_NM.contains(nm));
                let column = column.clone();
                bands.push((at, nm.ok_or(ReadColorsError::Wavelength { column })?));
            }
        }
        bands.sort_by(|a, b| a.1.total_cmp(&b.1));
        Ok(bands)
    }

    fn lab_colors(&self) -> Result<ReadColors, ReadColorsError> {
        let place = |name: &str| self.columns.iter().position(|own| own == name);
        let [Some(l), Some(a), Some(b)] = ["L", "a", "b"].map(place) else {
            return Err(ReadColorsError::Columns {
                columns: self.columns.join(", "),
            });
        };
        let accepted = "a number from -2000 to 2000";
        let row = |row: &Vec<f64>| {
            let mut lab = [0.0; 3];
            for (value, at) in lab.iter_mut().zip([l, a, b]) {
                *value = self.value(row, at, (-MAX_LAB, MAX_LAB), accepted)?;
            }
            Ok((angle_of(row), Lab::from(lab)))
        };
        Ok(ReadColors {
            white: WhitePoint::of(self.illuminant, Observer::Two),
            approximate: self.observer != Observer::Two,
            warning: None,
            rows: self
                .rows
                .iter()
                .map(row)
                .collect::<Result<_, ReadColorsError>>()?,
        })
    }

    fn spectral_colors(&self) -> Result<ReadColors, ReadColorsError> {
        let bands = self.bands()?;
        let nm: Vec<f64> = bands.iter().map(|band| band.1).collect();
        let wavelengths = Wavelengths::new(&nm)?;
        let accepted = "a reflectance factor from -1 to 1000; 1 is white";
        let row = |row: &Vec<f64>| {
            let factors = bands
                .iter()
                .map(|band| self.value(row, band.0, SPECTRAL, accepted));
            let factors = factors.collect::<Result<Vec<f64>, _>>()?;
            Ok((
                angle_of(row),
                Lab::from_xyz(wavelengths.xyz(&factors), D65_2),
            ))
        };
        let rows = self
            .rows
            .iter()
            .map(row)
            .collect::<Result<_, ReadColorsError>>()?;
        let all = self.rows.iter();
        let mut all: Vec<f64> = all
            .flat_map(|row| bands.iter().filter_map(|band| row.get(band.0).copied()))
            .collect();
        let middle = all.len() / 2;
        if middle > 0 {
            let median = *all.select_nth_unstable_by(middle, f64::total_cmp).1;
            if median > PERCENT {
                return Err(ReadColorsError::Percent { median });
            }
        }
        Ok(ReadColors {
            white: D65_2,
            approximate: false,
            warning: None,
            rows,
        })
    }

    fn value(
        &self,
        row: &[f64],
        at: usize,
        (low, high): (f64, f64),
        accepted: &'static str,
    ) -> Result<f64, ReadColorsError> {
        let value = row.get(at).copied().unwrap_or(f64::NAN);
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(ReadColorsError::Value {
            column: self.columns.get(at).cloned().unwrap_or_default(),
            aspecular_deg: angle_of(row),
            value,
            accepted,
        })
    }

    /// What was read of texture, angle by angle, by the name of its column; nothing of a column in which nothing stands.
    #[must_use]
    pub fn texture_notes(&self) -> BTreeMap<String, String> {
        let mut notes = BTreeMap::new();
        for (at, column) in self.columns.iter().enumerate() {
            if TEXTURE_COLUMNS.contains(&column.as_str()) {
                let at = |row: &Vec<f64>| {
                    let value = row.get(at).filter(|value| value.is_finite())?;
                    Some(format!("{}°: {value}", angle_of(row)))
                };
                let said: Vec<String> = self.rows.iter().filter_map(at).collect();
                if !said.is_empty() {
                    notes.insert(column.clone(), said.join(", "));
                }
            }
        }
        notes
    }
}

fn angle_of(row: &[f64]) -> f64 {
    row.first().copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(columns: &[&str], row: &[f64]) -> MultiAngle {
        MultiAngle {
            illumination_deg: 45.0,
            illuminant: Illuminant::D65,
            observer: Observer::Ten,
            columns: columns.iter().map(|&c| c.to_owned()).collect(),
            rows: vec![row.to_vec()],
        }
    }

    #[test]
    fn a_spectrum_wins_over_numbers_of_another_observer() {
        let bands: Vec<String> = (40..=70).map(|k| format!("nm{}", 10 * k)).collect();
        let mut columns = vec!["aspecular_deg", "L", "a", "b"];
        columns.extend(bands.iter().map(String::as_str));
        let mut row = vec![15.0, 50.0, 20.0, 20.0];
        row.extend([0.25; 31]);
        let colors = readings(&columns, &row).colors().expect("colors");
        assert!(!colors.approximate && colors.rows.len() == 1);
        let (angle, lab) = colors.rows[0];
        // Y = 0.25 is L = 116 ∛0.25 − 16.
        assert!(
            angle == 15.0 && (lab.l - 57.0754).abs() < 1e-3 && lab.a.hypot(lab.b) < 1e-6,
            "{lab:?}"
        );
        let colors = readings(&columns[..4], &row[..4]).colors().expect("colors");
        assert!(colors.approximate && colors.rows[0].1.a == 20.0);
    }

    #[test]
    fn what_has_no_color_is_refused_by_column() {
        let refused = |columns: &[&str], row: &[f64]| {
            readings(columns, row)
                .colors()
                .expect_err("no colors")
                .to_string()
        };
        assert!(
            refused(&["aspecular_deg", "L"], &[0.0, 1.0])
                .starts_with("the columns are aspecular_deg, L")
        );
        assert!(
            refused(&["aspecular_deg", "nmx"], &[0.0, 1.0])
                .starts_with("the column nmx names no wavelength")
        );
        assert!(refused(&["aspecular_deg", "nm400"], &[0.0, 1.0]).contains("from 400 to 400 nm"));
        let lab = ["aspecular_deg", "L", "a", "b"];
        assert!(
            refused(&lab, &[15.0, 2e4, 0.0, 0.0]).starts_with("L at 15° is 20000, accepted is")
        );
        assert!(refused(&lab, &[15.0, 20.0]).starts_with("a at 15° is NaN"));
    }

    #[test]
    fn a_spectrum_that_is_not_usable_leaves_lab_and_says_why() {
        let warning_of = |columns: &[&str], row: &[f64]| {
            let colors = readings(columns, row).colors().expect("colors");
            assert!(colors.approximate && colors.rows[0].1.l == 50.0);
            colors.warning.expect("a warning")
        };
        let mut columns = vec!["aspecular_deg", "L", "a", "b", "nm550"];
        let mut row = vec![15.0, 50.0, 1.0, 2.0, 0.5];
        assert!(warning_of(&columns, &row).contains("from 550 to 550 nm"));
        columns[4] = "nmx";
        assert!(warning_of(&columns, &row).contains("nmx names no wavelength"));
        let bands: Vec<String> = (40..=70).map(|k| format!("nm{}", 10 * k)).collect();
        columns.truncate(4);
        columns.extend(bands.iter().map(String::as_str));
        row.truncate(4);
        row.extend([0.5; 31]);
        row[10] = 1e5;
        assert!(warning_of(&columns, &row).contains("nm460 at 15° is 100000"));
    }

    #[test]
    fn percent_is_refused_and_a_bright_angle_is_not() {
        let mut columns = vec!["aspecular_deg".to_owned()];
        columns.extend((40..=70).map(|k| format!("nm{}", 10 * k)));
        let of = |factors: &[f64]| {
            let row = |(k, &factor): (usize, &f64)| {
                let angle = std::iter::once(15.0 * (k + 1) as f64);
                angle.chain([factor; 31]).collect()
            };
            let read = readings(&["aspecular_deg"], &[]);
            let (columns, rows) = (
                columns.clone(),
                factors.iter().enumerate().map(row).collect(),
            );
            let read = MultiAngle {
                columns,
                rows,
                ..read
            };
            read.colors()
        };
        assert!(of(&[40.0, 2.0, 0.3]).is_ok());
        let text = of(&[60.0, 20.0, 3.0]).expect_err("percent").to_string();
        assert!(
            text.contains("is 20, which looks like percent") && text.contains("1 is white"),
            "{text}"
        );
    }

    #[test]
    fn texture_is_kept_angle_by_angle() {
        let notes = readings(
            &["aspecular_deg", "L", "a", "b", "graininess", "sparkle_area"],
            &[15.0, 1.0, 0.0, 0.0, 3.5, f64::NAN],
        );
        assert!(!notes.texture_notes().contains_key("sparkle_area"));
        assert_eq!(
            notes.texture_notes().get("graininess").map(String::as_str),
            Some("15°: 3.5")
        );
    }
}
