//! The bundle of a whole blend, from which others take every realisation themselves.

use serde_json::json;

use super::describing::describe_correspondence;
use super::{Laps, Made, Thing, WorkshopError};
use crate::accuracy::{Profile, bundle_error};
use crate::blend::Blend;
use crate::export::{self, About};
use crate::paint::Provenance;

/// Writes all paints of a blend as one texture bundle whose shader mixes them at any weights.
///
/// # Errors
///
/// [`WorkshopError`] for a single paint, which has nothing to mix, a profile without alias tables, or an export that fails.
pub fn bundle_blend(thing: &Thing, profile: &Profile) -> Result<Made, WorkshopError> {
    match thing {
        Thing::Blend(blend) => of_blend(blend, profile),
        Thing::Paint(file) => {
            let problem = format!(
                "{} is one paint, which has no weights to move: realise it to a .zip instead",
                file.name
            );
            Err(WorkshopError::usage("blend", problem))
        }
    }
}

fn of_blend(blend: &Blend, profile: &Profile) -> Result<Made, WorkshopError> {
    if !profile.export.alias {
        let problem = "draw=inverse_cdf is of one realisation: the bundle of a blend draws by alias tables, \
                       accepted is draw=alias or draw=both";
        return Err(WorkshopError::usage("profile", problem));
    }
    let mut laps = Laps::begin();
    let (names, hashes): (Vec<&str>, Vec<&str>) = blend.ingredients().unzip();
    let report = json!({
        "paints": names,
        "hashes": hashes,
        "correspondence": describe_correspondence(blend),
        // At weights between 0 and 1 that sum to 1.
        "accuracy": { "error": bundle_error(blend, &profile.export) },
    });
    laps.end("error");
    let about = About {
        name: names.join(" + "),
        provenance: Provenance {
            source: "blend".to_owned(),
            hashes: hashes.iter().map(|&h| h.to_owned()).collect(),
            simulated_flakes: blend.origins().any(|origin| origin.simulated_flakes),
            ..Provenance::default()
        },
        report: report.clone(),
    };
    let bytes = export::blend_bundle(blend, &about, &profile.export)?;
    laps.end("encode");
    Ok(Made {
        bytes,
        report,
        notes: Vec::new(),
        stages: laps.into_stages(),
    })
}
