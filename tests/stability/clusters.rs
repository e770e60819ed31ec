//! Clusters of slices that are hardly pictures.

use crate::paints::Stream;
use carpaint::color::Lab;
use carpaint::fit::{BoxRule, ClusterSettings, Clusterer, NoTexel, SliceClusters, reduce_clusters};
use carpaint::paint::{CarPaint, Limits, Slice};
use std::f64::consts::PI;

fn cluster_into(pixels: &[[f32; 3]], clusters: usize) -> Result<SliceClusters, NoTexel> {
    cluster_by(pixels, clusters, BoxRule::Moments)
}

fn cluster_by(
    pixels: &[[f32; 3]],
    clusters: usize,
    box_rule: BoxRule,
) -> Result<SliceClusters, NoTexel> {
    let planes = [0, 1, 2].map(|k| pixels.iter().map(|p| p[k]).collect::<Vec<f32>>());
    let settings = ClusterSettings {
        clusters,
        box_rule,
        ..ClusterSettings::default()
    };
    Clusterer::default().cluster(planes.each_ref().map(Vec::as_slice), &settings)
}

fn mean_of(clusters: &SliceClusters) -> [f64; 3] {
    Slice {
        probability: &clusters.probability,
        lower: &clusters.lower,
        upper: &clusters.upper,
    }
    .mean()
}

/// Clusters a slice and checks what holds for all: 1 to n clusters, corners in order and in range, probabilities that
/// sum to 1, and the mean of the finite pixels within `tolerance` of the largest.
fn promised(pixels: &[[f32; 3]], most: usize, tolerance: f64) -> SliceClusters {
    let found = cluster_into(pixels, most).expect("a pixel is finite");
    let n = found.probability.len();
    assert!((1..=most).contains(&n), "{n} clusters");
    let finite: Vec<&[f32; 3]> = pixels
        .iter()
        .filter(|p| p.iter().all(|v| v.is_finite()))
        .collect();
    assert_eq!(found.dead, pixels.len() - finite.len());
    // Each probability is one division: half an ulp each, and half an ulp of 1 for each addition.
    let sum: f64 = found.probability.iter().sum();
    assert!((sum - 1.0).abs() <= f64::EPSILON * n as f64, "{sum}");
    assert!(found.probability.iter().all(|p| *p > 0.0));
    for (lower, upper) in found.lower.iter().zip(&found.upper) {
        for axis in 0..3 {
            assert!(lower[axis] <= upper[axis] && lower[axis] >= -2000.0 && upper[axis] <= 2000.0);
        }
    }
    let mean = mean_of(&found);
    for c in 0..3 {
        let want = finite.iter().map(|p| f64::from(p[c])).sum::<f64>() / finite.len() as f64;
        assert!(
            (mean[c] - want).abs() <= tolerance,
            "channel {c}: {} instead of {want}",
            mean[c]
        );
    }
    assert_variance_kept(pixels, &found, most);
    found
}

/// Colors of a leaf: how many, mean and variance of each axis.
struct Members {
    share: f64,
    mean: [f64; 3],
    variance: [f64; 3],
}

/// The members of each leaf, found from outside: tight boxes are the hulls of the same leaves, and hulls of leaves that
/// were split along axes do not meet.
fn members(labs: &[[f64; 3]], hulls: &SliceClusters) -> Vec<Members> {
    let mut of: Vec<Vec<&[f64; 3]>> = vec![Vec::new(); hulls.probability.len()];
    for lab in labs {
        let outside = |k: usize| -> f64 {
            (0..3)
                .map(|axis| {
                    let (low, high) = (
                        f64::from(hulls.lower[k][axis]),
                        f64::from(hulls.upper[k][axis]),
                    );
                    (low - lab[axis]).max(lab[axis] - high).max(0.0)
                })
                .fold(0.0, f64::max)
        };
        let nearest = (0..of.len()).min_by(|x, y| outside(*x).total_cmp(&outside(*y)));
        of[nearest.expect("a leaf")].push(lab);
    }
    let leaves = of.iter().zip(&hulls.probability).map(|(list, share)| {
        let n = list.len() as f64;
        assert_eq!(n, (share * labs.len() as f64).round(), "a leaf's members");
        let mean = [0, 1, 2].map(|k| list.iter().map(|lab| lab[k]).sum::<f64>() / n);
        let square = |k: usize| {
            list.iter()
                .map(|lab| (lab[k] - mean[k]).powi(2))
                .sum::<f64>()
        };
        Members {
            share: *share,
            mean,
            variance: [0, 1, 2].map(|k| square(k) / n),
        }
    });
    leaves.collect()
}

