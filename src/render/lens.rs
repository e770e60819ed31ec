//! Rays of the camera through places in the picture.

use super::scene::Scene;
use super::vector::{Vec3, along, cross, dot, sub, unit};

/// Rays of the camera.
pub(super) struct Lens {
    right: Vec3,
    up: Vec3,
    forward: Vec3,
    half: [f32; 2],
    pixel: [f32; 2],
    /// Side of a pixel at distance 1.
    pub(super) pixel_size: f32,
}

impl Lens {
    #[allow(clippy::cast_precision_loss)] // picture sizes
    pub(super) fn new(scene: &Scene) -> Self {
        let forward = unit(sub(scene.camera.target, scene.camera.origin));
        let level = cross(forward, [0.0, 1.0, 0.0]);
        let right = if dot(level, level) > 1e-9 {
            unit(level)
        } else {
            [1.0, 0.0, 0.0]
        };
        let tangent = (scene.camera.field_of_view_deg.to_radians() / 2.0).tan();
        let [width, height] = scene.size.map(|s| s as f32);
        let short = width.min(height);
        let half = [tangent * width / short, tangent * height / short];
        Self {
            right,
            up: cross(right, forward),
            forward,
            half,
            pixel: [2.0 / width, 2.0 / height],
            pixel_size: 2.0 * tangent / short,
        }
    }

    /// Direction through a place in a pixel, and the place in the picture.
    #[allow(clippy::cast_precision_loss)]
    pub(super) fn ray(&self, x: u32, y: u32, [u, v]: [f32; 2]) -> (Vec3, [f32; 2]) {
        let place = [
            (x as f32 + u) * self.pixel[0] - 1.0,
            1.0 - (y as f32 + v) * self.pixel[1],
        ];
        let sideways = along(self.forward, self.right, place[0] * self.half[0]);
        let short = self.half[0].min(self.half[1]);
        let even = [
            place[0] * self.half[0] / short,
            place[1] * self.half[1] / short,
        ];
        (
            unit(along(sideways, self.up, place[1] * self.half[1])),
            even,
        )
    }
}
