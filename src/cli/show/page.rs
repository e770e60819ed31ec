//! A page for people: what something is on the left, how it is on the right.

use std::fmt::{Display, Write as _};

use crate::accuracy::ResultError;
use crate::paint::{AngleGrid, Coat, EnergyCertificate, FitResiduals, Lobe, LuminanceError};

/// Lines of a page: a word on the left, what it is on the right.
#[derive(Default)]
pub struct Page(String);

impl Page {
    pub fn line(&mut self, word: &str, text: impl Display) {
        let _ = writeln!(self.0, "{word:<14} {text}");
    }

    pub fn table(&mut self, word: &str, head: &str, rows: impl IntoIterator<Item = String>) {
        self.line(word, head);
        for row in rows {
            self.line("", row);
        }
    }

    /// Coat, diffuse albedo and lobes of a paint.
    pub fn base(&mut self, coat: Option<Coat>, diffuse: &[f64; 3], lobes: &[Lobe]) {
        self.line(
            "coat",
            coat.map_or("none".to_owned(), |coat| {
                let finish = if coat.is_mirror() { ", a mirror" } else { "" };
                format!(
                    "ior {:.4}, roughness {:.4}{finish}",
                    coat.ior, coat.roughness
                )
            }),
        );
        self.line("diffuse", format!("albedo {}", short(diffuse)));
        let lobe = |lobe: &Lobe| {
            let (alpha, f0) = (lobe.alpha, lobe.f0);
            format!(
                "alpha {alpha:.4}   F0 {f0:.3}   weight {}",
                short(&lobe.weight)
            )
        };
        let lobes: Vec<String> = lobes.iter().map(lobe).collect();
        self.list("lobes", &lobes);
    }

    /// How well a base was fitted to a measured table.
    pub fn fit(&mut self, fit: &FitResiduals) {
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
        self.table(
            "fit",
            "the floor is what a free function of θh and θd reaches; a smooth fit may stay below it where the measurement is noisy",
            rows,
        );
    }

    /// How much of the light that falls on a paint it gives back.
    pub fn energy(&mut self, energy: &EnergyCertificate) {
        let albedo = energy.incidence_deg.iter().zip(&energy.albedo);
        let albedo: Vec<String> = albedo
            .map(|(angle, albedo)| format!("{angle:.4}°: {albedo:.3}").replace(".0000°", "°"))
            .collect();
        self.table(
            "energy",
            if energy.conserves {
                "gives back no more light than it gets"
            } else {
                "gives back more light than it gets: the measurement may be uncalibrated"
            },
            [albedo.join("   ")],
        );
    }

    /// Several lines under one word.
    pub fn list(&mut self, word: &str, texts: &[impl Display]) {
        for (k, text) in texts.iter().enumerate() {
            self.line(if k == 0 { word } else { "" }, text);
        }
    }

    /// How far a result is from the reference, term by term.
    pub fn error(&mut self, error: &ResultError) {
        for term in &error.terms {
            let how_far = term
                .lab
                .map_or("not known".to_owned(), |lab| format!("{lab:.3} Lab"));
            self.line("error", format!("{}: {how_far} ({})", term.what, term.how));
        }
        if let Some(seen) = &error.seen {
            let worst = |errors: &[f64; 6]| errors.iter().copied().fold(0.0, f64::max);
            self.line(
                "seen",
                format!(
                    "ΔE2000 up to {:.2} and {:.1} % of the lit flakes at the instrument geometries, {:.1} % of the sparkle ({})",
                    worst(&seen.delta_e_2000),
                    100.0 * worst(&seen.lit),
                    100.0 * seen.sparkle,
                    seen.how
                ),
            );
        }
        if let Some(why) = error.unseen {
            self.line("seen", format!("not known: {why}"));
        }
    }

    pub fn text(self) -> String {
        self.0
    }
}

fn short(values: &[f64; 3]) -> String {
    values.map(|v| format!("{v:.4}")).join(" ")
}

/// How many angles, and from where to where.
pub fn range(grid: &AngleGrid) -> String {
    let angles = grid.degrees();
    format!(
        "{} of {:.1}..{:.1}°",
        angles.len(),
        angles[0],
        angles[angles.len() - 1]
    )
}
