//! Point clouds that break transport solvers: slices as a paint's precompute has them, and nastier ones.

use carpaint::transport::Problem;
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

#[derive(Clone, Debug, Default)]
pub struct Clouds {
    pub kind: &'static str,
    pub source: Vec<[f64; 3]>,
    pub source_masses: Vec<f64>,
    pub target: Vec<[f64; 3]>,
    pub target_masses: Vec<f64>,
}

impl Clouds {
    pub fn problem(&self) -> Problem {
        Problem::new(
            &self.source,
            &self.source_masses,
            &self.target,
            &self.target_masses,
        )
        .unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    /// The same clouds with fewer points that still fail: halves are left out, then single points, as long as it does. What
    /// is left on a side takes over the masses of what is not.
    pub fn shrunk(&self, fails: impl Fn(&Self) -> bool) -> Self {
        let mut least = self.clone();
        let mut part = least.source.len().max(least.target.len());
        while part > 0 {
            let smaller = (0..2).find_map(|side| {
                let count = [least.source.len(), least.target.len()][side];
                (0..count)
                    .step_by(part)
                    .filter(|_| count > part)
                    .map(|from| least.without(side, from..(from + part).min(count)))
                    .find(&fails)
            });
            match smaller {
                Some(smaller) => least = smaller,
                None => part /= 2,
            }
        }
        least
    }

    fn without(&self, side: usize, gone: std::ops::Range<usize>) -> Self {
        let mut rest = self.clone();
        let (points, masses) = if side == 0 {
            (&mut rest.source, &mut rest.source_masses)
        } else {
            (&mut rest.target, &mut rest.target_masses)
        };
        let before: f64 = masses.iter().sum();
        points.drain(gone.clone());
        masses.drain(gone);
        let share = before / masses.iter().sum::<f64>();
        masses.iter_mut().for_each(|mass| *mass *= share);
        rest
    }
}

fn normal(rng: &mut StdRng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

fn power_of_ten(rng: &mut StdRng, from: f64, to: f64) -> f64 {
    10.0_f64.powf(rng.random_range(from..to))
}

/// A paint whose clusters drift over a grid of angles: centers and masses of 50 clusters at any place of the grid.
struct Paint {
    clusters: Vec<Cluster>,
}

struct Cluster {
    lightness: f64,
    a: f64,
    b: f64,
    mass: f64,
    swing: f64,
    phase: [f64; 2],
}

impl Paint {
    fn new(rng: &mut StdRng) -> Self {
        let steep = rng.random_range(1.4..2.6);
        let (hue, chroma) = (rng.random_range(0.0..6.3_f64), rng.random_range(0.0..35.0));
        let spread = rng.random_range(6.0..22.0);
        let cluster = |rank: i32| {
            let sparkle = rng.random_bool(0.1);
            Cluster {
                lightness: if sparkle {
                    100.0 - 30.0 * (1.0 - rng.random::<f64>()).ln()
                } else {
                    (3.3 + 0.6 * normal(rng)).exp().clamp(5.0, 100.0)
                },
                a: hue.cos() * chroma + spread * normal(rng),
                b: hue.sin() * chroma + spread * normal(rng),
                mass: f64::from(rank).powf(-steep) * (0.6 * normal(rng)).exp(),
                swing: rng.random_range(0.02..0.22),
                phase: [rng.random_range(0.0..6.3), rng.random_range(0.0..6.3)],
            }
        };
        Self {
            clusters: (1..=50).map(cluster).collect(),
        }
    }

    fn slice(&self, u: f64, v: f64, rng: &mut StdRng) -> (Vec<[f64; 3]>, Vec<f64>) {
        let lobe = (-(u - v).powi(2) / 0.05).exp() * (1.0 - 0.5 * u);
        let turn = std::f64::consts::TAU;
        let one = |cluster: &Cluster| {
            let wave = 1.0 + cluster.swing * (turn * u + cluster.phase[0]).sin() + 0.35 * lobe;
            let tint = 0.7 + 0.3 * (0.5 * turn * v + cluster.phase[1]).cos();
            let point = [
                (cluster.lightness * wave + 0.6 * normal(rng)).clamp(0.5, 250.0),
                (cluster.a * tint + 5.0 * lobe + 0.6 * normal(rng)).clamp(-60.0, 60.0),
                (cluster.b * tint - 5.0 * lobe + 0.6 * normal(rng)).clamp(-60.0, 60.0),
            ];
            let drift = 0.5 * (turn * (u + v) + cluster.phase[0]).sin() + 0.15 * normal(rng);
            (point, (cluster.mass * drift.exp()).max(1e-6))
        };
        let (points, mut masses): (Vec<_>, Vec<f64>) = self.clusters.iter().map(one).unzip();
        normalise(&mut masses);
        (points, masses)
    }
}

fn normalise(masses: &mut [f64]) {
    let sum: f64 = masses.iter().sum();
    masses.iter_mut().for_each(|mass| *mass /= sum);
}

/// 30 × 30 slices of two paints, three in ten made hard in one of six ways.
pub fn paint_slices(seed: u64) -> Vec<Clouds> {
    let mut rng = StdRng::seed_from_u64(seed);
    let rng = &mut rng;
    let (from, to) = (Paint::new(rng), Paint::new(rng));
    let kinds = ["dup", "uneven", "near", "dominant", "offsum", "tiny"];
    (0..900_i32)
        .map(|place| {
            let (u, v) = (f64::from(place / 30) / 29.0, f64::from(place % 30) / 29.0);
            let (source, source_masses) = from.slice(u, v, rng);
            let (target, target_masses) = to.slice(u, v, rng);
            let kind = if rng.random_bool(0.3) {
                kinds[rng.random_range(0..kinds.len())]
            } else {
                "smooth"
            };
            let mut clouds = Clouds {
                kind,
                source,
                source_masses,
                target,
                target_masses,
            };
            harden(&mut clouds, rng);
            clouds
        })
        .collect()
}

fn harden(clouds: &mut Clouds, rng: &mut StdRng) {
    let Clouds {
        kind,
        source,
        source_masses: p,
        target,
        target_masses: q,
    } = clouds;
    match *kind {
        "dup" => {
            for _ in 0..12 {
                let mut any = || rng.random_range(0..50);
                source[any()] = source[any()];
                target[any()] = source[any()];
            }
            if rng.random_bool(0.3) {
                for k in 0..50 {
                    source[k] = source[rng.random_range(0..4)];
                    target[k] = target[rng.random_range(0..4)];
                }
            }
        }
        "uneven" => {
            for (points, masses) in [(source, p), (target, q)] {
                let most = if rng.random_bool(0.2) { 1 } else { 50 };
                let count = rng.random_range(1..=most);
                points.truncate(count);
                masses.truncate(count);
            }
        }
        "near" => {
            target.clone_from(source);
            q.clone_from(p);
            if rng.random_bool(0.75) {
                let (shift, change) =
                    (power_of_ten(rng, -9.0, -1.0), power_of_ten(rng, -9.0, -1.0));
                target
                    .as_flattened_mut()
                    .iter_mut()
                    .for_each(|x| *x += shift * normal(rng));
                q.iter_mut()
                    .for_each(|mass| *mass *= (change * normal(rng)).exp());
            }
        }
        "dominant" => {
            for masses in [p, q] {
                masses.iter_mut().for_each(|mass| *mass *= 1e-4);
                masses[rng.random_range(0..50)] = 1.0;
                if rng.random_bool(0.5) {
                    break;
                }
            }
        }
        "offsum" => {
            for masses in [p, q] {
                let off = 1.0 + rng.random_range(-1e-7..1e-7);
                masses.iter_mut().for_each(|mass| *mass *= off);
            }
        }
        "tiny" => {
            if rng.random_bool(0.5) {
                p.fill(0.02);
                q.fill(0.02);
            } else {
                for masses in [p, q] {
                    for mass in masses {
                        if rng.random_bool(0.6) {
                            *mass = 1e-6 * power_of_ten(rng, -6.0, 0.0);
                        }
                    }
                }
            }
        }
        _ => {}
    }
}

/// Points from 1e-12 to 1e12 away from the origin, all in one cloud.
pub fn of_all_scales(rng: &mut StdRng) -> Clouds {
    let cloud = |rng: &mut StdRng| -> (Vec<[f64; 3]>, Vec<f64>) {
        let count = rng.random_range(1..=25);
        let point = |rng: &mut StdRng| {
            let size = power_of_ten(rng, -12.0, 12.0);
            [0; 3].map(|_| size * rng.random_range(-1.0..1.0))
        };
        (0..count)
            .map(|_| (point(rng), rng.random_range(0.001..1.0)))
            .unzip()
    };
    let (source, source_masses) = cloud(rng);
    let (target, target_masses) = cloud(rng);
    Clouds {
        kind: "of all scales",
        source,
        source_masses,
        target,
        target_masses,
    }
}

/// Masses of 1e-300, 1e-12 and 1 on both sides, with many light ones next to light ones.
pub fn light_on_both_sides(rng: &mut StdRng) -> Clouds {
    let lattice = rng.random_bool(0.5);
    let cloud = |rng: &mut StdRng| -> (Vec<[f64; 3]>, Vec<f64>) {
        let count = rng.random_range(2..=30);
        let heavy = rng.random_range(0..count);
        (0..count)
            .map(|k| {
                let mut axis = || {
                    let value = rng.random_range(-10.0..10.0_f64);
                    if lattice {
                        (value / 7.0).round()
                    } else {
                        value
                    }
                };
                let point = [axis(), axis(), axis()];
                let mass = [1e-300, 1e-12, 1e-12][rng.random_range(0..3)];
                (point, if k == heavy { 1.0 } else { mass })
            })
            .unzip()
    };
    let (source, source_masses) = cloud(rng);
    let (target, target_masses) = cloud(rng);
    Clouds {
        kind: "light on both sides",
        source,
        source_masses,
        target,
        target_masses,
    }
}

/// A small problem with as many of a solver's troubles as fit.
pub fn nasty(rng: &mut StdRng) -> Clouds {
    let most = [2, 6, 14, 40][rng.random_range(0..4)];
    let scale = match rng.random_range(0..4) {
        0 => power_of_ten(rng, -12.0, 12.0),
        _ => 1.0,
    };
    let pattern = rng.random_range(0..6);
    let point = |rng: &mut StdRng| -> [f64; 3] {
        let mut lattice = |size: u8| f64::from(rng.random_range(0..size)) * scale;
        match pattern {
            0 => [lattice(3), lattice(3), lattice(3)],
            1 => [lattice(9), 0.0, 0.0],
            2 => [scale; 3],
            3 => {
                // Near a line that is no axis.
                let t = rng.random_range(0.0..100.0) * scale;
                [0.6 * t, 0.48 * t, 0.64 * t]
            }
            _ => [0; 3].map(|_| rng.random_range(-100.0..100.0) * scale),
        }
    };
    let cloud = |rng: &mut StdRng| {
        let count = rng.random_range(1..=most);
        let points: Vec<_> = (0..count).map(|_| point(rng)).collect();
        let style = rng.random_range(0..5);
        let mut masses: Vec<f64> = (0..count)
            .map(|_| match style {
                0 => 1.0,
                1 => f64::from(rng.random_range(1..4_u8)),
                2 => power_of_ten(rng, -300.0, 0.0),
                3 => power_of_ten(rng, -16.0, 0.0),
                _ => rng.random_range(0.001..1.0),
            })
            .collect();
        if rng.random_bool(0.7) {
            normalise(&mut masses);
            masses.iter_mut().for_each(|mass| *mass = mass.max(1e-300));
        }
        if rng.random_bool(0.3) {
            let off = 1.0 + rng.random_range(-1e-7..1e-7);
            masses.iter_mut().for_each(|mass| *mass *= off);
        }
        (points, masses)
    };
    let (source, source_masses) = cloud(rng);
    let (mut target, mut target_masses) = cloud(rng);
    if rng.random_bool(0.1) {
        target.clone_from(&source);
        target_masses.clone_from(&source_masses);
        if rng.random_bool(0.5) {
            target.reverse();
            target_masses.reverse();
        }
    }
    Clouds {
        kind: "nasty",
        source,
        source_masses,
        target,
        target_masses,
    }
}
