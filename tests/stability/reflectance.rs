//! Reflectance at grazing, mirrored, and with parameters at their ends.

use carpaint::color::Lab;
use carpaint::paint::{
    AngleGrid, CarPaint, Chi, Coat, ColorTable, Direction, Lobe, Reflectance, certify, fresnel,
    half_angles, refract,
};

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

/// A unit vector of this height above the horizon, at an azimuth.
fn at(z: f64, azimuth: f64) -> Direction {
    let r = ((1.0 - z) * (1.0 + z)).sqrt();
    [r * azimuth.cos(), r * azimuth.sin(), z]
}

/// Directions from straight above to as near the horizon as a number can be.
fn directions() -> Vec<Direction> {
    let heights = [1.0, 0.7, 1e-3, 1e-8, 1e-160, 1e-300, f64::MIN_POSITIVE];
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
            coats.push(Some(Coat {
                ior,
                roughness,
                thickness_um: None,
            }));
        }
    }
    coats
}

#[test]
fn every_value_is_finite_not_negative_and_reciprocal() {
    let directions = directions();
    for coat in coats() {
        for alpha in [1e-12, 1e-8, 1e-4, 0.02, 1.0, 10.0] {
            for f0 in [0.0, 0.04, 1.0] {
                let paint = paint(alpha, f0, coat);
                let reflectance = Reflectance::new(&paint);
                for &wi in &directions {
                    for &wo in &directions {
                        let f = reflectance.evaluate(wi, wo, Chi::Table);
                        let g = reflectance.evaluate(wo, wi, Chi::Table);
                        for (f, g) in f.into_iter().zip(g) {
                            assert!(
                                f.is_finite() && f >= 0.0,
                                "α {alpha}, F0 {f0}, {coat:?}, {wi:?}, {wo:?}: {f}"
                            );
                            // Swapping i and o only reorders sums of two numbers: a few ulp, which the exponent
                            // tan²θh/α² of a narrow lobe multiplies by its own size, at most 745 before it is 0.
                            assert!(
                                (f - g).abs() <= 1e-6 * f.max(g) + 1e-300,
                                "{f} {g} at {wi:?}, {wo:?}"
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn below_the_horizon_is_black() {
    let paint = paint(0.1, 0.5, Some(Coat::smooth(1.5)));
    let reflectance = Reflectance::new(&paint);
    for (wi, wo) in [
        (at(0.5, 0.0), [0.0, 0.6, -0.8]),
        ([0.0, 0.0, -1.0], at(0.5, 0.0)),
        (at(0.0, 0.0), at(1.0, 0.0)),
    ] {
        assert_eq!(reflectance.evaluate(wi, wo, Chi::Table), [0.0; 3]);
    }
}

#[test]
fn light_opposite_to_the_view_and_along_the_normal_is_finite() {
    let paint = paint(
        0.1,
        0.5,
        Some(Coat {
            ior: 1.5,
            roughness: 0.01,
            thickness_um: None,
        }),
    );
    let reflectance = Reflectance::new(&paint);
    let n = [0.0, 0.0, 1.0];
    for (wi, wo) in [
        (n, n),
        ([1.0, 0.0, 1e-300], [-1.0, 0.0, 1e-300]),
        ([1.0, 0.0, 1e-300], [1.0, 0.0, 1e-300]),
    ] {
        let f = reflectance.evaluate(wi, wo, Chi::Table);
        assert!(
            f.iter().all(|v| v.is_finite() && *v >= 0.0),
            "{wi:?} {wo:?}: {f:?}"
        );
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
fn a_table_of_one_row_holds_everywhere() {
    let mut paint = paint(0.1, 0.5, None);
    let red = Lab {
        l: 50.0,
        a: 60.0,
        b: 40.0,
    };
    paint.color_table = ColorTable::new(AngleGrid::single(), AngleGrid::single(), vec![red], red)
        .expect("one color");
    let reflectance = Reflectance::new(&paint);
    let table = reflectance.evaluate(at(0.3, 0.0), at(0.9, 2.0), Chi::Table);
    assert_eq!(
        table,
        reflectance.evaluate(at(0.3, 0.0), at(0.9, 2.0), Chi::Overall)
    );
}

#[test]
fn a_paint_within_the_bounds_of_its_lobes_never_reflects_more_than_it_gets() {
    // Without a coat Σ s ≤ 0.25 suffices beside a black diffuse; the quadrature of the certificate is good to 1e-3.
    for alpha in [0.02, 0.1, 0.5] {
        let mut paint = paint(alpha, 1.0, None);
        paint.diffuse = [0.0; 3];
        paint.lobes[0].weight = [0.25; 3];
        let certificate = certify(&paint);
        assert!(certificate.conserves, "α {alpha}: {certificate:?}");
    }
}
