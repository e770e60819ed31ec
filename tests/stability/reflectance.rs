//! Reflectance at grazing, mirrored, and with parameters at their ends.

use crate::paints::{at, extreme, flakes, grid};
use carpaint::color::Lab;
use carpaint::paint::{
    AngleGrid, CarPaint, Chi, Coat, ColorTable, Direction, Limits, Lobe, PaintError, Reflectance,
    certify, fresnel, half_angles, refract,
};
use std::f64::consts::{FRAC_PI_2, PI};

fn paint(alpha: f64, f0: f64, coat: Option<Coat>) -> CarPaint {
    CarPaint {
        coat,
        diffuse: [0.2, 0.1, 0.05],
        lobes: vec![Lobe {
            weight: [0.05, 0.04, 0.03],
            alpha,
            f0,
        }],
        color_table: ColorTable::white(),
        flakes: None,
    }
}

fn rough(ior: f64, roughness: f64) -> Coat {
    Coat {
        ior,
        roughness,
        thickness_um: None,
    }
}

/// Directions from straight above to the horizon itself, among them opposite ones.
fn directions() -> Vec<Direction> {
    let heights = [
        1.0,
        0.7,
        1e-3,
        1e-8,
        1e-160,
        1e-162,
        1e-300,
        f64::MIN_POSITIVE,
        0.0,
    ];
    let azimuths = [0.0, 1e-9, 1.0, std::f64::consts::PI];
    heights
        .iter()
        .flat_map(|&z| azimuths.iter().map(move |&a| at(z, a)))
        .collect()
}

fn coats() -> Vec<Option<Coat>> {
    let mut coats = vec![None];
    for ior in [1.0, 1.0 + 1e-12, 1.5, 4.0] {
        for roughness in [0.0, 0.5e-3, 1e-3, 0.05, 1.0] {
            coats.push(Some(rough(ior, roughness)));
        }
    }
    coats
}

/// Three by three colors, from black to brighter than white.
fn colored() -> ColorTable {
    let nodes = (0..9_u8)
        .map(|k| Lab {
            l: f64::from(k) * 14.0,
            a: 30.0 - 7.0 * f64::from(k),
            b: 5.0 * f64::from(k) - 20.0,
        })
        .collect();
    let angles = grid(&[0.0, 30.0, 75.0]);
    ColorTable::new(angles.clone(), angles, nodes, Lab::default()).expect("nine colors")
}

/// Finite before anything is clamped, not negative after it, and bit for bit the same with light and view exchanged: the
/// two only change places in sums and products of two, in the larger of two, and in squares of their difference.
fn assert_sound(paint: &CarPaint, directions: &[Direction]) {
    let reflectance = Reflectance::new(paint);
    for (k, &wi) in directions.iter().enumerate() {
        for &wo in &directions[..=k] {
            let what = || format!("{:?} {:?} {wi:?} {wo:?}", paint.coat, paint.lobes);
            let above = wi[2] > 0.0 && wo[2] > 0.0;
            for chi in [Chi::Table, Chi::Overall] {
                let (terms, f) = (
                    reflectance.terms(wi, wo, chi),
                    reflectance.evaluate(wi, wo, chi),
                );
                assert_eq!(terms.is_some(), above, "{}", what());
                assert_eq!(f, reflectance.evaluate(wo, wi, chi), "{}", what());
                // The clamp at the end would make a 0 of NaN: the terms are looked at before it.
                if let Some(t) = terms {
                    let angles = [t.half.theta_h, t.half.theta_d, t.half.h_z, t.half.h_o];
                    let mut parts = angles.iter().chain(&t.base).chain(&t.flakes);
                    assert!(parts.all(|v| v.is_finite()), "{}: {t:?}", what());
                    // Two products of two shares, each rounded a few times.
                    let shares = 0.0..=1.0 + 8.0 * f64::EPSILON;
                    assert!(shares.contains(&t.transmission), "{}: {t:?}", what());
                    assert!(
                        t.highlight.is_finite() && t.highlight >= 0.0,
                        "{}: {t:?}",
                        what()
                    );
                    assert!(!t.half.tan2_h.is_nan() && t.half.tan2_h >= 0.0);
                }
                assert!(
                    f.iter().all(|v| v.is_finite() && *v >= 0.0),
                    "{}: {f:?}",
                    what()
                );
            }
        }
    }
}

