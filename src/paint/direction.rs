//! Directions in the shading frame and their half-vector angles.
//!
//! The normal is `(0, 0, 1)`; `wi` points towards the light, `wo` towards the viewer, both of unit length. Angles come
//! from `atan2`: `acos` loses half the digits next to the mirror direction, where car paint changes fastest.

/// A unit vector, `z` along the surface normal.
pub type Direction = [f64; 3];

/// Aspecular angles of the six-angle instruments, degrees.
pub const ASPECULAR_DEG: [f64; 6] = [-15.0, 15.0, 25.0, 45.0, 75.0, 110.0];

/// Half vector of a pair of directions, and the angles the model is written in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfAngles {
    /// Angle of the half vector from the normal, radians.
    pub theta_h: f64,
    /// Angle between half vector and light, radians.
    pub theta_d: f64,
    /// Cosine of `theta_h`.
    pub h_z: f64,
    /// Cosine of `theta_d`, the `h·o` of the lobes.
    pub h_o: f64,
    /// Squared tangent of `theta_h`, without cancellation near 0.
    pub tan2_h: f64,
}

pub(crate) fn dot(a: Direction, b: Direction) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Half-vector angles of two unit directions above the horizon.
///
/// `i = −o` cannot happen above the horizon; where the sum vanishes by rounding at grazing, the half vector is the
/// normal.
#[must_use]
pub fn half_angles(wi: Direction, wo: Direction) -> HalfAngles {
    let sum = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
    let difference = [wi[0] - wo[0], wi[1] - wo[1], wi[2] - wo[2]];
    let length = dot(sum, sum).sqrt();
    let h = if length > 0.0 {
        sum.map(|v| v / length)
    } else {
        [0.0, 0.0, 1.0]
    };
    let across = h[0].hypot(h[1]);
    // |i+o| = 2 cos θd and |i−o| = 2 sin θd for unit vectors: exact at both ends.
    let (sine2, cosine2) = (dot(difference, difference).sqrt(), length);
    let norm = sine2.hypot(cosine2);
    HalfAngles {
        theta_h: across.atan2(h[2]),
        theta_d: sine2.atan2(cosine2),
        h_z: h[2],
        h_o: if norm > 0.0 { cosine2 / norm } else { 0.0 },
        tan2_h: across * across / (h[2] * h[2]),
    }
}

/// `min(1/(i_z o_z), 2 h_z / ((h·o) max(i_z, o_z)))`: the geometry term over both cosines, without 0/0.
///
/// Reflectance grows without bound towards the grazing mirror; above 1e150 the value stops, short of overflow.
pub(crate) fn masking(h: &HalfAngles, i_z: f64, o_z: f64) -> f64 {
    (1.0 / (i_z * o_z))
        .min(2.0 * h.h_z / (h.h_o * i_z.max(o_z)))
        .min(1e150)
}

/// Light and view directions of the six-angle instrument: light at 45° in air, viewer in the plane of incidence.
#[must_use]
pub fn instrument_pairs() -> [(Direction, Direction); 6] {
    ASPECULAR_DEG.map(|aspecular| {
        let (light, view) = (45.0_f64.to_radians(), (45.0 - aspecular).to_radians());
        (
            [-light.sin(), 0.0, light.cos()],
            [view.sin(), 0.0, view.cos()],
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::coat::refract;

    /// Model description, section 5: angles under a coat of ior 1.5.
    #[test]
    fn the_six_geometries_meet_the_published_angles_inside_a_coat() {
        let theta_h = [3.57, 4.33, 7.47, 14.06, 23.80, 32.65];
        let theta_d = [31.69, 23.80, 20.65, 14.06, 4.33, 4.52];
        for (k, (wi, wo)) in instrument_pairs().into_iter().enumerate() {
            let angles = half_angles(refract(wi, 1.5), refract(wo, 1.5));
            assert!(
                (angles.theta_h.to_degrees() - theta_h[k]).abs() < 0.006,
                "{k}"
            );
            assert!(
                (angles.theta_d.to_degrees() - theta_d[k]).abs() < 0.006,
                "{k}"
            );
        }
    }

    #[test]
    fn a_billionth_of_a_radian_from_the_mirror_keeps_its_digits() {
        let tilt = 1e-9_f64;
        let wi = [tilt.sin(), 0.0, tilt.cos()];
        let angles = half_angles(wi, [0.0, 0.0, 1.0]);
        assert!((angles.theta_h - tilt / 2.0).abs() < 1e-15 * tilt.max(1e-9) + 1e-22);
        assert!((angles.theta_d - tilt / 2.0).abs() < 1e-6 * tilt);
    }
}
