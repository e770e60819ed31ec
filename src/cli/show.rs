//! `carpaint show`: everything known about a paint or a blend.

mod blend_page;
mod page;
mod paint_page;

use clap::Args;

use super::ingest::ReadingArgs;
use super::output;
use super::profile::ProfileArgs;
use super::progress::Progress;
use crate::paint::{InstrumentError, PaintFile};
use crate::workshop::{Thing, WorkshopError, describe_blend, describe_paint, open};
use blend_page::blend_page;
use paint_page::paint_page;

/// Show a paint or a blend: parameters, residuals beside their floor, energy, grain, lifetime, warnings.
#[derive(Args, Clone, Debug)]
pub struct Show {
    /// A .paint, a .blend, a sample or a measurement.
    #[arg(value_name = "PAINT|BLEND|sample")]
    input: String,
    #[command(flatten)]
    profile: ProfileArgs,
}

impl Show {
    pub fn run(&self, json: bool) -> Result<(), WorkshopError> {
        let options = ReadingArgs::default().options(None, &self.profile)?;
        let progress = Progress::reading(&self.input);
        let thing = open(&self.input, &options, &|share| progress.at(share))?;
        drop(progress);
        let text = match (thing, json) {
            (Thing::Paint(paint), true) => return output::print_json(&describe_paint(&paint)),
            (Thing::Blend(blend), true) => return output::print_json(&describe_blend(&blend)),
            (Thing::Paint(paint), false) => paint_page(&paint),
            (Thing::Blend(blend), false) => blend_page(&blend),
        };
        output::print(&text)
    }
}

/// One line for people.
pub fn one_line(paint: &PaintFile) -> String {
    let mut parts = vec![paint.name.clone()];
    if let Some(coat) = paint.paint.coat {
        parts.push(format!("coat of ior {:.3}", coat.ior));
    }
    if let Some(flakes) = &paint.paint.flakes {
        let t = &flakes.texture;
        parts.push(format!(
            "{} slices of up to {} clusters, grain {:.0} µm, lifetime {:.1}°",
            flakes.slices(),
            flakes.widest_slice(),
            t.grain_um,
            t.lifetime_deg[0]
        ));
    }
    if let Some(r) = &paint.residuals {
        parts.push(format!(
            "luminance error {:.1} % (floor {:.1} %)",
            100.0 * r.all.median,
            100.0 * r.all.floor_median
        ));
        let worst = |get: &dyn Fn(&InstrumentError) -> f64| {
            r.instrument.iter().map(get).fold(0.0, f64::max)
        };
        parts.push(format!(
            "color error up to {:.1} ΔE2000 (floor {:.1})",
            worst(&|at| at.fit),
            worst(&|at| at.floor)
        ));
    }
    parts.join(" · ")
}
