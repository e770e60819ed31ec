//! A paint under a virtual multi-angle instrument.

use super::error::WorkshopError;
use crate::color::{Lab, ciede2000};
use crate::export::{self, Gloss, Readings};
use crate::paint::{ASPECULAR_DEG, PaintFile};

/// Most angles that are read at once.
pub const MOST_ANGLES: usize = 256;

/// Reads a paint at these aspecular angles in degrees, at those of the six-angle instruments where none are asked for.
///
/// # Errors
///
/// [`WorkshopError`] for no or too many angles, and for one whose viewer is not above the paint.
pub fn readings(
    paint: &PaintFile,
    aspecular_deg: Option<&[f64]>,
) -> Result<Readings, WorkshopError> {
    let angles = aspecular_deg.unwrap_or(&ASPECULAR_DEG);
    if angles.is_empty() || angles.len() > MOST_ANGLES {
        let message = format!(
            "{} angles are given, accepted are 1 to {MOST_ANGLES}",
            angles.len()
        );
        return Err(WorkshopError::usage("angles", message));
    }
    export::readings(&paint.paint, angles).map_err(|error| WorkshopError::usage("angles", error))
}

/// The same as a `CxF3` document, dated as the measurement that the paint was made of.
///
/// # Errors
///
/// As [`readings`].
pub fn readings_document(
    paint: &PaintFile,
    aspecular_deg: Option<&[f64]>,
) -> Result<String, WorkshopError> {
    let measured_on = paint.provenance.notes.get("measured_on");
    let read = readings(paint, aspecular_deg)?;
    Ok(read.to_cxf(&paint.name, measured_on.map(String::as_str)))
}

/// What a glossmeter reads of a paint.
#[must_use]
pub fn gloss(paint: &PaintFile) -> Gloss {
    export::gloss(&paint.paint)
}

/// CIEDE2000 between two readings, L, a, b each.
#[must_use]
pub fn color_difference(x: [f64; 3], y: [f64; 3]) -> f64 {
    ciede2000(Lab::from(x), Lab::from(y))
}
