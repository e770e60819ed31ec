//! Three-component vectors in single precision, as pixels need them: directions, points and colors alike.

/// A direction, a point or a color.
pub type Vec3 = [f32; 3];

pub(super) fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(super) fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scale(a: Vec3, s: f32) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `a + b s`.
pub(super) fn along(a: Vec3, b: Vec3, s: f32) -> Vec3 {
    [a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s]
}

pub(super) fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    [
        a[0] + (b[0] - a[0]) * t,
        a[1] + (b[1] - a[1]) * t,
        a[2] + (b[2] - a[2]) * t,
    ]
}

/// The direction of a vector; the y axis where it has none.
pub(super) fn unit(a: Vec3) -> Vec3 {
    let length = dot(a, a).sqrt();
    if length > 0.0 {
        scale(a, 1.0 / length)
    } else {
        [0.0, 1.0, 0.0]
    }
}

pub(super) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Right-handed axes at a surface point: `normal` is z, the view lies in the plane of x and z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) tangent: Vec3,
    pub(super) side: Vec3,
}

impl Frame {
    /// Axes for a unit normal and a unit direction; any tangent will do where the two are parallel.
    pub(super) fn new(normal: Vec3, view: Vec3) -> Self {
        let across = along(view, normal, -dot(view, normal));
        let tangent = if dot(across, across) > 1e-12 {
            unit(across)
        } else {
            perpendicular(normal)
        };
        Self {
            tangent,
            side: cross(normal, tangent),
        }
    }
}

/// Some unit vector across a unit vector.
pub(super) fn perpendicular(n: Vec3) -> Vec3 {
    let axis = if n[0].abs() < 0.6 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    unit(cross(axis, n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_right_angled_and_holds_the_view() {
        let n = unit([0.3, -0.5, 0.8]);
        for view in [n, unit([0.1, 0.2, 0.9])] {
            let frame = Frame::new(n, view);
            for (a, b, want) in [
                (frame.tangent, frame.side, 0.0),
                (frame.tangent, n, 0.0),
                (frame.side, n, 0.0),
                (frame.tangent, frame.tangent, 1.0),
                (frame.side, frame.side, 1.0),
                (frame.side, view, 0.0),
            ] {
                assert!((dot(a, b) - want).abs() < 1e-6);
            }
            assert!(dot(cross(frame.tangent, frame.side), n) > 0.99);
        }
    }
}
