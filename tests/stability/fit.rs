//! Fits of measurements that are hardly any.

use crate::paints::at;
use carpaint::color::{LinearRgb, luminance};
use carpaint::fit::{CoatChoice, FitError, FittedBase, fit_base};
use carpaint::measurement::{HalfAngleTable, MeasuredBrdf, TableError, ThetaHSpacing};
use carpaint::paint::{CarPaint, Chi, Direction, Limits, Reflectance, half_angles};

/// A measurement that a function answers.
struct By<F: Fn(Direction, Direction) -> Option<LinearRgb> + Sync>(F);

impl<F: Fn(Direction, Direction) -> Option<LinearRgb> + Sync> MeasuredBrdf for By<F> {
    fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
        (self.0)(wi, wo)
    }
}

/// A number in `0..1` that depends on both directions and a seed, and nothing else.
fn noise(seed: u64, wi: Direction, wo: Direction) -> f64 {
    let bits = wi.iter().chain(&wo).fold(seed, |h, v| {
        (h ^ v.to_bits())
            .wrapping_mul(0x9E37_79B9_7F4A_7C15)
            .rotate_left(29)
    });
    (bits >> 40) as f64 / f64::from(1_u32 << 24)
}

/// A satin surface with one lobe of width 0.2 over a colored base.
fn satin(wi: Direction, wo: Direction) -> LinearRgb {
    let h = half_angles(wi, wo);
    let peak = 2.0 * (-h.tan2_h / 0.04).exp() / (wi[2] * wo[2]).max(0.1);
    [0.05 + peak, 0.03 + 0.8 * peak, 0.02 + 0.5 * peak]
}

fn fit(
    measured: impl Fn(Direction, Direction) -> Option<LinearRgb> + Sync,
) -> Result<FittedBase, FitError> {
    fit_base(&By(measured), CoatChoice::Ior(1.0))
}

fn paint(base: &FittedBase) -> CarPaint {
    let paint = CarPaint {
        coat: base.coat,
        diffuse: base.diffuse,
        lobes: base.lobes.clone(),
        color_table: base.color_table.clone(),
        flakes: None,
    };
    paint
        .validate(&Limits::default())
        .expect("every fit is a valid paint");
    paint
}

/// Luminance under light from 30°: towards the mirror, beside it, and far off.
fn looks(base: &FittedBase) -> [f64; 4] {
    let paint = paint(base);
    let reflectance = Reflectance::new(&paint);
    let wi = at(30.0_f64.to_radians().cos(), std::f64::consts::PI);
    [30.0_f64, 22.0, 5.0, -20.0].map(|degrees| {
        let wo = at(
            degrees.to_radians().cos(),
            if degrees > 0.0 {
                0.0
            } else {
                std::f64::consts::PI
            },
        );
        let f = reflectance.evaluate(wi, wo, Chi::Table);
        assert!(f.iter().all(|v| v.is_finite() && *v >= 0.0), "{f:?}");
        luminance(f)
    })
}

/// Both fits look alike; `tolerance` is relative, beside a thousandth of the brightest.
fn assert_alike(x: &FittedBase, y: &FittedBase, tolerance: f64, what: &str) {
    let (x, y) = (looks(x), looks(y));
    for k in 0..4 {
        assert!(
            (x[k] - y[k]).abs() <= tolerance * y[k] + 1e-3 * y[0].min(1.0),
            "{what}: {x:?} instead of {y:?}"
        );
    }
}

#[test]
fn flat_data_are_a_diffuse_paint_of_their_color() {
    let base = fit(|_, _| Some([0.1, 0.2, 0.3])).expect("a fit");
    for y in looks(&base) {
        // The fit's own aim is a relative error of 5e-3 on data that it can represent.
        assert!((y / luminance([0.1, 0.2, 0.3]) - 1.0).abs() < 5e-3, "{y}");
    }
    assert!(base.coat.is_none());
}

#[test]
fn a_pure_mirror_ends_in_a_finite_paint_that_is_dark_away_from_the_mirror() {
    let base = fit(|i, o| {
        Some(
            [if half_angles(i, o).theta_h < 0.01 {
                3000.0
            } else {
                0.0
            }; 3],
        )
    })
    .expect("a fit");
    let [_, _, _, flop] = looks(&base);
    // Black is told from 1e-3 1/sr only (the fit's logarithm has that floor), a hundred times it is not black.
    assert!(flop < 0.1, "{flop}");
}

#[test]
fn a_measurement_that_is_invalid_everywhere_is_refused_by_name() {
    let refused = fit(|_, _| None);
    assert!(
        matches!(refused, Err(FitError::TooFewSamples { found: 0, .. })),
        "{refused:?}"
    );
    let refused = fit(|_, _| Some([f64::NAN; 3]));
    assert!(
        matches!(refused, Err(FitError::TooFewSamples { found: 0, .. })),
        "{refused:?}"
    );
    let refused = fit(|_, _| Some([0.1, f64::INFINITY, 0.1]));
    assert!(
        matches!(refused, Err(FitError::TooFewSamples { found: 0, .. })),
        "{refused:?}"
    );
    assert_eq!(fit(|_, _| Some([0.0; 3])), Err(FitError::Dark));
    assert_eq!(fit(|_, _| Some([-1.0; 3])), Err(FitError::Dark));
    let table = HalfAngleTable::sample(ThetaHSpacing::SquareRoot, |_, _| None);
    assert!(matches!(table, Err(TableError::AllInvalid(_))));
}