#[test]
fn every_value_is_finite_not_negative_and_reciprocal() {
    let directions = directions();
    for coat in coats() {
        for alpha in [0.0, 1e-12, 1e-8, 1e-4, 0.02, 1.0, 10.0] {
            for f0 in [0.0, 0.04, 1.0] {
                assert_sound(&paint(alpha, f0, coat), &directions);
            }
        }
    }
}

#[test]
fn tables_and_flakes_at_the_ends_of_their_range_are_as_sound() {
    let bright = extreme().flakes;
    for coat in coats() {
        for alpha in [0.0, 0.02, 10.0] {
            let mut paint = paint(alpha, 0.04, coat);
            paint.color_table = colored();
            paint.flakes.clone_from(&bright);
            assert_sound(&paint, &directions());
        }
        assert_sound(&CarPaint { coat, ..extreme() }, &directions());
    }
}

#[test]
fn at_grazing_the_model_is_what_sixty_digits_say() {
    let eps = f64::EPSILON;
    let (mut cases, mut worst) = (0, 0.0_f64);
    let table = include_str!("grazing.txt");
    for line in table.lines().filter(|line| !line.starts_with('#')) {
        let row: Vec<f64> = line
            .split(' ')
            .map(|v| v.parse().expect("a number"))
            .collect();
        let (z_i, z_o, degrees, alpha, ior, roughness, want) =
            (row[0], row[1], row[2], row[3], row[4], row[5], row[6]);
        let mut paint = paint(alpha, 0.5, (ior > 0.0).then(|| rough(ior, roughness)));
        paint.diffuse = [0.2; 3];
        let reflectance = Reflectance::new(&paint);
        // The view in whole quarters of a turn, so that no cosine rounds.
        let (wi, r) = (at(z_i, 0.0), ((1.0 - z_o) * (1.0 + z_o)).sqrt());
        let wo = match degrees {
            0.0 => [r, 0.0, z_o],
            90.0 => [0.0, r, z_o],
            _ => [-r, 0.0, z_o],
        };
        let t = reflectance.terms(wi, wo, Chi::Table).expect("above");
        // White's Lab comes back to the seven digits of the matrix; the table is not what is looked at here.
        let f = t.transmission * t.base[0] / reflectance.chi_nodes()[0][0] + t.highlight;
        // A few roundings each of two cosines, their products, two T that are not taken as 1 − R, a power and an
        // exponential: 32 EPS. The exponent x = tan²θh/α² carries 8 EPS of itself, and where the horizontal parts cancel,
        // each of them being rounded by half an EPS, tan θh moves by EPS/(i_z + o_z).
        let index = ior.max(1.0);
        let (inner_i, inner_o) = (refract(wi, index), refract(wo, index));
        let exponent = |half: carpaint::paint::HalfAngles, alpha: f64, heights: f64| {
            (8.0 * half.tan2_h + 2.0 * half.tan2_h.sqrt() / heights) / (alpha * alpha)
        };
        let mut roundings = 32.0 + exponent(t.half, alpha, inner_i[2] + inner_o[2]);
        if roughness > 0.0 {
            roundings += exponent(half_angles(wi, wo), roughness, z_i + z_o);
        }
        let off = (f / want - 1.0).abs();
        worst = worst.max(off / (roundings * eps));
        cases += 1;
        assert!(off <= roundings * eps, "{line}: {f:e}, off by {off:e}");
    }
    println!("worst of {cases}: {worst} of what is allowed");
    assert_eq!(cases, 41);
}

#[test]
fn light_opposite_to_the_view_along_the_horizon_is_finite_to_the_last_representable_height() {
    let paint = paint(0.1, 0.5, Some(rough(1.5, 0.01)));
    let reflectance = Reflectance::new(&paint);
    for power in 0..=1074 {
        let z = 2.0_f64.powi(-power);
        let x = ((1.0 - z) * (1.0 + z)).sqrt();
        for wo in [[-x, 0.0, z], [x, 0.0, z], [0.0, x, z], [0.0, 0.0, 1.0]] {
            let angles = half_angles([x, 0.0, z], wo);
            let f = reflectance.evaluate([x, 0.0, z], wo, Chi::Table);
            assert!(
                f.iter().all(|v| v.is_finite() && *v >= 0.0),
                "2^-{power}, {wo:?}: {f:?}"
            );
            // The half vector of i = (x, 0, z) and o = (−x, 0, z) is the normal at every height, even where z² is 0.
            if wo == [-x, 0.0, z] {
                assert_eq!((angles.theta_h, angles.h_z), (0.0, 1.0), "2^-{power}");
            }
        }
    }
}

