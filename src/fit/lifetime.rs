//! Lifetime: how far the angle turns until a flake has gone dark, and the persistence that reproduces it.
//!
//! The lifetime along an axis is the angle at which the correlation of a slice with its neighbours along that axis falls
//! to one half, linear between slices. When texels are drawn, a cell keeps its number over Δ with the probability
//! `1 − Δ/persistence`, and while it does, its place in the order of brightness: neighbouring slices then correlate like
//! their distributions in step (comonotone), `ρ(Δ) ≤ 1`; afterwards not at all. The persistence is solved from
//!
//! ```text
//! (1 − Δ/persistence) ρ(Δ)  falls to one half at the lifetime
//! ```
//!
//! `ρ` comes from the clusters in closed form: in step, both slices show pieces of two boxes with the same place inside,
//! so the product of two luminances is a polynomial of degree six on each piece.

use super::grain::Luminance;
use crate::paint::{LIFETIMES_DEG, Slice};

/// Angle that a flake's number is kept for when nothing in the slices ever makes it change, degrees.
pub(super) const ENDLESS_DEG: f64 = 1e4;

/// Lifetime and persistence along one axis, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lifetime {
    pub lifetime_deg: f64,
    pub persistence_deg: f64,
}

/// Correlation of two slices' texels; `None` when one of them does not vary.
pub(super) fn correlation(x: &Luminance, y: &Luminance) -> Option<f64> {
    let (mx, my) = (x.mean(), y.mean());
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (a, b) in x.values.iter().zip(&y.values) {
        let (a, b) = (f64::from(*a) - mx, f64::from(*b) - my);
        xx += a * a;
        yy += b * b;
        xy += a * b;
    }
    let scale = (xx * yy).sqrt();
    (scale > 0.0 && scale.is_finite()).then(|| xy / scale)
}

/// Lifetime over neighbours at `angles` (the first is the slice itself), whose correlations are `measured`, and whose
/// comonotone correlations `in_step` computes on demand.
pub(super) fn lifetime(
    angles: &[f64],
    measured: &[Option<f64>],
    in_step: impl Fn(usize) -> f64,
) -> Lifetime {
    let offsets: Vec<f64> = angles.iter().map(|a| a - angles[0]).collect();
    // A neighbour that does not vary says nothing; the curve ends there.
    let known = measured.iter().skip(1).take_while(|r| r.is_some()).count();
    let curve: Vec<f64> = std::iter::once(1.0)
        .chain(measured.iter().skip(1).map_while(|r| *r))
        .collect();
    if known == 0 {
        return Lifetime {
            lifetime_deg: 90.0,
            persistence_deg: ENDLESS_DEG,
        };
    }
    let Some(crossing) = half_fall(&offsets, &curve) else {
        // It never falls to half: what is known is how far it fell over the whole range.
        let (last, fell) = (offsets[known], curve[known]);
        let kept = (fell / in_step(known)).clamp(0.0, 1.0);
        let persistence_deg = if kept < 1.0 {
            (last / (1.0 - kept)).clamp(LIFETIMES_DEG[0], ENDLESS_DEG)
        } else {
            ENDLESS_DEG
        };
        return Lifetime {
            lifetime_deg: last.max(LIFETIMES_DEG[0]),
            persistence_deg,
        };
    };
    // Drawn texels must fall to half between the same neighbours: no others are needed.
    let upto = offsets
        .iter()
        .position(|d| *d >= crossing)
        .unwrap_or(known)
        .clamp(1, known);
    let in_step: Vec<f64> = (0..=upto)
        .map(|k| if k == 0 { 1.0 } else { in_step(k) })
        .collect();
    let drawn_fall = |persistence: f64| {
        let kept = |k: usize| (1.0 - offsets[k] / persistence).max(0.0) * in_step[k];
        half_fall(&offsets, &(0..=upto).map(kept).collect::<Vec<_>>()).unwrap_or(f64::INFINITY)
    };
    let (mut low, mut high) = (crossing / 16.0, ENDLESS_DEG);
    for _ in 0..100 {
        let middle = (low * high).sqrt();
        if drawn_fall(middle) < crossing {
            low = middle;
        } else {
            high = middle;
        }
    }
    Lifetime {
        lifetime_deg: crossing.max(LIFETIMES_DEG[0]),
        persistence_deg: (low * high).sqrt().max(LIFETIMES_DEG[0]),
    }
}

/// Where a curve that begins at 1 falls to one half.
fn half_fall(offsets: &[f64], curve: &[f64]) -> Option<f64> {
    let below = curve.iter().position(|c| *c < 0.5).filter(|k| *k > 0)?;
    let (y0, y1) = (curve[below - 1], curve[below]);
    Some(offsets[below - 1] + (y0 - 0.5) / (y0 - y1) * (offsets[below] - offsets[below - 1]))
}

