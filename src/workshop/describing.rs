//! What is known about a paint or a blend, as one JSON object: the same for HTTP and for the command line.

use serde_json::{Value, json};

use crate::accuracy::{Profile, blend_error, paint_error, sparkle};
use crate::blend::{Blend, Order};
use crate::export::readings;
use crate::paint::{ASPECULAR_DEG, PaintFile};

/// Parameters, readings, residuals with their floor, energy certificate, flake statistics and warnings of a paint.
#[must_use]
pub fn describe_paint(file: &PaintFile) -> Value {
    let paint = &file.paint;
    let readings: Vec<Value> = readings(paint, &ASPECULAR_DEG)
        .into_iter()
        .flat_map(|read| read.rows)
        .map(|[angle, l, a, b]| json!({ "aspecular_deg": angle, "L": l, "a": a, "b": b }))
        .collect();
    let table = &paint.color_table;
    json!({
        "name": file.name,
        "hash": paint.content_hash().to_hex().to_string(),
        "provenance": file.provenance,
        "parameters": {
            "coat": paint.coat,
            "diffuse": paint.diffuse,
            "lobes": paint.lobes,
            "color_table": { "theta_h": table.theta_h().len(), "theta_d": table.theta_d().len(), "overall": table.overall() },
        },
        "flakes": paint.flakes.as_ref().map(|flakes| json!({
            "theta_h_deg": flakes.theta_h.degrees(),
            "theta_d_deg": flakes.theta_d.degrees(),
            "slices": flakes.slices(),
            "clusters": flakes.clusters(),
            "widest_slice": flakes.widest_slice(),
            "texel_um": flakes.texture.texel_um,
            "grain_um": flakes.texture.grain_um,
            "lifetime_deg": flakes.texture.lifetime_deg,
            "persistence_deg": flakes.texture.persistence_deg,
            "clustering": file.clustering,
            "sparkle": sparkle(paint),
        })),
        "error": paint_error(file),
        "readings": { "illuminant": "D65", "observer": "2", "illumination_deg": 45, "rows": readings },
        "residuals": file.residuals,
        "multi_angle": file.readings,
        "clamps": file.provenance.realisation.as_ref().map_or(&[][..], |of| &of.clamps),
        "energy": file.energy,
        "warnings": file.warnings,
    })
}

/// How the paints of a blend correspond. Paints are named, with their place in the order asked for.
pub(super) fn describe_correspondence(blend: &Blend) -> Value {
    let names: Vec<&str> = blend.ingredients().map(|(name, _)| name).collect();
    let report = blend.report();
    let told = |places: &[usize]| -> Vec<Value> {
        let asked = places.iter().filter_map(|&place| blend.asked_at(place));
        asked
            .map(|k| json!({ "place": k, "name": names[k] }))
            .collect()
    };
    let reduced: Vec<Value> = blend
        .origins()
        .enumerate()
        .filter_map(|(k, origin)| origin.reduced.as_ref().map(|by| (k, by)))
        .map(|(k, by)| json!({ "place": k, "name": names[k], "from": by.from, "to": by.to }))
        .collect();
    let mut correspondence = json!(report);
    correspondence["mixed"] = told(&report.mixed).into();
    correspondence["without_flakes"] = told(&report.without_flakes).into();
    correspondence["reduced"] = reduced.into();
    // Weights follow the order asked for; the paints are joined in this one.
    correspondence["order"] = match blend.settings().order.among(blend.len()) {
        Order::Canonical => "content hash".into(),
        Order::Sampled => "cheapest on a few slices".into(),
        Order::Cheapest => "cheapest".into(),
    };
    correspondence["joined"] = told(&report.order).into();
    for (k, pair) in report.pairs.iter().enumerate() {
        correspondence["pairs"][k]["paints"] = told(&pair.paints).into();
    }
    correspondence
}

/// What the caller of a blend with this profile should know: what the profile could not turn any more, what was reduced,
/// mixed or smoothed.
#[must_use]
pub fn blend_notes(blend: &Blend, profile: &Profile) -> Vec<String> {
    let (wanted, report) = (&profile.flakes, blend.report());
    let mut notes = Vec::new();
    let of_each = blend.ingredients().zip(blend.clusterings());
    for (((name, _), clustering), origin) in of_each.zip(blend.origins()) {
        let rule = wanted.box_rule.name();
        if let Some(had) = clustering
            && !had.is_of_blend()
            && (had.clusters != wanted.clusters || had.box_rule != rule)
        {
            notes.push(format!(
                "{name}: is clustered as it was ingested, with {} clusters a slice and {} boxes; the profile's {} and {rule} \
                 are for measurements",
                had.clusters, had.box_rule, wanted.clusters
            ));
        }
        if let Some(by) = &origin.thinned {
            notes.push(format!(
                "{name}: {} of {} flake slices were used, one angle in {} on either grid",
                by.to, by.from, by.step
            ));
        }
        if let Some(by) = &origin.reduced {
            notes.push(format!(
                "{name}: up to {} clusters a slice were reduced to {}",
                by.from, by.to
            ));
        }
    }
    if report.smoothed_more > 0 {
        notes.push(format!(
            "{} of {} slices were smoothed more than epsilon says, to converge; the gap tells what that costs",
            report.smoothed_more, report.slices
        ));
    }
    let names: Vec<&str> = blend.ingredients().map(|(name, _)| name).collect();
    let named = |place: usize| blend.asked_at(place).map_or("", |k| names[k]);
    for &place in &report.mixed {
        notes.push(format!(
            "{}: its angles differ from the common grid of {} slices; slices in between are mixtures of their neighbours",
            named(place), report.slices
        ));
    }
    for &place in &report.without_flakes {
        notes.push(format!(
            "{}: has no flakes and counts as black ones",
            named(place)
        ));
    }
    notes
}

/// Ingredients, settings and correspondence of a blend.
#[must_use]
pub fn describe_blend(blend: &Blend) -> Value {
    let paints: Vec<Value> = blend
        .ingredients()
        .zip(blend.origins())
        .zip(blend.bases())
        .map(|(((name, hash), origin), (coat, diffuse, lobes))| {
            json!({
                "name": name,
                "hash": hash,
                "simulated_flakes": origin.simulated_flakes,
                "parameters": { "coat": coat, "diffuse": diffuse, "lobes": lobes },
                "residuals": origin.residuals,
                "energy": origin.energy,
                "clamps": origin.clamps,
                "warnings": origin.warnings,
            })
        })
        .collect();
    json!({
        "paints": paints,
        "weights": format!("{} numbers, in this order", blend.len()),
        "settings": blend.settings(),
        "correspondence": describe_correspondence(blend),
        "error": blend_error(blend),
        "flakes": blend.flakes.as_ref().map(|f| json!({
            "theta_h_deg": f.theta_h.degrees(),
            "theta_d_deg": f.theta_d.degrees(),
            "textures": blend.textures().collect::<Vec<_>>(),
        })),
    })
}
