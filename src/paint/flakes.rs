//! Flakes as statistics: color clusters per angle pair, and how the random texture spends them.
//!
//! One slice per (θh, θd) holds clusters: boxes in CIELAB of π f with a probability each, colors uniform inside
//! (Golla and Klein 2018, 3.2). Within a slice clusters ascend in lightness as fitted, so that one random number kept
//! over neighbouring slices is one flake that brightens and fades.

use serde::{Deserialize, Serialize};

use super::angle::AngleGrid;
use super::box_color::mean_xyz_of_each;
use super::shared_list::SharedList;
use crate::color::{LinearRgb, xyz_to_rgb};

/// The flakes of a paint.
#[derive(Clone, Debug, PartialEq)]
pub struct Flakes {
    /// Half angles of the slices.
    pub theta_h: AngleGrid,
    /// Difference angles of the slices.
    pub theta_d: AngleGrid,
    /// First cluster of each slice, θd fastest, and one past the last: `theta_h.len() * theta_d.len() + 1` numbers.
    pub offsets: SharedList<u32>,
    /// Probability of each cluster; sums to 1 in every slice.
    pub probability: SharedList<f64>,
    /// Corner of smallest L, a, b of each box.
    pub lower: Vec<[f32; 3]>,
    /// Corner of largest L, a, b of each box.
    pub upper: Vec<[f32; 3]>,
    /// Size and persistence of the flakes.
    pub texture: FlakeTexture,
}

/// What a histogram does not say: how large a flake is and how long it shines.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlakeTexture {
    /// Side of a texel on the paint, micrometres.
    pub texel_um: f64,
    /// Distance over which the texels' autocorrelation falls to one half, micrometres.
    pub grain_um: f64,
    /// Angle over which a slice's correlation with its neighbours falls to one half, degrees, along θh and θd.
    pub lifetime_deg: [f64; 2],
    /// Angle over which a texel keeps its random number, degrees, along θh and θd: what gives the lifetime.
    pub persistence_deg: [f64; 2],
}

/// The clusters of one angle pair.
#[derive(Clone, Copy, Debug)]
pub struct Slice<'a> {
    /// Probability of each cluster.
    pub probability: &'a [f64],
    /// Lower corners in Lab.
    pub lower: &'a [[f32; 3]],
    /// Upper corners in Lab.
    pub upper: &'a [[f32; 3]],
}

impl Flakes {
    /// The slice at these grid indices.
    ///
    /// # Panics
    ///
    /// When an index is outside the grid.
    #[must_use]
    pub fn slice(&self, theta_h: usize, theta_d: usize) -> Slice<'_> {
        self.slice_at(theta_h * self.theta_d.len() + theta_d)
    }

    /// Slice `k` in storage order, θd fastest.
    ///
    /// # Panics
    ///
    /// When `k` is no slice.
    #[must_use]
    pub fn slice_at(&self, k: usize) -> Slice<'_> {
        let range = self.offsets[k] as usize..self.offsets[k + 1] as usize;
        Slice {
            probability: &self.probability[range.clone()],
            lower: &self.lower[range.clone()],
            upper: &self.upper[range],
        }
    }

    /// The slices at these grid indices of θh and θd alone, as they are.
    ///
    /// # Panics
    ///
    /// When an index is outside the grid.
    #[must_use]
    pub fn only(&self, theta_h: &[usize], theta_d: &[usize]) -> Self {
        let grids = [self.theta_h.at(theta_h), self.theta_d.at(theta_d)];
        let mut kept = Self::without_slices(grids, self.texture);
        for &h in theta_h {
            for &d in theta_d {
                let slice = self.slice(h, d);
                kept.push_slice(slice.probability, slice.lower, slice.upper);
            }
        }
        kept
    }

    /// Flakes on these grids of θh and θd whose slices follow, θd fastest.
    #[must_use]
    pub(crate) fn without_slices(
        [theta_h, theta_d]: [AngleGrid; 2],
        texture: FlakeTexture,
    ) -> Self {
        Self {
            theta_h,
            theta_d,
            offsets: vec![0].into(),
            probability: SharedList::default(),
            lower: Vec::new(),
            upper: Vec::new(),
            texture,
        }
    }

    /// The next slice: its clusters' shares and corners.
    ///
    /// # Panics
    ///
    /// Beyond 2^32 clusters in all, which no limit lets in.
    pub(crate) fn push_slice(
        &mut self,
        probability: &[f64],
        lower: &[[f32; 3]],
        upper: &[[f32; 3]],
    ) {
        self.probability.extend_from_slice(probability);
        self.lower.extend_from_slice(lower);
        self.upper.extend_from_slice(upper);
        let end = u32::try_from(self.probability.len()).expect("fewer clusters than 2^32");
        self.offsets.push(end);
    }

    /// Every `step`-th angle of either grid, and the last.
    #[must_use]
    pub fn thinned(&self, step: usize) -> Self {
        self.only(&self.theta_h.every(step), &self.theta_d.every(step))
    }

    /// How many slices.
    #[must_use]
    pub fn slices(&self) -> usize {
        self.theta_h.len() * self.theta_d.len()
    }

    /// How many clusters in all slices.
    #[must_use]
    pub fn clusters(&self) -> usize {
        self.probability.len()
    }

    /// The most clusters any slice has.
    #[must_use]
    pub fn widest_slice(&self) -> usize {
        self.offsets
            .windows(2)
            .map(|w| (w[1] - w[0]) as usize)
            .max()
            .unwrap_or(0)
    }
}

impl Slice<'_> {
    /// Mean flake reflectance of the slice in 1/sr, in closed form; may be slightly negative where the sensor was.
    #[must_use]
    pub fn mean(&self) -> LinearRgb {
        self.mean_of_boxes(|_| ())
    }

    /// [`Slice::mean`]; `each` hears the mean luminance, of π f, of every cluster in turn.
    pub(crate) fn mean_of_boxes(&self, mut each: impl FnMut(f64)) -> LinearRgb {
        let mut sum = [0.0; 3];
        let mut probability = self.probability.iter();
        mean_xyz_of_each(self.lower, self.upper, |xyz| {
            each(xyz[1]);
            let p = probability.next().copied().unwrap_or_default();
            for k in 0..3 {
                sum[k] += p * xyz[k];
            }
        });
        xyz_to_rgb(sum).map(|s| s / std::f64::consts::PI)
    }

    /// Middle of a box in Lab.
    #[must_use]
    pub fn center(&self, cluster: usize) -> [f64; 3] {
        let (lower, upper) = (self.lower[cluster], self.upper[cluster]);
        std::array::from_fn(|k| f64::midpoint(f64::from(lower[k]), f64::from(upper[k])))
    }
}
