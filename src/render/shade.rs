//! Light that leaves one point of the picture towards the camera.
//!
//! Per sample: the directional lights, one direction drawn by the environment's radiance and one by the paint's own
//! lobes, weighted by the balance heuristic (E. Veach 1997), and the coat's mirror image. All samples of a pixel are
//! one low-discrepancy set. Flakes belong to the texel under the sample, so a pixel averages the texels it covers.

use super::backdrop::behind;
use super::effects::{Effect, EffectPlan};
use super::environment::Source;
use super::ground::Ground;
use super::kernel::{Kernel, View};
use super::lanes::{self, Lanes, Lanes3, WIDTH, get, set, splat3, times};
use super::lens::Lens;
use super::light_table::LightTable;
use super::points::Points;
use super::scene::Scene;
use super::surface::{Hit, Surface};
use super::vector::{Frame, Vec3, add, along, scale, unit};
use crate::paint::{CarPaint, RandomTexture, cell_spacing};

/// A scene prepared for shading one paint.
pub(super) struct Shader<'a> {
    scene: &'a Scene,
    kernel: Kernel<'a>,
    surface: Surface,
    ground: Ground,
    lights: Vec<(Vec3, Vec3)>,
    light_table: Option<LightTable<'a>>,
    texture: Option<Texture>,
    /// Independent flakes a texel shows per solid angle of light.
    flakes_per_sr: f32,
    lens: Lens,
    coated: bool,
}

struct Texture {
    tile: &'static RandomTexture,
    texels_per_unit: f32,
    /// Side of a cell, texels, at least 1.
    cell: f32,
}

/// Samples of a pixel that are shaded together.
struct Batch {
    count: usize,
    index: [u32; WIDTH],
    point: Lanes3,
    normal: Lanes3,
    tangent: Lanes3,
    side: Lanes3,
    eye: Lanes3,
    cells: [u32; WIDTH],
    distance: Lanes,
}

impl Batch {
    fn new() -> Self {
        let zero = splat3([0.0; 3]);
        let (x, y, z) = (
            splat3([1.0, 0.0, 0.0]),
            splat3([0.0, 1.0, 0.0]),
            splat3([0.0, 0.0, 1.0]),
        );
        Self {
            count: 0,
            index: [0; WIDTH],
            point: zero,
            normal: z,
            tangent: x,
            side: y,
            eye: z,
            cells: [0; WIDTH],
            distance: Lanes::splat(1.0),
        }
    }

    fn push(&mut self, index: u32, hit: Hit, eye: Vec3, cell: u32) {
        let (k, frame) = (self.count, Frame::new(hit.normal, eye));
        self.index[k] = index;
        set(&mut self.point, k, hit.point);
        set(&mut self.normal, k, hit.normal);
        set(&mut self.tangent, k, frame.tangent);
        set(&mut self.side, k, frame.side);
        set(&mut self.eye, k, eye);
        self.cells[k] = cell;
        self.distance.0[k] = hit.distance;
        self.count += 1;
    }

    /// World directions in the frames of the points.
    fn local(&self, w: Lanes3) -> Lanes3 {
        [
            lanes::dot(w, self.tangent),
            lanes::dot(w, self.side),
            lanes::dot(w, self.normal),
        ]
    }

    /// World direction of a direction in the frame of one point.
    fn world(&self, k: usize, w: Vec3) -> Vec3 {
        let plane = along(scale(get(&self.tangent, k), w[0]), get(&self.side, k), w[1]);
        along(plane, get(&self.normal, k), w[2])
    }
}

/// Directions drawn from the environment per sample.
const fn lights(flakes: bool) -> u32 {
    // Without flakes a direction is cheap, and there is no sparkle to cover what noise is left.
    if flakes { 2 } else { 4 }
}

