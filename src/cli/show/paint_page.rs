//! A paint on a page for people: what `show --json` says, in the order a paint is looked at.

use super::page::{Page, range};
use crate::accuracy::{paint_error, sparkle};
use crate::paint::{AngleGrid, Flakes, PaintFile};
use crate::workshop::readings;

/// The page of a paint.
pub fn paint_page(file: &PaintFile) -> String {
    let mut page = Page::default();
    let (paint, from) = (&file.paint, &file.provenance);
    let simulated = if from.simulated_flakes {
        ", flakes simulated"
    } else {
        ""
    };
    page.line("paint", &file.name);
    page.line("source", format!("{}{simulated}", from.source));
    for (key, note) in &from.notes {
        page.line("", format!("{key}: {note}"));
    }
    if let Some(of) = &from.realisation {
        page.line(
            "realised at",
            format!(
                "base {}, flake lightness {}, flake color {}, saturation {}",
                list(&of.base),
                list(&of.flake_lightness),
                list(&of.flake_color),
                of.flake_saturation
            ),
        );
    }
    page.line("content", paint.content_hash().to_hex());
    page.base(paint.coat, &paint.diffuse, &paint.lobes);
    let table = &paint.color_table;
    page.line(
        "color table",
        format!(
            "{} θh x {} θd",
            table.theta_h().len(),
            table.theta_d().len()
        ),
    );
    if let Ok(read) = readings(file, None) {
        let rows = read.rows.iter().map(|[angle, l, a, b]| {
            format!(
                "{angle:>6}°   L {l:>7.2}   a {a:>7.2}   b {b:>7.2}{}",
                against(file, *angle)
            )
        });
        page.table("readings", "light at 45°, D65, 2° observer", rows);
    }
    match &paint.flakes {
        Some(flakes) => of_flakes(&mut page, file, flakes),
        None => page.line("flakes", "none"),
    }
    match &file.residuals {
        Some(fit) => page.fit(fit),
        None if from.is_blend() => page.line("fit", "none: it is a realisation of a blend"),
        None => page.line(
            "fit",
            "none of a table: the base came as a model, or was fitted to readings",
        ),
    }
    page.energy(&file.energy);
    page.list(
        "clamped",
        from.realisation.as_ref().map_or(&[][..], |of| &of.clamps),
    );
    page.list("warnings", &file.warnings);
    page.text()
}

fn list(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(f64::to_string).collect();
    texts.join(",")
}

/// What the instrument that came with the measurement says of the same angle.
fn against(file: &PaintFile, aspecular_deg: f64) -> String {
    // Only of the same light; the table's stands at 45°.
    let of_this_light = file
        .readings
        .iter()
        .filter(|of| of.illumination_deg == 45.0);
    let mut rows = of_this_light.flat_map(|of| &of.rows);
    let row = rows.find(|row| row.aspecular_deg == aspecular_deg);
    row.map_or(String::new(), |row| {
        format!("   ΔE2000 to the lab's reading {:.2}", row.delta_e_2000)
    })
}

fn of_flakes(page: &mut Page, file: &PaintFile, flakes: &Flakes) {
    let texture = &flakes.texture;
    let lasts = |degrees: f64, widest: f64| {
        if degrees < widest {
            format!("{degrees:.1}°")
        } else {
            "longer than measured".to_owned()
        }
    };
    let widest = |grid: &AngleGrid| grid.degrees()[grid.len() - 1];
    page.table(
        "flakes",
        &format!(
            "slices: θh {}, θd {}",
            range(&flakes.theta_h),
            range(&flakes.theta_d)
        ),
        [
            format!(
                "{} clusters, up to {} a slice",
                flakes.clusters(),
                flakes.widest_slice()
            ),
            format!(
                "texel {:.1} µm, grain {:.1} µm",
                texture.texel_um, texture.grain_um
            ),
            format!(
                "lifetime {} along θh, {} along θd",
                lasts(texture.lifetime_deg[0], widest(&flakes.theta_h)),
                lasts(texture.lifetime_deg[1], widest(&flakes.theta_d))
            ),
        ],
    );
    let rows = sparkle(&file.paint).into_iter().map(|of| {
        let [half, ninth, hundredth, thousandth] = of.luminance;
        format!(
            "{:>6}°   {:>6.1} lit/mm²   luminance {half:.3} | {ninth:.3} | {hundredth:.3} | {thousandth:.3}",
            of.aspecular_deg, of.lit_per_mm2
        )
    });
    page.table(
        "sparkle",
        "median | 90 % | 99 % | 99.9 % of the texels",
        rows,
    );
    page.error(&paint_error(file));
}
