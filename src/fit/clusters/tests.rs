//! Tests of `clusters`.

use super::*;
use crate::color::{Lab, luminance};
use crate::paint::{MAX_LAB, Slice};
use std::f64::consts::PI;

fn cluster_by(pixels: &[[f32; 3]], settings: ClusterSettings) -> Result<SliceClusters, NoTexel> {
    let plane = |k: usize| -> Vec<f32> { pixels.iter().map(|p| p[k]).collect() };
    let (red, green, blue) = (plane(0), plane(1), plane(2));
    Clusterer::default().cluster([&red, &green, &blue], &settings)
}

fn cluster(pixels: &[[f32; 3]]) -> SliceClusters {
    let clusters = cluster_by(pixels, ClusterSettings::default()).expect("has texels");
    let n = clusters.probability.len();
    assert!((1..=50).contains(&n) && clusters.lower.len() == n && clusters.upper.len() == n);
    let sum: f64 = clusters.probability.iter().sum();
    assert!((sum - 1.0).abs() <= f64::EPSILON * n as f64, "{sum}");
    for (lower, upper) in clusters.lower.iter().zip(&clusters.upper) {
        for k in 0..3 {
            assert!(
                lower[k] <= upper[k] && f64::from(lower[k].abs().max(upper[k].abs())) <= MAX_LAB
            );
        }
    }
    clusters
}

fn slice(clusters: &SliceClusters) -> Slice<'_> {
    Slice {
        probability: &clusters.probability,
        lower: &clusters.lower,
        upper: &clusters.upper,
    }
}

/// Mean of the finite pixels, 1/sr.
fn mean_of(pixels: &[[f32; 3]]) -> [f64; 3] {
    let finite: Vec<_> = pixels
        .iter()
        .filter(|p| p.iter().all(|v| v.is_finite()))
        .collect();
    [0, 1, 2].map(|k| finite.iter().map(|p| f64::from(p[k])).sum::<f64>() / finite.len() as f64)
}

/// Corners round to `f32`: L, a, b to 2^-24 of themselves, light to three times that and the matrix' condition, 5.
fn assert_mean(clusters: &SliceClusters, pixels: &[[f32; 3]]) {
    let (got, want) = (slice(clusters).mean(), mean_of(pixels));
    let scale = pixels
        .iter()
        .flatten()
        .filter(|v| v.is_finite())
        .fold(0.0, |s, v| s + f64::from(v.abs()));
    for k in 0..3 {
        let tolerance = 2e-6 * (scale / pixels.len() as f64) + 1e-9;
        assert!(
            (got[k] - want[k]).abs() <= tolerance,
            "{got:?} instead of {want:?}"
        );
    }
}

