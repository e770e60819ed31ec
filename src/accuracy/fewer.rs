//! What a paint loses with fewer angles, or with fewer clusters in its slices.

use rayon::prelude::*;

use super::geometries::{Geometry, geometries, slices_at};
use super::seen::{Noticed, Seen};
use crate::paint::{CarPaint, Flakes, LightnessMixture, Percentiles, SeenDifference};

/// Most slices that are compared.
const CHECKED: usize = 64;

/// Distance W1 of the lightnesses between slices that are left out and the mixtures of the kept ones that stand in for
/// them, Lab units, on at most 64 slices spread evenly over those left out.
#[must_use]
pub fn left_out_w1(flakes: &Flakes, step: usize) -> Percentiles {
    let (rows, columns) = (flakes.theta_h.every(step), flakes.theta_d.every(step));
    let (kept_h, kept_d) = (flakes.theta_h.at(&rows), flakes.theta_d.at(&columns));
    let width = flakes.theta_d.len();
    let left_out: Vec<usize> = (0..flakes.slices())
        .filter(|k| !rows.contains(&(k / width)) || !columns.contains(&(k % width)))
        .collect();
    let stride = left_out.len().div_ceil(CHECKED).max(1);
    let distances = left_out
        .into_par_iter()
        .step_by(stride)
        .map(|k| {
            let (h, d) = (
                flakes.theta_h.degrees()[k / width],
                flakes.theta_d.degrees()[k % width],
            );
            let parts: Vec<_> = slices_at(&kept_h, &kept_d, h, d)
                .into_iter()
                .map(|(weight, kept)| {
                    let (row, column) = (rows[kept / columns.len()], columns[kept % columns.len()]);
                    (weight, flakes.slice(row, column))
                })
                .collect();
            let own = LightnessMixture::of(&[(1.0, flakes.slice_at(k))]);
            own.distance(&LightnessMixture::of(&parts))
        })
        .collect();
    Percentiles::of(distances)
}

/// Distance W1 of the lightnesses between slices and the same slices with fewer clusters, Lab units, on at most 64 spread
/// evenly over them.
#[must_use]
pub fn reduced_w1(flakes: &Flakes, reduced: &Flakes) -> Percentiles {
    let stride = flakes.slices().div_ceil(CHECKED).max(1);
    let all = |of: &Flakes, k: usize| LightnessMixture::of(&[(1.0, of.slice_at(k))]);
    let checked = (0..flakes.slices()).into_par_iter().step_by(stride);
    let distances = checked.map(|k| all(flakes, k).distance(&all(reduced, k)));
    Percentiles::of(distances.collect())
}

/// What taking the latter flakes for the former changes at the six instrument geometries, over the base of a paint: with
/// fewer angles each is a mixture of other slices. `None` where the base tells nothing at one of them.
#[must_use]
pub fn seen_between(base: &CarPaint, own: &Flakes, taken: &Flakes) -> Option<SeenDifference> {
    let at = |geometry: &Geometry, flakes: &Flakes| {
        let met = geometry.slices(&flakes.theta_h, &flakes.theta_d);
        let parts: Vec<_> = met
            .into_iter()
            .map(|(weight, k)| (weight, flakes.slice_at(k)))
            .collect();
        Seen::of(geometry, &parts)
    };
    let noticed: Vec<Noticed> = geometries(base)
        .iter()
        .map(|geometry| at(geometry, taken).beside(&at(geometry, own)))
        .collect();
    let of = |get: fn(&Noticed) -> f64| -> Option<[f64; 6]> {
        let all: Vec<f64> = noticed.iter().map(get).collect();
        all.try_into().ok()
    };
    Some(SeenDifference {
        delta_e_2000: of(|own| own.delta_e_2000)?,
        sparkle: of(|own| own.sparkle)?,
        lit: of(|own| own.lit)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{AngleGrid, ColorTable, FlakeTexture};

    /// Five by one slices of one box each, a unit wide, as light as these.
    fn flakes(lightness: [f32; 5]) -> Flakes {
        Flakes {
            theta_h: AngleGrid::new(vec![0.0, 5.0, 10.0, 15.0, 20.0]).expect("ascends"),
            theta_d: AngleGrid::single(),
            offsets: vec![0, 1, 2, 3, 4, 5].into(),
            probability: vec![1.0; 5].into(),
            lower: lightness.map(|l| [l, 0.0, 0.0]).to_vec(),
            upper: lightness.map(|l| [l + 1.0, 0.0, 0.0]).to_vec(),
            texture: FlakeTexture {
                texel_um: 20.0,
                grain_um: 15.0,
                lifetime_deg: [5.0; 2],
                persistence_deg: [9.0; 2],
            },
        }
    }

    #[test]
    fn leaving_out_what_its_neighbours_say_costs_nothing() {
        assert_eq!(left_out_w1(&flakes([30.0; 5]), 2).worst, 0.0);
        assert_eq!(
            left_out_w1(&flakes([9.0, 7.0, 5.0, 3.0, 1.0]), 1).worst,
            0.0
        );
    }

    #[test]
    fn a_slice_between_a_dark_and_a_light_one_is_half_of_either_in_its_place() {
        // The darker half of 10..11, at 10.25 in the mean, goes to 0..1; the lighter to 20..21.
        let w1 = left_out_w1(&flakes([0.0, 10.0, 20.0, 20.0, 20.0]), 2);
        assert!((w1.worst - 9.75).abs() < 1e-6, "{w1:?}");
    }

    #[test]
    fn a_slice_with_one_cluster_for_two_has_moved_by_half_their_way() {
        let mut two = flakes([30.0; 5]);
        two.offsets = vec![0, 2, 3, 4, 5, 6].into();
        two.probability = vec![0.5, 0.5, 1.0, 1.0, 1.0, 1.0].into();
        two.lower.insert(0, [20.0, 0.0, 0.0]);
        two.upper.insert(0, [21.0, 0.0, 0.0]);
        let one = flakes([25.0, 30.0, 30.0, 30.0, 30.0]);
        let w1 = reduced_w1(&two, &one);
        // Halves of 25..26 go to 20..21 and to 30..31, by 4.75 each in the mean of what crosses.
        assert!((w1.worst - 4.75).abs() < 1e-6, "{w1:?}");
        assert_eq!(reduced_w1(&two, &two).worst, 0.0);
    }

    #[test]
    fn the_geometries_that_lose_their_slice_are_told_and_no_others() {
        // Light at 45 degrees: θh of -15° aspecular is 7.5, of 110° it is 55 degrees.
        let paint = |lightness| CarPaint {
            coat: None,
            diffuse: [0.1; 3],
            lobes: Vec::new(),
            color_table: ColorTable::white(),
            flakes: Some(flakes(lightness)),
        };
        let seen = |lightness| {
            let paint = paint(lightness);
            let own = paint.flakes.as_ref().expect("flakes");
            let seen = seen_between(&paint, own, &own.thinned(2)).expect("six geometries");
            [seen.delta_e_2000, seen.sparkle, seen.lit]
        };
        let none = |off: f64| off < 1e-9;
        let alike = seen([30.0; 5]);
        assert!(alike.into_iter().flatten().all(none), "{alike:?}");
        // The light slice at 5 degrees is left out.
        let [color, sparkle, lit] = seen([30.0, 80.0, 30.0, 30.0, 30.0]);
        assert!(color[0] > 5.0 && sparkle[0] > 0.3, "{color:?} {sparkle:?}");
        for at in 2..6 {
            let off = [color[at], sparkle[at], lit[at]];
            assert!(off.into_iter().all(none), "{at}: {off:?}");
        }
    }
}
