//! The object: where a ray meets it, its normal there, and which texel of the paint lies there.
//!
//! World units are half the object's size; y is up, the object rests on or above the floor `y = −1`. Texels have their
//! physical size on the paint. A sphere has no flat map, so it is covered by 32 overlapping-free patches around the
//! corners and faces of an icosahedron, each mapped by Lambert's equal-area projection: at most 22° from a patch's
//! centre, shapes are kept within 2 %. Texels are independent random flakes, so the seams between patches cannot be
//! seen, and there is no pole.

use super::vector::{Vec3, along, cross, dot, perpendicular, scale, sub, unit};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What is painted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
#[schema(as = Scene)]
pub enum Shape {
    /// A ball: every angle at once.
    #[default]
    Sphere,
    /// A cylinder with round ends, lying.
    Capsule,
    /// A flat test panel, leaning back.
    Panel,
}

/// Where a ray meets the object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) distance: f32,
    pub(super) point: Vec3,
    pub(super) normal: Vec3,
}

/// A shape placed in the world.
#[derive(Clone, Debug)]
pub(super) enum Surface {
    Sphere,
    Capsule {
        axis: Vec3,
        half: f32,
        radius: f32,
        center: Vec3,
    },
    Panel {
        center: Vec3,
        right: Vec3,
        up: Vec3,
        normal: Vec3,
        half: [f32; 2],
        corner: f32,
    },
}

/// Width of the rounded edge of a panel, world units.
const BEVEL: f32 = 0.018;

impl Surface {
    pub(super) fn new(shape: Shape) -> Self {
        match shape {
            Shape::Sphere => Self::Sphere,
            Shape::Capsule => {
                let (radius, axis) = (0.48, unit([1.0, 0.0, -0.16]));
                Self::Capsule {
                    axis,
                    half: 1.0 - radius,
                    radius,
                    center: [0.0, radius - 1.0, 0.0],
                }
            }
            Shape::Panel => {
                // Leaning so far that its coat mirrors the strip overhead across one corner, and turned from the key
                // light: face beside the streak, and travel across.
                let lean = 38.0_f32.to_radians();
                let (right, up) = (unit([1.0, 0.0, -0.22]), [0.0, lean.cos(), 0.0]);
                let back = cross(right, [0.0, 1.0, 0.0]);
                let up = unit(along(up, back, -lean.sin()));
                let half = [0.98, 0.72];
                let center = [0.0, half[1] * up[1] - 1.0, 0.0];
                Self::Panel {
                    center,
                    right,
                    up,
                    normal: cross(right, up),
                    half,
                    corner: 0.07,
                }
            }
        }
    }

    /// First point of the object along a unit direction.
    pub(super) fn meet(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        match *self {
            Self::Sphere => {
                let distance = sphere([0.0; 3], 1.0, origin, direction)?;
                let point = along(origin, direction, distance);
                Some(Hit {
                    distance,
                    point,
                    normal: unit(point),
                })
            }
            Self::Capsule {
                axis,
                half,
                radius,
                center,
            } => {
                let distance = capsule(axis, half, radius, sub(origin, center), direction)?;
                let point = along(origin, direction, distance);
                let inside = sub(point, center);
                let foot = dot(inside, axis).clamp(-half, half);
                Some(Hit {
                    distance,
                    point,
                    normal: unit(along(inside, axis, -foot)),
                })
            }
            Self::Panel {
                center,
                right,
                up,
                normal,
                half,
                corner,
            } => {
                let facing = -dot(direction, normal);
                if facing.abs() < 1e-6 {
                    return None;
                }
                let distance = dot(sub(origin, center), normal) / facing;
                let point = along(origin, direction, distance);
                let inside = sub(point, center);
                let (depth, outward) =
                    rounded_rectangle([dot(inside, right), dot(inside, up)], half, corner);
                if distance <= 1e-4 || depth < 0.0 {
                    return None;
                }
                let bend = (1.0 - depth / BEVEL).max(0.0);
                let edge = along(scale(right, outward[0]), up, outward[1]);
                Some(Hit {
                    distance,
                    point,
                    normal: unit(along(normal, edge, bend * bend * 0.9)),
                })
            }
        }
    }