/// Correlation of two slices' luminances when every texel keeps its place in the order of clusters and in its box.
pub(super) fn comonotone(x: Slice, y: Slice) -> f64 {
    let (mut sum_x, mut sum_y, mut sum_xx, mut sum_yy, mut sum_xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let (mut i, mut j) = (0, 0);
    let (mut left_x, mut left_y) = (x.probability[0], y.probability[0]);
    loop {
        let share = left_x.min(left_y);
        for (node, weight) in GAUSS {
            let (a, b) = (light(&x, i, node), light(&y, j, node));
            let w = share * weight;
            sum_x += w * a;
            sum_y += w * b;
            sum_xx += w * a * a;
            sum_yy += w * b * b;
            sum_xy += w * a * b;
        }
        left_x -= share;
        left_y -= share;
        // Rounding may leave a crumb of the last cluster on one side: it is the end of both.
        if left_x <= left_y {
            i += 1;
            let Some(next) = x.probability.get(i) else {
                break;
            };
            left_x += next;
        } else {
            j += 1;
            let Some(next) = y.probability.get(j) else {
                break;
            };
            left_y += next;
        }
    }
    let scale = ((sum_xx - sum_x * sum_x) * (sum_yy - sum_y * sum_y)).sqrt();
    if scale > 0.0 {
        (sum_xy - sum_x * sum_y) / scale
    } else {
        0.0
    }
}

/// Nodes and weights on 0..1, exact to degree seven.
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_1),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_1),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Relative luminance at a place of the lightness axis of a box.
fn light(slice: &Slice, cluster: usize, place: f64) -> f64 {
    let (low, high) = (
        f64::from(slice.lower[cluster][0]),
        f64::from(slice.upper[cluster][0]),
    );
    crate::color::expand((low + (high - low) * place + 16.0) / 116.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exponential fall of the texels over slices that are all alike: (1 − Δ/p) is half at p/2.
    #[test]
    fn alike_slices_need_twice_the_lifetime_as_persistence() {
        let angles: Vec<f64> = (0..20).map(|k| f64::from(k) * 0.5).collect();
        let measured: Vec<Option<f64>> = angles.iter().map(|a| Some((-a / 4.0).exp())).collect();
        let found = lifetime(&angles, &measured, |_| 1.0);
        // Linear between neighbours half a degree apart: off by h²/8 of the second derivative over the slope.
        assert!(
            (found.lifetime_deg - 4.0 * std::f64::consts::LN_2).abs() < 0.01,
            "{found:?}"
        );
        assert!(
            (found.persistence_deg - 2.0 * found.lifetime_deg).abs() < 1e-6,
            "{found:?}"
        );
    }

    #[test]
    fn slices_out_of_step_ask_for_more_persistence() {
        let angles = [0.0, 2.0, 4.0, 6.0];
        let measured = [Some(1.0), Some(0.8), Some(0.6), Some(0.4)];
        let found = lifetime(&angles, &measured, |k| [1.0, 0.95, 0.9, 0.85][k]);
        assert!((found.lifetime_deg - 5.0).abs() < 1e-12);
        let kept = |d: f64, rho: f64| (1.0 - d / found.persistence_deg) * rho;
        let at_five = f64::midpoint(kept(4.0, 0.9), kept(6.0, 0.85));
        assert!((at_five - 0.5).abs() < 1e-9, "{at_five}");
    }

    #[test]
    fn a_flake_that_never_goes_dark_lives_as_long_as_the_range() {
        let found = lifetime(
            &[10.0, 20.0, 30.0],
            &[Some(1.0), Some(0.95), Some(0.9)],
            |_| 1.0,
        );
        assert_eq!(found.lifetime_deg, 20.0);
        assert!((found.persistence_deg - 200.0).abs() < 1e-9);
        let alone = lifetime(&[10.0], &[Some(1.0)], |_| 1.0);
        assert_eq!(alone.persistence_deg, ENDLESS_DEG);
        let dark = lifetime(&[0.0, 5.0], &[None, None], |_| 1.0);
        assert_eq!(dark.persistence_deg, ENDLESS_DEG);
    }

    #[test]
    fn a_slice_is_in_step_with_itself_and_with_its_brighter_self() {
        let (lower, upper) = (
            [[0.0_f32; 3], [20.0; 3], [60.0; 3]],
            [[10.0_f32; 3], [30.0; 3], [90.0; 3]],
        );
        let one = Slice {
            probability: &[0.5, 0.3, 0.2],
            lower: &lower,
            upper: &upper,
        };
        assert!((comonotone(one, one) - 1.0).abs() < 1e-12);
        let split = [0.5, 0.3 - 1e-17, 0.2 + 1e-17];
        let other = Slice {
            probability: &split,
            ..one
        };
        assert!((comonotone(one, other) - 1.0).abs() < 1e-9);
    }
}
