//! What is drawn: an object of physical size, its lights, its surroundings and the camera.
//!
//! World units are half the object's size; y is up; the object stands on the floor `y = −1`. The default object is a
//! 40 mm ball, close enough that at 512 x 512 a pixel sees about 0.09 mm of paint, some twenty texels: the brightest
//! flakes of a metallic stand out, the others blend, as on a paint chip held before the eye.

use super::RenderError;
use super::environment::Environment;
use super::surface::Shape;
use super::vector::Vec3;
use crate::paint::Limits;

/// A scene, without its paint.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What is painted.
    pub shape: Shape,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples_per_pixel: u32,
    /// Size of the object in millimetres: diameter of the ball, length of capsule and panel.
    pub object_mm: f64,
    /// Lights of one direction each. They make flakes sparkle; a mirror shows no image of them.
    pub lights: Vec<DirectionalLight>,
    /// Light from everywhere else.
    pub environment: Environment,
    /// What the camera sees beside the object.
    pub background: Background,
    /// Where it is seen from.
    pub camera: Camera,
    /// Factor on light before tone mapping; files of linear light are not exposed.
    pub exposure: f32,
    /// Seed of the sample points.
    pub seed: u32,
}

/// Light of a single direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Towards the light; any length above 0.
    pub towards: Vec3,
    /// Irradiance on a surface that faces the light, linear sRGB.
    pub irradiance: Vec3,
}

/// What is behind the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Background {
    /// A neutral sweep, lighter towards the floor, with the object's soft shadow.
    #[default]
    Sweep,
    /// The environment itself.
    Environment,
}

/// A perspective camera; coordinates in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The eye.
    pub origin: Vec3,
    /// The point in the middle of the picture.
    pub target: Vec3,
    /// Full angle across the shorter side, degrees.
    pub field_of_view_deg: f32,
}

impl Scene {
    /// Samples per pixel unless told otherwise.
    pub const DEFAULT_SAMPLES: u32 = 64;

    /// A shape in the built-in studio with one key light.
    #[must_use]
    pub fn new(shape: Shape, size: [u32; 2]) -> Self {
        Self {
            shape,
            size,
            samples_per_pixel: Self::DEFAULT_SAMPLES,
            object_mm: 40.0,
            lights: vec![DirectionalLight::key(shape)],
            environment: Environment::studio(),
            background: Background::Sweep,
            camera: Camera::of(shape).framing(shape, size),
            // A ball shows its face in one place, a capsule along its side, a panel all over.
            exposure: match shape {
                Shape::Sphere => 1.08,
                Shape::Capsule => 0.93,
                Shape::Panel => 0.76,
            },
            seed: 1,
        }
    }

    /// The same scene in other surroundings: they are all the light there is, they are seen behind the object, and the
    /// exposure brings a white card lying in them to 0.8.
    #[must_use]
    pub fn in_environment(mut self, environment: Environment) -> Self {
        let level = environment.level();
        self.exposure = if level > 0.0 && level.is_finite() {
            0.8 / level
        } else {
            1.0
        };
        self.environment = environment;
        self.background = Background::Environment;
        self.lights.clear();
        self
    }

    /// Checks sizes and numbers.
    ///
    /// # Errors
    ///
    /// [`RenderError::Scene`] names the first field that is out of range.
    pub fn validate(&self, limits: &Limits) -> Result<(), RenderError> {
        let refuse =
            |field: &'static str, reason: String| Err(RenderError::Scene { field, reason });
        let [width, height] = self.size;
        if width == 0 || height == 0 || u64::from(width) * u64::from(height) > limits.pixels {
            return refuse(
                "size",
                format!(
                    "{width} x {height}, accepted are 1 to {} pixels",
                    limits.pixels
                ),
            );
        }
        if !(1..=limits.samples).contains(&self.samples_per_pixel) {
            let reason = format!(
                "{}, accepted is 1 to {}",
                self.samples_per_pixel, limits.samples
            );
            return refuse("samples_per_pixel", reason);
        }
        if !(0.1..=1e5).contains(&self.object_mm) {
            return refuse(
                "object_mm",
                format!("{}, accepted is 0.1 to 100000", self.object_mm),
            );
        }
        if !(self.exposure > 0.0 && self.exposure.is_finite()) {
            return refuse(
                "exposure",
                format!("{}, accepted is above 0", self.exposure),
            );
        }
        for light in &self.lights {
            let length2: f32 = light.towards.iter().map(|v| v * v).sum();
            if !(length2 > 0.0 && length2.is_finite()) {
                return refuse(
                    "lights.towards",
                    format!("{:?} is no direction", light.towards),
                );
            }
            if !light.irradiance.iter().all(|v| (0.0..=65504.0).contains(v)) {
                return refuse(
                    "lights.irradiance",
                    format!("{:?}, accepted is 0 to 65504", light.irradiance),
                );
            }
        }
        let Camera {
            origin,
            target,
            field_of_view_deg,
        } = self.camera;
        if !origin.iter().chain(&target).all(|v| v.is_finite()) || origin == target {
            return refuse("camera", format!("looks from {origin:?} to {target:?}"));
        }
        if !(0.1..=170.0).contains(&field_of_view_deg) {
            return refuse(
                "camera.field_of_view_deg",
                format!("{field_of_view_deg}, accepted is 0.1 to 170"),
            );
        }
        Ok(())
    }
}

impl DirectionalLight {
    /// The usual key light of a shape: on a ball inside the studio's, on a capsule 26 degrees above its middle, on a
    /// panel 39 degrees beside it, which would be all face otherwise. The studio's is the stronger on each.
    #[must_use]
    pub const fn key(shape: Shape) -> Self {
        match shape {
            Shape::Sphere => Self {
                towards: [-0.42, 0.50, 1.0],
                irradiance: [0.22; 3],
            },
            Shape::Capsule => Self {
                towards: [-0.36, 0.95, 0.90],
                irradiance: [0.22; 3],
            },
            Shape::Panel => Self {
                towards: [-0.80, 0.90, 0.30],
                irradiance: [0.50; 3],
            },
        }
    }
}

impl Camera {
    /// The usual view of a shape, a little from above.
    #[must_use]
    pub const fn of(shape: Shape) -> Self {
        match shape {
            Shape::Sphere => Self {
                origin: [0.0, 1.35, 7.0],
                target: [0.0, -0.10, 0.0],
                field_of_view_deg: 20.5,
            },
            Shape::Capsule => Self {
                origin: [-0.7, 1.9, 6.6],
                target: [0.0, -0.53, 0.0],
                field_of_view_deg: 18.0,
            },
            Shape::Panel => Self {
                origin: [-0.45, 0.30, 3.6],
                target: [0.0, -0.50, 0.0],
                field_of_view_deg: 34.0,
            },
        }
    }

    /// The camera, nearer where a picture has room above and below its shape: a capsule fills a square only across.
    #[must_use]
    #[allow(clippy::cast_precision_loss)] // picture sizes
    pub fn framing(self, shape: Shape, [width, height]: [u32; 2]) -> Self {
        let tall = match shape {
            Shape::Sphere => 1.0,
            Shape::Capsule => 0.68,
            Shape::Panel => 0.72,
        };
        let share = (height as f32 / width.max(1) as f32).clamp(tall, 1.0);
        let tangent = (self.field_of_view_deg.to_radians() / 2.0).tan();
        Self {
            field_of_view_deg: 2.0 * (tangent * share).atan().to_degrees(),
            ..self
        }
    }
}
