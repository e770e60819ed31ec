//! Fits of measurements that are hardly any.

use crate::paints::{Stream, at};
use carpaint::color::{LinearRgb, luminance};
use carpaint::fit::{CoatChoice, FitError, FittedBase, fit_base};
use carpaint::measurement::{HalfAngleTable, MeasuredBrdf, TableError, ThetaHSpacing};
use carpaint::paint::{CarPaint, Chi, Direction, Limits, Lobe, Reflectance, half_angles};
use std::collections::HashSet;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex};

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

/// Direction pairs as a fit is judged by: within 70° of the normal, three quarters of them independent, one quarter with a
/// half vector within 5°.
fn judged() -> Vec<(Direction, Direction)> {
    let mut random = Stream(99);
    let mut cone = |degrees: f64| {
        let z = 1.0 - random.unit() * (1.0 - degrees.to_radians().cos());
        at(z, TAU * random.unit())
    };
    let least = 70.0_f64.to_radians().cos();
    (0..16_000)
        .filter_map(|k| {
            let wi = cone(70.0);
            let wo = if k % 4 == 0 {
                let h = cone(5.0);
                let along: f64 = (0..3).map(|k| 2.0 * wi[k] * h[k]).sum();
                [0, 1, 2].map(|k| along * h[k] - wi[k])
            } else {
                cone(70.0)
            };
            (wo[2] > least).then_some((wi, wo))
        })
        .collect()
}

/// A fit errs against the surface itself, which it has only seen samples of, by no more than it says: of other directions,
/// drawn like those it was judged by, one in ten is beyond its 90th percentile, away from the mirror and near it.
///
/// Both are estimates of one share from finitely many directions, 9,600 of the fit's own and these: five standard errors of
/// their difference. Errors are relative to the surface, or to what counts as dark where that is more: a thousandth of the
/// data's unit, which is 1 unless nine tenths of all samples are below 1e-2 or above 1e3.
fn assert_as_near_as_it_says(
    base: &FittedBase,
    surface: impl Fn(Direction, Direction) -> LinearRgb,
    what: &str,
) {
    let paint = paint(base);
    let reflectance = Reflectance::new(&paint);
    let judged = judged();
    let truth: Vec<f64> = judged
        .iter()
        .map(|(i, o)| luminance(surface(*i, *o)))
        .collect();
    let mut sorted = truth.clone();
    sorted.sort_by(f64::total_cmp);
    let typical = sorted[sorted.len() * 9 / 10];
    let dark = 1e-3 * typical / typical.clamp(1e-2, 1e3);
    let (mut counted, mut beyond) = ([0.0_f64; 2], [0.0_f64; 2]);
    let says = [base.residuals.all.p90, base.residuals.near_mirror.p90];
    for ((wi, wo), truth) in judged.iter().zip(truth) {
        let found = luminance(reflectance.evaluate(*wi, *wo, Chi::Table));
        let near = usize::from(half_angles(*wi, *wo).theta_h < 5.0_f64.to_radians());
        counted[near] += 1.0;
        // The percentile of errors that are all rounding is one of rounding.
        if (found - truth).abs() / truth.max(dark) > says[near] + 16.0 * f64::EPSILON {
            beyond[near] += 1.0;
        }
    }
    for near in 0..2 {
        // A fifth of 48,000 judge the fit; as many of them are near as here.
        let own = 9600.0 * counted[near] / (counted[0] + counted[1]);
        let error = (0.09 * (1.0 / counted[near] + 1.0 / own)).sqrt();
        let share = beyond[near] / counted[near];
        assert!(
            share <= 0.1 + 5.0 * error,
            "{what}, {}: {share} beyond {:e}",
            ["away", "near"][near],
            says[near]
        );
    }
}

/// Whether the fit says of itself that other lobes may explain the data as well, or that it misses its aim.
fn flagged(base: &FittedBase) -> bool {
    let tells = |w: &String| w.contains("only one of") || w.contains("the fit errs by");
    base.warnings.iter().any(tells)
}

