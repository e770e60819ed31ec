//! What a paint reflects: the model's one evaluation, flakes at their mean.
//!
//! Source: Golla and Klein 2018, eq. 7, with the transmission and highlight of the coat; see the formula at the head of
//! [`crate::paint`]. Negative values of measured slices are clamped once, at the end.

use std::f64::consts::PI;

use super::CarPaint;
use super::coat::{self, refract};
use super::color_table::at_angles;
use super::direction::{Direction, HalfAngles, half_angles};
use crate::color::LinearRgb;

/// Which color table an evaluation uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chi {
    /// The table, by angle.
    Table,
    /// One color for all angles: the lobes alone carry the shape.
    Overall,
}

/// A paint prepared for evaluation: color table in linear sRGB, slice means in closed form.
#[derive(Clone, Debug)]
pub struct Reflectance<'a> {
    paint: &'a CarPaint,
    chi: Vec<LinearRgb>,
    overall: LinearRgb,
    flake_means: Vec<LinearRgb>,
}

/// The terms of one evaluation, in 1/sr, before they are clamped and summed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terms {
    /// Angles inside the coat.
    pub half: HalfAngles,
    /// `T(i) T(o)`.
    pub transmission: f64,
    /// `chi (a/π + Σ f_k)`.
    pub base: LinearRgb,
    /// Mean flakes.
    pub flakes: LinearRgb,
    /// Highlight of a coat of finite width.
    pub highlight: f64,
}

impl<'a> Reflectance<'a> {
    /// Prepares a paint: one pass over its color table and its clusters.
    #[must_use]
    pub fn new(paint: &'a CarPaint) -> Self {
        let chi = paint
            .color_table
            .nodes()
            .iter()
            .map(|lab| lab.to_rgb())
            .collect();
        let flake_means = paint.flakes.as_ref().map_or_else(Vec::new, |f| {
            (0..f.slices()).map(|k| f.slice_at(k).mean()).collect()
        });
        Self {
            paint,
            chi,
            overall: paint.color_table.overall().to_rgb(),
            flake_means,
        }
    }

    /// The paint that was prepared.
    #[must_use]
    pub const fn paint(&self) -> &'a CarPaint {
        self.paint
    }

    /// Closed-form mean of every slice, 1/sr, θd fastest; empty for a solid color.
    #[must_use]
    pub fn flake_means(&self) -> &[LinearRgb] {
        &self.flake_means
    }

    /// Color table nodes in linear sRGB, θd fastest.
    #[must_use]
    pub fn chi_nodes(&self) -> &[LinearRgb] {
        &self.chi
    }

    /// BRDF in 1/sr, linear sRGB, for unit directions; 0 where either is at or below the horizon.
    ///
    /// A coat's perfect mirror image is left out: see [`Reflectance::mirror`].
    #[must_use]
    pub fn evaluate(&self, wi: Direction, wo: Direction, chi: Chi) -> LinearRgb {
        let Some(t) = self.terms(wi, wo, chi) else {
            return [0.0; 3];
        };
        std::array::from_fn(|k| (t.transmission * (t.base[k] + t.flakes[k]) + t.highlight).max(0.0))
    }

    /// Weight of the perfect mirror image seen from `wo`, dimensionless.
    #[must_use]
    pub fn mirror(&self, wo: Direction) -> f64 {
        if wo[2] <= 0.0 {
            return 0.0;
        }
        self.paint.coat.map_or(0.0, |coat| coat.mirror(wo[2]))
    }

    /// The terms of [`Reflectance::evaluate`], or `None` at or below the horizon.
    #[must_use]
    pub fn terms(&self, wi: Direction, wo: Direction, chi: Chi) -> Option<Terms> {
        if !(wi[2] > 0.0 && wo[2] > 0.0) {
            return None;
        }
        let (mut inner_i, mut inner_o, mut transmission, mut highlight) = (wi, wo, 1.0, 0.0);
        if let Some(coat) = self.paint.coat {
            inner_i = refract(wi, coat.ior);
            inner_o = refract(wo, coat.ior);
            transmission = coat::transmission(wi, wo, coat.ior);
            highlight = coat.highlight(wi, wo);
        }
        let half = half_angles(inner_i, inner_o);
        Some(Terms {
            half,
            transmission,
            base: self.base(&half, inner_i[2], inner_o[2], chi),
            flakes: self.mean_flakes(&half),
            highlight,
        })
    }

    fn base(&self, half: &HalfAngles, i_z: f64, o_z: f64, chi: Chi) -> LinearRgb {
        let mut sum = self.paint.diffuse.map(|a| a / PI);
        for lobe in self.paint.lobes.iter().filter(|lobe| !lobe.is_absent()) {
            let shape = lobe.shape(half, i_z, o_z);
            for (s, weight) in sum.iter_mut().zip(lobe.weight) {
                *s += weight * shape;
            }
        }
        let color = match chi {
            Chi::Overall => self.overall,
            Chi::Table => {
                let table = &self.paint.color_table;
                at_angles(&self.chi, table.theta_h(), table.theta_d(), half)
            }
        };
        std::array::from_fn(|k| color[k] * sum[k])
    }

    fn mean_flakes(&self, half: &HalfAngles) -> LinearRgb {
        let Some(flakes) = &self.paint.flakes else {
            return [0.0; 3];
        };
        at_angles(&self.flake_means, &flakes.theta_h, &flakes.theta_d, half)
    }
}