#[test]
fn fewer_samples_than_a_dozen_parameters_can_use_are_refused_with_both_numbers() {
    for share in [1e-3, 1e-2] {
        let refused = fit(move |i, o| (noise(1, i, o) < share).then(|| satin(i, o)));
        let Err(FitError::TooFewSamples {
            found,
            asked,
            needed,
        }) = refused
        else {
            panic!("{share}: {refused:?}");
        };
        // Binomial: within five standard deviations of the share.
        let expected = share * asked as f64;
        assert!((found as f64 - expected).abs() <= 5.0 * expected.sqrt() + 1.0 && found < needed);
    }
}

#[test]
fn three_and_fifty_per_cent_invalid_entries_change_next_to_nothing() {
    let clean = fit(|i, o| Some(satin(i, o))).expect("a fit");
    for share in [0.03, 0.5] {
        let holes = fit(move |i, o| (noise(2, i, o) > share).then(|| satin(i, o))).expect("a fit");
        // Valid values are exact: only where the model errs by itself, some per cent, does the choice of samples matter.
        assert_alike(&holes, &clean, 0.05, &format!("{share} invalid"));
        // The same with what careless files write instead of a mark.
        let nan = fit(move |i, o| {
            Some(if noise(2, i, o) > share {
                satin(i, o)
            } else {
                [f64::NAN, 0.1, 0.1]
            })
        });
        assert_eq!(nan.expect("a fit"), holes);
    }
}

#[test]
fn one_outlier_a_hundred_times_too_bright_changes_next_to_nothing() {
    let clean = fit(|i, o| Some(satin(i, o))).expect("a fit");
    for seed in 0..3 {
        // One in 8000, which is one of the samples: the robust error of a factor 100 counts ln 100/0.05 times less
        // than its square would.
        let spoiled = fit(move |i, o| {
            let factor = if noise(seed, i, o) < 1.0 / 8000.0 {
                100.0
            } else {
                1.0
            };
            Some(satin(i, o).map(|v| v * factor))
        });
        assert_alike(
            &spoiled.expect("a fit"),
            &clean,
            0.02,
            &format!("outlier {seed}"),
        );
    }
}

#[test]
fn values_a_million_times_too_small_are_the_same_paint_dimmed_and_too_large_are_refused() {
    let clean = fit(|i, o| Some(satin(i, o))).expect("a fit");
    let dim = fit(|i, o| Some(satin(i, o).map(|v| v * 1e-6))).expect("a fit");
    let (dim, clean) = (looks(&dim), looks(&clean));
    for k in 0..4 {
        assert!(
            (1e6 * dim[k] / clean[k] - 1.0).abs() < 0.05,
            "{dim:?} {clean:?}"
        );
    }
    let refused = fit(|i, o| Some(satin(i, o).map(|v| v * 1e6)));
    assert!(
        matches!(refused, Err(FitError::NotAReflectance { value, .. }) if value > 1e3),
        "{refused:?}"
    );
}

#[test]
fn twenty_starts_of_other_noise_end_in_one_paint_or_say_that_they_do_not() {
    // The descent's own starts are fixed; what stands for other starts are other samples of the same surface: noise of
    // 1e-3 moves every path, and each answer must look the same or carry the warning that only one start found it.
    let clean = fit(|i, o| Some(satin(i, o))).expect("a fit");
    let mut flagged = 0;
    for seed in 0..20 {
        let base =
            fit(move |i, o| Some(satin(i, o).map(|v| v * (0.999 + 0.002 * noise(seed, i, o)))))
                .expect("a fit");
        if base.warnings.iter().any(|w| w.contains("only one of")) {
            flagged += 1;
            continue;
        }
        assert_alike(&base, &clean, 0.03, &format!("start {seed}"));
    }
    assert!(
        flagged < 20,
        "no answer was ever confirmed by a second start"
    );
}

#[test]
fn an_index_that_no_coat_has_is_refused_with_its_value() {
    for ior in [0.0, 0.999, 4.001, f64::INFINITY] {
        for choice in [CoatChoice::Ior(ior), CoatChoice::Inside(ior)] {
            assert_eq!(
                fit_base(&By(|_, _| Some([0.1; 3])), choice),
                Err(FitError::Ior(ior))
            );
        }
    }
    let refused = fit_base(&By(|_, _| Some([0.1; 3])), CoatChoice::Ior(f64::NAN));
    assert!(matches!(refused, Err(FitError::Ior(ior)) if ior.is_nan()));
}
