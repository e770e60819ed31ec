//! Lobes and coats found again.

use super::*;
use crate::color::LinearRgb;
use crate::fit::directions::measure;
use crate::fit::stream::Stream;
use crate::measurement::MeasuredBrdf;

struct Known(Shape);

impl MeasuredBrdf for Known {
    fn reflectance(&self, wi: Direction, wo: Direction) -> Option<LinearRgb> {
        let (base, transmission, highlight) = self.0.terms(wi, wo);
        Some([base * transmission + highlight; 3])
    }
}

fn known(coat: Option<(f64, f64)>) -> Shape {
    let lobes = [(0.05, 0.06, 0.5), (0.1, 0.2, 0.4), (0.08, 0.5, 0.3)];
    Shape {
        diffuse: 0.1,
        lobes,
        coat,
        cost: 0.0,
        agreeing: 0,
        starts: 0,
    }
}

fn worst(a: &Shape, b: &Shape, samples: &[Sample]) -> f64 {
    let value = |s: &Shape, at: &Sample| {
        let (base, transmission, highlight) = s.terms(at.wi, at.wo);
        base * transmission + highlight
    };
    samples
        .iter()
        .map(|s| (value(a, s) / value(b, s) - 1.0).abs())
        .fold(0.0, f64::max)
}

#[test]
fn a_model_without_noise_is_found_again() {
    for coat in [None, Some((1.5, 0.03))] {
        let truth = known(coat);
        let samples = measure(&Known(truth.clone()), 4000, 70.0, 3);
        let search = coat.map_or(CoatSearch::Bare, |c| CoatSearch::Index(c.0));
        let found = fit_shape(&samples, search, 1.0, None, &|_| ()).expect("a fit");
        // Weights and Fresnel values trade against each other under a coat; what they reflect does not.
        let worst = worst(&found, &truth, &samples);
        assert!(worst < 0.02, "{coat:?}: {worst}, {found:?}");
    }
}

#[test]
fn twenty_sets_of_other_starts_find_the_same_or_say_that_they_are_alone() {
    for coat in [None, Some((1.5, 0.03))] {
        let truth = known(coat);
        let samples = measure(&Known(truth.clone()), 4000, 70.0, 3);
        let search = coat.map_or(CoatSearch::Bare, |c| CoatSearch::Index(c.0));
        // As the fit of a base goes: what looks for a coat also begins at the shape without one.
        let bare = coat.map(|_| {
            fit_shape(&samples, CoatSearch::Bare, 1.0, None, &|_| ()).expect("a bare fit")
        });
        let (mut alone, mut other) = (0, Vec::new());
        for seed in 0..20 {
            let mut random = Stream::new(seed);
            // Every width, weight and Fresnel value of every start, by up to a factor of two either way.
            let elsewhere = |targets: &[Target], epsilon: f64| {
                let mut from = starts(search, targets, epsilon);
                from.extend(bare.iter().flat_map(|bare| starts_from(bare, search)));
                for value in from.iter_mut().flatten() {
                    *value += random.within(-std::f64::consts::LN_2, std::f64::consts::LN_2);
                }
                from
            };
            let found = fit_shape_from(elsewhere, &samples, search, 1.0, &|_| ()).expect("a fit");
            let worst = worst(&found, &truth, &samples);
            if found.agreeing < 2 {
                alone += 1;
            } else if worst >= 0.02 {
                other.push((seed, worst, found.agreeing, found.cost));
            }
        }
        assert!(other.is_empty(), "{coat:?}: {alone} alone, {other:?}");
        assert!(alone <= 10, "{coat:?}: {alone} of 20 stood alone");
    }
}

#[test]
fn derivatives_are_those_of_the_luminance() {
    let g = geometry(
        [0.3, 0.1, 0.9_f64.sqrt()],
        [-0.1, 0.3, 0.9_f64.sqrt()],
        Some(1.4),
    );
    let p: Vec<f64> = vec![
        -2.0, -1.0, -1.5, -0.7, -2.0, -0.9, -1.0, -3.0, -0.5, -0.2, -1.0,
    ];
    let mut row = [0.0; MOST];
    g.luminance(&p, Some(&mut row));
    for k in 0..p.len() {
        let moved = |d: f64| {
            let mut q = p.clone();
            q[k] += d;
            g.luminance(&q, None)
        };
        // Central difference of 1e-5: error 1e-10 relative to the third derivative.
        let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
        assert!(
            (slope - row[k]).abs() < 1e-7 * row[k].abs().max(1e-3),
            "{k}: {slope} {}",
            row[k]
        );
    }
}

#[test]
fn the_model_of_the_descent_is_the_paint_s() {
    for coat in [None, Some((1.4, 0.3))] {
        let shape = known(coat);
        let mut p = vec![shape.diffuse.ln()];
        for (s, alpha, f0) in shape.lobes {
            p.extend([s.ln(), alpha.ln(), f0.ln()]);
        }
        p.extend(coat.map(|c| f64::ln(c.1)));
        for (wi, wo) in [
            ([0.3, 0.1, 0.9_f64.sqrt()], [-0.1, 0.3, 0.9_f64.sqrt()]),
            ([0.6, 0.0, 0.8], [-0.6, 0.0, 0.8]),
        ] {
            let (base, transmission, highlight) = shape.terms(wi, wo);
            let told = base * transmission + highlight;
            let model = geometry(wi, wo, coat.map(|c| c.0)).luminance(&p, None);
            // A dozen roundings, those of the exponents as large as the exponents themselves.
            assert!(
                (model / told - 1.0).abs() < 1e-12,
                "{coat:?}: {model} {told}"
            );
        }
    }
}
