//! What a multi-angle instrument sees of a paint, with the flakes' mean taken from wherever a caller likes.
//!
//! Errors of mean color are judged at the six geometries of a hand-held instrument (light at 45°): each needs the base
//! there and at most four slices, so that no other slice is looked at.

use std::f64::consts::PI;

use crate::color::{Lab, LinearRgb};
use crate::paint::{
    ASPECULAR_DEG, AngleGrid, CarPaint, Chi, HalfAngles, Reflectance, Terms, instrument_pairs,
};

/// One instrument geometry on one paint.
#[derive(Clone, Debug)]
pub(super) struct Geometry {
    /// Aspecular angle, degrees.
    pub aspecular_deg: f64,
    terms: Terms,
}

/// The six geometries of a paint; its flakes are not looked at.
pub(super) fn geometries(paint: &CarPaint) -> Vec<Geometry> {
    let base = CarPaint {
        flakes: None,
        ..without_flakes(paint)
    };
    let reflectance = Reflectance::new(&base);
    ASPECULAR_DEG
        .iter()
        .zip(instrument_pairs())
        .filter_map(|(&aspecular_deg, (wi, wo))| {
            let terms = reflectance.terms(wi, wo, Chi::Table)?;
            Some(Geometry {
                aspecular_deg,
                terms,
            })
        })
        .collect()
}

/// The paint without its flakes, which are the most of it.
fn without_flakes(paint: &CarPaint) -> CarPaint {
    CarPaint {
        coat: paint.coat,
        diffuse: paint.diffuse,
        lobes: paint.lobes.clone(),
        color_table: paint.color_table.clone(),
        flakes: None,
    }
}

impl Geometry {
    /// Angles inside the coat.
    pub fn half(&self) -> &HalfAngles {
        &self.terms.half
    }

    /// Slices of a grid that meet here, with their weights; θd fastest.
    pub fn slices(&self, theta_h: &AngleGrid, theta_d: &AngleGrid) -> Vec<(f64, usize)> {
        slices_at(
            theta_h,
            theta_d,
            self.half().theta_h.to_degrees(),
            self.half().theta_d.to_degrees(),
        )
    }

    /// Luminance of the base under the coat, as a reflectance factor.
    pub fn base_luminance(&self) -> f64 {
        PI * crate::color::luminance(self.terms.base)
    }

    /// Reading with flakes of this mean, 1/sr.
    pub fn lab(&self, flakes: LinearRgb) -> Lab {
        let t = &self.terms;
        Lab::from_rgb(std::array::from_fn(|k| {
            PI * (t.transmission * (t.base[k] + flakes[k]) + t.highlight).max(0.0)
        }))
    }
}

/// Slices of a grid that meet at an angle pair in degrees, with their bilinear weights; θd fastest.
pub(super) fn slices_at(
    theta_h: &AngleGrid,
    theta_d: &AngleGrid,
    theta_h_deg: f64,
    theta_d_deg: f64,
) -> Vec<(f64, usize)> {
    let (row, column) = (theta_h.bracket(theta_h_deg), theta_d.bracket(theta_d_deg));
    let mut met = Vec::with_capacity(4);
    for (h, u) in [(row.low, 1.0 - row.fraction), (row.high, row.fraction)] {
        for (d, v) in [
            (column.low, 1.0 - column.fraction),
            (column.high, column.fraction),
        ] {
            if u * v > 0.0 {
                met.push((u * v, h * theta_d.len() + d));
            }
        }
    }
    met
}

/// Weighted sum of colors.
pub(super) fn mixed(parts: impl Iterator<Item = (f64, LinearRgb)>) -> LinearRgb {
    parts.fold([0.0; 3], |sum, (weight, color)| {
        std::array::from_fn(|k| sum[k] + weight * color[k])
    })
}