/// What the quick Lab of texels is off by at the most, L, a and b: 2e-6 of f and four roundings of single precision of the
/// light on the linear branch; a and b are 500 and 200 times a difference of two.
fn quick_lab(brightest: f64) -> [f64; 3] {
    let (light, single) = (brightest * PI, f64::from(f32::EPSILON));
    let f = light.cbrt().max(0.21);
    let off = (1.5e-6 + 4.0 * single) * f + 4.0 * single * light.min(0.01) / (3.0 * 0.0428);
    [116.0 * off, 1000.0 * off, 400.0 * off]
}

/// Every box has its members' variance, and the slice has its pixels' but for what moving the middles did:
///
/// ```text
/// Δvar = Σ p (s² + 2 s (m − M)) − (Σ p s)²     s a middle's shift, m its members' mean, M the slice's
/// ```
///
/// One box may be a single color instead, the one around the 99.9th percentile, of eight texels at the most: Δvar falls
/// by its members' variance.
fn assert_variance_kept(pixels: &[[f32; 3]], found: &SliceClusters, most: usize) {
    let finite = pixels.iter().filter(|p| p.iter().all(|v| v.is_finite()));
    let labs: Vec<[f64; 3]> = finite
        .map(|p| Lab::from_rgb(p.map(|v| f64::from(v) * PI)).to_array())
        .collect();
    let brightest = pixels.iter().flatten().filter(|v| v.is_finite());
    let brightest = brightest.fold(0.0_f64, |m, v| m.max(f64::from(v.abs())));
    let off = quick_lab(brightest);
    let hulls = cluster_by(pixels, most, BoxRule::Tight).expect("a pixel is finite");
    let leaves = members(&labs, &hulls);
    assert_eq!(leaves.len(), found.probability.len());
    let (mut left, mut flat): (Vec<usize>, usize) = ((0..leaves.len()).collect(), 0);
    let mut pairs = Vec::new();
    for leaf in &leaves {
        let away = |k: &usize| -> f64 {
            let slice = (found.lower[*k], found.upper[*k]);
            let center =
                |axis: usize| f64::from(slice.0[axis]) / 2.0 + f64::from(slice.1[axis]) / 2.0;
            (0..3)
                .map(|axis| (center(axis) - leaf.mean[axis]).abs())
                .sum()
        };
        let alike = left
            .iter()
            .enumerate()
            .filter(|(_, k)| (found.probability[**k] - leaf.share).abs() < 1e-12);
        let place = alike.min_by(|x, y| away(x.1).total_cmp(&away(y.1)));
        let place = place.expect("a box of as many members").0;
        pairs.push((leaf, left.swap_remove(place)));
    }
    let mut point = vec![false; pairs.len()];
    for (number, (leaf, k)) in pairs.iter().enumerate() {
        let width =
            |axis: usize| f64::from(found.upper[*k][axis]) - f64::from(found.lower[*k][axis]);
        if (0..3).all(|axis| width(axis) == 0.0) && leaf.variance != [0.0; 3] {
            let count = leaf.share * labs.len() as f64;
            let differs = (0..3).any(|axis| leaf.variance[axis].sqrt() > 2.0 * off[axis]);
            flat += usize::from(differs);
            point[number] = differs;
            assert!(!differs || count <= 8.5, "a color for {count} texels");
        }
        for axis in (0..3).filter(|_| !point[number]) {
            // Corners are rounded to single precision, each by half an ulp.
            let corner = f64::from(found.upper[*k][axis].abs().max(found.lower[*k][axis].abs()));
            let accepted = off[axis] + corner * f64::from(f32::EPSILON);
            let spread = leaf.variance[axis].sqrt();
            assert!(
                (width(axis) / 12.0_f64.sqrt() - spread).abs() <= accepted,
                "axis {axis}: a box as wide as {} for {spread}",
                width(axis) / 12.0_f64.sqrt()
            );
        }
    }
    assert!(flat <= 1, "{flat} boxes are single colors");
    for axis in 0..3 {
        let mean = leaves.iter().map(|l| l.share * l.mean[axis]).sum::<f64>();
        let want = labs
            .iter()
            .map(|lab| (lab[axis] - mean).powi(2))
            .sum::<f64>()
            / labs.len() as f64;
        let (mut first, mut second, mut moved, mut shifts, mut rounding) =
            (0.0, 0.0, 0.0, 0.0, 0.0);
        for (number, (leaf, k)) in pairs.iter().enumerate() {
            let (low, high) = (
                f64::from(found.lower[*k][axis]),
                f64::from(found.upper[*k][axis]),
            );
            let center = f64::midpoint(low, high) - mean;
            first += leaf.share * center;
            second += leaf.share * (center * center + (high - low).powi(2) / 12.0);
            let (offset, spread) = (leaf.mean[axis] - mean, leaf.variance[axis].sqrt());
            let shift = center - offset;
            moved += leaf.share * (shift * shift + 2.0 * shift * offset);
            shifts += leaf.share * shift;
            if point[number] {
                moved -= leaf.share * leaf.variance[axis];
            }
            let accepted = off[axis] + (low.abs() + high.abs()) * f64::from(f32::EPSILON);
            rounding += leaf.share * (2.0 * spread + accepted) * accepted;
        }
        let kept = second - first * first;
        let expected = want + moved - shifts * shifts;
        assert!(
            (kept - expected).abs() <= rounding,
            "axis {axis}: {kept} instead of {expected} = {want} + {moved}, ± {rounding}"
        );
    }
}

