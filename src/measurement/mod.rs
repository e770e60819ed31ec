//! What paint labs hand in: bytes in, a reflectance that can be asked for any pair of directions out.
//!
//! Every reader checks every count and offset against the bytes it was given before it believes them, names the field,
//! the value and what would be accepted when it refuses, and never panics on damaged input. What a reader returns is
//! the measurement as it is: nothing is smoothed, clamped or filled in, and where nothing was measured the answer is
//! `None`.
//!
//! Bare `.bsdf`, MPI and MERL files are measured in air and include everything the sample did to light, the clear
//! coat's highlight as well. Readings of a hand-held multi-angle instrument come in a package or as a file of their own
//! ([`ReadingsFile`]); they leave the highlight out. Left to others: turning a measurement into a paint (`fit`).

mod archive;
mod layout;
mod manifest;
mod merl;
mod mpi;
mod multi_angle;
mod package;
mod picture;
mod readings;
mod rgl;
mod table;
mod tensor;

use layout::LAYOUTS;
pub use layout::{Layout, ReadOptions, sniff};
pub use manifest::MANIFEST;
pub use merl::read_merl;
pub use mpi::{MPI_HEADER_BYTES, read_mpi};
pub use multi_angle::{MultiAngle, ReadColors, ReadColorsError};
pub use package::{
    FlakePictures, FlakeSlices, Package, PackageBase, PackageError, SliceRoom, TableLayout,
};
pub use picture::{Picture, PictureError, PictureScratch};
pub use readings::{CsvError, CxfError, ReadingsError, ReadingsFile};
pub use rgl::{RglError, RglMeasurement};
pub(crate) use table::half_frame_pair;
pub use table::{HalfAngleTable, TableError, ThetaHSpacing};
pub use tensor::TensorError;

use crate::color::LinearRgb;
use crate::paint::{Direction, Limits};

/// Something that answers how much it reflects from one direction to another.
pub trait MeasuredBrdf: Sync {
    /// BRDF in 1/sr, linear sRGB, for unit directions, normal `(0, 0, 1)`; `None` where nothing was measured.
    ///
    /// Sensor noise and colors outside the gamut may make a channel negative.
    fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb>;

    /// Share of the stored values that are marked invalid, `0..=1`.
    fn invalid_share(&self) -> f64 {
        0.0
    }
}

/// A reflectance measured in air, without flake pictures.
#[derive(Clone, Debug)]
pub enum BrdfMeasurement {
    /// A tensor file.
    Rgl(RglMeasurement),
    /// An MPI or MERL table.
    Table(HalfAngleTable),
}

/// Why bytes are no measurement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasurementError {
    /// Neither the first bytes nor the length belong to a known layout.
    #[error(
        "the measurement, {bytes} bytes, {what}; that is no tensor file, package, MPI 2005 table (17496000 bytes and a \
         header of 84), MERL table (34992012 bytes), CSV of readings (whose columns begin with aspecular_deg) or CxF3; where bytes do not tell, --layout or layout in a query does, \
         accepted are {LAYOUTS}"
    )]
    Unknown {
        /// Length of the input.
        bytes: usize,
        /// What it is instead, as far as its first bytes say.
        what: String,
    },
    /// A stated layout that the first bytes contradict.
    #[error("layout is {}, accepted is {}, as which the file begins; without a layout it is found out", stated.name(), found.name())]
    Stated {
        /// The layout that was said.
        stated: Layout,
        /// The one whose beginning no other file has.
        found: Layout,
    },
    /// More bytes than are accepted.
    #[error("the measurement has {bytes} bytes, accepted are {accepted}")]
    Size {
        /// Length of the input.
        bytes: usize,
        /// The limit.
        accepted: u64,
    },
    /// A package where a bare BRDF was wanted.
    #[error("this is a measured-paint package, not a bare BRDF")]
    Package,
    /// Readings where a bare BRDF was wanted.
    #[error("these are readings of an instrument at a few angles, not a bare BRDF")]
    Readings,
    /// A damaged tensor file, or one of something else.
    #[error("tensor file: {0}")]
    Rgl(#[from] RglError),
    /// A damaged table.
    #[error("BRDF table: {0}")]
    Table(#[from] TableError),
}

impl BrdfMeasurement {
    /// Reads a bare BRDF of any layout.
    ///
    /// # Errors
    ///
    /// [`MeasurementError`] when the layout is unknown or the file is damaged, too large, or a package.
    pub fn read(
        bytes: &[u8],
        options: &ReadOptions,
        limits: &Limits,
    ) -> Result<Self, MeasurementError> {
        if bytes.len() as u64 > limits.bytes {
            return Err(MeasurementError::Size {
                bytes: bytes.len(),
                accepted: limits.bytes,
            });
        }
        Ok(match sniff(bytes, options)? {
            Layout::Rgl => Self::Rgl(RglMeasurement::read(bytes)?),
            Layout::Mpi2005 => {
                let header = options.header_bytes.unwrap_or(MPI_HEADER_BYTES);
                Self::Table(read_mpi(
                    bytes,
                    header,
                    options.theta_h.unwrap_or(ThetaHSpacing::Linear),
                )?)
            }
            Layout::Merl => Self::Table(read_merl(
                bytes,
                options.theta_h.unwrap_or(ThetaHSpacing::SquareRoot),
            )?),
            Layout::Package => return Err(MeasurementError::Package),
            Layout::Csv | Layout::Cxf => return Err(MeasurementError::Readings),
        })
    }

    /// What the file says about itself, where it says anything.
    #[must_use]
    pub fn description(&self) -> Option<&str> {
        match self {
            Self::Rgl(tensor) => tensor.description(),
            Self::Table(_) => None,
        }
    }

    /// What a reader of the paint should know about this measurement.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        match self {
            Self::Rgl(tensor) if tensor.is_anisotropic() => vec![format!(
                "the sample is anisotropic ({} azimuths were measured); a car paint is not, so its reflectance is \
                 averaged over azimuth",
                tensor.azimuths()
            )],
            Self::Rgl(_) | Self::Table(_) => Vec::new(),
        }
    }
}

impl MeasuredBrdf for BrdfMeasurement {
    fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
        match self {
            Self::Rgl(tensor) => tensor.reflectance(wi, wo),
            Self::Table(table) => table.reflectance(wi, wo),
        }
    }

    fn invalid_share(&self) -> f64 {
        match self {
            Self::Rgl(_) => 0.0,
            Self::Table(table) => table.invalid_share(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_measurement_is_refused_with_its_length_and_what_it_is() {
        let error =
            BrdfMeasurement::read(b"hello, paint", &ReadOptions::default(), &Limits::default());
        let text = error.expect_err("no measurement").to_string();
        assert!(
            text.contains("12 bytes") && text.contains("hello, p"),
            "{text}"
        );
    }

    #[test]
    fn a_header_longer_than_any_file_is_no_overflow() {
        let options = ReadOptions {
            header_bytes: Some(u64::MAX),
            ..ReadOptions::default()
        };
        let error = BrdfMeasurement::read(b"hello", &options, &Limits::default());
        assert!(matches!(
            error,
            Err(MeasurementError::Unknown { bytes: 5, .. })
        ));
    }

    #[test]
    fn more_bytes_than_the_limit_are_refused() {
        let limits = Limits {
            bytes: 4,
            ..Limits::default()
        };
        let error = BrdfMeasurement::read(b"hello", &ReadOptions::default(), &limits)
            .expect_err("too long");
        assert_eq!(
            error,
            MeasurementError::Size {
                bytes: 5,
                accepted: 4
            }
        );
    }
}
