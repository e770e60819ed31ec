//! How far a paint is from what a portable instrument read on it.

use std::f64::consts::PI;

use super::from_readings::{directions, is_believed};
use crate::color::{D65_2, Lab, adapted, ciede2000, rgb_to_xyz};
use crate::measurement::MultiAngle;
use crate::paint::{CarPaint, Chi, ReadingError, ReadingResiduals, Reflectance};

/// Compares a paint, flakes at their mean and the coat's mirror image left out, with readings.
///
/// `None` where the readings hold no colors, or none with light and viewer well above the paint. Compared is under the readings'
/// own light, to which the paint's color is adapted, and of spectra under D65; L, a, b of another observer than the 2°
/// keep their numbers, which is marked as approximate: to convert them takes spectra. Model description, section 8.
#[must_use]
pub fn against_readings(paint: &CarPaint, readings: &MultiAngle) -> Option<ReadingResiduals> {
    let colors = readings.colors().ok()?;
    let reflectance = Reflectance::new(paint);
    let rows: Vec<ReadingError> = colors
        .rows
        .iter()
        .filter_map(|&(aspecular_deg, read)| {
            if !is_believed(readings.illumination_deg, aspecular_deg) {
                return None;
            }
            let (wi, wo) = directions(readings.illumination_deg, aspecular_deg);
            let factor = reflectance.evaluate(wi, wo, Chi::Table).map(|f| f * PI);
            let xyz = adapted(rgb_to_xyz(factor), D65_2, colors.white);
            Some(ReadingError {
                aspecular_deg,
                delta_e_2000: ciede2000(Lab::from_xyz(xyz, colors.white), read),
            })
        })
        .collect();
    let mut sorted: Vec<f64> = rows.iter().map(|row| row.delta_e_2000).collect();
    sorted.sort_by(f64::total_cmp);
    let worst = *sorted.last()?;
    let middle = sorted.len() / 2;
    let median = if sorted.len() % 2 == 1 {
        sorted[middle]
    } else {
        f64::midpoint(sorted[middle - 1], sorted[middle])
    };
    Some(ReadingResiduals {
        illumination_deg: readings.illumination_deg,
        rows,
        median,
        worst,
        approximate: colors.approximate,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{Illuminant, Observer, WhitePoint};
    use crate::paint::{ASPECULAR_DEG, ColorTable, instrument_pairs};

    fn gray(diffuse: f64) -> CarPaint {
        CarPaint {
            coat: None,
            diffuse: [diffuse; 3],
            lobes: Vec::new(),
            color_table: ColorTable::white(),
            flakes: None,
        }
    }

    /// What an instrument reads on a paint.
    fn read_on(paint: &CarPaint) -> MultiAngle {
        let reflectance = Reflectance::new(paint);
        let row = |(&angle, (wi, wo)): (&f64, ([f64; 3], [f64; 3]))| {
            let lab = Lab::from_rgb(reflectance.evaluate(wi, wo, Chi::Table).map(|f| f * PI));
            vec![angle, 0.5, lab.l, lab.a, lab.b]
        };
        MultiAngle {
            illumination_deg: 45.0,
            illuminant: Illuminant::D65,
            observer: Observer::Two,
            columns: ["aspecular_deg", "graininess", "L", "a", "b"]
                .map(str::to_owned)
                .to_vec(),
            rows: ASPECULAR_DEG
                .iter()
                .zip(instrument_pairs())
                .map(row)
                .collect(),
        }
    }

    #[test]
    fn a_paint_agrees_with_its_own_readings_and_differs_from_anothers() {
        let own = against_readings(&gray(0.2), &read_on(&gray(0.2))).expect("L, a, b");
        assert_eq!(own.rows.len(), 6);
        assert!(own.worst < 1e-9 && !own.approximate, "{own:?}");
        let other = against_readings(&gray(0.2), &read_on(&gray(0.3))).expect("L, a, b");
        assert!(
            other.median > 5.0 && other.worst >= other.median,
            "{other:?}"
        );
    }

    #[test]
    fn readings_of_another_daylight_are_compared_under_it() {
        let colored = CarPaint {
            diffuse: [0.5, 0.2, 0.05],
            ..gray(0.2)
        };
        let mut readings = read_on(&colored);
        let d50 = WhitePoint::of(Illuminant::D50, Observer::Two);
        readings.illuminant = Illuminant::D50;
        let as_they_are = against_readings(&colored, &readings).expect("L, a, b");
        for row in &mut readings.rows {
            let xyz = Lab::from([row[2], row[3], row[4]]).to_xyz(D65_2);
            row[2..].copy_from_slice(&Lab::from_xyz(adapted(xyz, D65_2, d50), d50).to_array());
        }
        let own = against_readings(&colored, &readings).expect("L, a, b");
        assert!(own.worst < 1e-9 && !own.approximate, "{own:?}");
        assert!(as_they_are.worst > 1.0, "{as_they_are:?}");
    }

    #[test]
    fn spectra_and_viewers_below_the_paint_are_left_out() {
        let mut readings = read_on(&gray(0.2));
        readings.rows.push(vec![-50.0, 0.5, 50.0, 0.0, 0.0]);
        readings.observer = Observer::Ten;
        let own = against_readings(&gray(0.2), &readings).expect("L, a, b");
        assert!(own.rows.len() == 6 && own.approximate, "{own:?}");
        readings.columns[2] = "nm400".to_owned();
        assert_eq!(against_readings(&gray(0.2), &readings), None);
    }
}