/// What corners in f32 can do to a mean: half an ulp of the largest coordinate of Lab moves light by its slope
/// dY/dL = 3 f²/116, over π; a and b add as much again, and the matrix to RGB three times that.
fn corner_rounding(pixels: &[[f32; 3]]) -> f64 {
    let light = pixels
        .iter()
        .flatten()
        .fold(0.01_f64, |m, v| m.max(f64::from(v.abs())))
        * PI;
    let f = light.cbrt().max(0.21);
    let lab = (116.0 * f).max(16.0) * f64::from(f32::EPSILON) / 2.0;
    // Lab of dark texels carries 2e-6 of f, where it decides a box that a single color fills: mean_color then
    // inverts exactly, so that only the corners' rounding stays.
    3.0 * 3.0 * 3.0 * f * f / 116.0 * lab / PI
}

#[test]
fn a_slice_of_one_color_is_one_point_of_that_color() {
    for color in [[0.2, 0.1, 0.05], [0.0; 3], [1e-6; 3], [30.0, 20.0, 10.0]] {
        let pixels = vec![color; 4096];
        let found = promised(&pixels, 50, corner_rounding(&pixels));
        assert_eq!(
            (found.probability.as_slice(), &found.lower),
            (&[1.0][..], &found.upper)
        );
    }
}

