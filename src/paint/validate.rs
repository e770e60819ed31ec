//! What makes a paint valid, and the bounds a synthesised one is held to.

use super::angle::AngleGridError;
use super::color_table::ColorTableError;
use super::{AngleGrid, CarPaint, Coat, Flakes, Limits, Lobe};

/// Least roughness a lobe is evaluated with.
pub const MIN_ALPHA: f64 = 1e-4;
/// Largest roughness of a lobe.
pub const MAX_ALPHA: f64 = 10.0;
/// Largest weight of a lobe.
pub const MAX_WEIGHT: f64 = 1e3;
/// Largest magnitude of L, a or b of a box or a table color.
pub const MAX_LAB: f64 = 2000.0;

/// Least and largest texel, µm.
pub const TEXELS_UM: [f64; 2] = [1e-3, 1e5];
/// Least and largest grain, µm.
pub const GRAINS_UM: [f64; 2] = [1e-3, 1e6];
/// Least and largest lifetime and persistence, degrees: a hundredth is far below what any instrument's lens accepts.
pub const LIFETIMES_DEG: [f64; 2] = [0.01, 1e4];

/// Why parameters are no paint. Names the field as a path, the value, and what is accepted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PaintError {
    /// A number outside its range, or not finite.
    #[error("{field} is {value}, accepted is {accepted}")]
    Range {
        /// Path of the field.
        field: String,
        /// The offending value.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// More of something than is accepted.
    #[error("{field} has {count} entries, accepted are {accepted}")]
    Count {
        /// Path of the field.
        field: String,
        /// How many there are.
        count: usize,
        /// What would be accepted.
        accepted: String,
    },
    /// Lists that belong together differ in length.
    #[error("{field}: {reason}")]
    Shape {
        /// Path of the field.
        field: String,
        /// What does not fit.
        reason: String,
    },
    /// An angle grid is not one.
    #[error("{field}: {source}")]
    Angles {
        /// Path of the field.
        field: String,
        /// What is wrong with it.
        source: AngleGridError,
    },
    /// The color table is not one.
    #[error("color_table: {0}")]
    ColorTable(#[from] ColorTableError),
}

fn within(
    field: impl FnOnce() -> String,
    value: f64,
    low: f64,
    high: f64,
    accepted: &'static str,
) -> Result<(), PaintError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(PaintError::Range {
        field: field(),
        value,
        accepted,
    })
}

/// Refuses grids with more angles than any blend has.
fn angles(
    part: &str,
    theta_h: &AngleGrid,
    theta_d: &AngleGrid,
    limits: &Limits,
) -> Result<(), PaintError> {
    let most = limits.common_angles();
    for (axis, grid) in [("theta_h", theta_h), ("theta_d", theta_d)] {
        if grid.len() > most {
            return Err(PaintError::Count {
                field: format!("{part}.{axis}"),
                count: grid.len(),
                accepted: format!("1 to {most}"),
            });
        }
    }
    Ok(())
}

impl CarPaint {
    /// Checks every number and every length.
    ///
    /// # Errors
    ///
    /// [`PaintError`] for the first field that is out of range, with its path.
    pub fn validate(&self, limits: &Limits) -> Result<(), PaintError> {
        if let Some(coat) = &self.coat {
            coat.validate()?;
        }
        for (channel, &value) in self.diffuse.iter().enumerate() {
            within(
                || format!("diffuse[{channel}]"),
                value,
                0.0,
                MAX_WEIGHT,
                "0 to 1000",
            )?;
        }
        if self.lobes.len() > limits.lobes {
            let accepted = format!("0 to {}", limits.lobes);
            return Err(PaintError::Count {
                field: "lobes".into(),
                count: self.lobes.len(),
                accepted,
            });
        }
        for (k, lobe) in self.lobes.iter().enumerate() {
            lobe.validate(k)?;
        }
        let table = &self.color_table;
        angles("color_table", table.theta_h(), table.theta_d(), limits)?;
        for (k, lab) in table.nodes().iter().enumerate() {
            for value in lab.to_array() {
                within(
                    || format!("color_table[{k}]"),
                    value,
                    -MAX_LAB,
                    MAX_LAB,
                    "-2000 to 2000",
                )?;
            }
        }
        for value in self.color_table.overall().to_array() {
            within(
                || "color_table.overall".into(),
                value,
                -MAX_LAB,
                MAX_LAB,
                "-2000 to 2000",
            )?;
        }
        self.flakes
            .as_ref()
            .map_or(Ok(()), |flakes| flakes.validate(limits))
    }
}

impl Coat {
    fn validate(&self) -> Result<(), PaintError> {
        within(|| "coat.ior".into(), self.ior, 1.0, 4.0, "1 to 4")?;
        within(
            || "coat.roughness".into(),
            self.roughness,
            0.0,
            1.0,
            "0 to 1",
        )?;
        let thickness = self.thickness_um.unwrap_or(1.0);
        within(
            || "coat.thickness_um".into(),
            thickness,
            0.0,
            1e6,
            "0 to 1000000",
        )
    }
}

impl Lobe {
    fn validate(&self, k: usize) -> Result<(), PaintError> {
        for (channel, &value) in self.weight.iter().enumerate() {
            within(
                || format!("lobes[{k}].weight[{channel}]"),
                value,
                0.0,
                MAX_WEIGHT,
                "0 to 1000",
            )?;
        }
        within(
            || format!("lobes[{k}].alpha"),
            self.alpha,
            f64::MIN_POSITIVE,
            MAX_ALPHA,
            "above 0, to 10",
        )?;
        within(|| format!("lobes[{k}].f0"), self.f0, 0.0, 1.0, "0 to 1")
    }
}

