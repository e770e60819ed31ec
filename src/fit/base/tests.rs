//! Tests of `base`.

use super::*;
use crate::paint::half_angles;

struct From<F: Fn(Direction, Direction) -> Option<LinearRgb> + Sync>(F);

impl<F: Fn(Direction, Direction) -> Option<LinearRgb> + Sync> MeasuredBrdf for From<F> {
    fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
        (self.0)(wi, wo)
    }
}

/// A number in 0..1 that depends on both directions and nothing else.
fn noise(wi: Direction, wo: Direction) -> f64 {
    let bits = wi.iter().chain(&wo).fold(0_u64, |h, v| {
        (h ^ v.to_bits())
            .wrapping_mul(0x9E37_79B9_7F4A_7C15)
            .rotate_left(29)
    });
    f64::from(u32::try_from(bits >> 40).expect("24 bits")) / f64::from(1_u32 << 24)
}

fn satin(wi: Direction, wo: Direction) -> LinearRgb {
    let h = half_angles(wi, wo);
    let peak = 2.0 * (-h.tan2_h / 0.04).exp() / (wi[2] * wo[2]).max(0.1);
    [0.05 + peak, 0.03 + 0.8 * peak, 0.02 + 0.5 * peak]
}

fn peak_and_flop(base: &FittedBase) -> [f64; 2] {
    let paint = CarPaint {
        coat: base.coat,
        diffuse: base.diffuse,
        lobes: base.lobes.clone(),
        color_table: base.color_table.clone(),
        flakes: None,
    };
    let r = Reflectance::new(&paint);
    let at = |deg: f64| {
        let a = deg.to_radians();
        crate::color::luminance(r.evaluate(
            [-0.5, 0.0, 0.75_f64.sqrt()],
            [a.sin(), 0.0, a.cos()],
            Chi::Table,
        ))
    };
    [at(30.0), at(-20.0)]
}

#[test]
fn flat_data_give_a_diffuse_paint() {
    let base =
        fit_base(&From(|_, _| Some([0.1, 0.2, 0.3])), CoatChoice::ByResidual).expect("a fit");
    assert!(base.coat.is_none(), "{base:?}");
    assert!(base.residuals.all.p90 < 5e-3, "{:?}", base.residuals);
    assert!(
        base.residuals.instrument.iter().all(|i| i.fit < 0.1),
        "{:?}",
        base.residuals
    );
}

#[test]
fn invalid_entries_and_an_outlier_hardly_matter() {
    let clean = fit_base(&From(|i, o| Some(satin(i, o))), CoatChoice::Ior(1.0)).expect("a fit");
    for share in [0.03, 0.5] {
        let holes = From(move |i, o| (noise(i, o) > share).then(|| satin(i, o)));
        let base = fit_base(&holes, CoatChoice::Ior(1.0)).expect("a fit");
        for (a, b) in peak_and_flop(&base).iter().zip(peak_and_flop(&clean)) {
            assert!((a / b - 1.0).abs() < 0.05, "{share}: {a} {b}");
        }
    }
    let spoiled = From(|i, o| {
        let factor = if noise(i, o) < 0.01 { 100.0 } else { 1.0 };
        Some(satin(i, o).map(|v| v * factor))
    });
    let base = fit_base(&spoiled, CoatChoice::Ior(1.0)).expect("a fit");
    for (a, b) in peak_and_flop(&base).iter().zip(peak_and_flop(&clean)) {
        assert!((a / b - 1.0).abs() < 0.05, "outliers: {a} {b}");
    }
}

