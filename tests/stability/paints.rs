//! Paints made by hand, every number of which depends on a seed and on nothing else.

use carpaint::blend::{Blend, BlendSettings, Ingredient, RealisationWeights, Realised};
use carpaint::color::Lab;
use carpaint::paint::{
    AngleGrid, CarPaint, Coat, ColorTable, Direction, FlakeTexture, Flakes, Limits, Lobe,
};

/// Half angles of ordinary slices.
pub const H: &[f64] = &[0.0, 12.0, 30.0];
/// Difference angles of ordinary slices.
pub const D: &[f64] = &[0.0, 25.0];

/// Numbers in `0..1` from a seed (`SplitMix64`).
#[derive(Clone)]
pub struct Stream(pub u64);

impl Stream {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

pub fn grid(degrees: &[f64]) -> AngleGrid {
    AngleGrid::new(degrees.to_vec()).expect("ascending")
}

/// A unit vector of this height above the horizon, at an azimuth.
pub fn at(z: f64, azimuth: f64) -> Direction {
    let r = ((1.0 - z) * (1.0 + z)).sqrt();
    [r * azimuth.cos(), r * azimuth.sin(), z]
}

/// One cluster: probability and the two corners of its box.
pub type Cluster = (f64, [f32; 3], [f32; 3]);

/// Flakes with the same clusters in every slice.
pub fn flakes(theta_h: &[f64], theta_d: &[f64], clusters: &[Cluster]) -> Flakes {
    let slices = theta_h.len() * theta_d.len();
    let repeated = || (0..slices).flat_map(|_| clusters);
    Flakes {
        theta_h: grid(theta_h),
        theta_d: grid(theta_d),
        offsets: (0..=slices).map(|k| (k * clusters.len()) as u32).collect(),
        probability: repeated().map(|c| c.0).collect(),
        lower: repeated().map(|c| c.1).collect(),
        upper: repeated().map(|c| c.2).collect(),
        texture: FlakeTexture {
            texel_um: 20.0,
            grain_um: 45.0,
            lifetime_deg: [4.0, 20.0],
            persistence_deg: [8.0, 40.0],
        },
    }
}

/// A coated or bare metallic with seven clusters in each slice.
pub fn metallic(seed: u64, theta_h: &[f64], theta_d: &[f64]) -> CarPaint {
    let mut random = Stream(seed);
    let mut made = flakes(theta_h, theta_d, &[]);
    made.texture.grain_um = random.within(20.0, 60.0);
    made.offsets = vec![0].into();
    for _ in 0..made.slices() {
        let masses: Vec<f64> = (0..7).map(|_| random.within(0.05, 1.0)).collect();
        let sum: f64 = masses.iter().sum();
        for mass in masses {
            let corner = [(0.0, 60.0), (-20.0, 20.0), (-20.0, 20.0)]
                .map(|(low, high)| random.within(low, high) as f32);
            made.probability.push(mass / sum);
            made.lower.push(corner);
            made.upper
                .push(corner.map(|c| c + random.within(0.0, 9.0) as f32));
        }
        made.offsets.push(made.probability.len() as u32);
    }
    CarPaint {
        flakes: Some(made),
        ..solid(seed.wrapping_add(1 << 32))
    }
}

/// A paint without flakes: diffuse, three lobes, a table of four colors, a coat for two seeds of three.
pub fn solid(seed: u64) -> CarPaint {
    let mut random = Stream(seed);
    let nodes = (0..4)
        .map(|_| Lab {
            l: random.within(40.0, 90.0),
            a: random.within(0.0, 30.0),
            b: random.within(-30.0, 0.0),
        })
        .collect();
    let overall = Lab {
        l: 70.0,
        a: 0.0,
        b: 0.0,
    };
    CarPaint {
        coat: (!seed.is_multiple_of(3)).then(|| Coat {
            ior: random.within(1.4, 1.6),
            roughness: 0.02,
            thickness_um: None,
        }),
        diffuse: [0; 3].map(|_| random.within(0.0, 0.5)),
        lobes: (0..3)
            .map(|k| Lobe {
                weight: [0; 3].map(|_| random.within(0.01, 0.1)),
                alpha: 0.08 * 2.0_f64.powi(k) * random.within(1.0, 2.0),
                f0: random.unit(),
            })
            .collect(),
        color_table: ColorTable::new(grid(&[0.0, 50.0]), grid(&[0.0, 40.0]), nodes, overall)
            .expect("one color a node"),
        flakes: None,
    }
}

/// Lightness of a gray whose linear light is `y`.
fn gray(y: f64) -> Lab {
    Lab::from_rgb([y; 3])
}

/// A paint whose table and slices go from far below a half's smallest number to far above its largest.
pub fn extreme() -> CarPaint {
    let mut paint = metallic(5, &[0.0, 20.0, 40.0], &[0.0, 30.0]);
    let light = [0.0, 1e-9, 3e-8, 5e-5, 6.2e-5, -4e-5, 1.0, 5000.0];
    let nodes: Vec<Lab> = light.iter().map(|y| gray(*y)).collect();
    let angles = grid(&[0.0, 10.0, 30.0, 60.0]);
    paint.color_table =
        ColorTable::new(angles, grid(&[0.0, 45.0]), nodes, gray(0.5)).expect("eight nodes");
    let point = |k: u8| {
        let tiny = 1e-6 * 10.0_f32.powi(i32::from(k % 6));
        (
            0.125,
            [tiny, -tiny, 3e-7],
            [tiny + f32::from(k) * 280.0, tiny, 1999.0],
        )
    };
    let boxes: Vec<_> = (0..8).map(point).collect();
    paint.flakes = Some(flakes(&[0.0, 20.0, 40.0], &[0.0, 30.0], &boxes));
    paint.validate(&Limits::default()).expect("within bounds");
    paint
}

pub fn blend(paints: &[&CarPaint]) -> Blend {
    let names = ["first", "second", "third", "fourth", "fifth"];
    let ingredients: Vec<Ingredient<'_>> = paints
        .iter()
        .zip(names)
        .map(|(paint, name)| Ingredient { name, paint })
        .collect();
    Blend::new(&ingredients, &BlendSettings::default(), &|_| ()).expect("these paints blend")
}

pub fn realise(blend: &Blend, weights: &[f64]) -> Realised {
    blend
        .realise(&RealisationWeights::uniform(weights.to_vec()))
        .expect("one finite weight a paint")
}

/// Direction pairs over the whole hemisphere, some of them near the mirror.
pub fn pairs(count: usize) -> Vec<(Direction, Direction)> {
    let mut random = Stream(77);
    (0..count)
        .map(|k| {
            let wi = at(
                random.within(0.05, 1.0),
                random.within(0.0, std::f64::consts::TAU),
            );
            let wo = if k % 3 == 0 {
                let tilt = random.within(-0.02, 0.02);
                let turned = [-wi[0] + tilt, -wi[1], wi[2]];
                let length = turned.iter().map(|v| v * v).sum::<f64>().sqrt();
                turned.map(|v| v / length)
            } else {
                at(
                    random.within(0.05, 1.0),
                    random.within(0.0, std::f64::consts::TAU),
                )
            };
            (wi, wo)
        })
        .collect()
}