static CLEAN: LazyLock<FittedBase> =
    LazyLock::new(|| fit(|i, o| Some(satin(i, o))).expect("a fit"));

#[test]
fn a_fit_errs_by_what_it_says_and_as_little_as_a_free_function() {
    assert_as_near_as_it_says(&CLEAN, satin, "satin");
    assert!(!flagged(&CLEAN), "{:?}", CLEAN.warnings);
    // The floor is what the nearest neighbours in (θh, θd) reach: the model has this surface in it and is far nearer.
    let all = &CLEAN.residuals.all;
    assert!(all.p90 < all.floor_p90 / 10.0, "{all:?}");
}

#[test]
fn flat_data_are_a_diffuse_paint_of_their_color_or_flagged() {
    for size in [1e-6, 0.1, 1.0, 3.0, 10.0, 100.0, 1000.0] {
        let color = [size, 2.0 * size, 3.0 * size];
        let base = fit(|_, _| Some(color)).expect("a fit");
        assert!(base.coat.is_none());
        assert_as_near_as_it_says(&base, |_, _| color, &format!("flat {size}"));
        if !flagged(&base) {
            // Nothing but a diffuse albedo and one color: a descent in logarithms ends where its step is a rounding of them.
            for y in looks(&base) {
                assert!((y / luminance(color) - 1.0).abs() < 1e-12, "{size}: {y}");
            }
        }
        // A reflectance is at most 1/π, and a fit of brighter data may be bounded, but not of such.
        assert!(size > 1.0 || !flagged(&base), "{size}: {:?}", base.warnings);
    }
}