#[test]
fn at_and_below_the_horizon_is_black() {
    let paint = paint(0.1, 0.5, Some(Coat::smooth(1.5)));
    let reflectance = Reflectance::new(&paint);
    let n = [0.0, 0.0, 1.0];
    for (wi, wo) in [
        (at(0.5, 0.0), [0.0, 0.6, -0.8]),
        (n, [0.0, 0.0, -1.0]),
        (at(0.6, 0.3), at(0.6, 0.3).map(|v| -v)),
        (at(0.0, 0.0), n),
        (at(0.0, 0.0), at(0.0, 1.0)),
        (at(-0.0, 0.0), at(0.0, 0.0).map(|v| -v)),
    ] {
        assert_eq!(reflectance.evaluate(wi, wo, Chi::Table), [0.0; 3]);
        assert!(reflectance.terms(wi, wo, Chi::Table).is_none());
    }
    assert_eq!(reflectance.mirror([1.0, 0.0, 0.0]), 0.0);
}

#[test]
fn a_direction_that_is_no_number_is_black_and_never_a_number_that_is_none() {
    let paint = paint(0.1, 0.5, Some(rough(1.5, 0.01)));
    let reflectance = Reflectance::new(&paint);
    let nan = [f64::NAN; 3];
    assert_eq!(
        reflectance.evaluate(nan, at(0.5, 0.0), Chi::Table),
        [0.0; 3]
    );
    assert_eq!(
        reflectance.evaluate(at(0.5, 0.0), nan, Chi::Table),
        [0.0; 3]
    );
}

#[test]
fn along_the_normal_the_model_is_what_a_pencil_says() {
    // i = o = n: θh = θd = 0, D = 1/α², F = F0, G = 1, T = 1 − R0 twice, the coat's D_c = 1/(πα²).
    for (alpha, f0, ior, roughness) in [
        (0.3, 0.5, 1.5, 0.02),
        (1.0, 1.0, 4.0, 1.0),
        (10.0, 0.0, 1.2, 0.5),
    ] {
        let paint = paint(alpha, f0, Some(rough(ior, roughness)));
        let f = Reflectance::new(&paint).evaluate([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], Chi::Table);
        let r0 = ((ior - 1.0) / (ior + 1.0)).powi(2);
        let pi = std::f64::consts::PI;
        let lobe = paint.lobes[0].weight[0] * f0 / (pi * alpha * alpha);
        let want = (1.0 - r0).powi(2) * (0.2 / pi + lobe) + r0 / (4.0 * pi * roughness * roughness);
        // White's Lab is (100, 0, 0) and comes back to seven digits of the matrix's row sums: 1 within 1e-7.
        assert!(
            (f[0] / want - 1.0).abs() < 2e-7,
            "{} instead of {want}",
            f[0]
        );
    }
}

#[test]
fn a_roughness_of_nothing_is_the_narrowest_lobe_and_not_a_hole() {
    // α is held to 1e-4 where it is evaluated: 0, 1e-12 and 1e-8 are the same lobe, bit for bit.
    let at_alpha = |alpha: f64| {
        let paint = paint(alpha, 0.5, None);
        let reflectance = Reflectance::new(&paint);
        [(at(0.7, 0.0), at(0.7, 3.1)), (at(1.0, 0.0), at(1.0, 0.0))]
            .map(|(i, o)| reflectance.evaluate(i, o, Chi::Table))
    };
    for alpha in [0.0, 1e-12, 1e-8] {
        assert_eq!(at_alpha(alpha), at_alpha(1e-4));
    }
}

#[test]
fn angles_near_the_mirror_keep_digits_that_acos_in_f32_would_lose() {
    for tilt in [1e-3_f64, 1e-5, 1e-7] {
        let (wi, wo) = ([tilt.sin(), 0.0, tilt.cos()], [0.0, 0.0, 1.0]);
        let angles = half_angles(wi, wo);
        // Half the angle between the two; the difference of unit vectors carries one rounding of 1.
        assert!(
            (angles.theta_h / (tilt / 2.0) - 1.0).abs() < 4.0 * f64::EPSILON / tilt,
            "{tilt}"
        );
        let single = ((tilt / 2.0).cos() as f32).acos();
        if tilt <= 1e-5 {
            assert!(
                (f64::from(single) / (tilt / 2.0) - 1.0).abs() > 0.1,
                "f32 would have been good enough at {tilt}"
            );
        }
    }
}

