//! Random draws against the distributions they promise, by χ² tests.
//!
//! A statistic of `k` degrees of freedom is judged at six standard deviations of its normal approximation,
//! `k + 6 √(2k)` (a chance of about 1e-7 for 40 or more): the streams are fixed, so a test that passes once always does.

use crate::paints::{Stream, flakes, metallic, solid};
use carpaint::color::Lab;
use carpaint::export::{alias_table, inverse_cdf};
use carpaint::paint::{CarPaint, FlakeSampler, Flakes, Limits, RandomTexture, TexelDraw};
use std::f64::consts::PI;

/// Pearson's statistic over cells that expect at least five draws, and its degrees of freedom.
fn chi_square(counts: &[u64], probability: &[f64]) -> (f64, f64) {
    let draws = counts.iter().sum::<u64>() as f64;
    let (mut statistic, mut cells) = (0.0, 0.0);
    let (mut rest_counted, mut rest_expected) = (0.0, 0.0);
    for (&count, &p) in counts.iter().zip(probability) {
        let expected = p * draws;
        if expected < 5.0 {
            rest_counted += count as f64;
            rest_expected += expected;
        } else {
            statistic += (count as f64 - expected).powi(2) / expected;
            cells += 1.0;
        }
    }
    if rest_expected >= 5.0 {
        statistic += (rest_counted - rest_expected).powi(2) / rest_expected;
        cells += 1.0;
    }
    (statistic, cells - 1.0)
}

fn assert_drawn_from(counts: &[u64], probability: &[f64], what: &str) {
    let (statistic, freedom) = chi_square(counts, probability);
    assert!(freedom >= 1.0, "{what}: nothing to compare");
    let limit = freedom + 6.0 * (2.0 * freedom).sqrt().max(2.0);
    assert!(
        statistic <= limit,
        "{what}: χ² {statistic} of {freedom} degrees of freedom"
    );
}

/// Skewed probabilities as slices have them, down to one in a million.
fn skewed(n: i32) -> Vec<f64> {
    let raw: Vec<f64> = (0..n).map(|k| 0.75_f64.powi(k)).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|p| p / sum).collect()
}

#[test]
fn the_test_itself_notices_a_draw_that_is_one_per_cent_off() {
    // Without this, a χ² that always passes would look like a sampler that is always right.
    let fair = [10_000_u64; 100];
    let mut biased = fair;
    biased[..50].iter_mut().for_each(|c| *c += 100);
    biased[50..].iter_mut().for_each(|c| *c -= 100);
    assert_drawn_from(&fair, &[0.01; 100], "fair");
    let caught = std::panic::catch_unwind(|| {
        assert_drawn_from(&biased.map(|c| 10 * c), &[0.01; 100], "biased");
    });
    assert!(caught.is_err());
}

#[test]
fn an_alias_table_draws_every_cluster_as_often_as_it_is_probable() {
    for p in [skewed(50), vec![0.02; 50], vec![1.0], skewed(3)] {
        let table = alias_table(&p);
        let mut random = Stream(11);
        let mut counts = vec![0_u64; p.len()];
        for _ in 0..1_000_000 {
            let u = random.unit() * p.len() as f64;
            let slot = u as usize;
            let entry = table[slot];
            let own = u - slot as f64 <= entry.threshold;
            counts[if own { slot } else { entry.alias as usize }] += 1;
        }
        if p.len() > 1 {
            assert_drawn_from(&counts, &p, "alias table");
        } else {
            assert_eq!(counts, [1_000_000]);
        }
    }
}

#[test]
fn the_inverse_cdf_of_500_steps_says_itself_how_far_it_is_from_the_distribution() {
    let p = skewed(50);
    let light: Vec<f64> = (0..50).map(|k| f64::from(k * k)).collect();
    let cdf = inverse_cdf(&p, &light);
    let mut counts = vec![0_u64; 50];
    cdf.steps.iter().for_each(|c| counts[*c as usize] += 1);
    let moved: f64 = p
        .iter()
        .zip(&counts)
        .map(|(p, c)| (p - *c as f64 / 500.0).abs())
        .sum();
    // 50 differences, each rounded to half an EPS.
    assert!((moved / 2.0 - cdf.probability_loss).abs() < 50.0 * f64::EPSILON);
    // It must drop clusters: 0.75^k falls below 1/1000 after two dozen of them.
    assert!(counts.iter().filter(|c| **c == 0).count() > 20);
}

