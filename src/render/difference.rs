//! How far two pictures are apart: CIEDE2000 pixel by pixel, and FLIP.
//!
//! Both compare what a screen shows, after exposure and tone mapping. FLIP models what is seen when two pictures
//! alternate: colors blurred by the eye's contrast sensitivity, edges and points found or missed.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild, "FLIP: a difference evaluator for
//! alternating images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020; at 67 pixels a degree, which is 0.7 m before
//! a screen of 0.7 m width and 3840 pixels.

use super::film::Film;
use super::noise::shown;
use super::tone::neutral;
use crate::color::{D65_2, Lab, ciede2000, rgb_to_xyz, xyz_to_rgb};

/// Pixels per degree of visual angle.
const PPD: f64 = 67.0;

/// How far two pictures are apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureDifference {
    /// Mean CIEDE2000 over all pixels.
    pub mean_delta_e: f64,
    /// 95th percentile.
    pub p95_delta_e: f64,
    /// Mean FLIP, 0 to 1.
    pub flip: f64,
}

/// Compares two pictures of one size.
///
/// # Panics
///
/// When the sizes differ or there is no pixel.
#[must_use]
#[allow(clippy::cast_precision_loss)] // a count of pixels
pub fn difference(x: &Film, y: &Film) -> PictureDifference {
    assert_eq!(
        (x.width(), x.height()),
        (y.width(), y.height()),
        "pictures of one size"
    );
    let pairs = x.pixels().iter().zip(y.pixels());
    let mut errors: Vec<f64> = pairs
        .map(|(&p, &q)| ciede2000(shown(p, x.exposure()), shown(q, y.exposure())))
        .collect();
    errors.sort_unstable_by(f64::total_cmp);
    PictureDifference {
        mean_delta_e: errors.iter().sum::<f64>() / errors.len() as f64,
        p95_delta_e: errors[errors.len() * 95 / 100],
        flip: flip(x, y),
    }
}

/// One channel of a picture.
#[derive(Clone)]
struct Plane {
    width: usize,
    values: Vec<f64>,
}

impl Plane {
    /// Convolves rows with one kernel and columns with another; border pixels hold beyond the border.
    fn convolved(&self, across: &[f64], down: &[f64]) -> Self {
        let (width, height) = (self.width, self.values.len() / self.width);
        let pass = |values: &[f64], kernel: &[f64], dx: usize, dy: usize| -> Vec<f64> {
            let reach = kernel.len() / 2;
            let held = |k: usize, j: usize, end: usize| (k + j).saturating_sub(reach).min(end - 1);
            (0..height * width)
                .map(|at| {
                    let (x, y) = (at % width, at / width);
                    let taps = kernel.iter().enumerate();
                    taps.map(|(j, weight)| {
                        let (px, py) = (
                            if dx > 0 { held(x, j, width) } else { x },
                            if dy > 0 { held(y, j, height) } else { y },
                        );
                        weight * values[py * width + px]
                    })
                    .sum()
                })
                .collect()
        };
        let rows = pass(&self.values, across, 1, 0);
        Self {
            width,
            values: pass(&rows, down, 0, 1),
        }
    }
}

/// Mean FLIP of two pictures.
#[allow(clippy::cast_precision_loss)] // a count of pixels
pub(super) fn flip(x: &Film, y: &Film) -> f64 {
    let (x, y) = (opponent(x), opponent(y));
    let (seen_x, seen_y) = (seen(&x), seen(&y));
    let features = feature_differences(&x[0], &y[0]);
    let largest = hyab(
        hunt(Lab::from_rgb([0.0, 1.0, 0.0])),
        hunt(Lab::from_rgb([0.0, 0.0, 1.0])),
    )
    .powf(0.7);
    let sum: f64 = seen_x
        .iter()
        .zip(&seen_y)
        .zip(&features)
        .map(|((&p, &q), feature)| {
            let color = redistributed(hyab(p, q).powf(0.7), largest);
            color.powf(1.0 - feature)
        })
        .sum();
    sum / features.len() as f64
}

/// Maps color errors to 0 to 1: what is above two fifths of the largest counts little more.
fn redistributed(error: f64, largest: f64) -> f64 {
    const KNEE: f64 = 0.4;
    const AT_KNEE: f64 = 0.95;
    let knee = KNEE * largest;
    if error < knee {
        AT_KNEE / knee * error
    } else {
        (AT_KNEE + (error - knee) / (largest - knee) * (1.0 - AT_KNEE)).min(1.0)
    }
}

/// Y, Cx, Cz: CIELAB's axes without the cube root.
fn opponent(film: &Film) -> [Plane; 3] {
    let mut planes = [(); 3].map(|()| Plane {
        width: film.width() as usize,
        values: Vec::with_capacity(film.pixels().len()),
    });
    for pixel in film.pixels() {
        let rgb = neutral(pixel.map(|v| v * film.exposure())).map(f64::from);
        let [x, y, z] = rgb_to_xyz(rgb);
        let (x, y, z) = (x / D65_2.x, y / D65_2.y, z / D65_2.z);
        let values = [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)];
        for (plane, value) in planes.iter_mut().zip(values) {
            plane.values.push(value);
        }
    }
    planes
}

