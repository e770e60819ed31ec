//! Colors under one light as they look under another.
//!
//! ```text
//! M = B⁻¹ diag(B w_to / B w_from) B,   B the cone responses of Bradford
//! ```
//!
//! K. M. Lam, "Metamerism and colour constancy" (1985), as ICC.1:2022, annex E, prints it. It moves between illuminants
//! for one observer; what another observer sees cannot be told without spectra.

use super::rgb::{inverse, times};
use super::white::WhitePoint;

const CONES: [[f64; 3]; 3] = [
    [0.8951, 0.2664, -0.1614],
    [-0.7502, 1.7135, 0.0367],
    [0.0389, -0.0685, 1.0296],
];

const FROM_CONES: [[f64; 3]; 3] = inverse(CONES);

/// XYZ under `to` of a color that has this XYZ under `from`; white becomes white.
#[must_use]
pub fn adapted(xyz: [f64; 3], from: WhitePoint, to: WhitePoint) -> [f64; 3] {
    let cones = |white: WhitePoint| times(&CONES, [white.x, white.y, white.z]);
    let (from, to, seen) = (cones(from), cones(to), times(&CONES, xyz));
    times(
        &FROM_CONES,
        std::array::from_fn(|k| seen[k] * to[k] / from[k]),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::{D65_2, Illuminant, Observer};

    const D50_2: WhitePoint = WhitePoint::of(Illuminant::D50, Observer::Two);

    /// The published matrix from D65 to D50, to the seven digits that it is printed with.
    #[test]
    fn the_matrix_between_daylights_is_the_published_one() {
        let published = [
            [1.047_811_2, 0.022_886_6, -0.050_127_0],
            [0.029_542_4, 0.990_484_4, -0.017_049_1],
            [-0.009_234_5, 0.015_043_6, 0.752_131_6],
        ];
        for column in 0..3 {
            let mut unit = [0.0; 3];
            unit[column] = 1.0;
            let found = adapted(unit, D65_2, D50_2);
            for row in 0..3 {
                assert!(
                    (found[row] - published[row][column]).abs() < 1e-6,
                    "{row} {column}"
                );
            }
        }
    }

    #[test]
    fn white_stays_white_and_the_way_back_ends_where_it_began() {
        let white = adapted([D65_2.x, D65_2.y, D65_2.z], D65_2, D50_2);
        for (x, y) in white.iter().zip([D50_2.x, D50_2.y, D50_2.z]) {
            assert!((x - y).abs() < 1e-15);
        }
        let back = adapted(adapted([0.2, 0.1, 0.7], D65_2, D50_2), D50_2, D65_2);
        for (x, y) in back.iter().zip([0.2, 0.1, 0.7]) {
            assert!((x - y).abs() < 1e-15);
        }
    }
}
