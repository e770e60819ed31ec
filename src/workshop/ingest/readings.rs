//! From the readings of an instrument to a paint: what a file of them cannot say, and the fit.

use super::IngestOptions;
use super::fitting::finish;
use super::measurement::ReadingsUpload;
use crate::fit::{PaintFromReadings, against_readings, paint_from_readings};
use crate::measurement::MultiAngle;
use crate::paint::{Coat, Flakes, PaintFile, Provenance};
use crate::workshop::error::Refusal;

/// Index of the clear coat that is assumed where a file cannot say: that of the resins which cars are lacquered with.
const ASSUMED_IOR: f64 = 1.5;

/// Fits readings that came as a file of their own.
pub(super) fn ingest_readings(
    upload: ReadingsUpload,
    name: String,
    options: &IngestOptions,
    ended: &dyn Fn(&'static str),
) -> Result<PaintFile, Refusal> {
    let file = upload.file;
    let mut warnings = file.warnings;
    let coat = match options.coat_ior {
        // An index of 1 is no coat.
        Some(1.0) => None,
        Some(ior) => Some(Coat::smooth(ior)),
        None => {
            warnings.push(format!(
                "readings do not show the clear coat: one of index {ASSUMED_IOR} was assumed, as cars have; --coat-ior, or \
                 coat_ior in a query, says otherwise, 1 that there is none"
            ));
            Some(Coat::smooth(ASSUMED_IOR))
        }
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
    let readings = against_readings(&fitted.paint, &file.readings);
    let paint = finish(name, provenance, fitted.paint, None, None, warnings);
    ended("certificate");
    Ok(PaintFile { readings, ..paint })
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