#[test]
fn fresnel_next_to_index_one_keeps_digits_that_the_textbook_form_loses() {
    // Normal incidence: R = (e/(2+e))². n − 1 itself is rounded to EPS/e relatively, and R is its square.
    for excess in [1e-12_f64, 1e-9, 1e-6] {
        let ior = 1.0 + excess;
        let e = ior - 1.0;
        let want = (e / (2.0 + e)).powi(2);
        assert!(
            (fresnel(1.0, ior) / want - 1.0).abs() < 8.0 * f64::EPSILON,
            "{excess}"
        );
    }
    // The textbook form in f32 sees a reflection where there is no coat, and none that grows: 1 + 1e-8 is 1.
    let textbook = |cos: f32, ior: f32| {
        let inner = (1.0 - (1.0 - cos * cos) / (ior * ior)).sqrt();
        (cos - ior * inner) / (cos + ior * inner)
    };
    assert!(textbook(0.3, 1.0) != 0.0 && textbook(0.3, 1.0 + 1e-8) == textbook(0.3, 1.0));
    assert!(fresnel(0.3, 1.0) == 0.0 && fresnel(0.3, 1.0 + 1e-8) > 0.0);
}

#[test]
fn a_coat_of_index_one_is_no_coat() {
    for z in [1.0, 0.5, 1e-3, 1e-300] {
        assert_eq!(fresnel(z, 1.0), 0.0);
        assert_eq!(refract(at(z, 0.3), 1.0), at(z, 0.3));
    }
    let (bare, coated) = (
        paint(0.1, 0.5, None),
        paint(0.1, 0.5, Some(Coat::smooth(1.0 + 1e-12))),
    );
    let (bare, coated) = (Reflectance::new(&bare), Reflectance::new(&coated));
    for (wi, wo) in [(at(0.8, 0.0), at(0.6, 2.0)), (at(0.2, 0.0), at(0.9, 1.0))] {
        for (x, y) in bare
            .evaluate(wi, wo, Chi::Table)
            .iter()
            .zip(coated.evaluate(wi, wo, Chi::Table))
        {
            // The directions turn by about 1e-12/z, the lobe's slope 2 tan θh/α² is below 100.
            assert!((x - y).abs() <= 1e-9 * x);
        }
    }
}

#[test]
fn a_coat_of_hardly_any_index_turns_grazing_light_by_what_snell_says() {
    // With e = n² − 1 the height inside is z' = √(z² + e)/n: relatively at most e/2z² higher, and never more than e/2
    // lower. f holds two such heights, in 1/(i_z o_z), h_z and its fourth power, and tan²θh/α²; F moves by 5/F0 times the cosine's change. R is at most (e/4z²)².
    let excess = 2e-12_f64 * (1.0 + 1e-4);
    let (bare, thin) = (
        paint(0.1, 0.5, None),
        paint(0.1, 0.5, Some(Coat::smooth(1.0 + 1e-12))),
    );
    let (bare, thin) = (Reflectance::new(&bare), Reflectance::new(&thin));
    let mut told_apart = 0;
    for z in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8] {
        let tilted = [(z, PI), (z * 0.9, PI + 0.1 * z), (1.0, 0.0)];
        for (wi, wo) in tilted.map(|(other, azimuth)| (at(z, 0.0), at(other, azimuth))) {
            let terms = bare.terms(wi, wo, Chi::Table).expect("above");
            let heights = [wi[2], wo[2]].map(|z| excess / (2.0 * z * z));
            let exponent = terms.half.tan2_h / 0.01;
            let turned: f64 = heights
                .iter()
                .map(|d| (8.0 + 2.0 * exponent) * d + 10.0 * excess / z + d * d / 4.0)
                .sum();
            // As with sixty digits below.
            let tangent = terms.half.tan2_h.sqrt() / (wi[2] + wo[2]);
            let rounding = f64::EPSILON * (64.0 + 16.0 * exponent + 4.0 * tangent / 0.01);
            let x = bare.evaluate(wi, wo, Chi::Table)[0];
            let y = thin.evaluate(wi, wo, Chi::Table)[0];
            assert!(
                (y / x - 1.0).abs() <= turned.exp_m1() + rounding,
                "{z}, {wo:?}: {x} {y}, allowed {turned:e}"
            );
            told_apart += usize::from(turned < 1e-3);
        }
    }
    // From 1e-6 down the coat is a mirror to such light, however thin its index, and the bound says nothing: there the
    // values with sixty digits do.
    assert!(told_apart >= 6, "{told_apart}");
}