#[test]
fn a_slice_of_two_colors_is_two_points_with_their_shares() {
    let pixels: Vec<[f32; 3]> = (0..4096)
        .map(|k| {
            if k % 4 == 0 {
                [0.5; 3]
            } else {
                [0.1, 0.1, 0.3]
            }
        })
        .collect();
    let found = promised(&pixels, 50, corner_rounding(&pixels));
    assert_eq!(found.probability, [0.75, 0.25]);
    assert_eq!(found.lower, found.upper);
}

#[test]
fn all_black_is_one_black_cluster() {
    let found = promised(&vec![[0.0; 3]; 4096], 50, 0.0);
    assert_eq!(found.probability, [1.0]);
    assert_eq!(mean_of(&found), [0.0; 3]);
}

#[test]
fn sensor_noise_around_zero_keeps_its_mean_though_half_of_it_is_negative() {
    let mut random = Stream(3);
    let pixels: Vec<[f32; 3]> = (0..4096)
        .map(|_| [0; 3].map(|_| random.within(-2e-4, 1.9e-4) as f32))
        .collect();
    let found = promised(&pixels, 50, corner_rounding(&pixels));
    assert!(found.probability.len() > 20);
    // Uniform noise of this width has σ = 3.9e-4/√12; the mean of 4096 lies within five standard errors of its own.
    let error = 3.9e-4 / 12.0_f64.sqrt() / 4096.0_f64.sqrt();
    assert!(
        mean_of(&found)
            .iter()
            .all(|v| (v + 5e-6).abs() < 5.0 * error)
    );
}

#[test]
fn one_pixel_a_million_times_the_rest_is_kept_as_the_sparkle_it_is() {
    let mut pixels = vec![[1e-4_f32, 2e-4, 1e-4]; 4096];
    pixels[100] = [100.0, 200.0, 100.0];
    let found = promised(&pixels, 50, corner_rounding(&pixels) / 4096.0 + 1e-9);
    assert_eq!(found.beyond, 0);
    assert_eq!(found.probability, [4095.0 / 4096.0, 1.0 / 4096.0]);
    // The naive mean in f32 would have lost the crowd's share beside the pixel: 4095 additions of 1e-4 to 100.
    let in_f32 = pixels.iter().map(|p| p[0]).sum::<f32>() / 4096.0;
    let exact = pixels.iter().map(|p| f64::from(p[0])).sum::<f64>() / 4096.0;
    assert!(
        (f64::from(in_f32) - exact).abs() > 1e-7,
        "f32 would have been good enough"
    );
}

#[test]
fn a_pixel_brighter_than_any_color_is_held_at_the_bound_and_counted() {
    for bright in [1e6, 1e30, f32::MAX] {
        let mut pixels = vec![[0.1_f32; 3]; 4096];
        pixels[7] = [bright; 3];
        let found = cluster_into(&pixels, 50).expect("finite pixels");
        assert_eq!((found.beyond, found.dead), (1, 0));
        assert!(found.upper.iter().flatten().all(|v| *v <= 2000.0));
        // The one pixel is a cluster of its own, held at the bound.
        let place = found.upper.iter().position(|upper| upper[0] == 2000.0);
        let place = place.expect("a cluster at the bound");
        assert_eq!(found.probability[place], 1.0 / 4096.0);
        assert_eq!(
            found.lower[place], found.upper[place],
            "one texel, one color"
        );
        // Lab of bright texels is good to 2e-6 of f, 17.4 at the bound: 500 times that in a.
        let [_, a, b] = found.upper[place];
        assert!(a.abs() < 0.02 && b.abs() < 0.02, "{a} {b}");
        // L = 2000 is a light of 17.4³ = 5250, of which one in 4096 is 1.28/π.
        let bound = (2016.0_f64 / 116.0).powi(3) / PI;
        let want = (4095.0 * f64::from(0.1_f32) + bound) / 4096.0;
        // Light moves by 3 f²/500 · 1.09 · 3.24 of a, over 4096 π: 5e-4 of 0.02.
        for mean in mean_of(&found) {
            assert!((mean - want).abs() <= 1e-5, "{mean} instead of {want}");
        }
    }
}

