//! Realising a blend, or exporting a paint as it is, to a file that others use.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::describing::describe_correspondence;
use super::{Lap, Laps, Thing, WorkshopError};
use crate::accuracy::{
    Profile, ResultError, SeenError, blend_error, file_error, paint_error, sparkle, writing_error,
};
use crate::blend::{Blend, RealisationWeights};
use crate::export::{self, About, ExportSettings};
use crate::paint::{
    CarPaint, Clamp, Clustering, NAME_CHARACTERS, PaintFile, Provenance, Realisation, certify,
};

/// What a realisation is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Texture bundle.
    Zip,
    /// glTF binary.
    Glb,
    /// `material.json` with the textures inline.
    Json,
    /// A `.paint`, which can be blended again.
    Paint,
}

/// Bytes that were made, and what is known about them.
#[derive(Clone, Debug)]
pub struct Made {
    /// The file.
    pub bytes: Vec<u8>,
    /// What is in it: weights, clamps.
    pub report: Value,
    /// The same for people, one line each.
    pub notes: Vec<String>,
    /// How long each stage took.
    pub stages: Vec<Lap>,
}

impl Format {
    /// Media type of the file.
    #[must_use]
    pub const fn media_type(self) -> &'static str {
        match self {
            Self::Zip => "application/zip",
            Self::Glb => "model/gltf-binary",
            Self::Json => "application/json",
            Self::Paint => "application/vnd.carpaint.paint",
        }
    }

    /// Ending of the file's name.
    #[must_use]
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Zip => "zip",
            Self::Glb => "glb",
            Self::Json => "json",
            Self::Paint => "paint",
        }
    }

    /// The format that a file name's ending means.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for another ending, naming those that are accepted.
    pub fn of_path(path: &Path) -> Result<Self, WorkshopError> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("zip") => Ok(Self::Zip),
            Some("glb") => Ok(Self::Glb),
            Some("json") => Ok(Self::Json),
            Some("paint") => Ok(Self::Paint),
            _ => {
                let problem = format!(
                    "{} ends in none of .zip, .glb, .json, .paint",
                    path.display()
                );
                Err(WorkshopError::usage("out", problem))
            }
        }
    }
}

/// One paint out of a thing, with the account of how it came about.
pub(super) struct Chosen {
    pub name: String,
    pub provenance: Provenance,
    pub paint: CarPaint,
    pub report: Value,
    pub notes: Vec<String>,
}

/// The paint itself, or the blend at the given weights.
pub(super) fn choose(
    thing: &Thing,
    weights: Option<&RealisationWeights>,
) -> Result<Chosen, WorkshopError> {
    match thing {
        Thing::Paint(file) => Ok(Chosen {
            name: file.name.clone(),
            provenance: file.provenance.clone(),
            paint: file.paint.clone(),
            report: json!({ "paint": file.name, "warnings": file.warnings }),
            notes: Vec::new(),
        }),
        Thing::Blend(blend) => of_blend(blend, needed(weights)?),
    }
}

/// Refuses the weights that [`choose`] refuses, and realises nothing.
pub(super) fn check(
    thing: &Thing,
    weights: Option<&RealisationWeights>,
) -> Result<(), WorkshopError> {
    match thing {
        Thing::Paint(_) => Ok(()),
        Thing::Blend(blend) => Ok(blend.check(needed(weights)?)?),
    }
}

fn needed(weights: Option<&RealisationWeights>) -> Result<&RealisationWeights, WorkshopError> {
    weights.ok_or_else(|| WorkshopError::usage("weights", "a blend needs weights"))
}

fn of_blend(blend: &Blend, weights: &RealisationWeights) -> Result<Chosen, WorkshopError> {
    let realised = blend.realise(weights)?;
    let (names, hashes): (Vec<&str>, Vec<&str>) = blend.ingredients().unzip();
    let mut notes: Vec<String> = realised.clamps.iter().map(Clamp::to_string).collect();
    for (what, sum) in ["base", "flake lightness", "flake color"]
        .iter()
        .zip(realised.weight_sums)
    {
        if (sum - 1.0).abs() > 1e-6 {
            notes.push(format!("weights of {what} sum to {sum}, not 1"));
        }
    }
    let report = json!({
        "paints": names,
        "hashes": hashes,
        "weights": weights,
        "weight_sums": realised.weight_sums,
        "clamps": realised.clamps,
        "correspondence": describe_correspondence(blend),
    });
    let provenance = Provenance {
        source: "blend".to_owned(),
        hashes: hashes.iter().map(|&h| h.to_owned()).collect(),
        simulated_flakes: blend.origins().any(|origin| origin.simulated_flakes),
        realisation: Some(Realisation {
            paints: names.iter().map(|&name| name.to_owned()).collect(),
            base: weights.base().to_vec(),
            flake_lightness: weights.flake_lightness().to_vec(),
            flake_color: weights.flake_color().to_vec(),
            flake_saturation: weights.flake_saturation,
            clamps: realised.clamps.clone(),
        }),
        ..Provenance::default()
    };
    Ok(Chosen {
        name: names.join(" + "),
        provenance,
        paint: realised.paint,
        report,
        notes,
    })
}

