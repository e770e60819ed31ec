//! A paint on a page for people: what `show --json` says, in the order a paint is looked at.

use super::page::{Page, range};
use crate::accuracy::{paint_error, sparkle};
use crate::paint::{AngleGrid, Flakes, LuminanceError, PaintFile};
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
    page.line(
        "coat",
        paint.coat.map_or("none".to_owned(), |coat| {
            let finish = if coat.is_mirror() { ", a mirror" } else { "" };
            format!(
                "ior {:.4}, roughness {:.4}{finish}",
                coat.ior, coat.roughness
            )
        }),
    );
    page.line("diffuse", format!("albedo {}", short(&paint.diffuse)));
    let lobe = |k: usize| {
        let lobe = &paint.lobes[k];
        let (alpha, f0) = (lobe.alpha, lobe.f0);
        format!(
            "alpha {alpha:.4}   F0 {f0:.3}   weight {}",
            short(&lobe.weight)
        )
    };
    for k in 0..paint.lobes.len() {
        page.line(if k == 0 { "lobes" } else { "" }, lobe(k));
    }
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
    of_fit(&mut page, file);
    let albedo = file.energy.incidence_deg.iter().zip(&file.energy.albedo);
    page.table(
        "energy",
        if file.energy.conserves {
            "gives back no more light than it gets"
        } else {
            "gives back more light than it gets: the measurement may be uncalibrated"
        },
        [albedo
            .map(|(angle, albedo)| format!("{angle:.4}°: {albedo:.3}").replace(".0000°", "°"))
            .collect::<Vec<_>>()
            .join("   ")],
    );
    let clamps = from.realisation.as_ref().map_or(&[][..], |of| &of.clamps);
    for (k, clamp) in clamps.iter().enumerate() {
        page.line(if k == 0 { "clamped" } else { "" }, clamp);
    }
    for (k, warning) in file.warnings.iter().enumerate() {
        page.line(if k == 0 { "warnings" } else { "" }, warning);
    }
    page.text()
}

fn list(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(f64::to_string).collect();
    texts.join(",")
}

fn short(values: &[f64; 3]) -> String {
    values.map(|v| format!("{v:.4}")).join(" ")
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

fn of_fit(page: &mut Page, file: &PaintFile) {
    let Some(fit) = &file.residuals else {
        page.line(
            "fit",
            "none of a table: the base came as a model, or was fitted to readings",
        );
        return;
    };
    let luminance = |what: &str, of: &LuminanceError| {
        format!(
            "{what}: median {:.1} %, 90th percentile {:.1} % (floor {:.1} % and {:.1} %)",
            100.0 * of.median,
            100.0 * of.p90,
            100.0 * of.floor_median,
            100.0 * of.floor_p90
        )
    };
    let mut rows = vec![
        luminance("luminance", &fit.all),
        luminance("within 5° of the mirror", &fit.near_mirror),
    ];
    rows.extend(fit.instrument.iter().map(|at| {
        format!(
            "{:>6}°   ΔE2000 {:.2} (floor {:.2})",
            at.aspecular_deg, at.fit, at.floor
        )
    }));
    rows.push(format!(
        "{:.2} % of the entries invalid",
        100.0 * fit.invalid_share
    ));
    page.table(
        "fit",
        "the floor is what a free function of θh and θd reaches on this measurement",
        rows,
    );
}