#[test]
fn four_dead_pixels_are_left_out_and_counted() {
    let mut random = Stream(4);
    let mut pixels: Vec<[f32; 3]> = (0..4096)
        .map(|_| [0; 3].map(|_| random.unit() as f32))
        .collect();
    for (k, dead) in [
        (0, f32::NAN),
        (17, f32::INFINITY),
        (2000, f32::NEG_INFINITY),
        (4095, f32::NAN),
    ] {
        pixels[k][k % 3] = dead;
    }
    assert_eq!(promised(&pixels, 50, corner_rounding(&[[1.0; 3]])).dead, 4);
}

#[test]
fn a_slice_without_a_finite_pixel_is_refused_by_name() {
    assert_eq!(
        cluster_into(&[[f32::NAN; 3]; 9], 50),
        Err(NoTexel { pixels: 9 })
    );
    assert_eq!(
        cluster_into(&[[f32::INFINITY, 0.0, 0.0]], 50),
        Err(NoTexel { pixels: 1 })
    );
    assert_eq!(cluster_into(&[], 50), Err(NoTexel { pixels: 0 }));
}

#[test]
fn a_picture_of_one_pixel_is_one_cluster() {
    let found = promised(&[[0.3, 0.2, 0.1]], 50, corner_rounding(&[[0.3; 3]]));
    assert_eq!(found.probability, [1.0]);
    assert_eq!(found.lower, found.upper);
}

#[test]
fn fifty_clusters_from_three_pixels_are_three() {
    let pixels = [[0.3; 3], [0.1, 0.2, 0.3], [0.9, 0.1, 0.2]];
    let found = promised(&pixels, 50, corner_rounding(&pixels));
    assert_eq!(found.probability, [1.0 / 3.0; 3]);
    assert_eq!(
        promised(&pixels, 1, corner_rounding(&pixels)).probability,
        [1.0]
    );
    // Not asking for any cluster is asking for one.
    assert_eq!(cluster_into(&pixels, 0).expect("finite").probability, [1.0]);
}

#[test]
fn mean_and_variance_of_a_sparkling_slice_are_kept() {
    let mut random = Stream(5);
    let pixels: Vec<[f32; 3]> = (0..4096)
        .map(|_| {
            let flake = 0.02 * (-random.unit().ln()).powf(1.7);
            [0.02 + flake, 0.02 + 0.9 * flake, 0.03 + 0.7 * flake].map(|v| v as f32)
        })
        .collect();
    let found = promised(&pixels, 50, corner_rounding(&pixels));
    assert_eq!(found.probability.len(), 50);
    let few = promised(&pixels, 3, corner_rounding(&pixels));
    assert_eq!(few.probability.len(), 3);
}

#[test]
fn merging_clusters_keeps_mass_and_mean() {
    let paint = crate::paints::metallic(9, &[0.0, 20.0], &[0.0, 30.0]);
    let flakes = paint.flakes.as_ref().expect("has flakes");
    for most in [1, 2, 5, 6, 7, 50] {
        let fewer = reduce_clusters(flakes, most);
        assert!(fewer.widest_slice() <= most);
        for k in 0..flakes.slices() {
            let (before, after) = (flakes.slice_at(k), fewer.slice_at(k));
            let sum: f64 = after.probability.iter().sum();
            // Masses that summed to 1 ± 7 roundings are added pairwise six times more.
            assert!((sum - 1.0).abs() <= 14.0 * f64::EPSILON, "{sum}");
            for (x, y) in after.mean().iter().zip(before.mean()) {
                assert!(
                    (x - y).abs() <= corner_rounding(&[[0.2; 3]]),
                    "{most}: {x} {y}"
                );
            }
        }
        let reduced = CarPaint {
            flakes: Some(fewer),
            ..paint.clone()
        };
        reduced.validate(&Limits::default()).expect("still a paint");
    }
}
