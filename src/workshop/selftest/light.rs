//! Checks of what a paint does with light: reflectance, color, and the flakes that texels draw.

use super::{Check, Subject, worse};
use crate::color::Lab;
use crate::fit::Stream;
use crate::paint::{Chi, Direction, FlakeSampler, HalfAngles, half_angles};

/// Direction pairs from straight above to the last height a number can have, mirrored and opposite ones among them.
fn pairs() -> Vec<(Direction, Direction)> {
    let at = |z: f64, turn: f64| {
        let r = ((1.0 - z) * (1.0 + z)).sqrt();
        [r * turn.cos(), r * turn.sin(), z]
    };
    let heights = [1.0, 0.7, 0.3, 1e-3, 1e-8, 1e-160, 1e-300];
    let turns = [0.0, 1e-9, 1.0, std::f64::consts::PI];
    let hard: Vec<Direction> = heights
        .iter()
        .flat_map(|&z| turns.iter().map(move |&turn| at(z, turn)))
        .collect();
    let mut random = Stream::new(1);
    let mut any = || {
        at(
            random.within(0.01, 1.0),
            random.within(0.0, std::f64::consts::TAU),
        )
    };
    let easy: Vec<(Direction, Direction)> = (0..2000).map(|_| (any(), any())).collect();
    let crossed = hard
        .iter()
        .flat_map(|&wi| hard.iter().map(move |&wo| (wi, wo)));
    crossed.chain(easy).collect()
}

/// Finite, not negative, and the same from both ends.
pub(super) fn reflectance(subject: &Subject<'_>) -> Vec<Check> {
    let (mut wrong, mut worst) = (0, 0.0_f64);
    for (wi, wo) in pairs() {
        let f = subject.reflectance.evaluate(wi, wo, Chi::Table);
        let g = subject.reflectance.evaluate(wo, wi, Chi::Table);
        // Clamping at 0 hides a number that is none: the terms before it do not.
        let terms = subject.reflectance.terms(wi, wo, Chi::Table);
        let sound = |v: &f64| v.is_finite();
        let lost = terms.is_none_or(|t| !t.base.iter().chain(&t.flakes).all(sound));
        wrong += usize::from(lost || !f.iter().all(|v| v.is_finite() && *v >= 0.0));
        for (f, g) in f.into_iter().zip(g) {
            worst = worse(worst, (f - g).abs() / f.max(g).max(f64::MIN_POSITIVE));
        }
    }
    let HalfAngles { theta_h, .. } =
        half_angles([1e-9_f64.sin(), 0.0, 1e-9_f64.cos()], [0.0, 0.0, 1.0]);
    vec![
        Check::none("reflectance up to grazing, 1e-300", wrong, "values lost"),
        // A few roundings, times the exponent of a narrow lobe, at most 745 before it is 0.
        Check::at_most(
            "reflectance, light and view exchanged",
            worst,
            1e-6,
            "relative",
        ),
        Check::at_most(
            "half angle a billionth from the mirror",
            (theta_h / 5e-10 - 1.0).abs(),
            1e-6,
            "relative",
        ),
    ]
}

/// What the paint's certificate says against a second integration: polar angles around the mirror direction, in even steps
/// of `t`, `ψ = w sinh t`, where the certificate goes round the normal.
pub(super) fn energy(subject: &Subject<'_>) -> Vec<Check> {
    let paint = subject.paint;
    let lobes = paint.lobes.iter().filter(|lobe| !lobe.is_absent());
    let coat = paint.coat.iter().filter(|coat| !coat.is_mirror());
    let widths = lobes.map(|l| l.alpha).chain(coat.map(|c| c.roughness));
    let narrowest = widths.fold(0.5, f64::min).max(1e-3);
    let mut worst = 0.0;
    for (degrees, stated) in subject
        .energy
        .incidence_deg
        .iter()
        .zip(&subject.energy.albedo)
    {
        // Beyond it half of a lobe is below the horizon, and its edge is not followed here.
        if *degrees <= 65.0 {
            let again = albedo(subject, degrees.to_radians(), narrowest);
            worst = worse(worst, (again - stated).abs() / stated.max(1e-3));
        }
    }
    vec![Check::at_most(
        "albedo against the paint's energy certificate",
        worst,
        // Both rules meet the kinks of the paint's own tables between their nodes.
        0.01,
        "relative",
    )]
}

