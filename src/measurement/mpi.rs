//! Tables of the MPI car paints (Günther et al. 2005): little-endian `f32` RGB, φd slowest, then θh, then θd.
//!
//! The published files carry 84 bytes of undocumented header; tables inside packages carry none. −1 in all three
//! channels marks an invalid entry. Whether θh is linear or by square root is not written in the file.

use super::table::{ENTRIES, HalfAngleTable, TableError, ThetaHSpacing};

/// Header of the published files.
pub const MPI_HEADER_BYTES: u64 = 84;

/// Bytes after the header.
pub(super) const VALUE_BYTES: u64 = 12 * ENTRIES as u64;

/// Reads an MPI table whose values start after `header_bytes`.
///
/// # Errors
///
/// [`TableError::Length`] when the file has another length, [`TableError::AllInvalid`] when it holds nothing.
pub fn read_mpi(
    bytes: &[u8],
    header_bytes: u64,
    spacing: ThetaHSpacing,
) -> Result<HalfAngleTable, TableError> {
    let wanted = VALUE_BYTES.saturating_add(header_bytes);
    let wrong = TableError::Length {
        layout: "MPI 2005",
        wanted,
        bytes: bytes.len(),
    };
    if bytes.len() as u64 != wanted {
        return Err(wrong);
    }
    let Some(values) = usize::try_from(header_bytes)
        .ok()
        .and_then(|start| bytes.get(start..))
    else {
        return Err(wrong);
    };
    HalfAngleTable::new(spacing, values.chunks_exact(12).map(entry))
}

fn entry(bytes: &[u8]) -> Option<[f32; 3]> {
    let channel = |k: usize| {
        bytes
            .get(4 * k..4 * k + 4)?
            .try_into()
            .ok()
            .map(f32::from_le_bytes)
    };
    let rgb = [channel(0)?, channel(1)?, channel(2)?];
    (rgb != [-1.0; 3]).then_some(rgb)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::MeasuredBrdf;

    fn file(header: usize, mut value: impl FnMut(usize) -> [f32; 3]) -> Vec<u8> {
        let mut bytes = vec![7; header];
        for k in 0..ENTRIES {
            for v in value(k) {
                bytes.extend_from_slice(&v.to_le_bytes());
            }
        }
        bytes
    }

    #[test]
    fn minus_one_in_all_channels_and_what_is_not_finite_are_invalid() {
        let bytes = file(84, |k| match k % 4 {
            0 => [-1.0; 3],
            1 => [0.5, f32::NAN, 0.5],
            2 => [-1.0, 0.2, 0.2],
            _ => [0.1, 0.2, 0.3],
        });
        let table = read_mpi(&bytes, 84, ThetaHSpacing::Linear).expect("whole");
        assert!((table.invalid_share() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_order_is_phi_then_theta_h_then_theta_d() {
        // Green counts θh bins, red θd bins: read back at (θh, θd) = (30.5°, 10.5°).
        let count = |k: usize| f32::from(u16::try_from(k).expect("small"));
        let table = read_mpi(
            &file(0, |k| [count(k % 90), count(k / 90 % 90), 1.0]),
            0,
            ThetaHSpacing::Linear,
        );
        let (h, d) = (30.5_f64.to_radians(), 10.5_f64.to_radians());
        let (wi, wo) = (
            [(h + d).sin(), 0.0, (h + d).cos()],
            [(h - d).sin(), 0.0, (h - d).cos()],
        );
        let rgb = table.expect("whole").reflectance(wi, wo).expect("valid");
        assert!(
            (rgb[0] - 10.0).abs() < 1e-6 && (rgb[1] - 30.0).abs() < 1e-6,
            "{rgb:?}"
        );
    }

    #[test]
    fn a_cut_file_is_refused_with_both_lengths() {
        let error = read_mpi(&[0; 100], 84, ThetaHSpacing::Linear)
            .expect_err("cut")
            .to_string();
        assert!(
            error.contains("17496084") && error.contains("100"),
            "{error}"
        );
        assert!(read_mpi(&[0; 100], u64::MAX, ThetaHSpacing::Linear).is_err());
    }
}
