use super::*;
use crate::color::{Illuminant, Observer, ciede2000};
use crate::fit::against_readings;
use crate::paint::{ASPECULAR_DEG, AngleGrid, LEAST_STEP_DEG, Lobe, certify};
use proptest::prelude::*;

/// A paint like a measured one: three lobes under a coat, a color that turns from face to flop.
fn metallic(coat: Option<Coat>) -> CarPaint {
    let lobe = |weight: f64, alpha: f64| Lobe {
        weight: [weight; 3],
        alpha,
        f0: 0.4,
    };
    let grid = |degrees: &[f64]| AngleGrid::new(degrees.to_vec()).expect("ascending");
    let face = Lab::from_rgb([0.9, 1.0, 1.2]);
    let flop = Lab::from_rgb([1.1, 1.0, 0.8]);
    let table = ColorTable::new(
        grid(&[5.0, 30.0]),
        AngleGrid::single(),
        vec![face, flop],
        face,
    );
    CarPaint {
        coat,
        diffuse: [0.05; 3],
        lobes: vec![lobe(0.008, 0.1), lobe(0.08, 0.24), lobe(0.1, 0.42)],
        color_table: table.expect("two colors"),
        flakes: None,
    }
}

fn read_on(paint: &CarPaint, aspecular_deg: &[f64]) -> MultiAngle {
    let reflectance = Reflectance::new(paint);
    let row = |&angle: &f64| {
        let (wi, wo) = directions(45.0, angle);
        let lab = Lab::from_rgb(reflectance.evaluate(wi, wo, Chi::Table).map(|f| f * PI));
        vec![angle, lab.l, lab.a, lab.b]
    };
    MultiAngle {
        illumination_deg: 45.0,
        illuminant: Illuminant::D65,
        observer: Observer::Two,
        columns: ["aspecular_deg", "L", "a", "b"].map(str::to_owned).to_vec(),
        rows: aspecular_deg.iter().map(row).collect(),
    }
}

fn fit(readings: &MultiAngle, coat: Option<Coat>) -> PaintFromReadings {
    paint_from_readings(readings, coat, None).expect("readings")
}

/// Largest CIEDE2000 between two paints at these angles.
fn apart(a: &CarPaint, b: &CarPaint, aspecular_deg: &[f64]) -> f64 {
    let of = against_readings(a, &read_on(b, aspecular_deg)).expect("above the paint");
    of.worst
}

#[test]
fn a_paint_is_read_as_it_was_and_nearly_so_between_the_angles() {
    let between: Vec<f64> = (8..=55).map(|k| 2.0 * f64::from(k)).collect();
    for coat in [None, Some(Coat::smooth(1.5)), Some(Coat::smooth(1.8))] {
        let truth = metallic(coat);
        let fitted = fit(&read_on(&truth, &ASPECULAR_DEG), coat).paint;
        assert!(apart(&fitted, &truth, &ASPECULAR_DEG) < 0.01, "{coat:?}");
        // Six readings choose two lobes where there are three: that is what may be between them.
        let between = apart(&fitted, &truth, &between);
        assert!(between < 2.5, "{coat:?}: {between}");
        assert!(certify(&fitted).conserves, "{coat:?}");
    }
}

#[test]
fn nothing_that_no_angle_saw_outshines_the_nearest_that_one_did() {
    for coat in [None, Some(Coat::smooth(1.5))] {
        // The narrow lobe of an uncoated paint's gloss, which an instrument's first angle hardly sees.
        let mut truth = metallic(coat);
        truth.lobes[0].alpha = 0.03;
        truth.lobes[0].weight = [0.05; 3];
        let fitted = fit(&read_on(&truth, &ASPECULAR_DEG), coat).paint;
        let reflectance = Reflectance::new(&fitted);
        let at = |angle: f64| {
            let (wi, wo) = directions(45.0, angle);
            luminance(reflectance.evaluate(wi, wo, Chi::Table))
        };
        let seen = at(-15.0).max(at(15.0));
        assert!(
            at(0.0) < std::f64::consts::E * 1.1 * seen,
            "{coat:?}: {} {seen}",
            at(0.0)
        );
    }
}

#[test]
fn twins_beside_the_mirror_make_two_columns_and_no_wild_colors() {
    let coat = Some(Coat::smooth(1.5));
    let mut readings = read_on(&metallic(coat), &ASPECULAR_DEG);
    // At −15° half as bright again as at 15°, half a degree of θh away.
    readings.rows[0][1] += 15.0;
    let paint = fit(&readings, coat).paint;
    let of = against_readings(&paint, &readings).expect("L, a, b");
    assert!(of.worst < 0.05, "{of:?}");
    let table = &paint.color_table;
    assert_eq!((table.theta_h().len(), table.theta_d().len()), (5, 2));
    for node in table.nodes() {
        assert!((70.0..=130.0).contains(&node.l), "{:?}", table.nodes());
    }
}