#[test]
fn a_coat_on_nothing_reflects_what_the_coat_reflects() {
    let mut nothing = paint(0.1, 0.5, Some(rough(1.5, 0.05)));
    nothing.diffuse = [0.0; 3];
    nothing.lobes.clear();
    nothing.validate(&Limits::default()).expect("a paint");
    let reflectance = Reflectance::new(&nothing);
    for (wi, wo) in [(at(0.8, 0.0), at(0.8, 3.1)), (at(1e-8, 0.0), at(0.5, 2.0))] {
        let highlight = rough(1.5, 0.05).highlight(wi, wo);
        assert_eq!(reflectance.evaluate(wi, wo, Chi::Table), [highlight; 3]);
    }
    nothing.coat = Some(Coat::smooth(1.5));
    let smooth = Reflectance::new(&nothing);
    assert_eq!(
        smooth.evaluate(at(0.8, 0.0), at(0.8, 3.1), Chi::Table),
        [0.0; 3]
    );
    // All that is left is the mirror image, and the certificate counts it: R0 = 0.04 for 1.5, exact to rounding.
    let albedo = certify(&nothing).albedo;
    assert!((albedo[0] - 0.04).abs() < 1e-15, "{albedo:?}");
}

#[test]
fn a_table_of_one_row_holds_everywhere() {
    let mut paint = paint(0.1, 0.5, None);
    let red = Lab {
        l: 50.0,
        a: 60.0,
        b: 40.0,
    };
    paint.color_table = ColorTable::new(AngleGrid::single(), AngleGrid::single(), vec![red], red)
        .expect("one color");
    let (wi, wo) = (at(0.3, 0.0), at(0.9, 2.0));
    let one = Reflectance::new(&paint).evaluate(wi, wo, Chi::Table);
    assert_eq!(one, Reflectance::new(&paint).evaluate(wi, wo, Chi::Overall));
    // One row and three columns of the same color are that color, whatever the bilinear weights: they sum to 1 ± EPS.
    let columns = AngleGrid::new(vec![0.0, 30.0, 60.0]).expect("ascending");
    paint.color_table =
        ColorTable::new(AngleGrid::single(), columns, vec![red; 3], red).expect("three colors");
    let row = Reflectance::new(&paint).evaluate(wi, wo, Chi::Table);
    for (x, y) in one.iter().zip(row) {
        assert!((x - y).abs() <= 4.0 * f64::EPSILON * x, "{one:?} {row:?}");
    }
}

#[test]
fn outside_the_slices_that_were_taken_the_border_slice_holds() {
    let mut metallic = paint(0.1, 0.5, None);
    let cluster = (1.0, [20.0, 0.0, 0.0], [30.0, 1.0, 1.0]);
    metallic.flakes = Some(flakes(&[20.0], &[30.0], &[cluster]));
    let one = Reflectance::new(&metallic);
    let want = one.flake_means()[0];
    for (wi, wo) in [(at(1.0, 0.0), at(1.0, 0.0)), (at(0.1, 0.0), at(0.2, 1.0))] {
        let terms = one.terms(wi, wo, Chi::Table).expect("above the horizon");
        assert_eq!(terms.flakes, want);
    }
}

#[test]
fn a_slice_that_is_missing_is_refused_by_its_number() {
    let mut metallic = paint(0.1, 0.5, None);
    let cluster = (1.0, [20.0, 0.0, 0.0], [30.0, 1.0, 1.0]);
    let whole = flakes(&[0.0, 20.0], &[0.0, 30.0], &[cluster]);
    // The list ends one slice early.
    let mut short = whole.clone();
    short.offsets.pop();
    metallic.flakes = Some(short);
    let error = metallic.validate(&Limits::default()).expect_err("refused");
    assert!(
        matches!(&error, PaintError::Shape { field, .. } if field == "flakes.offsets"),
        "{error}"
    );
    // The third slice has no cluster.
    let mut empty = whole;
    empty.offsets = vec![0, 1, 2, 2, 4].into();
    metallic.flakes = Some(empty);
    let error = metallic.validate(&Limits::default()).expect_err("refused");
    assert!(
        matches!(&error, PaintError::Count { field, count: 0, .. } if field == "flakes.slices[2]"),
        "{error}"
    );
}

