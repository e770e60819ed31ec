//! The car paint: coat, diffuse base, lobes, color table and flakes, and what light does with them.
//!
//! ```text
//! f(x,i,o) = T(i) T(o) [ chi(θh,θd) (a/π + Σ f_k(ī,ō)) + Ξ(x,θh,θd) ] + f_coat(i,o)
//! ```
//!
//! The model is Golla and Klein's (2018) statistical car paint: flakes are color clusters per angle pair, boxes in
//! CIELAB with a probability each. This room promises that a [`CarPaint`] is finite and in range once
//! [`CarPaint::validate`] accepted it, and that [`Reflectance`] reads nothing a texture bundle does not carry.
//!
//! Left to others: how a paint is measured (`measurement`), fitted (`fit`), mixed (`blend`) or drawn (`render`).

mod angle;
mod box_color;
mod cells;
mod coat;
mod color_table;
mod container;
mod direction;
mod energy;
mod file;
mod finite;
mod flakes;
mod lattice;
mod lightness;
mod limits;
mod lobe;
mod magnitude;
mod realisation;
mod reflectance;
mod residuals;
mod shared_list;
mod sparkle;
mod validate;

pub use angle::{AngleGrid, AngleGridError, Bracket, LEAST_STEP_DEG};
pub(crate) use angle::{QuickBracket, QuickGrid};
pub use box_color::{center_of_mean, mean_color};
pub use cells::{RandomTexture, cell_spacing};
pub use coat::{Coat, fresnel, refract, transmission};
pub use color_table::{ColorTable, ColorTableError, at_angles};
pub use container::{Container, ContainerError, Reader, Writer};
pub(crate) use direction::masking;
pub use direction::{ASPECULAR_DEG, Direction, HalfAngles, half_angles, instrument_pairs};
pub use energy::{EnergyCertificate, certify};
pub use file::{Clustering, NAME_CHARACTERS, PaintFile, PaintFileError, Provenance};
pub use finite::NotFinite;
pub(crate) use finite::{check_corners, check_list};
pub use flakes::{FlakeTexture, Flakes, Slice};
pub use lattice::slices_spread_over;
pub use lightness::LightnessMixture;
pub use limits::Limits;
pub use lobe::Lobe;
pub(crate) use magnitude::largest_magnitude;
pub use realisation::{Clamp, Realisation};
pub use reflectance::{Chi, Reflectance, Terms};
pub use residuals::{
    ClusteringError, FitResiduals, InstrumentError, LuminanceError, Percentiles, ReadingError,
    ReadingResiduals, SeenDifference,
};
pub use shared_list::SharedList;
pub(crate) use sparkle::pcg;
pub use sparkle::{FlakeSampler, TexelDraw, cumulative};
pub use validate::{
    GRAINS_UM, LIFETIMES_DEG, MAX_ALPHA, MAX_LAB, MAX_WEIGHT, MIN_ALPHA, PaintError, TEXELS_UM,
};

use crate::color::LinearRgb;

/// A car paint, measured or synthesised. All angles are inside the coat where there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct CarPaint {
    /// Clear coat; `None` is an uncoated paint.
    pub coat: Option<Coat>,
    /// Lambertian albedo of the base, before the color table.
    pub diffuse: LinearRgb,
    /// Cook-Torrance lobes, at most [`Limits::lobes`].
    pub lobes: Vec<Lobe>,
    /// Color of diffuse and lobes by angle.
    pub color_table: ColorTable,
    /// Flakes; `None` is a solid color.
    pub flakes: Option<Flakes>,
}