    /// Texel of the paint at a point of the surface; `per_unit` texels are as long as a world unit.
    pub(super) fn texel(&self, hit: &Hit, per_unit: f32) -> [i32; 2] {
        match *self {
            Self::Sphere => on_ball(hit.normal, per_unit),
            Self::Capsule {
                axis,
                half,
                radius,
                center,
            } => {
                let foot = dot(sub(hit.point, center), axis);
                if foot.abs() >= half {
                    return on_ball(hit.normal, radius * per_unit);
                }
                let (x, y) = (perpendicular(axis), cross(axis, perpendicular(axis)));
                let turn = dot(hit.normal, y).atan2(dot(hit.normal, x));
                [whole(foot * per_unit), whole(turn * radius * per_unit)]
            }
            Self::Panel {
                center, right, up, ..
            } => {
                let inside = sub(hit.point, center);
                [
                    whole(dot(inside, right) * per_unit),
                    whole(dot(inside, up) * per_unit),
                ]
            }
        }
    }
}

#[allow(clippy::cast_possible_truncation)] // saturates; objects are smaller
fn whole(x: f32) -> i32 {
    x.floor() as i32
}

fn sphere(center: Vec3, radius: f32, origin: Vec3, direction: Vec3) -> Option<f32> {
    let away = sub(origin, center);
    let b = dot(away, direction);
    // The point of the ray nearest the centre, for a discriminant without cancellation.
    let nearest = along(away, direction, -b);
    let discriminant = radius * radius - dot(nearest, nearest);
    if discriminant < 0.0 {
        return None;
    }
    let distance = -b - discriminant.sqrt();
    (distance > 1e-4).then_some(distance)
}

/// A capsule around the origin.
fn capsule(axis: Vec3, half: f32, radius: f32, origin: Vec3, direction: Vec3) -> Option<f32> {
    let (along_d, along_o) = (dot(direction, axis), dot(origin, axis));
    let (d, o) = (
        along(direction, axis, -along_d),
        along(origin, axis, -along_o),
    );
    let (a, b, c) = (dot(d, d), dot(d, o), dot(o, o) - radius * radius);
    let discriminant = b * b - a * c;
    if a > 1e-9 && discriminant >= 0.0 {
        let distance = (-b - discriminant.sqrt()) / a;
        if distance > 1e-4 && (along_o + along_d * distance).abs() <= half {
            return Some(distance);
        }
    }
    let ends = [half, -half].map(|end| sphere(scale(axis, end), radius, origin, direction));
    match ends {
        [Some(x), Some(y)] => Some(x.min(y)),
        [x, y] => x.or(y),
    }
}

/// Depth inside a rounded rectangle (negative outside) and the outward direction of its nearest edge.
fn rounded_rectangle(p: [f32; 2], half: [f32; 2], corner: f32) -> (f32, [f32; 2]) {
    let q = [
        p[0].abs() - (half[0] - corner),
        p[1].abs() - (half[1] - corner),
    ];
    let outside = [q[0].max(0.0), q[1].max(0.0)];
    let length = outside[0].hypot(outside[1]);
    let depth = corner - length - q[0].max(q[1]).min(0.0);
    let outward = if length > 1e-6 {
        [outside[0] / length, outside[1] / length]
    } else if q[0] > q[1] {
        [1.0, 0.0]
    } else {
        [0.0, 1.0]
    };
    (
        depth,
        [
            outward[0].copysign(p[0]) * f32::from(outward[0] != 0.0),
            outward[1].copysign(p[1]) * f32::from(outward[1] != 0.0),
        ],
    )
}