/// Four slices of point boxes, each gray of a lightness of its own, with other probabilities in each: the most probable
/// first, last, in the middle, and all alike and many more than the parts of the unit interval that draws are guided by.
fn points() -> (Flakes, Vec<Vec<f64>>) {
    let falling = skewed(40);
    let rising: Vec<f64> = falling.iter().rev().copied().collect();
    let peaked: Vec<f64> = rising[20..].iter().chain(&falling[20..]).copied().collect();
    let sum: f64 = peaked.iter().sum();
    let peaked = peaked.iter().map(|p| p / sum).collect();
    let slices = vec![falling, rising, peaked, vec![1.0 / 160.0; 160]];
    let mut made = flakes(&[0.0, 40.0], &[0.0, 40.0], &[]);
    let mut offsets = vec![0];
    for slice in &slices {
        for (k, p) in slice.iter().enumerate() {
            let point = [2.0 + 0.5 * k as f32, 0.0, 0.0];
            made.probability.push(*p);
            made.lower.push(point);
            made.upper.push(point);
        }
        offsets.push(made.probability.len() as u32);
    }
    made.offsets = offsets.into();
    (made, slices)
}

#[test]
fn texels_pick_clusters_as_often_as_they_are_probable_at_every_angle() {
    let (made, slices) = points();
    let paint = CarPaint {
        flakes: Some(made.clone()),
        ..solid(16)
    };
    paint.validate(&Limits::default()).expect("a paint");
    let sampler = FlakeSampler::new(&made);
    let mut random = Stream(12);
    let cells: Vec<u32> = (0..400_000).map(|_| random.bits() as u32).collect();
    // On the grid's angles, and beyond its border, where the border's slice holds.
    for (h, d, k) in [
        (0.0, 0.0, 0),
        (0.0, 40.0, 1),
        (40.0, 0.0, 2),
        (40.0, 40.0, 3),
        (77.0, 80.0, 3),
        (77.0, 0.0, 2),
    ] {
        let mut counts = vec![0_u64; slices[k].len()];
        for &cell in &cells {
            let draw = TexelDraw::of(cell, h, d, [8.0, 40.0]);
            assert!((0.0..1.0).contains(&draw.pick));
            assert!(draw.place.iter().all(|v| (0.0..1.0).contains(v)));
            // The light says which of the points was drawn: neighbours are half a unit of lightness apart.
            let light = sampler.color(cell, h, d).map(|v| PI * f64::from(v));
            let place = (Lab::from_rgb(light).l - 2.0) / 0.5;
            assert!(
                (place - place.round()).abs() < 0.01,
                "between points: {place}"
            );
            counts[place.round() as usize] += 1;
        }
        assert_drawn_from(&counts, &slices[k], &format!("texels at {h}°, {d}°"));
    }
}

#[test]
fn places_in_a_box_are_uniform_and_the_three_axes_independent() {
    let mut random = Stream(13);
    let mut counts = vec![0_u64; 8 * 8 * 8];
    for _ in 0..500_000 {
        let [x, y, z] = TexelDraw::of(random.bits() as u32, 21.0, 9.0, [8.0, 40.0])
            .place
            .map(|v| (v * 8.0) as usize);
        counts[(x * 8 + y) * 8 + z] += 1;
    }
    assert_drawn_from(&counts, &[1.0 / 512.0; 512], "places");
}

#[test]
fn drawn_flakes_have_the_mean_of_their_slice() {
    let paint = metallic(14, &[0.0, 20.0], &[0.0, 30.0]);
    let flakes = paint.flakes.as_ref().expect("has flakes");
    let sampler = FlakeSampler::new(flakes);
    let want = flakes.slice(0, 0).mean();
    let mut random = Stream(15);
    let n = 400_000;
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    for _ in 0..n {
        let color = sampler.color(random.bits() as u32, 0.0, 0.0).map(f64::from);
        for c in 0..3 {
            sum[c] += color[c];
            squares[c] += color[c] * color[c];
        }
    }
    for c in 0..3 {
        let mean = sum[c] / f64::from(n);
        let error = ((squares[c] / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
        // Five standard errors, and f32 arithmetic on colors of 0.1: 1e-7 of them.
        assert!(
            (mean - want[c]).abs() < 5.0 * error + 1e-7,
            "{mean} instead of {}",
            want[c]
        );
    }
}

#[test]
fn numbers_of_a_tile_are_uniform_whatever_the_size_of_its_cells() {
    for spacing in [0.5, 1.5] {
        let tile = RandomTexture::new(256, 256, spacing, 3);
        let mut counts = vec![0_u64; 64];
        tile.cells()
            .iter()
            .for_each(|c| counts[(c >> 26) as usize] += 1);
        // Better than random: a run of numbers covers its share of the tile but for the cells at its two ends, each of
        // some spacing² texels (the largest of thousands is several times the mean).
        for count in counts {
            let off = (count as f64 - 1024.0).abs();
            assert!(
                off <= 2.0 * (8.0 * spacing * spacing).max(1.0),
                "{spacing}: {count}"
            );
        }
    }
}