#[test]
fn negative_sensor_light_is_held_at_black_once_and_at_the_end() {
    let mut dark = paint(0.1, 0.5, None);
    dark.lobes.clear();
    dark.diffuse = [0.01; 3];
    let noise = (1.0, [-3.0, 0.0, 0.0], [-2.0, 0.0, 0.0]);
    dark.flakes = Some(flakes(&[0.0], &[0.0], &[noise]));
    let reflectance = Reflectance::new(&dark);
    let (wi, wo) = (at(0.9, 0.0), at(0.9, 3.0));
    let terms = reflectance
        .terms(wi, wo, Chi::Table)
        .expect("above the horizon");
    assert!(terms.flakes.iter().all(|v| *v < 0.0), "{terms:?}");
    let f = reflectance.evaluate(wi, wo, Chi::Table);
    for c in 0..3 {
        assert_eq!(f[c], terms.base[c] + terms.flakes[c]);
    }
    dark.diffuse = [0.0; 3];
    assert_eq!(
        Reflectance::new(&dark).evaluate(wi, wo, Chi::Table),
        [0.0; 3]
    );
}

/// `∫ f o_z dω` by the midpoint rule in polar angle and azimuth, at a resolution and at half of it: the error of the finer
/// is a third of their difference, for a rule of second order.
///
/// Heights over the horizon are `u² π/2` in even steps of `u`, dense where masking bends at grazing. The azimuth is that from the mirror's, `φ = w sinh t` in even steps of `t`: the width of a lobe across the plane of
/// incidence is `2 α cos θ/sin θ`, which becomes nothing at grazing. Both halves are alike.
fn furnace(paint: &CarPaint, wi: Direction, fineness: u32) -> [f64; 2] {
    let reflectance = Reflectance::new(paint);
    let lobes = paint.lobes.iter().map(|lobe| lobe.alpha);
    let coat = paint.coat.iter().filter(|coat| !coat.is_mirror());
    let alpha = lobes.chain(coat.map(|c| c.roughness)).fold(1.0, f64::min);
    let width = (2.0 * alpha * wi[2] / wi[0].abs().max(1e-9)).min(PI);
    [1, 2].map(|coarser| {
        let (rings, spokes) = (240 * fineness / coarser, 48 * fineness / coarser);
        let (height, reach) = (1.0 / f64::from(rings), (PI / width).asinh());
        let step = reach / f64::from(spokes);
        let mut sum = [0.0; 3];
        for spoke in 0..spokes {
            let t = (f64::from(spoke) + 0.5) * step;
            let (s, c) = (width * t.sinh()).sin_cos();
            for ring in 0..rings {
                let u = (f64::from(ring) + 0.5) * height;
                let (cosine, sine) = (FRAC_PI_2 * u * u).sin_cos();
                let f = reflectance.evaluate(wi, [sine * c, sine * s, cosine], Chi::Table);
                let solid = 2.0 * width * t.cosh() * step * PI * u * height * sine;
                (0..3).for_each(|c| sum[c] += f[c] * solid * cosine);
            }
        }
        sum.into_iter().fold(0.0, f64::max) + reflectance.mirror(wi)
    })
}

