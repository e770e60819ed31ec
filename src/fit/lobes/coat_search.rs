//! Where descents start and what bounds them, for each coat that is looked for.

use std::f64::consts::PI;

use super::{LOBES, Shape, Target};

/// Which coat a fit looks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::fit) enum CoatSearch {
    /// None: light meets the base.
    Bare,
    /// Of this index, roughness to be found.
    Index(f64),
    /// Index and roughness to be found.
    Free,
}

pub(super) fn bounds(search: CoatSearch, unit: f64) -> Vec<(f64, f64)> {
    let least_f0: f64 = if search == CoatSearch::Bare {
        0.05
    } else {
        0.1
    };
    let lift = unit.ln();
    let mut out = vec![(-14.0 + lift, 2.0 + lift)];
    for _ in 0..LOBES {
        out.extend([
            (-16.0 + lift, 4.0_f64.ln() + lift),
            (0.004_f64.ln(), 0.0),
            (least_f0.ln(), 0.0),
        ]);
    }
    if search != CoatSearch::Bare {
        out.push((0.002_f64.ln(), 0.8_f64.ln()));
    }
    if search == CoatSearch::Free {
        out.push((1.2, 1.8));
    }
    out
}

/// Roughnesses of lobes that a descent starts from.
pub(super) const ROUGHNESSES: [[f64; LOBES]; 6] = [
    [0.04, 0.12, 0.40],
    [0.015, 0.06, 0.25],
    [0.08, 0.20, 0.60],
    [0.03, 0.25, 0.80],
    [0.10, 0.15, 0.35],
    [0.006, 0.10, 0.45],
];

/// Roughness and index of coats that a descent starts from, beside [`ROUGHNESSES`].
pub(super) const COATS: [(f64, f64); 6] = [
    (0.03, 1.5),
    (0.08, 1.4),
    (0.3, 1.3),
    (0.01, 1.5),
    (0.5, 1.25),
    (0.15, 1.5),
];

/// Parameters in the order of the luminance model.
pub(super) fn parameters(shape: &Shape, search: CoatSearch) -> Vec<f64> {
    let mut p = vec![shape.diffuse.ln()];
    for (s, alpha, f0) in shape.lobes {
        p.extend([s.ln(), alpha.ln(), f0.ln()]);
    }
    let (ior, roughness) = shape.coat.unwrap_or((1.5, 0.03));
    if search != CoatSearch::Bare {
        p.push(roughness.ln());
    }
    if search == CoatSearch::Free {
        p.push(ior);
    }
    p
}

/// The bare shape put under coats: its narrowest lobe turned into the coat's highlight, or all of them kept.
pub(super) fn starts_from(bare: &Shape, search: CoatSearch) -> Vec<Vec<f64>> {
    // Inside a coat of index 1.5 half angles shrink by a third, and D grows by the square of that.
    let under = |l: (f64, f64, f64)| (l.0 / 2.0, l.1 / 1.5, l.2);
    let [a, b, c] = bare.lobes;
    let halved = |l: (f64, f64, f64)| (l.0 / 4.0, l.1 / 2.0, l.2);
    let turned = [under(halved(b)), under(b), under(c)];
    let kept = [under(a), under(b), under(c)];
    [(turned, a.1), (kept, 0.03), (kept, 0.3)]
        .into_iter()
        .map(|(lobes, roughness)| {
            parameters(
                &Shape {
                    lobes,
                    coat: Some((1.45, roughness)),
                    ..bare.clone()
                },
                search,
            )
        })
        .collect()
}

pub(super) fn starts(search: CoatSearch, samples: &[Target], epsilon: f64) -> Vec<Vec<f64>> {
    let mut logs: Vec<f64> = samples.iter().map(|s| s.log).collect();
    logs.sort_by(f64::total_cmp);
    let at =
        |share: usize| (logs[(logs.len() - 1) * share / 100].exp() - epsilon).max(epsilon / 10.0);
    let (dark, bright) = (at(20), at(95));
    ROUGHNESSES
        .iter()
        .zip(COATS)
        .map(|(alphas, (roughness, ior))| {
            let mut p = vec![(dark * PI).ln()];
            for alpha in alphas {
                let f0: f64 = 0.3;
                p.extend([
                    (bright * PI * alpha * alpha / (3.0 * f0)).ln(),
                    alpha.ln(),
                    f0.ln(),
                ]);
            }
            if search != CoatSearch::Bare {
                p.push(f64::ln(roughness));
            }
            if search == CoatSearch::Free {
                p.push(ior);
            }
            p
        })
        .collect()
}