#[test]
fn few_readings_are_a_color_by_angle_and_said_to_be_no_more() {
    for angles in [&[45.0][..], &[15.0, 110.0]] {
        let truth = metallic(None);
        let fitted = fit(&read_on(&truth, angles), None);
        assert!(
            fitted.paint.lobes.is_empty() && fitted.warnings[0].contains("the base is diffuse")
        );
        assert!(apart(&fitted.paint, &truth, angles) < 0.01);
    }
    let three = fit(&read_on(&metallic(None), &[15.0, 45.0, 110.0]), None);
    assert_eq!(three.paint.lobes.len(), 1);
}

#[test]
fn a_whole_scan_is_told_from_its_outlier() {
    let coat = Some(Coat::smooth(1.5));
    let angles: Vec<f64> = (4..=60).map(|k| 2.0 * f64::from(k)).collect();
    let truth = metallic(coat);
    let mut readings = read_on(&truth, &angles);
    readings.rows[25][1] *= 1.5;
    let fitted = fit(&readings, coat).paint;
    let others: Vec<f64> = angles
        .iter()
        .copied()
        .filter(|a| (a - angles[25]).abs() > 3.0)
        .collect();
    assert!(apart(&fitted, &truth, &others) < 0.05);
    // The lobes alone: the outlier is in the table, and not in them.
    let alone = Reflectance::new(&fitted);
    for angle in others {
        let (wi, wo) = directions(45.0, angle);
        let off = luminance(alone.evaluate(wi, wo, Chi::Overall))
            / luminance(Reflectance::new(&truth).evaluate(wi, wo, Chi::Table));
        assert!((off - 1.0).abs() < 0.15, "{angle}: {off}");
    }
}

#[test]
fn what_reflects_nothing_or_stands_below_the_paint_is_refused() {
    let mut readings = read_on(&metallic(None), &[15.0, 45.0]);
    readings.rows[0][0] = -60.0;
    let fitted = fit(&readings, None);
    assert!(
        fitted.warnings[0].starts_with("1 of 2 readings were left out"),
        "{:?}",
        fitted.warnings
    );
    readings.rows[1][0] = 140.0;
    let refused =
        |readings: &MultiAngle| paint_from_readings(readings, None, None).expect_err("refused");
    assert!(matches!(
        refused(&readings),
        ReadingsFitError::NoViewer { rows: 2, .. }
    ));
    let mut black = read_on(&metallic(None), &[15.0, 45.0]);
    for row in &mut black.rows {
        row[1..].fill(0.0);
    }
    assert_eq!(refused(&black), ReadingsFitError::Dark);
    black.columns[1] = "lightness".to_owned();
    assert!(matches!(refused(&black), ReadingsFitError::Colors(_)));
}

#[test]
fn a_color_outside_the_gamut_becomes_one_inside_and_is_counted() {
    let mut readings = read_on(&metallic(None), &[45.0]);
    readings.rows[0] = vec![45.0, 60.0, 120.0, 100.0];
    let fitted = fit(&readings, None);
    assert!(
        fitted.warnings[0].starts_with("what was read at 45° lies outside sRGB"),
        "{:?}",
        fitted.warnings
    );
    assert!(
        fitted
            .paint
            .color_table
            .nodes()
            .iter()
            .all(|lab| lab.to_rgb().iter().all(|v| *v > -1e-9))
    );
}

#[test]
fn the_grids_steps_are_those_of_a_grid_however_near_the_readings() {
    let coat = Some(Coat::smooth(1.5));
    let angles: Vec<f64> = (0..40).map(|k| 45.0 + 1e-4 * f64::from(k)).collect();
    let fitted = fit(&read_on(&metallic(coat), &angles), coat).paint;
    assert!(
        fitted
            .color_table
            .theta_h()
            .degrees()
            .windows(2)
            .all(|p| p[1] - p[0] >= LEAST_STEP_DEG)
    );
    assert!(apart(&fitted, &metallic(coat), &[45.0]) < 0.05);
}