/// Corners and face centres of an icosahedron in the positive octant; signs give the others.
const CENTERS: [Vec3; 7] = {
    // 1/√(1+φ²), φ/√(1+φ²), 1/√3, 1/(φ√3), φ/√3
    const A: f32 = 0.525_731_1;
    const B: f32 = 0.850_650_8;
    const C: f32 = 0.577_350_3;
    const D: f32 = 0.356_822_1;
    const E: f32 = 0.934_172_4;
    [
        [0.0, A, B],
        [B, 0.0, A],
        [A, B, 0.0],
        [C, C, C],
        [0.0, E, D],
        [D, 0.0, E],
        [E, D, 0.0],
    ]
};

/// Texel on a ball whose radius is `radius` texels.
fn on_ball(n: Vec3, radius: f32) -> [i32; 2] {
    let folded = n.map(f32::abs);
    let (mut best, mut nearest) = (0, -1.0);
    for (k, center) in CENTERS.iter().enumerate() {
        let cosine = dot(folded, *center);
        if cosine > nearest {
            (best, nearest) = (k, cosine);
        }
    }
    let mut patch = 0;
    let mut center = CENTERS[best];
    for axis in 0..3 {
        if center[axis] != 0.0 && n[axis] < 0.0 {
            center[axis] = -center[axis];
            patch |= 1 << axis;
        }
    }
    let x = perpendicular(center);
    let y = cross(center, x);
    let stretch = (2.0 / (1.0 + nearest)).sqrt() * radius;
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // below 56
    let place = (best as i32 * 8 + patch) * 1_000_003;
    [
        whole(dot(n, x) * stretch).wrapping_add(place),
        whole(dot(n, y) * stretch).wrapping_sub(place),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn directions(count: u32) -> impl Iterator<Item = Vec3> {
        (0..count).map(move |k| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
            let turn = f64::from(k) * 2.399_963_229_728_653;
            let r = (1.0 - z * z).sqrt();
            #[allow(clippy::cast_possible_truncation)]
            [(r * turn.cos()) as f32, (r * turn.sin()) as f32, z as f32]
        })
    }

    #[test]
    fn texels_on_a_ball_all_have_the_same_area() {
        let mut count = HashMap::new();
        for n in directions(400_000) {
            *count.entry(on_ball(n, 12.0)).or_insert(0_u32) += 1;
        }
        // 4π 12² texels; interior ones all get the mean, those cut by a seam less.
        let mean = 400_000.0 / (4.0 * std::f64::consts::PI * 144.0);
        let full = count
            .values()
            .filter(|&&c| (f64::from(c) - mean).abs() < 0.06 * mean)
            .count();
        assert!(full > 1100, "{full} of {}", count.len());
        assert!(count.values().all(|&c| f64::from(c) < 1.1 * mean));
    }

    #[test]
    fn rays_meet_every_shape_on_its_surface() {
        for shape in [Shape::Sphere, Shape::Capsule, Shape::Panel] {
            let surface = Surface::new(shape);
            let origin = [0.3, 0.8, 6.0];
            let mut met = 0;
            for target in directions(2000) {
                let direction = unit(sub(scale(target, 0.9), origin));
                let Some(hit) = surface.meet(origin, direction) else {
                    continue;
                };
                met += 1;
                assert!((dot(hit.normal, hit.normal) - 1.0).abs() < 1e-5);
                assert!(dot(hit.normal, direction) < 0.5, "{shape:?}: {hit:?}");
                assert!(hit.point[1] >= -1.001);
            }
            assert!(met > 400, "{shape:?}: {met}");
        }
    }

    #[test]
    fn a_grazing_ray_still_has_a_finite_hit() {
        let hit = Surface::Sphere
            .meet([0.999_999_9, 0.0, 5.0], [0.0, 0.0, -1.0])
            .expect("meets");
        assert!(hit.normal.iter().all(|v| v.is_finite()));
    }
}
