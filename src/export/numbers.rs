//! What every number of a document means: path, unit, range and a sentence, group by group.
//!
//! A path names the way from the document's root; `[]` stands for every entry of a list, `*` for every name. Documents of
//! several formats share the groups of what they share. A test walks real documents and fails on a number that is not
//! explained or lies outside its range.

use serde_json::{Map, Value, json};

/// Path, unit, range and meaning.
pub(super) type Number = (&'static str, &'static str, (f64, f64), &'static str);

/// No bound.
pub(super) const ANY: f64 = f64::INFINITY;

/// The documentation of these groups; an end of a range that is not bounded is `null`.
pub(super) fn documentation(groups: &[&[Number]]) -> Value {
    let mut out = Map::new();
    for &(path, unit, range, about) in groups.iter().copied().flatten() {
        let range = [range.0, range.1].map(|v| if v.is_finite() { json!(v) } else { Value::Null });
        out.insert(
            path.into(),
            json!({"unit": unit, "range": range, "about": about}),
        );
    }
    Value::Object(out)
}

/// Coat and base of one paint.
#[rustfmt::skip]
pub(super) const PAINT: &[Number] = &[
    ("version", "1", (1.0, ANY), "version of this document's form; later versions may add, never change"),
    ("coat.ior", "1", (1.0, 4.0), "index of refraction of the clear coat; 1 is optically no coat"),
    ("coat.roughness", "1", (0.0, 1.0), "Beckmann roughness of the coat's highlight; below 0.001 a mirror"),
    ("coat.thickness_um", "micrometre", (0.0, 1e6), "thickness as the lab stated it; not used"),
    ("diffuse[]", "1", (0.0, 1000.0), "Lambertian albedo of the base before the color table, linear sRGB"),
    ("lobes[].weight[]", "1", (0.0, 1000.0), "weight s of the lobe, linear sRGB"),
    ("lobes[].alpha", "1", (0.0, 10.0), "Beckmann roughness, evaluated as at least 0.0001"),
    ("lobes[].f0", "1", (0.0, 1.0), "Schlick reflectance at normal incidence"),
    ("color_table.overall[]", "1", (-ANY, ANY), "the one color that stands for the table, linear sRGB"),
];

/// Angles of color table and flakes.
#[rustfmt::skip]
pub(super) const ANGLES: &[Number] = &[
    ("color_table.theta_h_deg[]", "degree", (0.0, 90.0), "half angle of each row, inside the coat"),
    ("color_table.theta_d_deg[]", "degree", (0.0, 90.0), "difference angle of each column, inside the coat"),
    ("flakes.theta_h_deg[]", "degree", (0.0, 90.0), "half angle of each row of slices, inside the coat"),
    ("flakes.theta_d_deg[]", "degree", (0.0, 90.0), "difference angle of each column of slices, inside the coat"),
];

/// Grain and lifetime of one paint's flakes.
#[rustfmt::skip]
pub(super) const GRAIN: &[Number] = &[
    ("flakes.texel_um", "micrometre", (0.0, 1e5), "side of a texel on the paint"),
    ("flakes.grain_um", "micrometre", (0.0, 1e6), "distance over which the texels' autocorrelation falls to one half"),
    ("flakes.lifetime_deg[]", "degree", (0.0, 1e4), "angle over which a slice's correlation falls to one half, along theta_h and theta_d"),
    ("flakes.persistence_deg[]", "degree", (0.0, 1e4), "angle over which a texel keeps its random number, along theta_h and theta_d"),
    ("flakes.cell_spacing_texels", "texel", (0.0, ANY), "distance of the cells that share a random number"),
];

/// Textures and what their types did to the numbers in them.
#[rustfmt::skip]
pub(super) const TEXTURES: &[Number] = &[
    ("flakes.clusters", "1", (1.0, 16_777_216.0), "clusters of all slices"),
    ("flakes.widest_slice", "1", (1.0, 16_777_216.0), "most clusters of a slice"),
    ("flakes.tile_texels", "texel", (1.0, ANY), "side of the random texture"),
    ("flakes.corner_rounding_lab", "CIELAB", (0.0, ANY), "largest rounding of a box corner in the corner textures"),
    ("textures.*.width", "texel", (1.0, 4096.0), "columns"),
    ("textures.*.height", "texel", (1.0, 4096.0), "rows; row 0 is the first line of the file"),
    ("textures.*.scale[]", "as the texture", (0.0, ANY), "value = offset + scale * texel, texel 0 to 1; absent: value = texel"),
    ("textures.*.offset[]", "as the texture", (-ANY, ANY), "see scale"),
    ("clamped[].count", "1", (1.0, ANY), "numbers of this texture outside the range of its type"),
    ("clamped[].farthest", "as the texture", (-ANY, ANY), "the farthest of them"),
    ("clamped[].limit", "as the texture", (65504.0, 65504.0), "the magnitude they were held to"),
];

/// The distribution in 500 steps.
#[rustfmt::skip]
pub(super) const INVERSE_CDF: &[Number] = &[
    ("flakes.inverse_cdf.steps", "1", (500.0, 500.0), "steps of the inverse cumulative distribution"),
    ("flakes.inverse_cdf.blocks", "1", (1.0, ANY), "slices that stand side by side in a row of its texture"),
    ("flakes.inverse_cdf.probability_loss[]", "1", (0.0, 1.0), "per slice (theta_d fastest): share of draws that show another cluster than they should (total variation)"),
    ("flakes.inverse_cdf.mean_luminance_change[]", "1", (-ANY, ANY), "per slice: change of the mean luminance by the steps, relative; 0 where the mean is below 1e-6 1/sr"),
];

/// What happened on the way to a realisation.
#[rustfmt::skip]
pub(super) const REPORT: &[Number] = &[
    ("report.weights.weights[]", "1", (-1e12, 1e12), "weight of each of report.paints for everything that has no weight of its own; may leave 0 to 1 and need not sum to 1"),
    ("report.weights.base[]", "1", (-1e12, 1e12), "weight of each paint's coat, diffuse, lobes and color table, where given apart"),
    ("report.weights.flake_lightness[]", "1", (-1e12, 1e12), "weight of the lightness of each paint's flakes, with grain and lifetime, where given apart"),
    ("report.weights.flake_color[]", "1", (-1e12, 1e12), "weight of a and b of each paint's flakes, where given apart"),
    ("report.weights.flake_saturation", "1", (-1e12, 1e12), "factor on a and b of the flakes: 0 whitens them, absent is 1"),
    ("report.weight_sums[]", "1", (-ANY, ANY), "sums of the weights of base, flake lightness and flake color; 1 keeps the light of the paints"),
    ("report.clamps[].count", "1", (1.0, ANY), "numbers of `field` that were beyond `bound`"),
    ("report.clamps[].of", "1", (1.0, ANY), "numbers of `field` in all"),
    ("report.clamps[].worst", "as the field", (0.0, ANY), "how far the worst of them was beyond the bound"),
    ("report.correspondence.slices", "1", (0.0, ANY), "angle pairs of the paints' common grid, 0 where none has flakes"),
    ("report.correspondence.clusters", "1", (0.0, ANY), "clusters of all slices"),
    ("report.correspondence.mean_cost", "CIELAB", (0.0, ANY), "mean transport cost of a slice, summed over the paints: the distance that flakes move, or its square where blended so"),
    ("report.correspondence.largest_gap", "CIELAB", (0.0, ANY), "largest gap of a slice between its plan's cost and the dual bound: no plan is further from optimal"),
    ("report.correspondence.joined[].place", "1", (0.0, 4.0), "place in report.paints, from 0, of the paints in the order in which they were joined"),
    ("report.correspondence.pairs[].paints[].place", "1", (0.0, 4.0), "places in report.paints of the two paints"),
    ("report.correspondence.pairs[].mean_cost", "CIELAB", (0.0, ANY), "mean distance between corresponding clusters of the pair, over all slices"),
    ("report.correspondence.pairs[].mean_gap", "CIELAB", (0.0, ANY), "mean excess over the best that the pair alone could have (its dual bound), over the slices that were checked"),
    ("report.correspondence.pairs[].largest_gap", "CIELAB", (0.0, ANY), "largest such excess"),
    ("report.correspondence.pairs[].checked", "1", (0.0, ANY), "slices that were checked"),
    ("report.correspondence.against_exact[].aspecular_deg", "degree", (-90.0, 180.0), "aspecular angle of a geometry, light at 45 degrees"),
    ("report.correspondence.against_exact[].delta_e_2000", "CIEDE2000", (0.0, ANY), "difference of the mean color at equal weights from the blend by exact transport"),
    ("report.correspondence.against_exact[].sparkle", "1", (-ANY, ANY), "relative difference of the 99.9th percentile of the flakes' luminance likewise"),
    ("report.correspondence.against_exact[].lit", "1", (0.0, ANY), "relative difference of how many flakes are lit likewise, fewer than one texel in a thousand counted as that many"),
    ("report.correspondence.mixed[].place", "1", (0.0, 4.0), "place in report.paints, from 0, of a paint whose slices are mixtures, as its angles differ from the common grid"),
    ("report.correspondence.without_flakes[].place", "1", (0.0, 4.0), "place of a paint that has no flakes and counts as black ones"),
    ("report.correspondence.reduced[].place", "1", (0.0, 4.0), "place of a paint whose clusters were reduced"),
    ("report.correspondence.reduced[].from", "1", (1.0, ANY), "clusters of its widest slice before"),
    ("report.correspondence.reduced[].to", "1", (1.0, ANY), "clusters of its widest slice after"),
    ("report.accuracy.error.lab", "CIELAB", (0.0, ANY), "distance by which the flakes are misplaced, against the pixels and exact transport: sum of the terms, of which that of clusters is along lightness; null where one is not known"),
    ("report.accuracy.error.terms[].lab", "CIELAB", (0.0, ANY), "one term of it, null where it is not known; `how` says how it is"),
    ("report.accuracy.error.seen.aspecular_deg[]", "degree", (-90.0, 180.0), "aspecular angles of the instrument geometries, light at 45 degrees; `seen` is null where that was not measured, and `unseen` says why"),
    ("report.accuracy.error.seen.delta_e_2000[]", "CIEDE2000", (0.0, ANY), "error of the mean color there, added up over the steps; `how` says which"),
    ("report.accuracy.error.seen.lit[]", "1", (0.0, ANY), "relative error of how many flakes are lit there, fewer than one texel in a thousand counted as that many"),
    ("report.accuracy.error.seen.sparkle", "1", (0.0, ANY), "relative error of the 99.9th percentile of the flakes' luminance"),
    ("report.accuracy.writing.rounding_w1", "CIELAB", (0.0, ANY), "bound on the distance W1 between the paint's flakes and those of the textures, worst of the slices at the instrument geometries"),
    ("report.accuracy.writing.instrument[]", "CIEDE2000", (0.0, ANY), "difference of the mean color by the textures, per instrument geometry"),
    ("report.accuracy.writing.sparkle[]", "1", (-ANY, ANY), "relative change of the 99.9th percentile of luminance by the textures, per instrument geometry"),
    ("report.accuracy.writing.lit[]", "1", (0.0, ANY), "relative change of how many flakes are lit by the textures, per instrument geometry, counted likewise"),
    ("report.accuracy.writing.inverse_cdf_loss", "1", (0.0, 1.0), "largest share of draws that show another cluster than they should, where flakes are drawn by the 500 steps"),
    ("report.accuracy.sparkle[].aspecular_deg", "degree", (-90.0, 180.0), "aspecular angle of a geometry, light at 45 degrees"),
    ("report.accuracy.sparkle[].luminance[]", "1", (-ANY, ANY), "50th, 90th, 99th and 99.9th percentile of the flakes' luminance factor; 1 is the perfect diffuser"),
    ("report.accuracy.sparkle[].lit_per_mm2", "1/mm^2", (0.0, ANY), "flakes that shine, per square millimetre"),
];

/// The realisation that a paint's provenance tells of.
#[rustfmt::skip]
pub(super) const PROVENANCE: &[Number] = &[
    ("provenance.realisation.base[]", "1", (-1e12, 1e12), "weight of each paint's coat, diffuse, lobes and color table"),
    ("provenance.realisation.flake_lightness[]", "1", (-1e12, 1e12), "weight of the lightness of each paint's flakes, with grain and lifetime"),
    ("provenance.realisation.flake_color[]", "1", (-1e12, 1e12), "weight of a and b of each paint's flakes"),
    ("provenance.realisation.flake_saturation", "1", (-1e12, 1e12), "factor on a and b of the flakes"),
    ("provenance.realisation.clamps[].count", "1", (1.0, ANY), "numbers of `field` that were beyond `bound`"),
    ("provenance.realisation.clamps[].of", "1", (1.0, ANY), "numbers of `field` in all"),
    ("provenance.realisation.clamps[].worst", "as the field", (0.0, ANY), "how far the worst of them was beyond the bound"),
];

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Numbers of a value by path, lists as `[]`, names of textures as `*`.
    fn collect<'a>(value: &'a Value, path: &str, out: &mut BTreeMap<String, Vec<&'a Value>>) {
        match value {
            Value::Number(_) => out.entry(path.to_owned()).or_default().push(value),
            Value::Array(list) => list
                .iter()
                .for_each(|entry| collect(entry, &format!("{path}[]"), out)),
            Value::Object(map) => {
                for (key, entry) in map {
                    let key = if path == "textures" { "*" } else { key };
                    let dot = if path.is_empty() { "" } else { "." };
                    collect(entry, &format!("{path}{dot}{key}"), out);
                }
            }
            _ => {}
        }
    }

    /// Fails when a number of the document is not explained, or lies outside the range that is told.
    pub(crate) fn assert_documented(document: &Value) {
        let mut found = BTreeMap::new();
        for (key, value) in document.as_object().expect("an object") {
            if key != "documentation" {
                collect(value, key, &mut found);
            }
        }
        assert!(found.len() > 10, "only {} kinds of numbers", found.len());
        for (path, numbers) in found {
            let Some(entry) = document["documentation"].get(&path) else {
                panic!("{path} is not documented");
            };
            assert!(entry["unit"].is_string() && entry["about"].is_string());
            let [low, high] = [0, 1].map(|k| entry["range"][k].as_f64());
            for number in numbers {
                let n = number.as_f64().expect("a number");
                let inside = low.is_none_or(|low| n >= low) && high.is_none_or(|high| n <= high);
                assert!(inside, "{path} is {n}, documented as {}", entry["range"]);
            }
        }
    }

    #[test]
    #[should_panic(expected = "report.surprise is not documented")]
    fn an_unexplained_number_is_found_wherever_it_is() {
        let mut document = json!({ "report": { "surprise": 1.0 } });
        document["documentation"] = documentation(&[REPORT]);
        for k in 0..10 {
            document[format!("known{k}")] = 1.into();
            document["documentation"][format!("known{k}")] =
                json!({"unit": "1", "range": [null, null], "about": "known"});
        }
        assert_documented(&document);
    }
}
