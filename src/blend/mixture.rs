//! A paint's clusters at an angle pair that its own grid may not have.
//!
//! Between its angles a slice is the mixture of its neighbours' clusters with the bilinear weights, which has exactly
//! the mean that interpolating the neighbours' means has. Outside its range the border slice holds. Pictures are never
//! resampled. Mixed clusters ascend in lightness, as a slice's own do.

use crate::paint::{Bracket, Flakes};

/// One cluster of one paint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cluster {
    pub probability: f64,
    pub lower: [f32; 3],
    pub upper: [f32; 3],
}

impl Cluster {
    /// Everything black, in one cluster: a paint without flakes.
    pub const BLACK: Self = Self {
        probability: 1.0,
        lower: [0.0; 3],
        upper: [0.0; 3],
    };

    pub fn center(&self) -> [f64; 3] {
        std::array::from_fn(|k| f64::midpoint(f64::from(self.lower[k]), f64::from(self.upper[k])))
    }
}

/// Fills `out` with the clusters at an angle pair in degrees; those of probability 0 are left out.
pub(super) fn clusters_at(
    flakes: Option<&Flakes>,
    theta_h_deg: f64,
    theta_d_deg: f64,
    out: &mut Vec<Cluster>,
) {
    out.clear();
    let Some(flakes) = flakes else {
        out.push(Cluster::BLACK);
        return;
    };
    let (row, column) = (
        flakes.theta_h.bracket_of_near(theta_h_deg),
        flakes.theta_d.bracket_of_near(theta_d_deg),
    );
    let ends = |b: Bracket| [(b.low, 1.0 - b.fraction), (b.high, b.fraction)];
    let mut parts = 0;
    for (h, weight_h) in ends(row) {
        for (d, weight_d) in ends(column) {
            let weight = weight_h * weight_d;
            if weight == 0.0 {
                continue;
            }
            parts += 1;
            let slice = flakes.slice(h, d);
            for ((&p, &lower), &upper) in slice.probability.iter().zip(slice.lower).zip(slice.upper)
            {
                // What is below 0 or no number is passed on: a solver names it.
                if p * weight != 0.0 {
                    out.push(Cluster {
                        probability: p * weight,
                        lower,
                        upper,
                    });
                }
            }
        }
    }
    if parts > 1 {
        out.sort_by(|x, y| x.center()[0].total_cmp(&y.center()[0]));
    }
}