/// Writes a paint, or a blend at the given weights, as a file of the given format.
///
/// # Errors
///
/// [`WorkshopError`] for a blend without weights, weights it refuses, or an export that fails.
pub fn realise(
    thing: &Thing,
    weights: Option<&RealisationWeights>,
    format: Format,
    profile: &Profile,
) -> Result<Made, WorkshopError> {
    let mut laps = Laps::begin();
    if let (Format::Paint, Thing::Paint(file)) = (format, thing) {
        let accuracy = accuracy(&paint_error(file), &file.paint, None);
        laps.end("error");
        let bytes = file.to_bytes()?;
        laps.end("encode");
        return Ok(Made {
            bytes,
            report: json!({ "paint": file.name, "accuracy": accuracy }),
            notes: Vec::new(),
            stages: laps.into_stages(),
        });
    }
    let mut chosen = choose(thing, weights)?;
    laps.end("realise");
    // Viewers of a GLB see its material, whose own loss stands beside.
    let error = match format {
        Format::Glb => error_of(thing, weights).of_other_material(),
        _ => error_of(thing, weights),
    };
    // Only textures are rounded: a GLB and a .paint carry lists as they are.
    let textures = matches!(format, Format::Zip | Format::Json).then_some(&profile.export);
    chosen.report["accuracy"] = accuracy(&error, &chosen.paint, textures);
    laps.end("error");
    let about = About {
        name: chosen.name.clone(),
        provenance: chosen.provenance.clone(),
        report: chosen.report.clone(),
    };
    let bytes = match format {
        Format::Zip => export::bundle(&chosen.paint, &about, &profile.export)?,
        Format::Glb => {
            let (bytes, loss) = export::glb_and_loss(&chosen.paint, &about)?;
            chosen.notes.push(format!(
                "its material, one lobe under a coat, differs from the paint by CIEDE2000 {:.1} in the median of the six \
                 instrument geometries, {:.1} at worst",
                loss.median, loss.worst
            ));
            chosen.report["accuracy"]["gltf_loss"] = json!(loss);
            bytes
        }
        Format::Json => export::material_json(&chosen.paint, &about, &profile.export)?,
        Format::Paint => {
            let file = paint_file(&chosen, &error);
            laps.end("certificate");
            chosen.notes.extend(file.warnings.iter().cloned());
            file.to_bytes()?
        }
    };
    laps.end("encode");
    Ok(Made {
        bytes,
        report: chosen.report,
        notes: chosen.notes,
        stages: laps.into_stages(),
    })
}

/// How far the file is from what the reference profile would have given, and its sparkle.
fn accuracy(of: &ResultError, paint: &CarPaint, textures: Option<&ExportSettings>) -> Value {
    let writing = textures.and_then(|settings| writing_error(paint, settings));
    json!({
        "error": file_error(of, writing.as_ref()),
        "writing": writing,
        "sparkle": sparkle(paint),
    })
}

/// Error of a thing at some weights as it is written with these settings.
pub(super) fn error_as_written(
    thing: &Thing,
    weights: Option<&RealisationWeights>,
    format: Format,
    settings: &ExportSettings,
) -> Result<ResultError, WorkshopError> {
    let of = error_of(thing, weights);
    if !matches!(format, Format::Zip | Format::Json) {
        return Ok(of);
    }
    let writing = writing_error(&choose(thing, weights)?.paint, settings);
    Ok(file_error(&of, writing.as_ref()))
}

/// Error of a thing at some weights, before anything is written of it.
pub(super) fn error_of(thing: &Thing, weights: Option<&RealisationWeights>) -> ResultError {
    match (thing, weights) {
        (Thing::Paint(file), _) => paint_error(file),
        (Thing::Blend(blend), None) => blend_error(blend),
        (Thing::Blend(blend), Some(weights)) => {
            let size = |weights: &[f64]| weights.iter().map(|w| w.abs()).sum::<f64>();
            let color = size(weights.flake_color()) * weights.flake_saturation.abs();
            let flakes = size(weights.flake_lightness()).max(color);
            blend_error(blend).stretched([flakes, size(weights.base())])
        }
    }
}

/// A realised paint as a paint of its own.
fn paint_file(chosen: &Chosen, error: &ResultError) -> PaintFile {
    let clustering = chosen.paint.flakes.as_ref().map(|f| Clustering {
        clusters: f.widest_slice(),
        box_rule: Clustering::BLENDED.to_owned(),
        angle_step: 1,
        w1_bound: None,
        left_out_w1: None,
        left_out_seen: None,
        error: None,
        realised_lab: error.lab,
        realised_seen: error.seen.as_ref().map(SeenError::kept),
        reduced_w1: None,
        reduced_seen: None,
    });
    let energy = certify(&chosen.paint);
    // What was clamped stands with the provenance.
    let warnings = energy.excess().map(|most| {
        format!(
            "the realisation reflects up to {most:.2} times the light it gets: its weights add light, or one of its paints \
             does so itself"
        )
    });
    PaintFile {
        name: chosen.name.chars().take(NAME_CHARACTERS).collect(),
        provenance: chosen.provenance.clone(),
        energy,
        paint: chosen.paint.clone(),
        clustering,
        residuals: None,
        readings: None,
        warnings: warnings.into_iter().collect(),
    }
}