#[test]
fn in_a_white_furnace_a_certified_paint_gives_back_no_more_than_it_gets() {
    // Without a coat Σ s ≤ 0.25 suffices beside a black diffuse; under ior 1.5 Σ s F0 ≤ 0.116 (model, section 1).
    let cases = [
        (0.1, 1.0, 0.25, 0.0, None),
        (0.5, 1.0, 0.25, 0.0, None),
        (10.0, 1.0, 0.25, 0.0, None),
        (0.2, 1.0, 0.05, 0.5, None),
        (0.2, 0.5, 0.1, 0.2, Some(Coat::smooth(1.5))),
        (0.3, 0.04, 0.1, 0.2, Some(rough(1.5, 0.1))),
    ];
    let mut paints: Vec<CarPaint> = cases
        .into_iter()
        .map(|(alpha, f0, weight, albedo, coat)| {
            let mut paint = paint(alpha, f0, coat);
            paint.diffuse = [albedo; 3];
            paint.lobes[0].weight = [weight; 3];
            paint
        })
        .collect();
    // The same under colors that change by angle, some of them brighter than white, and with flakes.
    let sparkle = [
        (0.9, [5.0, -4.0, 0.0], [30.0, 4.0, 9.0]),
        (0.1, [60.0, 0.0, 0.0], [90.0, 1.0, 1.0]),
    ];
    let sparkle = flakes(&[0.0, 12.0, 40.0], &[0.0, 25.0, 60.0], &sparkle);
    for k in 0..paints.len() {
        let mut changed = paints[k].clone();
        changed.color_table = colored();
        for weight in changed
            .diffuse
            .iter_mut()
            .chain(&mut changed.lobes[0].weight)
        {
            *weight *= 0.5;
        }
        changed.flakes = Some(sparkle.clone());
        paints.push(changed);
    }
    for (k, paint) in paints.iter().enumerate() {
        let certificate = certify(paint);
        assert!(certificate.conserves, "{k}: {certificate:?}");
        let own = &certificate.incidence_deg;
        assert!(own.contains(&0.0) && own.iter().any(|d| *d >= 80.0));
        let swept = (0..30).map(|k| f64::from(k) * 3.0).chain([89.0]);
        for degrees in swept.chain(own.iter().copied()) {
            let theta = degrees.to_radians();
            let fineness = if degrees > 89.0 { 3 } else { 1 };
            let [found, coarse] = furnace(paint, [-theta.sin(), 0.0, theta.cos()], fineness);
            let error = (found - coarse).abs();
            assert!(error < 3e-3, "{k} at {degrees}°: {found} {coarse}");
            // 1e-3 is what the certificate promises, of itself and of the paint.
            assert!(found <= 1.0 + 1e-3 + error, "{k} at {degrees}°: {found}");
            if let Some(place) = own.iter().position(|d| *d == degrees) {
                let certified = certificate.albedo[place];
                // Beyond 89° the certificate's rings are too wide for the widest lobe, and it says more than there is.
                let over = if degrees > 89.0 { 8e-3 } else { 1e-3 };
                assert!(
                    (-1e-3 - error..=over + error).contains(&(certified - found)),
                    "{k} at {degrees}°: {found} ± {error}, certified {certified}"
                );
            }
        }
    }
}

/// Fresnel's factor takes a lobe of F0 0 to 1 within the last degree: `ρ → 4 s` at grazing, whatever it is before.
#[test]
fn a_paint_at_the_limit_of_its_certificate_holds_it_up_to_grazing() {
    for (f0, alphas) in [
        (0.0, &[1e-3, 0.02, 0.1, 0.5][..]),
        (0.04, &[0.02]),
        (1.0, &[0.1]),
    ] {
        for &alpha in alphas {
            let mut paint = paint(alpha, f0, None);
            paint.diffuse = [0.0; 3];
            paint.lobes[0].weight = [0.1; 3];
            // Light is proportional to the weight: as much of it as the certificate allows.
            let most = certify(&paint).albedo.into_iter().fold(0.0, f64::max);
            paint.lobes[0].weight = [0.1 / most; 3];
            assert!(certify(&paint).conserves, "F0 {f0}, alpha {alpha}");
            // The furnace's own rings are too wide for the narrowest lobe before that.
            let from = if alpha < 0.01 { 89.0 } else { 0.0 };
            let degrees = [85.0, 88.0, 89.0, 89.5, 89.7, 89.9, 89.97, 89.99, 89.9995];
            for degrees in degrees.into_iter().filter(|d| *d >= from) {
                let theta = f64::to_radians(degrees);
                let [found, coarse] = furnace(&paint, [-theta.sin(), 0.0, theta.cos()], 2);
                let error = (found - coarse).abs();
                assert!(
                    error < 5e-3 && found <= 1.0 + 1e-3 + error,
                    "F0 {f0}, alpha {alpha} at {degrees}°: {found} ± {error}"
                );
            }
        }
    }
}

#[test]
fn a_paint_that_gives_back_more_than_it_gets_is_not_certified() {
    let mut bright = paint(0.1, 1.0, None);
    bright.lobes[0].weight = [0.3; 3];
    bright.diffuse = [0.0; 3];
    // ρ = 4 s for a narrow lobe at normal incidence: 1.2.
    let certificate = certify(&bright);
    assert!(
        !certificate.conserves && (certificate.albedo[0] - 1.2).abs() < 0.012,
        "{certificate:?}"
    );
}
