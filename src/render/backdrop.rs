//! What the camera sees beside the object.

use super::ground::Ground;
use super::scene::{Background, Scene};
use super::vector::{Vec3, smoothstep};

/// Linear light from a direction in which the object is not met.
///
/// `place` is −1 to 1 from the middle to the nearer edges of the picture, y upwards.
pub(super) fn behind(scene: &Scene, ground: &Ground, direction: Vec3, place: [f32; 2]) -> Vec3 {
    if scene.background == Background::Environment {
        return scene.environment.radiance(direction);
    }
    let shade =
        Ground::meet(scene.camera.origin, direction).map_or(0.0, |[x, z]| ground.occlusion(x, z));
    sweep(place, shade)
}

/// A neutral sweep: a pool of light behind the object, darker corners, the object's shadow on the floor.
fn sweep(place: [f32; 2], shade: f32) -> Vec3 {
    let out = (place[0] * place[0] * 0.7 + (place[1] - 0.15).powi(2)).sqrt();
    let light = 0.40 - 0.24 * smoothstep(0.0, 1.5, out) + 0.07 * smoothstep(-0.2, -1.0, place[1]);
    [light * (1.0 - 0.86 * shade); 3]
}