#[test]
fn a_reading_near_the_horizon_is_left_out_and_told() {
    let coat = Some(Coat::smooth(1.5));
    let good = read_on(&metallic(coat), &ASPECULAR_DEG);
    let alone = fit(&good, coat);
    for angle in [135.0, -45.0, 134.999, 131.0] {
        let mut readings = good.clone();
        readings.rows.push(vec![angle, 150.0, 0.0, 0.0]);
        let fitted = fit(&readings, coat);
        assert_eq!(fitted.paint, alone.paint, "{angle}");
        let told = fitted
            .warnings
            .iter()
            .any(|w| w.starts_with("1 of 7 readings"));
        assert!(told, "{:?}", fitted.warnings);
    }
    let light = MultiAngle {
        illumination_deg: 89.0,
        ..good
    };
    let refused = paint_from_readings(&light, coat, None);
    assert!(
        matches!(refused, Err(ReadingsFitError::NoViewer { .. })),
        "{refused:?}"
    );
}

#[test]
fn numbers_that_mean_something_else_are_doubted() {
    let read = |of: &dyn Fn(f64, f64) -> [f64; 3]| {
        let mut readings = read_on(&metallic(None), &ASPECULAR_DEG);
        for row in &mut readings.rows {
            let [angle, l, a] = of(row[0], row[1]);
            (row[0], row[1], row[2]) = (angle, l, a);
        }
        fit(&readings, None).warnings.join("; ")
    };
    assert!(!read(&|angle, l| [angle, l, 0.0]).contains("L goes up to 100"));
    assert!(read(&|angle, l| [angle, l / 200.0, 0.0]).contains("L goes up to 100"));
    let below = read(&|angle, l| [angle, l.min(120.0) - 30.0, 0.0]);
    assert!(
        below.contains("L is negative") && !below.contains("contradict"),
        "{below}"
    );
    let reversed = read(&|angle, l| [95.0 - angle, l, 0.0]);
    assert!(reversed.contains("angles reversed"), "{reversed}");
    let twice = read(&|angle, l| [if angle == 75.0 { 15.0 } else { angle }, l, 0.0]);
    assert!(twice.contains("contradict each other"), "{twice}");
    let colored = read(&|angle, l| [angle, if angle == 45.0 { 0.0 } else { l }, 50.0]);
    assert!(colored.contains("45° lies outside sRGB"), "{colored}");
}

#[test]
fn two_readings_that_differ_much_are_both_met_without_a_wild_table() {
    let mut readings = read_on(&metallic(None), &[15.0, 110.0]);
    (readings.rows[0][1], readings.rows[1][1]) = (120.0, 10.0);
    let fitted = fit(&readings, None).paint;
    let most = fitted
        .color_table
        .nodes()
        .iter()
        .map(|lab| lab.l)
        .fold(0.0, f64::max);
    assert!(most < 400.0, "{most}");
    assert!(against_readings(&fitted, &readings).expect("read").worst < 0.1);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn whatever_was_read_the_paint_that_comes_of_it_is_a_valid_one(
        lightness in prop::collection::vec(0.0..180.0_f64, 1..9),
        a in -40.0..40.0_f64, b in -40.0..40.0_f64,
        light in 0.0..80.0_f64, from in -60.0..20.0_f64, step in 0.0..25.0_f64, ior in 1.0..2.0_f64,
    ) {
        let rows = lightness.iter().enumerate().map(|(k, l)| {
            let chroma = l / 180.0;
            vec![from + step * k as f64, *l, a * chroma, b * chroma]
        });
        let readings = MultiAngle { illumination_deg: light, rows: rows.collect(), ..read_on(&metallic(None), &[]) };
        let coat = (ior > 1.05).then(|| Coat::smooth(ior));
        if let Ok(fitted) = paint_from_readings(&readings, coat, None) {
            fitted.paint.validate(&crate::paint::Limits::default()).expect("a paint");
            let reflectance = Reflectance::new(&fitted.paint);
            for angle in -80..160 {
                let (wi, wo) = directions(light, f64::from(angle));
                prop_assert!(reflectance.evaluate(wi, wo, Chi::Table).iter().all(|f| f.is_finite() && *f >= 0.0));
            }
        }
    }

    #[test]
    fn a_color_outside_the_gamut_moves_no_farther_than_cutting_it_would(
        r in -0.5..1.0_f64, g in -0.5..1.0_f64, b in -0.5..1.0_f64,
    ) {
        let (inside, away) = colors::inside_gamut([r, g, b]);
        prop_assert!(inside.iter().all(|v| *v >= 0.0));
        let lab = |rgb: LinearRgb| Lab::from_rgb(rgb.map(|v| v * PI));
        let cut = [r, g, b].map(|v| v.max(0.0));
        prop_assert!(away <= ciede2000(lab([r, g, b]), lab(cut)));
        if cut == [r, g, b] {
            prop_assert_eq!(inside, cut);
        }
    }
}
