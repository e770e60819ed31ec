//! The half-angle table of Rusinkiewicz (1998): 180 x 90 x 90 colors over φd, θh, θd.
//!
//! ```text
//! θh = angle(h, n),  θd = angle(h, i),  φd = azimuth of i around h, modulo π (reciprocity)
//! ```
//!
//! Bins of 1° in φd and θd; θh by 1° or, in MERL's files, by `(k/90)² · 90°`. A value stands at the middle of its bin
//! and is read by trilinear interpolation over the *valid* ones of the eight neighbours, their weights made to sum to
//! one again. Where none is valid there is no answer. Beyond the outermost bin middles the border bin holds, in φd the
//! table goes round.

use std::f64::consts::{FRAC_PI_2, PI};

use super::MeasuredBrdf;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::color::LinearRgb;
use crate::paint::{Direction, half_angles};

/// Bins of φd.
pub(super) const PHI_D: usize = 180;
/// Bins of θh.
pub(super) const THETA_H: usize = 90;
/// Bins of θd.
pub(super) const THETA_D: usize = 90;
/// Entries of a table.
pub(super) const ENTRIES: usize = PHI_D * THETA_H * THETA_D;

/// How the θh bins lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = ThetaH)]
pub enum ThetaHSpacing {
    /// 1° each.
    Linear,
    /// Bin k ends at `((k+1)/90)² · 90°`: fine next to the mirror direction.
    #[serde(rename = "sqrt")]
    SquareRoot,
}

/// Why bytes are no half-angle table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// Another number of bytes.
    #[error("{layout} tables have {wanted} bytes, this has {bytes}")]
    Length {
        /// `MPI 2005` or `MERL`.
        layout: &'static str,
        /// Length that is needed.
        wanted: u64,
        /// Length of the input.
        bytes: usize,
    },
    /// A MERL file of other dimensions.
    #[error("the dimensions are {0:?}, accepted are [90, 90, 180]")]
    Dimensions([i32; 3]),
    /// Nothing to fit.
    #[error("all {0} entries are marked invalid")]
    AllInvalid(usize),
}

/// A half-angle table, in air or, from a package, inside the clear coat.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfAngleTable {
    spacing: ThetaHSpacing,
    /// φd slowest, then θh, then θd; a NaN in red marks an invalid entry.
    values: Vec<[f32; 3]>,
    invalid: usize,
}

impl HalfAngleTable {
    /// A table of `180 x 90 x 90` entries (φd, θh, θd; θd fastest), `None` where nothing was measured.
    ///
    /// # Errors
    ///
    /// [`TableError::Length`] for another number of entries, [`TableError::AllInvalid`] when none is valid.
    pub fn new(
        spacing: ThetaHSpacing,
        entries: impl IntoIterator<Item = Option<[f32; 3]>>,
    ) -> Result<Self, TableError> {
        let mut invalid = 0;
        let mut values = Vec::with_capacity(ENTRIES);
        for entry in entries {
            let valid = entry.filter(|rgb| rgb.iter().all(|v| v.is_finite()));
            invalid += usize::from(valid.is_none());
            values.push(valid.unwrap_or([f32::NAN; 3]));
        }
        if values.len() != ENTRIES {
            let (wanted, bytes) = (12 * ENTRIES as u64, 12 * values.len());
            return Err(TableError::Length {
                layout: "half-angle",
                wanted,
                bytes,
            });
        }
        if invalid == ENTRIES {
            return Err(TableError::AllInvalid(ENTRIES));
        }
        Ok(Self {
            spacing,
            values,
            invalid,
        })
    }

    /// Samples a reflectance on the middles of a table's bins; `None` marks an entry invalid.
    ///
    /// # Errors
    ///
    /// [`TableError::AllInvalid`] when the reflectance answers nowhere.
    pub fn sample(
        spacing: ThetaHSpacing,
        reflectance: impl Fn(Direction, Direction) -> Option<LinearRgb>,
    ) -> Result<Self, TableError> {
        let entries = (0..ENTRIES).map(|k| {
            let (wi, wo) = bin_middle(spacing, k);
            #[allow(clippy::cast_possible_truncation)]
            // Entries are stored as the files store them.
            reflectance(wi, wo).map(|rgb| rgb.map(|v| v as f32))
        });
        Self::new(spacing, entries)
    }

