//! Evaluating a paint, a blend at given weights, or a raw measurement at pairs of directions.

use serde::{Deserialize, Serialize};

use super::WorkshopError;
use super::ingest::{Measurement, table_of};
use crate::measurement::{FlakePictures as _, MeasuredBrdf as _, Package, PackageBase};
use crate::paint::{
    self, CarPaint, Chi, Coat, Direction, HalfAngles, Limits, Reflectance, at_angles, half_angles,
    refract,
};

/// Direction pairs to evaluate.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pairs {
    /// Light and view directions, unit vectors with z along the normal.
    pub pairs: Vec<[Direction; 2]>,
}

/// BRDF values of direction pairs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Values {
    /// BRDF in 1/sr, linear sRGB, `null` where a measurement holds nothing.
    pub f: Vec<Option<[f64; 3]>>,
    /// Weight of the coat's perfect mirror image seen from each view direction, where it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirror: Option<Vec<f64>>,
}

impl Pairs {
    /// Reads pairs and checks that they are unit vectors.
    ///
    /// # Errors
    ///
    /// [`WorkshopError`] for JSON that is none, too many pairs, or a vector that is not of unit length to 1e-3.
    pub fn from_json(name: &str, json: &[u8], limits: &Limits) -> Result<Self, WorkshopError> {
        let mut pairs: Self = serde_json::from_slice(json).map_err(|e| {
            WorkshopError::input(
                name,
                format!("{e}; accepted is {{\"pairs\": [[[ix,iy,iz],[ox,oy,oz]], …]}}"),
            )
        })?;
        if pairs.pairs.len() > limits.pairs {
            let problem = format!(
                "{} pairs, accepted are up to {}",
                pairs.pairs.len(),
                limits.pairs
            );
            return Err(WorkshopError::input(name, problem));
        }
        for (k, pair) in pairs.pairs.iter_mut().enumerate() {
            for (end, w) in pair.iter_mut().enumerate() {
                let length = (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]).sqrt();
                if (length - 1.0).abs() > 1e-3 || !length.is_finite() {
                    let problem =
                        format!("pairs[{k}][{end}] has length {length}, accepted are unit vectors");
                    return Err(WorkshopError::input(name, problem));
                }
                *w = w.map(|v| v / length);
            }
        }
        Ok(pairs)
    }
}

/// Evaluates a paint, flakes at their mean.
#[must_use]
pub fn evaluate(paint: &CarPaint, pairs: &Pairs, chi: Chi) -> Values {
    let reflectance = Reflectance::new(paint);
    let f = pairs
        .pairs
        .iter()
        .map(|&[wi, wo]| Some(reflectance.evaluate(wi, wo, chi)))
        .collect();
    Values {
        f,
        mirror: mirror_of(paint.coat, pairs),
    }
}

/// Weight of the perfect mirror image of a coat for every pair, `None` where the coat shows none.
fn mirror_of(coat: Option<Coat>, pairs: &Pairs) -> Option<Vec<f64>> {
    let coat = coat.filter(Coat::is_mirror)?;
    let weight = |&[wi, wo]: &[Direction; 2]| {
        if wi[2] > 0.0 && wo[2] > 0.0 {
            coat.mirror(wo[2])
        } else {
            0.0
        }
    };
    Some(pairs.pairs.iter().map(weight).collect())
}

/// Said of a measurement whose base nobody measured.
const NOTHING_BUT_READINGS: &str = "nothing but readings at a few angles was measured, which says nothing of other \
                                    directions; without --raw the paint that was fitted to them is evaluated";

/// Evaluates a measurement as it is: negative values kept, `None` where it holds nothing. Of a package, the base plus the
/// mean of the texels, both through the coat.
///
/// # Errors
///
/// [`WorkshopError`] for a package whose table or pictures are damaged, and where nothing but readings was measured.
pub fn evaluate_raw(measurement: &Measurement, pairs: &Pairs) -> Result<Values, WorkshopError> {
    match measurement {
        Measurement::Brdf(bare) => Ok(Values {
            f: pairs
                .pairs
                .iter()
                .map(|&[wi, wo]| bare.brdf.reflectance(wi, wo))
                .collect(),
            mirror: None,
        }),
        Measurement::Readings(upload) => Err(WorkshopError::input(
            upload.layout.name(),
            NOTHING_BUT_READINGS,
        )),
        Measurement::Package(package) => Ok(Values {
            f: raw_package(package, pairs)?,
            mirror: mirror_of(package.coat, pairs),
        }),
    }
}

fn raw_package(package: &Package, pairs: &Pairs) -> Result<Vec<Option<[f64; 3]>>, WorkshopError> {
    let wrong = |problem: &dyn std::fmt::Display| WorkshopError::input(&package.name, problem);
    let means = package
        .flakes
        .as_ref()
        .map(crate::measurement::FlakeSlices::mean_colors)
        .transpose()
        .map_err(|e| wrong(&e))?;
    let flakes = |half: &HalfAngles| match (&package.flakes, &means) {
        (Some(slices), Some(means)) => at_angles(means, slices.theta_h(), slices.theta_d(), half),
        _ => [0.0; 3],
    };
    let (coat, ior) = (package.coat, package.coat.map_or(1.0, |c| c.ior));
    let through = |wi: Direction, wo: Direction, base: [f64; 3]| {
        let inner = half_angles(refract(wi, ior), refract(wo, ior));
        let (transmission, flakes) = (paint::transmission(wi, wo, ior), flakes(&inner));
        std::array::from_fn(|k| transmission * (base[k] + flakes[k]))
    };
    let above = |w: Direction| w[2] > 0.0;
    match &package.base {
        None => Err(wrong(&NOTHING_BUT_READINGS)),
        Some(PackageBase::Model {
            diffuse,
            lobes,
            color_table,
        }) => {
            let (lobes, color_table) = (lobes.clone(), color_table.clone());
            let base = CarPaint {
                coat,
                diffuse: *diffuse,
                lobes,
                color_table,
                flakes: None,
            };
            let reflectance = Reflectance::new(&base);
            let value = |&[wi, wo]: &[Direction; 2]| {
                let terms = reflectance.terms(wi, wo, Chi::Table);
                Some(terms.map_or([0.0; 3], |terms| through(wi, wo, terms.base)))
            };
            Ok(pairs.pairs.iter().map(value).collect())
        }
        Some(base) => {
            let table = table_of(base).map_err(|e| wrong(&e))?;
            let value = |&[wi, wo]: &[Direction; 2]| {
                if !(above(wi) && above(wo)) {
                    return None;
                }
                table
                    .reflectance(refract(wi, ior), refract(wo, ior))
                    .map(|base| through(wi, wo, base))
            };
            Ok(pairs.pairs.iter().map(value).collect())
        }
    }
}