/// Largest channel's albedo at an incidence.
fn albedo(subject: &Subject<'_>, incidence: f64, narrowest: f64) -> f64 {
    let (sine, cosine) = incidence.sin_cos();
    let wi = [-sine, 0.0, cosine];
    let (rings, spokes) = (240_u32, 96_u32);
    let reach = (std::f64::consts::PI / narrowest).asinh();
    let mut sum = [0.0; 3];
    for ring in 0..rings {
        let t = (f64::from(ring) + 0.5) / f64::from(rings) * reach;
        let away = narrowest * t.sinh();
        let step = reach / f64::from(rings) * narrowest * t.cosh();
        for spoke in 0..spokes {
            let turn = (f64::from(spoke) + 0.5) / f64::from(spokes) * std::f64::consts::TAU;
            let (x, y, z) = (away.sin() * turn.cos(), away.sin() * turn.sin(), away.cos());
            // Around the mirror direction, (sine, 0, cosine).
            let wo = [cosine * x + sine * z, y, cosine * z - sine * x];
            if wo[2] > 0.0 {
                let f = subject.reflectance.evaluate(wi, wo, Chi::Table);
                let weight = away.sin() * step * std::f64::consts::TAU / f64::from(spokes) * wo[2];
                (0..3).for_each(|c| sum[c] += f[c] * weight);
            }
        }
    }
    sum.into_iter().fold(0.0, worse) + subject.reflectance.mirror(wi)
}

/// Lab to light and back, for every color of the paint.
pub(super) fn color(subject: &Subject<'_>) -> Vec<Check> {
    let corners = subject.paint.flakes.iter().flat_map(|f| {
        let both = f.lower.iter().chain(&f.upper);
        both.map(|corner| Lab::from(corner.map(f64::from)))
    });
    let nodes = subject.paint.color_table.nodes().iter().copied();
    let mut worst = 0.0_f64;
    for lab in nodes.chain(corners) {
        let xyz = lab.to_xyz(crate::color::D65_2);
        let back = Lab::from_xyz(xyz, crate::color::D65_2).to_array();
        let size = lab.to_array().iter().fold(100.0_f64, |m, v| m.max(v.abs()));
        for (x, y) in back.iter().zip(lab.to_array()) {
            worst = worse(worst, (x - y).abs() / (5.0 * size));
        }
    }
    // f is kept to a few roundings; a and b are differences of it, times 500 and 200.
    vec![Check::at_most(
        "Lab to light and back",
        worst,
        1e-12,
        "relative",
    )]
}

/// Probabilities of each slice sum to 1.
pub(super) fn probabilities(subject: &Subject<'_>) -> Vec<Check> {
    let Some(flakes) = &subject.paint.flakes else {
        return Vec::new();
    };
    let mut worst = 0.0_f64;
    for k in 0..flakes.slices() {
        let slice = flakes.slice_at(k);
        #[allow(clippy::cast_precision_loss)] // a count of clusters
        let count = slice.probability.len() as f64;
        let sum: f64 = slice.probability.iter().sum();
        worst = worse(worst, (sum - 1.0).abs() / count);
    }
    vec![Check::at_most(
        "probabilities of a slice sum to 1",
        worst / f64::EPSILON,
        // What a realised paint's masses, whole units of 2^-55, may add to a rounding each.
        64.0,
        "roundings a cluster",
    )]
}

/// The mean of a hundred thousand drawn texels against the closed form.
pub(super) fn texels(subject: &Subject<'_>) -> Vec<Check> {
    let Some(flakes) = &subject.paint.flakes else {
        return Vec::new();
    };
    let sampler = FlakeSampler::new(flakes);
    let [h, d] = [&flakes.theta_h, &flakes.theta_d].map(|grid| grid.degrees()[0]);
    let want = flakes.slice(0, 0).mean();
    let mut random = Stream::new(2);
    let draws = 100_000_u32;
    let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
    for _ in 0..draws {
        #[allow(clippy::cast_possible_truncation)] // a cell is 32 bits
        let drawn = sampler.color(random.bits() as u32, h as f32, d as f32);
        for c in 0..3 {
            let value = f64::from(drawn[c]);
            sum[c] += value;
            squares[c] += value * value;
        }
    }
    let count = f64::from(draws);
    let off = (0..3).map(|c| {
        let mean = sum[c] / count;
        let error = ((squares[c] / count - mean * mean).max(0.0) / count).sqrt();
        // Colors are drawn in f32.
        (mean - want[c]).abs() / (error + 1e-6 * want[c].abs() + 1e-12)
    });
    vec![Check::at_most(
        "mean of 100000 texels against the closed form",
        off.fold(0.0, worse),
        6.0,
        "standard errors",
    )]
}
