//! Measurements of EPFL's material database: an adaptive parameterisation, evaluated for any pair of directions.
//!
//! ```text
//! f(i,o) = rgb(u; i) · ndf(m) / (4 σ(i) o_z),   m the half vector,  u = the sample that vndf(·; i) warps to m
//! ```
//!
//! Axes are `√(2θ/π)` and `(φ+π)/2π`. For each measured incidence the visible normals' density is a bilinear patch
//! per cell; its inverse warp (marginal over rows, then conditional along the row) is evaluated in closed form, and
//! densities and their integrals are interpolated linearly between the two nearest incidences. rgb is bilinear in the
//! sample `u`.
//!
//! J. Dupuy, W. Jakob, "An adaptive parameterization for efficient material acquisition and rendering", ACM TOG 37
//! (2018). An isotropic file holds one azimuth of incidence; of an anisotropic one the azimuths are averaged, because
//! a car paint has none. Out-of-gamut colors stay negative. Accuracy beyond 80° from the normal is the instrument's.

mod density;
mod fields;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::MeasuredBrdf;
use super::tensor::{TensorError, Tensors};
use crate::color::LinearRgb;
use crate::paint::{Direction, half_angles};
use density::{Density, Extent};
use fields::{angles, finite, surface, wrong};

/// Why a tensor file is no reflectance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RglError {
    /// The file itself.
    #[error(transparent)]
    Tensor(#[from] TensorError),
    /// A field of a shape that does not go with the others.
    #[error("field {name} has shape {shape:?}, accepted is {accepted}")]
    Shape {
        /// Name of the field.
        name: &'static str,
        /// Its shape.
        shape: Vec<usize>,
        /// What it must be.
        accepted: String,
    },
    /// Angles that do not ascend, or lie outside their range.
    #[error("{name}[{index}] is {value}, angles ascend within {accepted}")]
    Angle {
        /// `theta_i` or `phi_i`.
        name: &'static str,
        /// Position in the list.
        index: usize,
        /// The offending angle, radians.
        value: f32,
        /// Range in radians.
        accepted: &'static str,
    },
    /// A number that is not finite, or negative where it is a density.
    #[error("{name}[{index}] is {value}, accepted are {accepted}")]
    Value {
        /// Name of the field.
        name: &'static str,
        /// Flat position in it.
        index: usize,
        /// The offending number.
        value: f32,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// A density that is 0 everywhere: nothing would be reflected anywhere.
    #[error("field {0} is 0 everywhere, accepted are densities that are above 0 somewhere")]
    Empty(&'static str),
    /// A file whose colors are not multiplied by the warp's Jacobian.
    #[error("field jacobian is {0}, accepted is 1")]
    Jacobian(u8),
}

/// One azimuth of incidence.
#[derive(Clone, Debug)]
struct Azimuth {
    phi: f64,
    /// Share in the average over azimuth.
    weight: f64,
    /// One per `theta_i`.
    densities: Vec<Density>,
}

/// A reflectance from the database.
#[derive(Clone, Debug)]
pub struct RglMeasurement {
    description: Option<String>,
    theta_i: Vec<f64>,
    azimuths: Vec<Azimuth>,
    isotropic: bool,
    vndf: Extent,
    ndf: (Extent, Vec<f32>),
    sigma: (Extent, Vec<f32>),
    rgb: Extent,
    /// Azimuth slowest, then incidence, channel, row, column.
    colors: Vec<f32>,
}

impl RglMeasurement {
    /// Reads and checks a tensor file.
    ///
    /// # Errors
    ///
    /// [`RglError`] for a damaged file, a missing field, shapes that do not go together, angles out of order, and
    /// numbers that are not finite.
    pub fn read(bytes: &[u8]) -> Result<Self, RglError> {
        let file = Tensors::read(bytes)?;
        if let Some(&flag @ (0 | 2..)) = file.bytes("jacobian").and_then(<[u8]>::first) {
            return Err(RglError::Jacobian(flag));
        }
        let theta_i = angles(&file, "theta_i", 2, -1e-3..=1.572, "0 to pi/2")?;
        let phi_i = angles(&file, "phi_i", 1, -6.3..=6.3, "-2 pi to 2 pi")?;
        let ndf = surface(&file, "ndf")?;
        let sigma = surface(&file, "sigma")?;

        let (vndf, shape) = finite(&file, "vndf", true)?;
        let &[p, t, rows, columns] = shape else {
            return Err(wrong("vndf", shape, "4 dimensions"));
        };
        if (p, t) != (phi_i.len(), theta_i.len()) || rows < 2 || columns < 2 {
            return Err(wrong(
                "vndf",
                shape,
                &format!("[{}, {}, 2.., 2..]", phi_i.len(), theta_i.len()),
            ));
        }
        let extent = Extent { rows, columns };
        let (colors, shape) = finite(&file, "rgb", false)?;
        let &[p, t, 3, rows, columns] = shape else {
            return Err(wrong("rgb", shape, "[.., .., 3, .., ..]"));
        };
        if (p, t) != (phi_i.len(), theta_i.len()) || rows < 2 || columns < 2 {
            return Err(wrong(
                "rgb",
                shape,
                &format!("[{}, {}, 3, 2.., 2..]", phi_i.len(), theta_i.len()),
            ));
        }

        let weights = trapezoid(&phi_i);
        let azimuths = phi_i
            .iter()
            .zip(weights)
            .zip(vndf.chunks_exact(extent.len() * theta_i.len()))
            .map(|((&phi, weight), slices)| Azimuth {
                phi,
                weight,
                densities: slices
                    .chunks_exact(extent.len())
                    .map(|s| Density::new(extent, s))
                    .collect(),
            })
            .collect();
        Ok(Self {
            description: file
                .bytes("description")
                .map(|d| String::from_utf8_lossy(d).chars().take(200).collect()),
            isotropic: phi_i.len() <= 2,
            theta_i,
            azimuths,
            vndf: extent,
            ndf,
            sigma,
            rgb: Extent { rows, columns },
            colors,
        })
    }

    /// The sample's name as the file gives it.
    #[must_use]
    pub fn description(&self) -> Option<&str> {
        self.description.as_deref()
    }

    /// Whether the sample was measured, and is averaged, over azimuths of incidence.
    #[must_use]
    pub const fn is_anisotropic(&self) -> bool {
        !self.isotropic
    }

    /// How many azimuths of incidence were measured.
    #[must_use]
    pub fn azimuths(&self) -> usize {
        self.azimuths.len()
    }

    /// `f · o_z` for one azimuth of incidence; `turn` is the azimuth of the half vector from that of the incidence.
    fn at(
        &self,
        index: usize,
        azimuth: &Azimuth,
        theta_i: f64,
        theta_m: f64,
        turn: f64,
    ) -> LinearRgb {
        let phi_m = if self.isotropic {
            turn
        } else {
            azimuth.phi + turn
        };
        let (u, v) = (
            (theta_m / FRAC_PI_2).sqrt(),
            ((phi_m + PI) / TAU).rem_euclid(1.0),
        );
        let low = self
            .theta_i
            .partition_point(|&t| t <= theta_i)
            .clamp(1, self.theta_i.len() - 1)
            - 1;
        let (from, to) = (self.theta_i[low], self.theta_i[low + 1]);
        let weight = ((theta_i - from) / (to - from)).clamp(0.0, 1.0);

        let (a, b) = (&azimuth.densities[low], &azimuth.densities[low + 1]);
        let blend = |x: f64, y: f64| (1.0 - weight) * x + weight * y;
        let Some((x, y)) = self.sample_of(u, v, |table, k| blend(table(a)[k], table(b)[k])) else {
            return [0.0; 3];
        };

        let cell = self.rgb.cell(x, y);
        let channel = |incidence: usize, c: usize| {
            let start = ((index * self.theta_i.len() + incidence) * 3 + c) * self.rgb.len();
            self.rgb
                .bilinear(&self.colors[start..start + self.rgb.len()], cell)
        };
        let ndf = self.ndf.0.bilinear(&self.ndf.1, self.ndf.0.cell(u, v));
        let phi_i = if self.isotropic { 0.0 } else { azimuth.phi };
        let sigma_at = (
            (theta_i / FRAC_PI_2).sqrt(),
            ((phi_i + PI) / TAU).rem_euclid(1.0),
        );
        let sigma = self
            .sigma
            .0
            .bilinear(&self.sigma.1, self.sigma.0.cell(sigma_at.0, sigma_at.1));
        let scale = if sigma > 0.0 {
            ndf / (4.0 * sigma)
        } else {
            0.0
        };
        std::array::from_fn(|c| blend(channel(low, c), channel(low + 1, c)) * scale)
    }

    /// The sample that the density warps to `(u, v)`; `read` blends a table of both incidences at a flat index.
    ///
    /// Within a cell the density is bilinear, so its integral along the row is a quadratic in x, and the row
    /// integrals, linear in y, integrate to a quadratic in y. `None` where the density vanishes along the whole row.
    fn sample_of(
        &self,
        u: f64,
        v: f64,
        read: impl Fn(fn(&Density) -> &[f64], usize) -> f64,
    ) -> Option<(f64, f64)> {
        let cell = self.vndf.cell(u, v);
        let (x, y, columns) = (cell.x, cell.y, self.vndf.columns);
        let vertex = |r: usize, c: usize| (cell.row + r) * columns + cell.column + c;
        let mix = |lower: f64, upper: f64| (1.0 - y) * lower + y * upper;
        let value = |r, c| read(|d| &d.values, vertex(r, c));
        let along = |k| read(|d| &d.along, k);
        let left = mix(value(0, 0), value(1, 0));
        let right = mix(value(0, 1), value(1, 1));
        let within =
            left * x + 0.5 * x * x * (right - left) + mix(along(vertex(0, 0)), along(vertex(1, 0)));
        let row = |r: usize| along((cell.row + r + 1) * columns - 1);
        let (lower, upper) = (row(0), row(1));
        let whole = mix(lower, upper);
        let below = lower * y + 0.5 * y * y * (upper - lower) + read(|d| &d.over, cell.row);
        (whole > 0.0).then(|| (within / whole, below))
    }
}

impl MeasuredBrdf for RglMeasurement {
    fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
        if !(wi[2] > 0.0 && wo[2] > 0.0) {
            return None;
        }
        let half = [wi[0] + wo[0], wi[1] + wo[1]];
        let theta_i = wi[0].hypot(wi[1]).atan2(wi[2]);
        let theta_m = half_angles(wi, wo).theta_h;
        let turn = half[1].atan2(half[0]) - wi[1].atan2(wi[0]);
        let mut sum = [0.0; 3];
        for (index, azimuth) in self.azimuths.iter().enumerate() {
            for (s, v) in sum
                .iter_mut()
                .zip(self.at(index, azimuth, theta_i, theta_m, turn))
            {
                *s += azimuth.weight * v / wo[2];
            }
        }
        sum.iter().all(|v| v.is_finite()).then_some(sum)
    }
}

/// Weights of an average over ascending nodes, trapezoidal: the two ends of a full turn are the same azimuth.
fn trapezoid(nodes: &[f64]) -> Vec<f64> {
    let (Some(first), Some(last)) = (nodes.first(), nodes.last()) else {
        return Vec::new();
    };
    if nodes.len() < 2 {
        return vec![1.0];
    }
    (0..nodes.len())
        .map(|k| {
            (nodes[(k + 1).min(nodes.len() - 1)] - nodes[k.saturating_sub(1)])
                / 2.0
                / (last - first)
        })
        .collect()
}

#[cfg(test)]
mod tests;
