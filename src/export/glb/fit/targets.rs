//! What a glTF material should look like: the paint at the instrument's geometries and beside them.

use super::loss::reflected;
use crate::color::{Lab, LinearRgb};
use crate::export::glb::brdf::Cosines;
use crate::paint::{Chi, Direction, Reflectance, instrument_pairs};

/// Weight of the pairs beside the instrument's.
const BESIDE: f64 = 0.1;

/// A pair of directions and what the paint shows there.
pub(super) struct Target {
    pub(super) cosines: Cosines,
    pub(super) color: LinearRgb,
    pub(super) lab: Lab,
    pub(super) metric: Metric,
    pub(super) weight: f64,
}

/// CIEDE2000 near one color: differences of lightness, chroma and hue over their tolerances.
pub(super) struct Metric {
    chroma_axis: [f64; 2],
    tolerance: [f64; 3],
}

impl Metric {
    fn at(lab: Lab) -> Self {
        let chroma = lab.a.hypot(lab.b);
        let chroma_axis = if chroma > 1e-9 {
            [lab.a / chroma, lab.b / chroma]
        } else {
            [1.0, 0.0]
        };
        let l50 = (lab.l - 50.0).powi(2);
        let tolerance = [
            1.0 + 0.015 * l50 / (20.0 + l50).sqrt(),
            1.0 + 0.045 * chroma,
            1.0 + 0.015 * chroma,
        ];
        Self {
            chroma_axis,
            tolerance,
        }
    }

    pub(super) fn difference(&self, from: Lab, to: Lab) -> [f64; 3] {
        let [u, v] = self.chroma_axis;
        let (da, db) = (to.a - from.a, to.b - from.b);
        let parts = [to.l - from.l, u * da + v * db, u * db - v * da];
        std::array::from_fn(|k| parts[k] / self.tolerance[k])
    }
}

fn target(
    reflectance: &Reflectance<'_>,
    (wi, wo): (Direction, Direction),
    weight: f64,
) -> Option<Target> {
    let color = reflectance.evaluate(wi, wo, Chi::Table);
    let lab = reflected(color);
    Cosines::of(wi, wo).map(|cosines| Target {
        cosines,
        color,
        lab,
        metric: Metric::at(lab),
        weight,
    })
}

/// What the paint shows at the instrument's geometries and beside them.
pub(super) fn targets(reflectance: &Reflectance<'_>) -> Vec<Target> {
    instrument_pairs()
        .into_iter()
        .map(|pair| (pair, 1.0))
        .chain(pairs_beside().map(|pair| (pair, BESIDE)))
        .filter_map(|(pair, weight)| target(reflectance, pair, weight))
        .collect()
}

/// Pairs beside the instrument's: light at 15° and 65°, so that the lobe holds where the instrument does not look.
fn pairs_beside() -> impl Iterator<Item = (Direction, Direction)> {
    [15.0_f64, 65.0].into_iter().flat_map(|light| {
        [15.0, 35.0, 60.0].map(|aspecular| {
            let (light, view) = (light.to_radians(), (light - aspecular).to_radians());
            (
                [-light.sin(), 0.0, light.cos()],
                [view.sin(), 0.0, view.cos()],
            )
        })
    })
}
