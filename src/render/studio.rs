//! The built-in studio: the soft boxes and strips that draw crisp highlights over a painted shape.
//!
//! Everything is analytic, so the coat's mirror image stays sharp at any picture size. Lights are rectangles at
//! infinity in their own tangent plane, with a soft border; the rest is a dim gradient over a mid-grey floor. Colors
//! are neutral: a studio must not tint what it shows.
//!
//! Most light is broad and comes from the camera's side, to the left: the face lies there, and what turns away to the
//! right and downwards is seen far from the gloss, in dim surroundings, so that a paint shows its travel. Radiance is in
//! units in which a white diffuser facing the camera comes out near 0.7: the face of a silver is twice as bright, and
//! must not burn out.

use super::scene::DirectionalLight;
use super::vector::{Vec3, along, cross, dot, scale, smoothstep, unit};

/// One soft box.
#[derive(Clone, Copy, Debug)]
struct SoftBox {
    center: Vec3,
    across: Vec3,
    upwards: Vec3,
    half: [f32; 2],
    border: f32,
    radiance: f32,
    /// Share of the radiance lost from the middle to the border, as a diffuser cloth shows it.
    falloff: f32,
    /// Cosine from the center beyond which nothing of the box is seen.
    reach: f32,
}

/// The studio's lights, placed.
#[derive(Clone, Debug)]
pub(super) struct Studio {
    boxes: Vec<SoftBox>,
}

/// Radiance of the floor far from the object, towards the camera.
const FLOOR: f32 = 0.25;

/// Towards the middle of the key light.
const KEY: Vec3 = [-0.44, 0.36, 1.0];

impl Studio {
    pub(super) fn new() -> Self {
        let boxes = vec![
            // The key: a wide cloth beside the camera.
            soft_box(KEY, 0.0, [0.74, 0.38], 0.05, 1.65, 0.3),
            // A long strip overhead, the highlight that runs over a roof, and a tall one on the right. Mirror images of
            // lights stay clear of each other on a ball.
            soft_box([0.16, 1.0, 0.30], 0.0, [0.80, 0.055], 0.012, 8.0, 0.2),
            soft_box([1.0, 0.10, 0.22], 90.0, [0.46, 0.05], 0.012, 7.0, 0.2),
            // Rim lights behind the object.
            soft_box([-0.85, 0.25, -1.0], 90.0, [0.60, 0.04], 0.02, 6.0, 0.2),
            soft_box([0.95, 0.40, -1.0], 90.0, [0.60, 0.04], 0.02, 6.0, 0.2),
        ];
        Self { boxes }
    }

    /// Radiance from a unit direction that points towards the surroundings.
    pub(super) fn radiance(&self, direction: Vec3) -> Vec3 {
        let mut light = surround(direction);
        for lamp in &self.boxes {
            let (cover, radiance) = lamp.seen(direction);
            light += (radiance - light) * cover;
        }
        [light; 3]
    }

    /// The key as a light of one direction, with the irradiance of its whole cloth.
    pub(super) fn key(&self) -> DirectionalLight {
        let irradiance = self.boxes.first().map_or(0.0, SoftBox::irradiance);
        DirectionalLight {
            towards: unit(KEY),
            irradiance: [irradiance; 3],
        }
    }
}

/// Places a side at which a box is looked at for its irradiance.
const LOOKS: u16 = 64;

fn soft_box(
    center: Vec3,
    roll_deg: f32,
    half: [f32; 2],
    border: f32,
    radiance: f32,
    falloff: f32,
) -> SoftBox {
    let center = unit(center);
    let level = unit(cross([0.0, 1.0, 0.001], center));
    let steep = cross(center, level);
    let (s, c) = roll_deg.to_radians().sin_cos();
    let across = std::array::from_fn(|k| level[k] * c + steep[k] * s);
    let corner = [half[0] + border, half[1] + border];
    let reach = 1.0 / (1.0 + corner[0] * corner[0] + corner[1] * corner[1]).sqrt();
    SoftBox {
        center,
        across,
        upwards: cross(center, across),
        half,
        border,
        radiance,
        falloff,
        reach,
    }
}

impl SoftBox {
    /// How much of this direction the box covers, and with what radiance.
    fn seen(&self, direction: Vec3) -> (f32, f32) {
        let towards = dot(direction, self.center);
        if towards < self.reach {
            return (0.0, 0.0);
        }
        let place = scale(direction, 1.0 / towards);
        let (x, y) = (dot(place, self.across), dot(place, self.upwards));
        let edge = |p: f32, half: f32| smoothstep(-self.border, self.border, half - p.abs());
        let cover = edge(x, self.half[0]) * edge(y, self.half[1]);
        let out = (x / self.half[0])
            .powi(2)
            .max((y / self.half[1]).powi(2))
            .min(1.0);
        (cover, self.radiance * (1.0 - self.falloff * out))
    }