    /// How the θh bins lie.
    #[must_use]
    pub const fn spacing(&self) -> ThetaHSpacing {
        self.spacing
    }

    fn at(&self, phi: usize, h: usize, d: usize) -> Option<[f32; 3]> {
        let rgb = *self.values.get((phi * THETA_H + h) * THETA_D + d)?;
        (!rgb[0].is_nan()).then_some(rgb)
    }
}

/// Directions at the middle of entry `k`'s bin.
fn bin_middle(spacing: ThetaHSpacing, k: usize) -> (Direction, Direction) {
    let middle = |index: usize| f64::from(u32::try_from(index).unwrap_or(0)) + 0.5;
    let phi = middle(k / (THETA_H * THETA_D)) * PI / 180.0;
    let d = (middle(k % THETA_D) / 90.0) * FRAC_PI_2;
    let h = middle(k / THETA_D % THETA_H) / 90.0;
    let h = FRAC_PI_2
        * match spacing {
            ThetaHSpacing::Linear => h,
            ThetaHSpacing::SquareRoot => h * h,
        };
    half_frame_pair(h, d, phi)
}

/// The pair of directions with these half angles, half vector in the xz plane. Either may lie below the horizon.
pub(crate) fn half_frame_pair(theta_h: f64, theta_d: f64, phi_d: f64) -> (Direction, Direction) {
    let ((sh, ch), (sd, cd), (sp, cp)) = (theta_h.sin_cos(), theta_d.sin_cos(), phi_d.sin_cos());
    let half = [sh, 0.0, ch];
    let across = [ch * cp, sp, -sh * cp];
    let mix = |sign: f64| std::array::from_fn(|k| cd * half[k] + sign * sd * across[k]);
    (mix(1.0), mix(-1.0))
}

/// Two neighbours of a position among `count` bin middles, and the weight of the second; borders hold.
fn neighbours(position: f64, count: usize) -> (usize, usize, f64) {
    let last = count - 1;
    let x = (position - 0.5).clamp(0.0, f64::from(u32::try_from(last).unwrap_or(u32::MAX)));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Clamped to 0..=last above.
    let low = (x as usize).min(last);
    (low, (low + 1).min(last), x - x.floor())
}

/// The same on a circle of `count` bins.
fn neighbours_around(position: f64, count: usize) -> (usize, usize, f64) {
    let n = f64::from(u32::try_from(count).unwrap_or(u32::MAX));
    let x = (position - 0.5).rem_euclid(n);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // 0..=count by the remainder.
    let low = x as usize % count;
    (low, (low + 1) % count, x - x.floor())
}

impl MeasuredBrdf for HalfAngleTable {
    fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
        if !(wi[2] > 0.0 && wo[2] > 0.0) {
            return None;
        }
        let angles = half_angles(wi, wo);
        let sum = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        // The half frame: z along h, x towards larger θh. With h along n the azimuth starts at the x axis.
        let across = sum[0].hypot(sum[1]);
        let (c, s) = if across > 0.0 {
            (sum[0] / across, sum[1] / across)
        } else {
            (1.0, 0.0)
        };
        let (sh, ch) = angles.theta_h.sin_cos();
        let (x, y) = (c * wi[0] + s * wi[1], c * wi[1] - s * wi[0]);
        let phi = y.atan2(ch * x - sh * wi[2]).rem_euclid(PI);