#[test]
fn a_pure_mirror_is_a_paint_that_shines_towards_the_mirror_and_nowhere_else() {
    let mirror = |i: Direction, o: Direction| {
        let bright = half_angles(i, o).theta_h < 0.01;
        [if bright { 3000.0 } else { 0.0 }; 3]
    };
    let base = fit(|i, o| Some(mirror(i, o))).expect("a fit");
    let [peak, _, _, flop] = looks(&base);
    // Black is told from 1e-3 1/sr only (the fit's logarithm has that floor), a hundred times it is not black.
    assert!(flop < 0.1, "{flop}");
    // A bell stands in for a step: as high but for a factor of two.
    assert!((1500.0..6000.0).contains(&peak), "{peak}");
    assert_as_near_as_it_says(&base, mirror, "a mirror");
    // Nine directions of ten are black in both, so that the percentiles say nothing of the rim, where the bell is not the
    // step; the root mean square does. Relative to what counts as dark, like it.
    let paint = paint(&base);
    let reflectance = Reflectance::new(&paint);
    let squares: Vec<f64> = judged()
        .into_iter()
        .map(|(i, o)| {
            let truth = luminance(mirror(i, o));
            let found = luminance(reflectance.evaluate(i, o, Chi::Table));
            ((found - truth) / truth.max(1e-3)).powi(2)
        })
        .collect();
    let mean = |list: &[f64]| list.iter().sum::<f64>() / list.len() as f64;
    let found = mean(&squares);
    let scatter = squares
        .iter()
        .map(|e| (e - found).powi(2))
        .collect::<Vec<_>>();
    // Five standard errors of the two estimates' difference.
    let error = (mean(&scatter) * (1.0 / squares.len() as f64 + 1.0 / 9600.0)).sqrt();
    let says = base.residuals.relative_rmse.powi(2);
    assert!(
        says > 0.0 && (found - says).abs() <= 5.0 * error,
        "{found:e} ± {error:e}, and it says {says:e}"
    );
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
fn two_hundred_samples_are_enough_and_one_less_is_refused() {
    let asked = asked_for_the_shape();
    for valid in [199_usize, 200] {
        // Every fortieth of them, so that they are as mixed as all.
        let chosen: HashSet<[u64; 6]> = asked.iter().step_by(40).take(valid).map(bits).collect();
        let hidden: HashSet<[u64; 6]> = asked.iter().map(bits).collect();
        let found = fit(|i, o| {
            let pair = bits(&(i, o));
            (chosen.contains(&pair) || !hidden.contains(&pair)).then(|| satin(i, o))
        });
        if valid < 200 {
            let refused = FitError::TooFewSamples {
                found: 199,
                asked: 8000,
                needed: 200,
            };
            assert_eq!(found, Err(refused));
        } else {
            // What it is told by 200 samples it says of itself against all others.
            let base = found.expect("200 are enough");
            assert_as_near_as_it_says(&base, satin, "200 samples");
        }
    }
}

#[test]
fn three_and_fifty_per_cent_invalid_entries_change_next_to_nothing() {
    for share in [0.03, 0.5] {
        let holes = fit(move |i, o| (noise(2, i, o) > share).then(|| satin(i, o))).expect("a fit");
        // Valid values are exact, so that what is left errs by what it says, which is no more than a free function would
        // (no warning); were invalid entries taken for black or filled from their neighbours, it would not.
        assert_as_near_as_it_says(&holes, satin, &format!("{share} invalid"));
        assert!(!flagged(&holes), "{:?}", holes.warnings);
        let all = &holes.residuals.all;
        assert!(all.p90 < all.floor_p90 / 10.0, "{all:?}");
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

/// The directions that the shape is fitted at: 8,000, asked for before anything else, by several threads in any order.
fn asked_for_the_shape() -> Vec<(Direction, Direction)> {
    let asked = Mutex::new(Vec::new());
    let clean = fit(|i, o| {
        asked.lock().expect("nobody panicked").push((i, o));
        Some(satin(i, o))
    });
    assert_eq!(clean.expect("a fit"), *CLEAN);
    let mut asked = asked.into_inner().expect("nobody panicked");
    asked.truncate(8000);
    asked.sort_by_key(bits);
    asked
}

fn bits((i, o): &(Direction, Direction)) -> [u64; 6] {
    [i[0], i[1], i[2], o[0], o[1], o[2]].map(f64::to_bits)
}

#[test]
fn one_outlier_a_hundred_times_too_bright_changes_next_to_nothing() {
    // Near the mirror, halfway, far from it.
    let mut asked = asked_for_the_shape();
    let theta_h = |pair: &(Direction, Direction)| half_angles(pair.0, pair.1).theta_h;
    asked.sort_by(|x, y| theta_h(x).total_cmp(&theta_h(y)));
    for place in [10, 1900, 4000, 7990] {
        let outlier = asked[place];
        let hits = AtomicUsize::new(0);
        let spoiled = fit(|i, o| {
            let hit = (i, o) == outlier;
            hits.fetch_add(usize::from(hit), Ordering::Relaxed);
            Some(satin(i, o).map(|v| if hit { 100.0 * v } else { v }))
        });
        let spoiled = spoiled.expect("a fit");
        assert_eq!(hits.into_inner(), 1, "the outlier is one of the samples");
        assert_ne!(spoiled, *CLEAN, "the outlier was not used");
        assert_as_near_as_it_says(&spoiled, satin, &format!("outlier {place}"));
        // A robust error pulls by 0.05 at the most, whatever the outlier, and a sample's share in what 11 parameters say
        // elsewhere is 11 in 8,000 on average: a logarithm's move of 7e-5.
        let moved = 0.05 * 11.0 / 8000.0;
        for (now, before) in [
            (spoiled.residuals.all, CLEAN.residuals.all),
            (spoiled.residuals.near_mirror, CLEAN.residuals.near_mirror),
        ] {
            assert!(now.p90 <= before.p90 + moved, "{place}: {now:?} {before:?}");
        }
    }
}

#[test]
fn brightness_times_anything_is_the_same_surface_or_flagged_or_refused() {
    let mut unflagged = Vec::new();
    for scale in [1e-6, 1e-4, 1e-2, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6] {
        let scaled = |i: Direction, o: Direction| satin(i, o).map(|v| v * scale);
        match fit(|i, o| Some(scaled(i, o))) {
            Ok(base) => {
                // Flagged or not, it errs by what it says.
                assert_as_near_as_it_says(&base, scaled, &format!("times {scale:e}"));
                let all = &base.residuals.all;
                // The floor is a property of the data and of nothing else: dim data have the same but for what is dark.
                assert!(
                    all.floor_p90 < 1.1 * CLEAN.residuals.all.floor_p90,
                    "{all:?}"
                );
                let missed = all.p90 > 1.3 * all.floor_p90 + 1e-3;
                assert!(!missed || flagged(&base), "{scale:e}: {all:?}");
                assert!(scale < 1e5, "{scale:e} is no reflectance");
                if !flagged(&base) {
                    unflagged.push(scale);
                    assert_scaled(&base, scale);
                }
            }
            // Beyond the largest weight that a paint may have: π times 0.03 a diffuse, with the table's own factor.
            Err(FitError::NotAReflectance { value, .. }) => {
                assert!(value > 1e3 && scale > 1e4, "{scale:e}: {value}");
            }
            Err(other) => panic!("{scale:e}: {other}"),
        }
    }
    // Bright data have no such lobes within the bounds of a weight; of dim ones only one start finds them.
    assert_eq!(unflagged, [1e-2]);
}

/// The clean fit's parameters, weights times the scale. Two lobes of nearly one width share their weight in any way: what the
/// data tell is its sum, and the means of ln α and F0 over it. Both fits err by less than a part in a thousand.
fn assert_scaled(base: &FittedBase, scale: f64) {
    let told = |base: &FittedBase, scale: f64| {
        let sum: f64 = base.lobes.iter().map(|l| l.weight[1]).sum();
        let mean = |get: fn(&Lobe) -> f64| {
            base.lobes.iter().map(|l| l.weight[1] * get(l)).sum::<f64>() / sum
        };
        let alpha = mean(|l| l.alpha.ln()).exp();
        [base.diffuse[1] / scale, sum / scale, alpha, mean(|l| l.f0)]
    };
    let (found, clean) = (told(base, scale), told(&CLEAN, 1.0));
    for fit in [base, &*CLEAN] {
        assert!(fit.residuals.all.p90 < 1e-3, "{:?}", fit.residuals.all);
    }
    for (x, y) in found.iter().zip(clean) {
        assert!(
            (x / y - 1.0).abs() <= 1e-3,
            "{scale:e}: {found:?} for {clean:?}"
        );
    }
}

#[test]
fn twenty_starts_of_other_noise_end_in_one_paint_or_say_that_they_do_not() {
    // The descent's own starts are fixed, and other ones are given to it in its own tests; what stands for other starts here
    // are other samples of the same surface: noise of 1e-3 moves every path. Errors against the surface are below those
    // against its noisy samples, which the fit says.
    let mut alone = 0;
    let mut seen = Vec::new();
    for seed in 0..20 {
        let base =
            fit(move |i, o| Some(satin(i, o).map(|v| v * (0.999 + 0.002 * noise(seed, i, o)))))
                .expect("a fit");
        assert_as_near_as_it_says(&base, satin, &format!("start {seed}"));
        // The noise is uniform of ±1e-3: its 90th percentile is 9e-4, and the clean fit's own comes to it.
        let most = 9e-4 + CLEAN.residuals.all.p90;
        assert!(
            base.residuals.all.p90 <= most,
            "{seed}: {:?}",
            base.residuals.all
        );
        if flagged(&base) {
            alone += 1;
        } else {
            seen.push((seed, looks(&base)));
        }
    }
    // Any two of the others look alike, from the mirror direction to far off: to less than the noise of one sample, which
    // eight thousand average away.
    for (k, (seed, x)) in seen.iter().enumerate() {
        for (other, y) in &seen[..k] {
            for (x, y) in x.iter().zip(y) {
                assert!((x / y - 1.0).abs() <= 1e-3, "{seed} {other}: {x} {y}");
            }
        }
    }
    println!("{alone} of 20 say that only one start found them");
    // A few may: a quarter would say that the starts hardly ever meet.
    assert!(alone <= 5, "{alone} of 20 are found by one start alone");
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