#[test]
fn a_million_times_darker_is_the_same_fit_and_brighter_is_no_reflectance() {
    let clean = fit_base(&From(|i, o| Some(satin(i, o))), CoatChoice::Ior(1.0)).expect("a fit");
    let dim = fit_base(
        &From(|i, o| Some(satin(i, o).map(|v| v * 1e-6))),
        CoatChoice::Ior(1.0),
    )
    .expect("a fit");
    for (a, b) in peak_and_flop(&dim).iter().zip(peak_and_flop(&clean)) {
        assert!((1e6 * a / b - 1.0).abs() < 0.05, "{a} {b}");
    }
    let bright = fit_base(
        &From(|i, o| Some(satin(i, o).map(|v| v * 1e6))),
        CoatChoice::Ior(1.0),
    );
    assert!(
        matches!(bright, Err(FitError::NotAReflectance { .. })),
        "{bright:?}"
    );
}

#[test]
fn nothing_to_fit_is_refused_by_name() {
    assert!(matches!(
        fit_base(&From(|_, _| None), CoatChoice::ByResidual),
        Err(FitError::TooFewSamples { found: 0, .. })
    ));
    assert_eq!(
        fit_base(&From(|_, _| Some([0.0; 3])), CoatChoice::ByResidual),
        Err(FitError::Dark)
    );
    assert_eq!(
        fit_base(&From(|_, _| Some([0.1; 3])), CoatChoice::Ior(0.5)),
        Err(FitError::Ior(0.5))
    );
    let few = From(|i: Direction, o| (noise(i, o) < 1e-3).then_some([0.1; 3]));
    assert!(matches!(
        fit_base(&few, CoatChoice::ByResidual),
        Err(FitError::TooFewSamples { needed: 200, .. })
    ));
}

#[test]
fn a_mirror_ends_in_a_finite_answer() {
    let mirror = From(|i, o| {
        let h = half_angles(i, o);
        Some(if h.theta_h < 0.01 {
            [3000.0; 3]
        } else {
            [0.0; 3]
        })
    });
    let base = fit_base(&mirror, CoatChoice::ByResidual).expect("a fit");
    let [peak, flop] = peak_and_flop(&base);
    assert!(
        peak.is_finite() && flop.is_finite() && flop < 0.1,
        "{peak} {flop}"
    );
}

#[test]
fn a_clear_coat_over_a_metallic_base_is_made_explicit() {
    let lobe = |s: f64, alpha, f0| Lobe {
        weight: [s, 0.8 * s, 0.5 * s],
        alpha,
        f0,
    };
    let truth = CarPaint {
        coat: Some(Coat {
            ior: 1.5,
            roughness: 0.03,
            thickness_um: None,
        }),
        diffuse: [0.05, 0.04, 0.02],
        lobes: vec![
            lobe(0.02, 0.12, 0.6),
            lobe(0.04, 0.25, 0.5),
            lobe(0.03, 0.5, 0.4),
        ],
        color_table: ColorTable::white(),
        flakes: None,
    };
    let reflectance = Reflectance::new(&truth);
    let measured = From(|i, o| {
        Some(
            reflectance
                .evaluate(i, o, Chi::Table)
                .map(|v| v * (0.95 + 0.1 * noise(i, o))),
        )
    });
    let base = fit_base(&measured, CoatChoice::ByResidual).expect("a fit");
    let coat = base.coat.expect("a coat");
    assert!(
        (coat.ior - 1.5).abs() < 0.05 && (coat.roughness / 0.03 - 1.0).abs() < 0.05,
        "{coat:?}"
    );
    assert!(
        base.residuals
            .instrument
            .iter()
            .all(|i| i.fit < i.floor + 1.0),
        "{:?}",
        base.residuals
    );
    let forced = fit_base(&measured, CoatChoice::Ior(1.4)).expect("a fit");
    assert_eq!(forced.coat.expect("a coat").ior, 1.4);
    assert_eq!(
        fit_base(&measured, CoatChoice::Ior(1.0))
            .expect("a fit")
            .coat,
        None
    );
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let fit = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            fit_base(
                &From(|i, o| Some(satin(i, o).map(|v| v * (0.8 + 0.4 * noise(i, o))))),
                CoatChoice::ByResidual,
            )
        })
    };
    assert_eq!(fit(1).expect("a fit"), fit(3).expect("a fit"));
}