    /// Irradiance on a surface that faces its middle. At a distance r from the middle of a plane one away, both the
    /// solid angle of a place and its cosine shrink: by 1/(1 + r²)² in all.
    fn irradiance(&self) -> f32 {
        let half = self.half.map(|half| half + self.border);
        let place = |k: u16| 2.0 * (f32::from(k) + 0.5) / f32::from(LOOKS) - 1.0;
        let mut sum = 0.0;
        for (row, column) in (0..LOOKS).flat_map(|row| (0..LOOKS).map(move |c| (row, c))) {
            let (x, y) = (place(column) * half[0], place(row) * half[1]);
            let towards = along(along(self.center, self.across, x), self.upwards, y);
            let (cover, radiance) = self.seen(unit(towards));
            sum += cover * radiance / (1.0 + x * x + y * y).powi(2);
        }
        sum * 4.0 * half[0] * half[1] / f32::from(LOOKS).powi(2)
    }
}

/// Walls, ceiling and floor: brightest at the horizon, dim above, a grey floor below.
///
/// The wall behind the camera is lit, the one behind the object is not: edges stay dark, faces bright.
fn surround(direction: Vec3) -> f32 {
    let y = direction[1];
    let front = 0.5 + 0.5 * direction[2];
    let wall = 0.014 + (0.03 + 0.27 * front) * (-1.2 * y.max(0.0)).exp() + 0.03 * front;
    let floor = FLOOR * (0.4 + 0.6 * front) * (0.75 + 0.25 * (1.0 + y.min(0.0)));
    wall + (floor - wall) * smoothstep(0.03, -0.03, y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_studio_is_neutral_and_bright_overhead() {
        let studio = Studio::new();
        let up = studio.radiance(unit([0.16, 1.0, 0.30]));
        assert_eq!(up[0], up[1]);
        assert!(up[0] > 6.0);
        assert!(studio.radiance([0.0, 0.0, -1.0])[0] < 1.0);
    }

    #[test]
    fn no_light_touches_another() {
        let boxes = Studio::new().boxes;
        let steps = || (-20..=20).map(|k: i8| f32::from(k) / 20.0);
        for (k, lamp) in boxes.iter().enumerate() {
            // The box widened by 0.08 radians, a twenty-fifth of a ball's radius in its mirror image.
            let half = lamp.half.map(|half| half + lamp.border + 0.08);
            for (u, v) in steps().flat_map(|u| steps().map(move |v| (u, v))) {
                let place = along(lamp.center, lamp.across, u * half[0]);
                let direction = unit(along(place, lamp.upwards, v * half[1]));
                for (other, beside) in boxes.iter().enumerate() {
                    assert!(k == other || beside.seen(direction).0 == 0.0, "{k} {other}");
                }
            }
        }
    }

    #[test]
    fn the_key_has_the_irradiance_of_what_is_seen_around_it() {
        let studio = Studio::new();
        let key = studio.key();
        // All that is seen through a hole just around the cloth, less the wall in the cloth's place.
        let (lamp, n) = (&studio.boxes[0], 400_u16);
        let place = |k: u16| 2.0 * (f32::from(k) + 0.5) / f32::from(n) - 1.0;
        let mut summed = 0.0;
        for (j, i) in (0..n).flat_map(|j| (0..n).map(move |i| (j, i))) {
            let (x, y) = (place(i), place(j));
            let d = unit(along(along(lamp.center, lamp.across, x), lamp.upwards, y));
            let (cover, _) = lamp.seen(d);
            let light = studio.radiance(d)[0] - (1.0 - cover) * surround(d);
            if cover > 0.0 {
                summed += f64::from(light / (1.0 + x * x + y * y).powi(2));
            }
        }
        let summed = summed * 4.0 / f64::from(n).powi(2);
        let told = f64::from(key.irradiance[0]);
        assert!((told / summed - 1.0).abs() < 0.01, "{told}, not {summed}");
        // Stronger than the directional light of any shape, which the angle map relies on.
        for shape in [
            crate::render::Shape::Sphere,
            crate::render::Shape::Capsule,
            crate::render::Shape::Panel,
        ] {
            assert!(key.irradiance[0] > DirectionalLight::key(shape).irradiance[0]);
        }
    }
}
