//! Tests of `cells`.

use super::*;
use crate::paint::TexelDraw;

/// Half-fall of the probability that texels some way apart share a cell, over both axes.
fn grain_of(tiles: &[RandomTexture]) -> f64 {
    let shared = |lag: u32| {
        let mut share = 0.0;
        for tile in tiles {
            let (w, h) = (tile.width(), tile.height());
            let at = |x: u32, y: u32| tile.cells()[(y % h * w + x % w) as usize];
            let texels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
            let same = texels.map(|(x, y)| {
                u32::from(at(x, y) == at(x + lag, y)) + u32::from(at(x, y) == at(x, y + lag))
            });
            share += f64::from(same.sum::<u32>()) / f64::from(2 * w * h);
        }
        share / tiles.len() as f64
    };
    let mut before = 1.0;
    for lag in 1..100 {
        let now = shared(lag);
        if now < 0.5 {
            return f64::from(lag - 1) + (before - 0.5) / (before - now);
        }
        before = now;
    }
    f64::INFINITY
}

#[test]
fn tiles_have_the_grain_they_were_asked_for() {
    for grain in [0.5, 0.52, 0.57, 0.66, 0.75, 0.9, 1.2, 1.5, 2.0, 4.0, 9.0] {
        let tiles: Vec<_> = (0..3)
            .map(|seed| RandomTexture::new(240, 240, cell_spacing(grain), seed))
            .collect();
        let found = grain_of(&tiles);
        // 3 · 240² / spacing² cells, at least 380, whose sizes scatter by half: a standard error under 3 %.
        assert!(
            (found / grain - 1.0).abs() < 0.06,
            "{found} instead of {grain}"
        );
    }
}

#[test]
fn every_interval_of_numbers_covers_its_share_of_the_tile() {
    for spacing in [0.5, 2.0, 5.0] {
        let tile = RandomTexture::new(200, 100, spacing, 9);
        let mut numbers = tile.cells().to_vec();
        numbers.sort_unstable();
        for (rank, number) in numbers.iter().enumerate() {
            let (share, place) = (rank as f64 / 20_000.0, f64::from(*number) / 4_294_967_296.0);
            // Off by the rest of the cell itself; the largest is several times the mean of spacing² texels.
            assert!(
                (share - place).abs() <= 8.0 * spacing * spacing / 20_000.0,
                "{spacing}: {share} {place}"
            );
        }
    }
}

#[test]
fn a_tile_keeps_the_shares_of_its_picks_at_every_angle() {
    // Four groups of epochs meet at an angle. In each a share is cut out of the ranks in up to 11 runs, each end of which
    // misses by an even part of a cell, 1/12 of a squared area. A group's phases thin a run evenly by number, off by the
    // rounding at its two ends, 1/6 of a cell squared; and where the n cells of the share are divided by number, the
    // scatter of their areas stays. Cells dealt by chance would scatter twice as far.
    let tile = RandomTexture::new(256, 256, 3.0, 1);
    let mut areas = std::collections::HashMap::new();
    for cell in tile.cells() {
        *areas.entry(cell).or_insert(0.0) += 1.0;
    }
    let count = areas.len() as f64;
    let mean = 65_536.0 / count;
    let square = areas.values().map(|a| a * a).sum::<f64>() / count / (mean * mean);
    for share in [0.01_f32, 0.1, 0.5] {
        let angles: Vec<(f32, f32)> = (0_u8..20)
            .map(|k| (4.3 * f32::from(k), (37.0 * f32::from(k)) % 90.0))
            .collect();
        let squares = angles.iter().map(|&(h, d)| {
            let picks = |cell: &u32| TexelDraw::of(*cell, h, d, [10.0; 2]).pick < share;
            let below = tile.cells().iter().filter(|cell| picks(cell)).count() as f64;
            ((below - 65_536.0 * f64::from(share)) / mean).powi(2)
        });
        let off = (squares.sum::<f64>() / angles.len() as f64).sqrt();
        let cells = count * f64::from(share);
        let argued =
            (4.0 * 11.0 / 6.0 * square + 4.0 * 11.0 / 6.0 + 0.75 * cells * (square - 1.0)).sqrt();
        assert!(off < argued, "{share}: {off} cells, not {argued}");
    }
}

#[test]
fn shared_tiles_are_those_of_their_spacing() {
    let texture = |grain: f64| FlakeTexture {
        texel_um: 1.0,
        grain_um: grain,
        lifetime_deg: [1.0; 2],
        persistence_deg: [1.0; 2],
    };
    for grain in [0.4, 0.5, 0.504, 0.6, 1.0, 2.7, 40.0, 1e6] {
        let own = RandomTexture::new(256, 256, cell_spacing(grain), 1);
        assert!(*RandomTexture::of(&texture(grain)) == own, "{grain}");
    }
    assert!(buckets_along(RandomTexture::TILE, LEAST_SPACING) as usize == KINDS - 1);
}

#[test]
fn spacing_grows_with_grain() {
    let spacings: Vec<f64> = (0..2000)
        .map(|k| cell_spacing(f64::from(k) * 0.005))
        .collect();
    assert!(spacings.windows(2).all(|w| w[0] <= w[1]));
}

#[test]
fn a_tile_has_no_seam() {
    // Across the seam as many texels share a cell as across any other line.
    let tile = RandomTexture::new(128, 128, 3.0, 7);
    let cells = tile.cells();
    let across = |x: u32| {
        (0..128).filter(move |y| {
            let row = &cells[y * 128..][..128];
            row[x as usize] == row[(x as usize + 1) % 128]
        })
    };
    let inside = (0..127).map(|x| across(x).count()).sum::<usize>() as f64 / 127.0;
    // About 42 cells meet a line, in or out: a standard deviation near √128 · 0.5.
    assert!(
        (across(127).count() as f64 - inside).abs() < 24.0,
        "{} against {inside}",
        across(127).count()
    );
}

#[test]
fn repetitions_of_a_tile_show_other_flakes() {
    let tile = RandomTexture::new(16, 16, 2.0, 1);
    assert_eq!(tile.at(3, 5), tile.cells()[5 * 16 + 3]);
    let same = (0..16)
        .filter(|k| tile.at(*k, 5) == tile.at(*k + 16, 5))
        .count();
    assert_eq!(same, 0);
    assert_eq!(tile.at(-13, 5), tile.at(-13, 5));
}

#[test]
fn tiny_tiles_and_huge_cells_are_tiles() {
    for (width, height, spacing) in [
        (1, 1, 0.5),
        (1, 7, 100.0),
        (5, 1, 1.0),
        (0, 0, 3.0),
        (3, 3, 1e6),
    ] {
        let tile = RandomTexture::new(width, height, spacing, 0);
        assert_eq!(tile.cells().len(), (width.max(1) * height.max(1)) as usize);
    }
    assert_eq!(RandomTexture::new(4, 4, f64::NAN, 0).cells().len(), 16);
}
