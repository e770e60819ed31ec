//! From the readings of an instrument to a paint: what a file of them cannot say, and the fit.

use super::IngestOptions;
use super::fitting::finish;
use super::measurement::ReadingsUpload;
use crate::fit::{PaintFromReadings, against_readings, paint_from_readings};
use crate::measurement::MultiAngle;
use crate::paint::{CarPaint, Coat, Flakes, PaintFile, Provenance, ReadingResiduals};
use crate::workshop::error::Refusal;

/// Index of the clear coat that is assumed where a file cannot say: that of the resins which cars are lacquered with.
const ASSUMED_IOR: f64 = 1.5;

/// CIEDE2000 from which on a paint is another than its readings, to an instrument and to the eye.
const FAR: f64 = 3.0;

/// Fits readings that came as a file of their own.
pub(super) fn ingest_readings(
    upload: ReadingsUpload,
    name: String,
    options: &IngestOptions,
    ended: &dyn Fn(&'static str),
) -> Result<PaintFile, Refusal> {
    let file = upload.file;
    let mut warnings = file.warnings;
    let coat = if let Some(ior) = options.coat_ior {
        coat_of_index(ior)
    } else {
        warnings.push(format!(
            "readings do not show the clear coat: one of index {ASSUMED_IOR} was assumed, as cars have; --coat-ior, or coat_ior in a query, says \
             otherwise, 1 that there is none"
        ));
        Some(Coat::smooth(ASSUMED_IOR))
    };
    let fitted = fitted(&file.readings, coat, None, &mut warnings)?;
    ended("base");
    let mut notes = file.notes;
    notes.extend(file.readings.texture_notes());
    let provenance = Provenance {
        source: upload.layout.name().to_owned(),
        hashes: vec![upload.hash.to_hex().to_string()],
        notes,
        ..Provenance::default()
    };
    let readings = compared(&fitted.paint, &file.readings, &mut warnings);
    let paint = finish(name, provenance, fitted.paint, None, None, warnings);
    ended("certificate");
    Ok(PaintFile { readings, ..paint })
}

/// A coat of an index that somebody says; 1 is none.
pub(super) fn coat_of_index(ior: f64) -> Option<Coat> {
    (ior != 1.0).then(|| Coat::smooth(ior))
}

/// How far a paint is from readings, and what a reader of that should know.
pub(super) fn compared(
    paint: &CarPaint,
    readings: &MultiAngle,
    warnings: &mut Vec<String>,
) -> Option<ReadingResiduals> {
    let against = against_readings(paint, readings)?;
    if against.approximate {
        warnings.push(
            "L, a, b were read by the 10° observer and are taken as those of the 2°, as the paint's own readings are: for \
             colors far from gray the two differ by several units; spectra have no observer"
                .to_owned(),
        );
    }
    let farthest = against.rows.iter();
    if let Some(farthest) = farthest.max_by(|a, b| a.delta_e_2000.total_cmp(&b.delta_e_2000))
        && farthest.delta_e_2000 > FAR
    {
        warnings.push(format!(
            "at {}° the paint is {:.1} CIEDE2000 from what the instrument read",
            farthest.aspecular_deg, farthest.delta_e_2000
        ));
    }
    Some(against)
}

/// Fits a base to readings, under the coat and the flakes that are known.
pub(super) fn fitted(
    readings: &MultiAngle,
    coat: Option<Coat>,
    flakes: Option<Flakes>,
    warnings: &mut Vec<String>,
) -> Result<PaintFromReadings, String> {
    let flakeless = flakes.is_none();
    let fitted = paint_from_readings(readings, coat, flakes).map_err(|e| e.to_string())?;
    warnings.extend(fitted.warnings.iter().cloned());
    if flakeless {
        warnings.push(
            "readings do not show flakes: the paint has none; with pictures of them a package makes one that sparkles"
                .to_owned(),
        );
    }
    Ok(fitted)
}