/// Colors as the eye blurs them, with Hunt's adjustment.
fn seen(planes: &[Plane; 3]) -> Vec<[f64; 3]> {
    let blurred = [
        sensitivity(&planes[0], &[(1.0, 0.0047)]),
        sensitivity(&planes[1], &[(1.0, 0.0053)]),
        sensitivity(&planes[2], &[(34.1, 0.04), (13.5, 0.025)]),
    ];
    (0..blurred[0].len())
        .map(|k| {
            let y = (blurred[0][k] + 16.0) / 116.0;
            let (x, z) = (blurred[1][k] / 500.0 + y, y - blurred[2][k] / 200.0);
            let rgb = xyz_to_rgb([x * D65_2.x, y * D65_2.y, z * D65_2.z]);
            hunt(Lab::from_rgb(rgb.map(|v| v.clamp(0.0, 1.0))))
        })
        .collect()
}

/// A channel through its contrast sensitivity: a sum of Gaussians `a √(π/b) exp(−π² r²/b)`, r in degrees.
fn sensitivity(plane: &Plane, gaussians: &[(f64, f64)]) -> Vec<f64> {
    let widest = gaussians.iter().map(|g| g.1).fold(0.0, f64::max);
    let pi2 = std::f64::consts::PI.powi(2);
    let reach = reach(3.0 * (widest / (2.0 * pi2)).sqrt() * PPD);
    let (mut sum, mut weight) = (vec![0.0; plane.values.len()], 0.0);
    for &(a, b) in gaussians {
        let kernel: Vec<f64> = (-reach..=reach)
            .map(|k| (-pi2 * (f64::from(k) / PPD).powi(2) / b).exp())
            .collect();
        let scale = a * (std::f64::consts::PI / b).sqrt();
        weight += scale * kernel.iter().sum::<f64>().powi(2);
        for (sum, value) in sum.iter_mut().zip(plane.convolved(&kernel, &kernel).values) {
            *sum += scale * value;
        }
    }
    sum.into_iter().map(|v| v / weight).collect()
}

#[allow(clippy::cast_possible_truncation)] // a few pixels
fn reach(pixels: f64) -> i32 {
    pixels.ceil() as i32
}

fn hunt(lab: Lab) -> [f64; 3] {
    [lab.l, 0.01 * lab.l * lab.a, 0.01 * lab.l * lab.b]
}

fn hyab(x: [f64; 3], y: [f64; 3]) -> f64 {
    (x[0] - y[0]).abs() + (x[1] - y[1]).hypot(x[2] - y[2])
}

/// Where one picture has an edge or a point and the other has not, 0 to 1.
fn feature_differences(x: &Plane, y: &Plane) -> Vec<f64> {
    let sigma = 0.5 * 0.082 * PPD;
    let reach = reach(3.0 * sigma);
    let bell = |k: i32| (-(f64::from(k) / sigma).powi(2) / 2.0).exp();
    let blur: Vec<f64> = {
        let sum: f64 = (-reach..=reach).map(bell).sum();
        (-reach..=reach).map(|k| bell(k) / sum).collect()
    };
    let edge: Vec<f64> = (-reach..=reach).map(|k| -f64::from(k) * bell(k)).collect();
    let point: Vec<f64> = (-reach..=reach)
        .map(|k| ((f64::from(k) / sigma).powi(2) - 1.0) * bell(k))
        .collect();
    let strength = |plane: &Plane, kernel: &[f64]| -> Vec<f64> {
        let gray = Plane {
            width: plane.width,
            values: plane.values.iter().map(|v| (v + 16.0) / 116.0).collect(),
        };
        let kernel = balanced(kernel);
        let (across, down) = (
            gray.convolved(&kernel, &blur),
            gray.convolved(&blur, &kernel),
        );
        across
            .values
            .iter()
            .zip(&down.values)
            .map(|(a, d)| a.hypot(*d))
            .collect()
    };
    let difference = |kernel: &[f64]| -> Vec<f64> {
        let (x, y) = (strength(x, kernel), strength(y, kernel));
        x.iter().zip(&y).map(|(x, y)| (x - y).abs()).collect()
    };
    let (edges, points) = (difference(&edge), difference(&point));
    edges
        .iter()
        .zip(&points)
        .map(|(e, p)| (e.max(*p) / std::f64::consts::SQRT_2).sqrt().min(1.0))
        .collect()
}

/// A kernel whose positive weights sum to 1 and whose negative ones to −1.
fn balanced(kernel: &[f64]) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|v| **v > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|v| **v < 0.0).sum::<f64>();
    kernel
        .iter()
        .map(|v| if *v > 0.0 { v / positive } else { v / negative })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gray(value: impl Fn(usize, usize) -> f32) -> Film {
        let pixels = (0..40)
            .flat_map(|y| (0..40).map(move |x| (x, y)))
            .map(|(x, y)| [value(x, y); 3])
            .collect();
        Film::new(40, 40, 1.0, pixels)
    }

    #[test]
    fn equal_pictures_do_not_differ_and_black_from_white_differs_most() {
        let (black, white) = (gray(|_, _| 0.0), gray(|_, _| 1e6));
        let none = difference(&white, &white);
        assert_eq!(
            (none.mean_delta_e, none.p95_delta_e, none.flip),
            (0.0, 0.0, 0.0)
        );
        let most = difference(&black, &white);
        assert!(most.mean_delta_e > 95.0 && most.flip > 0.9, "{most:?}");
    }

    #[test]
    fn a_lost_sparkle_is_seen_and_shared_ones_are_not() {
        let dark = gray(|_, _| 0.1);
        let sparkling = gray(|x, y| if (x, y) == (20, 20) { 1.0 } else { 0.1 });
        let lost = difference(&dark, &sparkling);
        assert!(lost.flip > 0.002 && lost.p95_delta_e == 0.0, "{lost:?}");
        assert_eq!(difference(&sparkling, &sparkling).flip, 0.0);
    }
}
