//! Tests of `kernel`.

use super::*;
use crate::color::Lab;
use crate::paint::{AngleGrid, Chi, Coat, ColorTable, Direction, Lobe};
use crate::render::lanes::splat3;
use proptest::prelude::*;

fn paint(coat: Option<Coat>) -> CarPaint {
    let grid = |d: &[f64]| AngleGrid::new(d.to_vec()).expect("ascending");
    let nodes = (0..12).map(|k| Lab {
        l: 95.0 - 6.0 * f64::from(k),
        a: 20.0 - f64::from(k),
        b: 4.0 * f64::from(k),
    });
    let (rows, columns) = (grid(&[0.0, 7.0, 25.0, 60.0]), grid(&[0.0, 20.0, 66.0]));
    let overall = Lab {
        l: 70.0,
        a: 0.0,
        b: 0.0,
    };
    CarPaint {
        coat,
        diffuse: [0.3, 0.2, 0.1],
        lobes: vec![
            Lobe {
                weight: [0.05, 0.06, 0.07],
                alpha: 0.4,
                f0: 0.3,
            },
            Lobe {
                weight: [0.01; 3],
                alpha: 0.09,
                f0: 0.6,
            },
        ],
        color_table: ColorTable::new(rows, columns, nodes.collect(), overall).expect("fits"),
        flakes: None,
    }
}

fn direction(z: f64, turn: f64) -> Direction {
    let r = (1.0 - z * z).sqrt();
    [r * turn.cos(), r * turn.sin(), z]
}

#[allow(clippy::cast_possible_truncation)]
fn single(w: Direction) -> Lanes3 {
    splat3(w.map(|v| v as f32))
}

fn answer<const COATED: bool>(paint: &CarPaint, wi: Direction, wo: Direction) -> Answer {
    let kernel = Kernel::new(paint);
    let view = kernel.view::<COATED>(single(wo));
    kernel.evaluate::<COATED, false>(&view, single(wi), &[0; WIDTH], None)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn the_kernel_says_what_the_reflectance_says(
        iz in 0.02..1.0_f64, oz in 0.02..1.0_f64, turn in 0.0..std::f64::consts::TAU, ior in 1.0..2.5_f64, rough in 0.0..0.3_f64,
    ) {
        let (wi, wo) = (direction(iz, turn), direction(oz, 0.0));
        for coat in [None, Some(Coat { ior, roughness: rough, thickness_um: None })] {
            let paint = paint(coat);
            let want = Reflectance::new(&paint).evaluate(wi, wo, Chi::Table);
            let got = if coat.is_some() { answer::<true>(&paint, wi, wo) } else { answer::<false>(&paint, wi, wo) };
            // At a cosine of 0.02 the half vector of f32 directions is off by 2.5e-6; out to four widths that turns
            // a lobe by up to 2e-5 over its width, doubled for the coat's own rounding.
            let narrowest = if coat.is_some() && rough >= Coat::MIRROR_ROUGHNESS { rough.min(0.09) } else { 0.09 };
            let accepted = 2e-3 + 5e-5 / narrowest;
            for (x, y) in get(&got.f, 2).iter().zip(want) {
                // The kernel leaves the clamp at 0 to the pixel.
                let x = f64::from(x.max(0.0));
                prop_assert!((x - y).abs() <= accepted * y + 1e-5, "{x} instead of {y}");
            }
        }
    }

    #[test]
    fn nothing_is_infinite_at_grazing(
        iz in 0.0..1e-3_f64, oz in 0.0..1e-3_f64, turn in 0.0..std::f64::consts::TAU, rough in 0.0..0.3_f64,
    ) {
        let paint = paint(Some(Coat { ior: 1.5, roughness: rough, thickness_um: None }));
        let got = answer::<true>(&paint, direction(iz, turn), direction(oz, 0.0));
        prop_assert!(get(&got.f, 0).iter().all(|v| v.is_finite()));
        prop_assert!(got.density.0[0].is_finite());
    }
}

/// χ² over 8 bands of height and 8 of azimuth: how often directions are drawn against the integral of the density.
#[test]
fn drawn_directions_fall_where_their_density_says() {
    for height in [1.0, 0.7, 0.12] {
        for (coat, roughness) in [(true, 0.0), (true, 0.08), (false, 0.0)] {
            let coat = coat.then_some(Coat {
                ior: 1.5,
                roughness,
                thickness_um: None,
            });
            if coat.is_some() {
                assert_drawn_by_density::<true>(&paint(coat), height);
            } else {
                assert_drawn_by_density::<false>(&paint(coat), height);
            }
        }
    }
}

