//! A blend on a page for people: what `show --json` says, in the order a blend is looked at.

use serde_json::{Value, json};

use super::page::{Page, range};
use crate::accuracy::blend_error;
use crate::blend::{Blend, Order};

/// The page of a blend.
pub fn blend_page(blend: &Blend) -> String {
    let mut page = Page::default();
    let names: Vec<&str> = blend.ingredients().map(|(name, _)| name).collect();
    let report = blend.report();
    page.line("blend", names.join(", "));
    page.line("weights", format!("{} numbers, in this order", names.len()));
    let paints = blend.ingredients().zip(blend.origins()).zip(blend.bases());
    for (k, (((name, hash), origin), (coat, diffuse, lobes))) in paints.enumerate() {
        let simulated = if origin.simulated_flakes {
            ", flakes simulated"
        } else {
            ""
        };
        let reduced = origin.reduced.as_ref().map_or(String::new(), |by| {
            format!(", reduced from {} to {} clusters a slice", by.from, by.to)
        });
        page.line(
            &format!("paint {}", k + 1),
            format!("{name}{simulated}{reduced}"),
        );
        page.line("", format!("content {hash}"));
        page.base(coat, &diffuse, lobes);
        if let Some(texture) = blend.textures().nth(k) {
            page.line(
                "",
                format!(
                    "texel {:.1} µm, grain {:.1} µm, lifetime {:.1}° along θh, {:.1}° along θd",
                    texture.texel_um,
                    texture.grain_um,
                    texture.lifetime_deg[0],
                    texture.lifetime_deg[1]
                ),
            );
        }
        if let Some(fit) = &origin.residuals {
            page.fit(fit);
        }
        if let Some(energy) = &origin.energy {
            page.energy(energy);
        }
        page.list("clamped", &origin.clamps);
        page.list("warnings", &origin.warnings);
    }
    match &blend.flakes {
        None => page.line("flakes", "none"),
        Some(flakes) => page.table(
            "flakes",
            &format!(
                "slices: θh {}, θd {}",
                range(&flakes.theta_h),
                range(&flakes.theta_d)
            ),
            [format!(
                "{} corresponding clusters in {} slices",
                report.clusters, report.slices
            )],
        ),
    }
    let called = |places: &[usize]| called(blend, places);
    if !report.mixed.is_empty() {
        let whose = called(&report.mixed);
        let what = "angles differ from the common ones: slices in between are mixed";
        page.line("mixed", format!("{whose}: {what}"));
    }
    if !report.without_flakes.is_empty() {
        let whose = called(&report.without_flakes);
        let what = "no flakes of its own: one black cluster";
        page.line("without flakes", format!("{whose}: {what}"));
    }
    of_transport(&mut page, blend);
    page.error(&blend_error(blend));
    page.text()
}

/// Names of the paints at these places in the order of content hashes.
fn called(blend: &Blend, places: &[usize]) -> String {
    let asked = places.iter().filter_map(|&place| blend.asked_at(place));
    let names = asked.filter_map(|k| blend.ingredients().nth(k));
    names.map(|(name, _)| name).collect::<Vec<_>>().join(", ")
}

fn of_transport(page: &mut Page, blend: &Blend) {
    let report = blend.report();
    let called = |places: &[usize]| called(blend, places);
    let settings = blend.settings();
    let order = match settings.order.among(blend.len()) {
        Order::Canonical => "by content hash",
        Order::Sampled => "the cheapest as a few slices tell",
        Order::Cheapest => "the cheapest of all",
    };
    let named = |value: Value| match value {
        Value::String(name) => name.replace('_', " "),
        other => other.to_string(),
    };
    let (method, cost) = (named(json!(settings.method)), named(json!(settings.cost)));
    page.table(
        "transport",
        &format!(
            "{method}, cost {cost}, order {order}: {}",
            called(&report.order)
        ),
        [format!(
            "mean cost {:.3} a slice, none more than {:.1e} above its dual bound",
            report.mean_cost, report.largest_gap
        )],
    );
    for pair in &report.pairs {
        page.line(
            "",
            format!(
                "{}: {:.3} Lab apart, {:.1e} more than the best of the pair alone",
                called(&pair.paints),
                pair.mean_cost,
                pair.mean_gap
            ),
        );
    }
    for at in &report.against_exact {
        page.line(
            "",
            format!(
                "{:>6}°   ΔE2000 {:.3} to exact transport, sparkle {:.2} %{}",
                at.aspecular_deg,
                at.delta_e_2000,
                100.0 * at.sparkle,
                at.lit.map_or(String::new(), |lit| format!(
                    ", lit flakes {:.2} %",
                    100.0 * lit
                ))
            ),
        );
    }
}