/// Numbers between 0 and 1, the same on every run.
fn noise(k: usize, salt: u64) -> f64 {
    let mut h = (k as u64 ^ salt << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ h >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93);
    ((h ^ h >> 32) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A slice as cameras see it: exponential brightness under sensor noise, two tints, one texel in thirty a flake.
fn sparkling(count: usize, salt: u64) -> Vec<[f32; 3]> {
    let pixel = |k: usize| {
        let lit = if noise(k, salt) < 0.03 { 2.0 } else { 0.01 };
        let light = -lit * noise(k, salt + 1).ln();
        let tint = if noise(k, salt + 2) < 0.5 {
            [1.0, 0.8, 0.4]
        } else {
            [0.3, 0.7, 1.0]
        };
        [0, 1, 2].map(|c| (light * tint[c] + 3e-4 * (noise(k, salt + 3 + c as u64) - 0.5)) as f32)
    };
    (0..count).map(pixel).collect()
}

/// Luminances of stratified draws from the clusters, sorted.
fn drawn(clusters: &SliceClusters, count: usize) -> Vec<f64> {
    let mut light = Vec::with_capacity(count);
    let (mut k, mut sum) = (0, clusters.probability[0]);
    for j in 0..count {
        while (j as f64 + 0.5) / count as f64 > sum && k + 1 < clusters.probability.len() {
            k += 1;
            sum += clusters.probability[k];
        }
        let at = |axis: usize| {
            let (low, high) = (
                f64::from(clusters.lower[k][axis]),
                f64::from(clusters.upper[k][axis]),
            );
            low + (high - low) * noise(j, 90 + axis as u64)
        };
        light.push(
            luminance(
                Lab {
                    l: at(0),
                    a: at(1),
                    b: at(2),
                }
                .to_rgb(),
            ) / PI,
        );
    }
    light.sort_by(f64::total_cmp);
    light
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (low, part) = (place.floor() as usize, place.fract());
    sorted[low] + part * (sorted[(low + 1).min(sorted.len() - 1)] - sorted[low])
}

#[test]
fn the_mean_is_exact_and_the_sparkle_is_kept() {
    for (count, salt) in [
        (1089, 10),
        (1600, 30),
        (2304, 40),
        (3136, 50),
        (4096, 1),
        (4096, 20),
        (9216, 60),
        (16384, 80),
    ] {
        let pixels = sparkling(count, salt);
        let clusters = cluster(&pixels);
        assert_mean(&clusters, &pixels);
        let mut light: Vec<f64> = pixels.iter().map(|p| luminance(p.map(f64::from))).collect();
        light.sort_by(f64::total_cmp);
        let draws = drawn(&clusters, 300_000);
        let sparkle = percentile(&draws, 0.999) / percentile(&light, 0.999);
        assert!(
            (sparkle - 1.0).abs() < 0.05,
            "{count}: 99.9th percentile off by {sparkle}"
        );
        let spread = |v: &[f64]| {
            let mean = v.iter().sum::<f64>() / v.len() as f64;
            (v.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / v.len() as f64).sqrt()
        };
        let spread = spread(&draws) / spread(&light);
        assert!(
            (spread - 1.0).abs() < 0.02,
            "{count}: standard deviation off by {spread}"
        );
    }
}

#[test]
fn the_variance_in_lab_is_kept() {
    let pixels = sparkling(4096, 7);
    let clusters = cluster(&pixels);
    for axis in 0..3 {
        let labs = pixels
            .iter()
            .map(|p| Lab::from_rgb(p.map(|v| f64::from(v) * PI)).to_array()[axis]);
        let labs: Vec<f64> = labs.collect();
        let mean = labs.iter().sum::<f64>() / labs.len() as f64;
        let want = labs.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / labs.len() as f64;
        let moments = clusters
            .probability
            .iter()
            .zip(clusters.lower.iter().zip(&clusters.upper));
        let (mut first, mut second) = (0.0, 0.0);
        for (p, (lower, upper)) in moments {
            let (low, high) = (f64::from(lower[axis]), f64::from(upper[axis]));
            first += p * f64::midpoint(low, high);
            second += p * ((low * low + low * high + high * high) / 3.0);
        }
        // Boxes keep their members' variance; moving their middles to keep the mean of light changes a little.
        let got = second - first * first;
        assert!(
            (got / want - 1.0).abs() < 0.02,
            "axis {axis}: {got} instead of {want}"
        );
    }
}

#[test]
fn one_color_is_one_cluster_and_two_are_two() {
    let one = cluster(&vec![[0.2, 0.1, 0.05]; 4096]);
    assert_eq!(
        (one.probability.as_slice(), &one.lower),
        (&[1.0][..], &one.upper)
    );
    assert_mean(&one, &[[0.2, 0.1, 0.05]]);
    let two: Vec<[f32; 3]> = (0..4096)
        .map(|k| {
            if k % 4 == 0 {
                [0.5; 3]
            } else {
                [0.1, 0.1, 0.3]
            }
        })
        .collect();
    let clusters = cluster(&two);
    assert_eq!(clusters.probability, [0.75, 0.25]);
    assert_mean(&clusters, &two);
}

#[test]
fn black_is_black_and_noise_around_it_keeps_its_mean() {
    let black = cluster(&vec![[0.0; 3]; 4096]);
    assert_eq!(black.probability, [1.0]);
    assert!(slice(&black).mean().iter().all(|v| v.abs() < 1e-9));
    let noise: Vec<[f32; 3]> = (0..4096)
        .map(|k| [0, 1, 2].map(|c| (2e-4 * (noise(k, c) - 0.6)) as f32))
        .collect();
    let clusters = cluster(&noise);
    assert!(mean_of(&noise)[0] < 0.0);
    assert_mean(&clusters, &noise);
}

#[test]
fn one_pixel_a_million_times_brighter_is_kept_or_held_and_told() {
    let mut pixels = vec![[1e-4_f32, 2e-4, 1e-4]; 4096];
    pixels[100] = [100.0, 200.0, 100.0];
    let clusters = cluster(&pixels);
    assert_eq!(clusters.beyond, 0);
    assert_mean(&clusters, &pixels);
    pixels[100] = [1e6; 3];
    let clusters = cluster(&pixels);
    assert_eq!(clusters.beyond, 1);
    assert!(slice(&clusters).mean()[0] < 1.0);
}

#[test]
fn dead_pixels_are_left_out_and_a_dead_slice_is_refused() {
    let mut pixels = sparkling(4096, 3);
    for k in [0, 17, 2000, 4095] {
        pixels[k][k % 3] = f32::NAN;
    }
    let clusters = cluster(&pixels);
    assert_eq!(clusters.dead, 4);
    assert_mean(&clusters, &pixels);
    let dead = cluster_by(&[[f32::NAN; 3]; 9], ClusterSettings::default());
    assert_eq!(dead, Err(NoTexel { pixels: 9 }));
    assert_eq!(
        cluster_by(&[], ClusterSettings::default()),
        Err(NoTexel { pixels: 0 })
    );
}

#[test]
fn few_pixels_make_few_clusters() {
    assert_eq!(cluster(&[[0.3; 3]]).probability, [1.0]);
    let three = cluster(&[[0.3; 3], [0.1, 0.2, 0.3], [0.9, 0.1, 0.2]]);
    assert_eq!(three.probability, [1.0 / 3.0; 3]);
    for count in [2, 5, 60, 200, 700, 1100] {
        let pixels = sparkling(count, 11);
        assert_mean(&cluster(&pixels), &pixels);
    }
}

#[test]
fn any_number_of_clusters_keeps_the_mean() {
    let pixels = sparkling(4096, 5);
    for clusters in [1, 2, 5, 14, 15, 25, 30, 39, 50, 100, 400, 4096] {
        let settings = ClusterSettings {
            clusters,
            ..ClusterSettings::default()
        };
        let found = cluster_by(&pixels, settings).expect("has texels");
        assert!(found.probability.len() <= clusters, "{clusters}");
        assert_mean(&found, &pixels);
    }
}

#[test]
fn tight_boxes_hold_every_texel() {
    let pixels = sparkling(1000, 9);
    let settings = ClusterSettings {
        box_rule: BoxRule::Tight,
        ..ClusterSettings::default()
    };
    let clusters = cluster_by(&pixels, settings).expect("has texels");
    for pixel in &pixels {
        let lab = Lab::from_rgb(pixel.map(|v| f64::from(v) * PI)).to_array();
        let inside = |(lower, upper): (&[f32; 3], &[f32; 3])| {
            (0..3).all(|k| {
                (f64::from(lower[k]) - 1e-2..=f64::from(upper[k]) + 1e-2).contains(&lab[k])
            })
        };
        assert!(
            clusters.lower.iter().zip(&clusters.upper).any(inside),
            "{lab:?}"
        );
    }
}

#[test]
fn clusters_ascend_in_lightness_and_room_used_before_changes_nothing() {
    let (first, second) = (sparkling(4096, 1), sparkling(2000, 2));
    let mut room = Clusterer::default();
    let planes = |p: &[[f32; 3]]| [0, 1, 2].map(|k| p.iter().map(|v| v[k]).collect::<Vec<f32>>());
    let (a, b) = (planes(&first), planes(&second));
    let settings = ClusterSettings::default();
    let alone = room
        .cluster(b.each_ref().map(Vec::as_slice), &settings)
        .expect("has texels");
    room.cluster(a.each_ref().map(Vec::as_slice), &settings)
        .expect("has texels");
    assert_eq!(
        room.cluster(b.each_ref().map(Vec::as_slice), &settings),
        Ok(alone.clone())
    );
    let light = |k: usize| alone.lower[k][0] + alone.upper[k][0];
    assert!((1..alone.probability.len()).all(|k| light(k - 1) <= light(k)));
}

/// The same picture by sample and with every texel at hand.
fn both_ways(pixels: &[[f32; 3]], settings: &ClusterSettings) -> [SliceClusters; 2] {
    let plane = |k: usize| -> Vec<f32> { pixels.iter().map(|p| p[k]).collect() };
    let planes = [plane(0), plane(1), plane(2)];
    let planes = planes.each_ref().map(Vec::as_slice);
    let mut room = Clusterer::default();
    let sampled = room.cluster_by_sample(planes, settings);
    let all = room.cluster_all(planes, settings);
    [sampled.expect("large enough"), all.expect("has texels")]
}

#[test]
fn a_sample_finds_borders_as_good_as_all_texels_do() {
    for (rule, clusters) in [
        (BoxRule::Moments, 50),
        (BoxRule::Tight, 50),
        (BoxRule::Moments, 100),
    ] {
        let settings = ClusterSettings {
            clusters,
            box_rule: rule,
            ..ClusterSettings::default()
        };
        let pixels = sparkling(70_001, 13);
        let [sampled, all] = both_ways(&pixels, &settings);
        assert!(sampled.probability.len() <= clusters);
        assert!(
            sampled.w1_bound < 1.03 * all.w1_bound,
            "{} instead of {}",
            sampled.w1_bound,
            all.w1_bound
        );
        if rule == BoxRule::Moments {
            assert_mean(&sampled, &pixels);
        }
        // The brightest are not sampled: their clusters are the same ones.
        for back in 1..=8 {
            let of = |c: &SliceClusters| {
                let k = c.probability.len() - back;
                (c.probability[k], c.lower[k], c.upper[k])
            };
            assert_eq!(of(&sampled), of(&all), "{back} from the lightest");
        }
    }
}

#[test]
fn a_large_picture_of_one_color_is_one_cluster_and_its_dead_are_counted() {
    let mut pixels = vec![[0.2, 0.1, 0.05]; 60_000];
    pixels[12_345][1] = f32::NAN;
    pixels[59_999] = [f32::INFINITY; 3];
    let clusters = cluster(&pixels);
    assert_eq!(
        (clusters.probability.as_slice(), clusters.dead),
        (&[1.0][..], 2)
    );
    assert_mean(&clusters, &pixels);
}

#[test]
fn flakes_that_a_sample_misses_are_found_all_the_same() {
    // All in one corner, and too few for a share of any sample; then so many that they are not only the brightest.
    for bright in [3, 300, 5000] {
        let mut pixels = vec![[0.01_f32, 0.012, 0.011]; 65_536];
        for (k, pixel) in pixels[..bright].iter_mut().enumerate() {
            *pixel = [0.5 + 1e-4 * k as f32; 3];
        }
        let plane = |k: usize| -> Vec<f32> { pixels.iter().map(|p| p[k]).collect() };
        let planes = [plane(0), plane(1), plane(2)];
        let planes = planes.each_ref().map(Vec::as_slice);
        let settings = ClusterSettings::default();
        let all = Clusterer::default().cluster_all(planes, &settings);
        let (found, all) = (cluster(&pixels), all.expect("has texels"));
        assert_mean(&found, &pixels);
        let lightest = |c: &SliceClusters| (c.probability.last().copied(), c.upper.last().copied());
        assert_eq!(lightest(&found), lightest(&all), "{bright}");
    }
}