        let scaled = angles.theta_h / FRAC_PI_2;
        let h = match self.spacing {
            ThetaHSpacing::Linear => 90.0 * scaled,
            ThetaHSpacing::SquareRoot => 90.0 * scaled.sqrt(),
        };
        let phi = neighbours_around(phi * 180.0 / PI, PHI_D);
        let h = neighbours(h, THETA_H);
        let d = neighbours(angles.theta_d / FRAC_PI_2 * 90.0, THETA_D);
        let mut total = [0.0; 3];
        let mut mass = 0.0;
        for (p, wp) in [(phi.0, 1.0 - phi.2), (phi.1, phi.2)] {
            for (r, wr) in [(h.0, 1.0 - h.2), (h.1, h.2)] {
                for (c, wc) in [(d.0, 1.0 - d.2), (d.1, d.2)] {
                    let weight = wp * wr * wc;
                    if let Some(rgb) = self.at(p, r, c).filter(|_| weight > 0.0) {
                        mass += weight;
                        for (t, v) in total.iter_mut().zip(rgb) {
                            *t += weight * f64::from(v);
                        }
                    }
                }
            }
        }
        (mass > 1e-9).then(|| total.map(|t| t / mass))
    }

    #[allow(clippy::cast_precision_loss)] // Counts up to 1.5 million.
    fn invalid_share(&self) -> f64 {
        self.invalid as f64 / ENTRIES as f64
    }
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use super::*;
    use proptest::prelude::*;

    fn smooth(wi: Direction, wo: Direction) -> Option<LinearRgb> {
        (wi[2] > 0.05 && wo[2] > 0.05).then(|| {
            let h = half_angles(wi, wo);
            [h.h_z, h.h_o, 0.5 + 0.2 * wi[2] * wo[2]]
        })
    }

    #[test]
    fn a_smooth_function_is_read_back_between_bins() {
        for spacing in [ThetaHSpacing::Linear, ThetaHSpacing::SquareRoot] {
            let table = HalfAngleTable::sample(spacing, smooth).expect("mostly valid");
            assert!(table.invalid_share() > 0.1 && table.invalid_share() < 0.9);
            for (h, d, p) in [
                (0.0, 0.3, 1.0),
                (0.31, 0.42, 0.7),
                (0.6, 0.1, 3.0),
                (0.2, 0.9, 2.2),
            ] {
                let (wi, wo) = half_frame_pair(h, d, p);
                let (got, want) = (
                    table.reflectance(wi, wo).expect("valid"),
                    smooth(wi, wo).expect("valid"),
                );
                for (g, w) in got.iter().zip(want) {
                    // Half a square-root bin at 35° is 0.6°.
                    assert!(
                        (g - w).abs() < 5e-3,
                        "{spacing:?} {h} {d} {p}: {got:?} {want:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn an_invalid_entry_is_left_out_and_never_mixed_in() {
        let one_bad = |wi, wo| {
            let h = half_angles(wi, wo);
            let bad = (h.theta_h.to_degrees() - 20.5).abs() < 0.1;
            (!bad).then_some([2.0, 2.0, 2.0])
        };
        let table = HalfAngleTable::sample(ThetaHSpacing::Linear, one_bad).expect("mostly valid");
        let (wi, wo) = half_frame_pair(20.9_f64.to_radians(), 0.5, 1.0);
        for v in table.reflectance(wi, wo).expect("a valid neighbour") {
            assert!((v - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn where_no_neighbour_is_valid_there_is_no_answer() {
        let far = |wi, wo| (half_angles(wi, wo).theta_h < 0.5).then_some([1.0; 3]);
        let table = HalfAngleTable::sample(ThetaHSpacing::Linear, far).expect("half valid");
        let (wi, wo) = half_frame_pair(0.8, 0.2, 1.0);
        assert_eq!(table.reflectance(wi, wo), None);
        assert_eq!(table.reflectance([1.0, 0.0, 0.0], wo), None);
    }

    #[test]
    fn a_table_without_a_valid_entry_is_refused() {
        let error =
            HalfAngleTable::sample(ThetaHSpacing::Linear, |_, _| None).expect_err("nothing valid");
        assert_eq!(error, TableError::AllInvalid(ENTRIES));
    }

    static RECIPROCAL: LazyLock<HalfAngleTable> = LazyLock::new(|| {
        let product = |wi: Direction, wo: Direction| {
            let h = half_angles(wi, wo);
            Some([wi[2] * wo[2], h.h_o, h.h_z])
        };
        HalfAngleTable::sample(ThetaHSpacing::Linear, product).expect("valid")
    });

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn exchanging_light_and_viewer_changes_nothing(
            h in 0.01..0.7_f64, d in 0.01..0.7_f64, p in 0.0..6.2_f64,
        ) {
            let (wi, wo) = half_frame_pair(h, d, p);
            let (forth, back) = (RECIPROCAL.reflectance(wi, wo), RECIPROCAL.reflectance(wo, wi));
            prop_assert_eq!(forth.is_some(), back.is_some());
            for (a, b) in forth.into_iter().flatten().zip(back.into_iter().flatten()) {
                prop_assert!((a - b).abs() < 1e-9);
            }
        }
    }
}