impl<'a> Shader<'a> {
    pub(super) fn new(paint: &'a CarPaint, scene: &'a Scene) -> (Self, EffectPlan) {
        let light_table = LightTable::new(&scene.environment);
        let plan = EffectPlan::new(paint, scene, light_table.is_some());
        let surface = Surface::new(scene.shape);
        let texture = paint.flakes.as_ref().map(|flakes| {
            let t = &flakes.texture;
            #[allow(clippy::cast_possible_truncation)] // pixels are f32
            let texels_per_unit = (scene.object_mm * 500.0 / t.texel_um) as f32;
            let tile = RandomTexture::of(t);
            #[allow(clippy::cast_possible_truncation)]
            let cell = cell_spacing(t.grain_um / t.texel_um).max(1.0) as f32;
            Texture {
                tile,
                texels_per_unit,
                cell,
            }
        });
        // Turning a light by an angle turns the half vector by half of it.
        #[allow(clippy::cast_possible_truncation)]
        let flakes_per_sr = paint.flakes.as_ref().map_or(1.0, |flakes| {
            let [h, d] = flakes.texture.persistence_deg.map(f64::to_radians);
            (1.0 / (4.0 * h * d)) as f32
        });
        let shader = Self {
            scene,
            flakes_per_sr,
            kernel: Kernel::new(paint),
            ground: Ground::new(&surface),
            surface,
            lights: scene
                .lights
                .iter()
                .map(|light| (unit(light.towards), light.irradiance))
                .collect(),
            light_table,
            texture,
            lens: Lens::new(scene),
            coated: plan.has(Effect::Coat),
        };
        (shader, plan)
    }

    /// Mean radiance of a pixel. Another seed looks at the same flakes through other sample points.
    pub(super) fn pixel(&self, x: u32, y: u32, seed: u32) -> Vec3 {
        match (self.coated, self.texture.is_some()) {
            (true, true) => self.pixel_of::<true, true>(x, y, seed),
            (true, false) => self.pixel_of::<true, false>(x, y, seed),
            (false, true) => self.pixel_of::<false, true>(x, y, seed),
            (false, false) => self.pixel_of::<false, false>(x, y, seed),
        }
    }

    fn pixel_of<const COATED: bool, const FLAKES: bool>(&self, x: u32, y: u32, seed: u32) -> Vec3 {
        let count = self.scene.samples_per_pixel;
        let points = Points::of_pixel(x, y, count, seed);
        let origin = self.scene.camera.origin;
        let mut sum = [0.0; 3];
        let mut batch = Batch::new();
        for index in 0..count {
            let (direction, place) = self.lens.ray(x, y, points.pair(index, 0));
            if let Some(hit) = self.surface.meet(origin, direction) {
                batch.push(
                    index,
                    hit,
                    scale(direction, -1.0),
                    self.cell::<FLAKES>(&hit),
                );
                if batch.count == WIDTH {
                    sum = add(sum, self.leaving::<COATED, FLAKES>(&batch, points));
                    batch.count = 0;
                }
            } else {
                let beside = behind(self.scene, &self.ground, direction, place);
                sum = add(sum, beside);
            }
        }
        if batch.count > 0 {
            sum = add(sum, self.leaving::<COATED, FLAKES>(&batch, points));
        }
        #[allow(clippy::cast_precision_loss)] // a few thousand
        scale(sum, 1.0 / count as f32).map(|v| v.max(0.0))
    }

    /// Number of the texel at a point.
    fn cell<const FLAKES: bool>(&self, hit: &Hit) -> u32 {
        match &self.texture {
            Some(texture) if FLAKES => {
                let [x, y] = self.surface.texel(hit, texture.texels_per_unit);
                texture.tile.at(x, y)
            }
            _ => 0,
        }
    }

