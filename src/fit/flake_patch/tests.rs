//! Simulated flakes.

use super::*;
use crate::fit::{ClusterSettings, FittedFlakes, simulate_flakes};
use crate::paint::{ColorTable, Lobe};

fn silver() -> CarPaint {
    let lobe = |s: f64, alpha: f64, f0: f64| Lobe {
        weight: [s; 3],
        alpha,
        f0,
    };
    let lobes = vec![
        lobe(0.08, 0.38, 1.0),
        lobe(0.11, 0.17, 0.92),
        lobe(0.013, 0.013, 0.9),
    ];
    CarPaint {
        coat: None,
        diffuse: [0.06; 3],
        lobes,
        color_table: ColorTable::white(),
        flakes: None,
    }
}

fn simulated(recipe: &FlakeRecipe) -> FittedFlakes {
    simulate_flakes(&silver(), recipe, &ClusterSettings::default(), &|_, _| ()).expect("in range")
}

const SMALL: FlakeRecipe = FlakeRecipe {
    per_mm2: 2000.0,
    radius_um: 11.0,
    tilt: 0.17,
    half_width_deg: 3.0,
    tint: [0.9; 3],
    tint_spread: 0.04,
    depth_spread: 0.4,
    share: 0.15,
    texel_um: 20.0,
    texels: 48,
    angles: 12,
    largest_deg: 66.0,
    seed: 3,
};

#[test]
fn flakes_carry_their_share_at_the_mirror_and_less_elsewhere() {
    let flakes = simulated(&SMALL).flakes;
    let mean = |h: usize, d: usize| luminance(flakes.slice(h, d).mean());
    let wanted = 0.15 * base_luminance(&silver());
    assert!(
        (mean(0, 0) / wanted - 1.0).abs() < 1e-5,
        "{} instead of {wanted}",
        mean(0, 0)
    );
    assert!(mean(2, 0) < mean(0, 0) && mean(6, 0) < 0.02 * mean(0, 0));
}

#[test]
fn few_texels_shine_many_times_brighter_than_the_mean() {
    let patch = SimulatedPatch::new(&silver(), &SMALL).expect("in range");
    let reflections = patch.reflections(12.0, 10.0);
    let mut light: Vec<f64> = (0..patch.starts.len() - 1)
        .map(|t| luminance(patch.texel(t, &reflections)))
        .collect();
    light.sort_by(f64::total_cmp);
    let mean = light.iter().sum::<f64>() / light.len() as f64;
    assert!(
        light[light.len() * 99 / 100] > 8.0 * mean,
        "99th percentile over mean"
    );
    assert!(light[light.len() / 2] < 0.5 * mean, "median over mean");
}

#[test]
fn coarser_flakes_have_a_larger_grain() {
    let grain = |radius_um: f64| {
        simulated(&FlakeRecipe {
            radius_um,
            angles: 4,
            ..SMALL
        })
        .flakes
        .texture
        .grain_um
    };
    let (fine, coarse) = (grain(8.0), grain(40.0));
    assert!(coarse > 1.5 * fine, "{fine} {coarse}");
}

#[test]
fn the_same_seed_is_the_same_patch_and_another_is_not() {
    let small = FlakeRecipe {
        angles: 3,
        texels: 24,
        ..SMALL
    };
    let one = simulated(&small);
    assert_eq!(one, simulated(&small));
    assert_ne!(
        one.flakes,
        simulated(&FlakeRecipe { seed: 4, ..small }).flakes
    );
}

#[test]
fn a_recipe_out_of_range_is_refused_by_field() {
    let recipe = FlakeRecipe {
        tilt: f64::NAN,
        ..SMALL
    };
    let error = simulate_flakes(&silver(), &recipe, &ClusterSettings::default(), &|_, _| ());
    assert!(error.expect_err("refused").to_string().contains("tilt"));
}

#[test]
fn no_flakes_at_all_are_black_slices() {
    let flakes = simulated(&FlakeRecipe {
        per_mm2: 0.0,
        angles: 2,
        ..SMALL
    })
    .flakes;
    assert_eq!(flakes.clusters(), 4);
    assert_eq!(flakes.slice(0, 0).mean(), [0.0; 3]);
}