impl Flakes {
    fn validate(&self, limits: &Limits) -> Result<(), PaintError> {
        let shape = |field: &str, reason: String| {
            Err(PaintError::Shape {
                field: field.into(),
                reason,
            })
        };
        if self.offsets.len() != self.slices() + 1 {
            return shape(
                "flakes.offsets",
                format!(
                    "{} offsets for {} slices",
                    self.offsets.len(),
                    self.slices()
                ),
            );
        }
        angles("flakes", &self.theta_h, &self.theta_d, limits)?;
        let clusters = self.offsets.last().map_or(0, |&last| last as usize);
        let lengths = [self.probability.len(), self.lower.len(), self.upper.len()];
        if lengths != [clusters; 3] || self.offsets[0] != 0 {
            return shape(
                "flakes.clusters",
                format!("offsets name {clusters} clusters, the lists hold {lengths:?}"),
            );
        }
        for (k, pair) in self.offsets.windows(2).enumerate() {
            let count = (pair[1] as usize).saturating_sub(pair[0] as usize);
            if pair[1] <= pair[0] || count > limits.clusters {
                let accepted = format!("1 to {}", limits.clusters);
                return Err(PaintError::Count {
                    field: format!("flakes.slices[{k}]"),
                    count,
                    accepted,
                });
            }
        }
        // Only now that all offsets ascend does every slice lie within the lists.
        for k in 0..self.slices() {
            self.validate_slice(k)?;
        }
        let t = &self.texture;
        within(
            || "flakes.texel_um".into(),
            t.texel_um,
            TEXELS_UM[0],
            TEXELS_UM[1],
            "0.001 to 100000",
        )?;
        within(
            || "flakes.grain_um".into(),
            t.grain_um,
            GRAINS_UM[0],
            GRAINS_UM[1],
            "0.001 to 1000000",
        )?;
        for (field, angles) in [
            ("flakes.lifetime_deg", t.lifetime_deg),
            ("flakes.persistence_deg", t.persistence_deg),
        ] {
            for (axis, angle) in angles.into_iter().enumerate() {
                within(
                    || format!("{field}[{axis}]"),
                    angle,
                    LIFETIMES_DEG[0],
                    LIFETIMES_DEG[1],
                    "0.01 to 10000",
                )?;
            }
        }
        Ok(())
    }

    fn validate_slice(&self, k: usize) -> Result<(), PaintError> {
        let slice = self.slice_at(k);
        let mut sum = 0.0;
        for (c, &p) in slice.probability.iter().enumerate() {
            within(
                || format!("flakes.slices[{k}].probability[{c}]"),
                p,
                0.0,
                1.0,
                "0 to 1",
            )?;
            sum += p;
        }
        #[allow(clippy::cast_precision_loss)] // at most a few thousand
        let rounding = 1e-12 * slice.probability.len() as f64;
        if (sum - 1.0).abs() > rounding {
            let field = format!("flakes.slices[{k}].probability");
            return Err(PaintError::Range {
                field,
                value: sum,
                accepted: "probabilities that sum to 1",
            });
        }
        for (c, (lower, upper)) in slice.lower.iter().zip(slice.upper).enumerate() {
            for axis in 0..3 {
                let field = || format!("flakes.slices[{k}].box[{c}][{axis}]");
                within(
                    field,
                    f64::from(lower[axis]),
                    -MAX_LAB,
                    MAX_LAB,
                    "-2000 to 2000",
                )?;
                within(
                    field,
                    f64::from(upper[axis]),
                    f64::from(lower[axis]),
                    MAX_LAB,
                    "the lower corner to 2000",
                )?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{ColorTable, FlakeTexture};

    #[test]
    fn more_angles_than_any_blend_has_are_refused() {
        let limits = Limits::default();
        let grid = |angles: usize| {
            let degrees = (0..angles).map(|k| 90.0 * k as f64 / angles as f64);
            AngleGrid::new(degrees.collect()).expect("ascending")
        };
        let most = limits.common_angles();
        let one = AngleGrid::single();
        assert_eq!(angles("flakes", &grid(most), &one, &limits), Ok(()));
        let error = angles("flakes", &one, &grid(most + 1), &limits).expect_err("refused");
        assert_eq!(
            error.to_string(),
            "flakes.theta_d has 906 entries, accepted are 1 to 905"
        );
    }

    #[test]
    fn offsets_that_do_not_ascend_are_refused_before_a_slice_is_read() {
        for offsets in [vec![0, 4096, 2, 4], vec![0, 2, 1, 4], vec![0, 0, 2, 4]] {
            let paint = CarPaint {
                coat: None,
                diffuse: [0.1; 3],
                lobes: vec![],
                color_table: ColorTable::white(),
                flakes: Some(Flakes {
                    theta_h: AngleGrid::new(vec![0.0, 10.0, 20.0]).expect("ascending"),
                    theta_d: AngleGrid::single(),
                    offsets: offsets.into(),
                    probability: vec![1.0; 4].into(),
                    lower: vec![[0.0; 3]; 4],
                    upper: vec![[1.0; 3]; 4],
                    texture: FlakeTexture {
                        texel_um: 20.0,
                        grain_um: 20.0,
                        lifetime_deg: [5.0; 2],
                        persistence_deg: [5.0; 2],
                    },
                }),
            };
            let error = paint.validate(&Limits::default()).expect_err("refused");
            assert!(
                matches!(&error, PaintError::Count { field, .. } if field.starts_with("flakes.slices[")),
                "{error}"
            );
        }
    }
}
