//! Binaries of the MERL database (Matusik et al. 2003): three little-endian `i32` dimensions, then a red, a green and
//! a blue plane of `f64`.
//!
//! Entry `φd + 180 (θd + 90 θh)`; counts become 1/sr by 1/1500 for red, 1.15/1500 for green, 1.66/1500 for blue. A
//! negative value marks a direction below the horizon. θh bins grow with the square of their index.

use super::table::{ENTRIES, HalfAngleTable, PHI_D, THETA_D, THETA_H, TableError, ThetaHSpacing};

const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
const DIMENSIONS: [i32; 3] = [90, 90, 180];

/// Length of every MERL file.
pub(super) const FILE_BYTES: usize = 12 + 24 * ENTRIES;

fn dimensions(bytes: &[u8]) -> Option<[i32; 3]> {
    let at = |k: usize| {
        bytes
            .get(4 * k..4 * k + 4)?
            .try_into()
            .ok()
            .map(i32::from_le_bytes)
    };
    Some([at(0)?, at(1)?, at(2)?])
}

pub(super) fn begins_like_one(bytes: &[u8]) -> bool {
    dimensions(bytes) == Some(DIMENSIONS)
}

/// Reads a MERL binary.
///
/// # Errors
///
/// [`TableError`] for other dimensions, another length, or no valid entry at all.
pub fn read_merl(bytes: &[u8], spacing: ThetaHSpacing) -> Result<HalfAngleTable, TableError> {
    let wrong = TableError::Length {
        layout: "MERL",
        wanted: FILE_BYTES as u64,
        bytes: bytes.len(),
    };
    let Some(found) = dimensions(bytes) else {
        return Err(wrong);
    };
    if found != DIMENSIONS {
        return Err(TableError::Dimensions(found));
    }
    if bytes.len() != FILE_BYTES {
        return Err(wrong);
    }
    let value = |index: usize, channel: usize| {
        let at = 12 + 8 * (channel * ENTRIES + index);
        bytes
            .get(at..at + 8)?
            .try_into()
            .ok()
            .map(f64::from_le_bytes)
            .filter(|v| *v >= 0.0)
    };
    let entry = |index: usize| {
        let rgb = [
            value(index, 0)? * SCALE[0],
            value(index, 1)? * SCALE[1],
            value(index, 2)? * SCALE[2],
        ];
        #[allow(clippy::cast_possible_truncation)]
        // Measured to three digits; a value that overflows is invalid.
        Some(rgb.map(|v| v as f32))
    };
    let entries = (0..PHI_D).flat_map(|phi| {
        (0..THETA_H).flat_map(move |h| (0..THETA_D).map(move |d| phi + PHI_D * (d + THETA_D * h)))
    });
    HalfAngleTable::new(spacing, entries.map(entry))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::MeasuredBrdf;
    use crate::paint::Direction;

    fn file(value: impl Fn(usize, usize) -> f64) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(FILE_BYTES);
        for d in DIMENSIONS {
            bytes.extend_from_slice(&d.to_le_bytes());
        }
        for channel in 0..3 {
            for index in 0..ENTRIES {
                bytes.extend_from_slice(&value(index, channel).to_le_bytes());
            }
        }
        bytes
    }

    fn pair(h_deg: f64, d_deg: f64) -> (Direction, Direction) {
        let (h, d) = (h_deg.to_radians(), d_deg.to_radians());
        (
            [(h + d).sin(), 0.0, (h + d).cos()],
            [(h - d).sin(), 0.0, (h - d).cos()],
        )
    }

    #[test]
    fn planes_scales_order_and_square_root_spacing_are_those_of_the_database() {
        let count = |k: usize| f64::from(u32::try_from(k).expect("small"));
        let bytes = file(|index, channel| match channel {
            0 => 1500.0 * count(index / 180 % 90),
            1 => 1500.0 / 1.15 * count(index / 180 / 90),
            _ => 1500.0 / 1.66,
        });
        let table = read_merl(&bytes, ThetaHSpacing::SquareRoot).expect("whole");
        // Bin 30 of θh is centred, on its own scale, at (30.5/90)² · 90°.
        let (wi, wo) = pair(30.5 * 30.5 / 90.0, 20.5);
        let rgb = table.reflectance(wi, wo).expect("valid");
        for (got, want) in rgb.iter().zip([20.0, 30.0, 1.0]) {
            assert!((got - want).abs() < 1e-4, "{rgb:?}");
        }
    }

    #[test]
    fn negative_counts_are_below_the_horizon() {
        let bytes = file(|index, _| if index % 2 == 0 { -1.0 } else { 1.0 });
        let table = read_merl(&bytes, ThetaHSpacing::SquareRoot).expect("half valid");
        assert!((table.invalid_share() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn other_dimensions_and_a_cut_file_are_named() {
        let mut bytes = vec![0; 40];
        assert_eq!(
            read_merl(&bytes, ThetaHSpacing::SquareRoot),
            Err(TableError::Dimensions([0, 0, 0]))
        );
        for (k, d) in DIMENSIONS.iter().enumerate() {
            bytes[4 * k..4 * k + 4].copy_from_slice(&d.to_le_bytes());
        }
        assert!(matches!(
            read_merl(&bytes, ThetaHSpacing::SquareRoot),
            Err(TableError::Length { bytes: 40, .. })
        ));
        assert!(read_merl(&[], ThetaHSpacing::SquareRoot).is_err());
    }
}