    /// Light that leaves the points of a batch, summed.
    #[allow(clippy::too_many_lines)] // one loop over the lanes: what it holds in registers must not cross a call
    fn leaving<const COATED: bool, const FLAKES: bool>(
        &self,
        batch: &Batch,
        points: Points,
    ) -> Vec3 {
        let view = self.kernel.view::<COATED>(batch.local(batch.eye));
        let texels = if FLAKES {
            self.texels_seen(batch, &view)
        } else {
            Lanes::splat(1.0)
        };
        let mut sum = [Lanes::splat(0.0); 3];
        let mut shine =
            |light: Lanes3, power: Lanes3, drawn: Option<Lanes>, contrast: Option<Lanes>| {
                let answer =
                    self.kernel
                        .evaluate::<COATED, FLAKES>(&view, light, &batch.cells, contrast);
                let mut weight = light[2].at_least(0.0);
                if let Some(density) = drawn {
                    weight = weight / (density + answer.density);
                }
                sum = std::array::from_fn(|k| sum[k] + answer.f[k] * power[k] * weight);
            };
        let lone = self.contrast(texels);
        for &(towards, irradiance) in &self.lights {
            let light = batch.local(splat3(towards));
            if light[2].0.iter().any(|&z| z > 0.0) {
                shine(light, splat3(irradiance), None, Some(lone));
            }
        }
        if let Some(table) = &self.light_table {
            let count = lights(FLAKES);
            #[allow(clippy::cast_precision_loss)] // a few
            let count_f = count as f32;
            let facing: [usize; WIDTH] =
                std::array::from_fn(|k| LightTable::facing(get(&batch.normal, k)));
            // One of the directions carries the flakes' deviations for all of them; the others see the mean.
            let many = FLAKES.then(|| {
                let extent = Lanes(facing.map(|k| table.extent(k)));
                self.contrast(texels * (extent * self.flakes_per_sr).at_least(1.0))
            });
            for draw in 0..count {
                let contrast = many
                    .filter(|_| draw == 0)
                    .map(|contrast| contrast * count_f);
                let (mut directions, mut power) = (splat3([0.0, 0.0, 1.0]), splat3([0.0; 3]));
                let mut density = Lanes::splat(1.0);
                for (k, &facing) in facing.iter().enumerate() {
                    let drawn = table.sample(facing, points.one_of(draw, count, batch.index[k], 1));
                    set(&mut directions, k, drawn.direction);
                    set(&mut power, k, drawn.light);
                    density.0[k] = drawn.density;
                }
                let light = batch.local(directions);
                if view.draws {
                    shine(
                        light,
                        times(power, density),
                        Some(density * count_f),
                        contrast,
                    );
                } else {
                    shine(
                        light,
                        times(power, Lanes::splat(1.0 / count_f)),
                        None,
                        contrast,
                    );
                }
            }
            if view.draws {
                let (mut light, mut power) = (splat3([0.0, 0.0, 1.0]), splat3([0.0; 3]));
                let mut density = Lanes::splat(1.0);
                for (k, &facing) in facing.iter().enumerate().take(batch.count) {
                    let (pick, place) = (
                        points.pair(batch.index[k], 3)[0],
                        points.pair(batch.index[k], 2),
                    );
                    if let Some(drawn) = self.kernel.sample::<COATED>(&view, k, pick, place) {
                        let direction = batch.world(k, drawn);
                        set(&mut light, k, drawn);
                        set(&mut power, k, self.scene.environment.radiance(direction));
                        density.0[k] = table.density(facing, direction);
                    }
                }
                shine(light, power, Some(density * count_f), many);
            }
        }
        let mut light = [0.0; 3];
        let mirror = if COATED {
            self.kernel.mirror(&view)
        } else {
            Lanes::splat(0.0)
        };
        for k in 0..batch.count {
            light = add(light, get(&sum, k));
            if COATED && mirror.0[k] > 0.0 {
                let direction = along(
                    scale(get(&batch.normal, k), 2.0 * view.outer[2].0[k]),
                    get(&batch.eye, k),
                    -1.0,
                );
                light = along(
                    light,
                    self.around(get(&batch.point, k), direction),
                    mirror.0[k],
                );
            }
        }
        light
    }

    /// Independent texels under a pixel: its footprint on the paint over the size of a cell.
    fn texels_seen(&self, batch: &Batch, view: &View) -> Lanes {
        let Some(texture) = &self.texture else {
            return Lanes::splat(1.0);
        };
        let side = self.lens.pixel_size * texture.texels_per_unit / texture.cell;
        batch.distance * batch.distance * (side * side) / view.outer[2].at_least(0.05)
    }

    /// How much of a drawn flake's deviation from the mean a sample keeps.
    ///
    /// A pixel shows the mean of `independent` flakes but draws only as many as it has samples. Deviations are shrunk
    /// to what is left of them in the mean of all, so that sparkle keeps its contrast and sampling adds no noise of its
    /// own; with more samples than flakes every flake is drawn as it is.
    #[allow(clippy::cast_precision_loss)] // a few thousand
    fn contrast(&self, independent: Lanes) -> Lanes {
        let drawn = self.scene.samples_per_pixel as f32;
        (Lanes::splat(drawn) / independent.at_least(1.0))
            .min(Lanes::splat(1.0))
            .sqrt()
    }

    /// What a mirror on the object sees.
    fn around(&self, point: Vec3, direction: Vec3) -> Vec3 {
        let radiance = self.scene.environment.radiance(direction);
        if let (Source::Studio(_), Some([x, z])) = (
            self.scene.environment.source(),
            Ground::meet(point, direction),
        ) {
            let shade = 1.0 - 0.9 * self.ground.occlusion(x, z);
            // The floor's own radiance near the object, the studio's far from it.
            return scale(radiance, shade);
        }
        radiance
    }
}