/// Integral of the density over each of 64 cells, by the midpoint rule with `steps` steps a side of each.
fn integrated<const COATED: bool>(kernel: &Kernel<'_>, view: &View, steps: u32) -> Vec<f64> {
    let part = |k: u32| (f64::from(k) + 0.5) / f64::from(steps);
    let solid = std::f64::consts::TAU / 64.0 / f64::from(steps * steps);
    let cell = |cell: usize| {
        let mut density = 0.0;
        for k in (0..steps * steps).step_by(WIDTH) {
            let mut light = splat3([0.0; 3]);
            for lane in 0..WIDTH {
                let k = k + lane as u32;
                let z = ((cell / 8) as f64 + part(k / steps)) / 8.0;
                let turn = ((cell % 8) as f64 + part(k % steps)) / 8.0 * std::f64::consts::TAU;
                set(&mut light, lane, direction(z, turn).map(|v| v as f32));
            }
            let answer = kernel.evaluate::<COATED, false>(view, light, &[0; WIDTH], None);
            density += answer.density.0.iter().map(|d| f64::from(*d)).sum::<f64>();
        }
        density * solid
    };
    (0..64).map(cell).collect()
}

fn assert_drawn_by_density<const COATED: bool>(paint: &CarPaint, height: f64) {
    const DRAWS: u32 = 1 << 16;
    let mut kernel = Kernel::new(paint);
    kernel.narrow_below = f32::INFINITY;
    let view = kernel.view::<COATED>(single(direction(height, 0.3)));
    let points = super::super::points::Points::of_pixel(0, 0, DRAWS, 5);
    let mut counts = [0.0_f64; 64];
    for k in 0..DRAWS {
        let (pick, pair) = (points.pair(k, 1)[0], points.pair(k, 0));
        let Some(light) = kernel.sample::<COATED>(&view, 0, pick, pair) else {
            continue;
        };
        let turn = light[1].atan2(light[0]) / TAU;
        let band = ((light[2] * 8.0) as usize).min(7);
        counts[8 * band + ((turn - turn.floor()) * 8.0).min(7.0) as usize] += 1.0;
    }
    let (coarse, fine) = (
        integrated::<COATED>(&kernel, &view, 128),
        integrated::<COATED>(&kernel, &view, 256),
    );
    let total = fine.iter().sum::<f64>();
    let (mut statistic, mut cells, mut off) = (0.0, 0.0, 0.0_f64);
    let (mut rest, mut rarely) = (0.0_f64, 0.0_f64);
    for ((count, fine), coarse) in counts.iter().zip(fine).zip(coarse) {
        let expected = fine * f64::from(DRAWS);
        if expected >= 5.0 {
            statistic += (count - expected).powi(2) / expected;
            cells += 1.0;
            // What halving the steps changes is three times what is left, in standard deviations of the count.
            off = off.max((fine - coarse).abs() / 3.0 * f64::from(DRAWS) / expected.sqrt());
        } else {
            rest += expected;
            rarely += count;
        }
    }
    let (drawn, expected) = (counts.iter().sum::<f64>(), total * f64::from(DRAWS));
    // Binomial, and what single precision does to a density: a density too small or too large everywhere shows here.
    let scatter = (expected * (1.0 - total).max(0.0)).sqrt();
    assert!(
        (drawn - expected).abs() <= 6.0 * scatter + 1e-4 * f64::from(DRAWS),
        "{height}: {drawn} directions of {expected}"
    );
    assert!(
        off < 0.1,
        "{height}: the integral is off by {off} standard deviations"
    );
    assert!(
        (rarely - rest).abs() <= 6.0 * rest.sqrt().max(1.0),
        "{height}: {rarely} rare draws of {rest}"
    );
    // Six standard deviations of chance, and the draws are spread more evenly than that.
    let limit: f64 = cells + 6.0 * f64::sqrt(2.0 * cells);
    assert!(
        cells > 20.0 && statistic < limit,
        "{height}: χ² {statistic} of {cells} cells"
    );
}

/// Directions drawn by the kernel, weighted by one over their stated density, must cover the hemisphere.
#[test]
fn drawn_directions_have_their_stated_density() {
    for roughness in [0.0, 0.08] {
        let paint = paint(Some(Coat {
            ior: 1.5,
            roughness,
            thickness_um: None,
        }));
        let mut kernel = Kernel::new(&paint);
        kernel.narrow_below = f32::INFINITY;
        let wo = direction(0.7, 0.0);
        let view = kernel.view::<true>(single(wo));
        let points = super::super::points::Points::of_pixel(0, 0, 1 << 16, 5);
        let mut sum = 0.0_f64;
        for k in 0..1 << 16 {
            let Some(light) =
                kernel.sample::<true>(&view, 0, points.pair(k, 1)[0], points.pair(k, 0))
            else {
                continue;
            };
            let light = splat3(light);
            let answer = kernel.evaluate::<true, false>(&view, light, &[0; WIDTH], None);
            sum += f64::from(light[2].0[0] / answer.density.0[0]);
        }
        let projected = sum / f64::from(1 << 16);
        assert!(
            (projected / std::f64::consts::PI - 1.0).abs() < 0.01,
            "{roughness}: {projected}"
        );
    }
}
