//! Writes bundles, GLBs and what they must shade to: the input of the browser tests.
//!
//! `cargo run --example export_fixture -- DIR`. The paints are made up: a silver under a coat with skewed, colored flakes
//! that show every branch of the shader, the same with a hue that travels, and a solid without coat; and blends of them.

mod blend_fixture;

use std::path::Path;

use carpaint::color::Lab;
use carpaint::export::{About, ExportSettings, Precision, bundle, glb, material_json};
use carpaint::paint::{
    AngleGrid, CarPaint, Chi, Coat, ColorTable, Direction, FlakeSampler, FlakeTexture, Flakes,
    Lobe, Provenance, RandomTexture, Reflectance, half_angles, refract,
};
use serde_json::{Value, json};

type Anything = Box<dyn std::error::Error>;

fn main() -> Result<(), Anything> {
    let folder = std::env::args().nth(1).ok_or("name a folder to write to")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    for (name, paint) in [
        ("silver", silver()?),
        ("travel", travelling()?),
        ("solid", solid()?),
    ] {
        let about = about(name);
        write_each_precision(folder, name, |settings| {
            Ok(bundle(&paint, &about, settings)?)
        })?;
        let settings = ExportSettings::default();
        std::fs::write(
            folder.join(format!("{name}.json")),
            material_json(&paint, &about, &settings)?,
        )?;
        std::fs::write(folder.join(format!("{name}.glb")), glb(&paint, &about)?)?;
        std::fs::write(
            folder.join(format!("{name}_expected.json")),
            serde_json::to_vec(&expected(&paint, tile_of(&paint)))?,
        )?;
    }
    blend_fixture::write(folder)
}

/// Writes a bundle in every precision there is.
fn write_each_precision(
    folder: &Path,
    name: &str,
    bundle: impl Fn(&ExportSettings) -> Result<Vec<u8>, Anything>,
) -> Result<(), Anything> {
    for (suffix, precision) in [
        ("f32", Precision::F32),
        ("f16", Precision::F16),
        ("8bit", Precision::Eight),
    ] {
        let settings = ExportSettings {
            precision,
            ..ExportSettings::default()
        };
        let file = folder.join(format!("{name}_{suffix}.zip"));
        std::fs::write(file, bundle(&settings)?)?;
    }
    Ok(())
}

fn about(name: &str) -> About {
    About {
        name: name.into(),
        provenance: Provenance {
            source: "made up".into(),
            ..Provenance::default()
        },
        report: json!({"warnings": []}),
    }
}

fn tile_of(paint: &CarPaint) -> Option<&'static RandomTexture> {
    let flakes = paint.flakes.as_ref()?;
    Some(RandomTexture::of(&flakes.texture))
}

/// What the shader must find, with flakes scattered as this tile says.
fn expected(paint: &CarPaint, tile: Option<&RandomTexture>) -> Value {
    let reflectance = Reflectance::new(paint);
    let mut random = Random(7);
    let pairs: Vec<Value> = (0..50)
        .map(|k| {
            // Half of the pairs near the mirror direction, where paint changes fastest.
            let wi = random.direction();
            let wo = if k % 2 == 0 {
                random.direction()
            } else {
                random.near([-wi[0], -wi[1], wi[2]])
            };
            let (f, mirror) = (
                reflectance.evaluate(wi, wo, Chi::Table),
                reflectance.mirror(wo),
            );
            let terms = reflectance.terms(wi, wo, Chi::Table);
            let base = terms.map_or([0.0; 3], |terms| terms.base);
            let mean = terms.map_or([0.0; 3], |terms| terms.flakes);
            json!({"wi": wi, "wo": wo, "f": f, "mirror": mirror, "base": base, "flakes": mean})
        })
        .collect();
    let (Some(flakes), Some(tile)) = (&paint.flakes, tile) else {
        return json!({"pairs": pairs, "slices": [], "texels": []});
    };
    let columns = flakes.theta_d.len();
    let slices: Vec<Value> = (0..flakes.slices())
        .map(|k| {
            let angles = [
                flakes.theta_h.degrees()[k / columns],
                flakes.theta_d.degrees()[k % columns],
            ];
            json!({"angles": angles, "mean": flakes.slice_at(k).mean()})
        })
        .collect();
    let sampler = FlakeSampler::new(flakes);
    let texels: Vec<Value> = (0..400)
        .map(|_| {
            let (x, y) = (random.within(-900, 900), random.within(-900, 900));
            let (wi, wo) = (random.direction(), random.direction());
            let ior = paint.coat.map_or(1.0, |coat| coat.ior);
            let half = half_angles(refract(wi, ior), refract(wo, ior));
            // The angles as a shader takes them.
            #[allow(clippy::cast_possible_truncation)]
            let angles = [half.theta_h.to_degrees(), half.theta_d.to_degrees()].map(|a| a as f32);
            let cell = tile.at(x, y);
            let color = sampler.color(cell, angles[0], angles[1]);
            json!({"texel": [x, y], "cell": cell, "angles": angles, "color": color})
        })
        .collect();
    json!({"pairs": pairs, "slices": slices, "texels": texels})
}

fn solid() -> Result<CarPaint, Anything> {
    Ok(CarPaint {
        coat: None,
        diffuse: [0.4, 0.05, 0.03],
        lobes: vec![Lobe {
            weight: [0.02, 0.021, 0.022],
            alpha: 0.06,
            f0: 0.3,
        }],
        color_table: ColorTable::white(),
        flakes: None,
    })
    .and_then(checked)
}

fn silver() -> Result<CarPaint, Anything> {
    let (theta_h, theta_d) = (
        AngleGrid::new(vec![0.0, 3.0, 7.0, 12.0, 20.0, 30.0, 45.0])?,
        AngleGrid::new(vec![0.0, 10.0, 20.0, 30.0, 41.0])?,
    );
    let nodes = (0..theta_h.len() * theta_d.len())
        .map(|k| {
            #[allow(clippy::cast_precision_loss)]
            let t = k as f64;
            Lab {
                l: 95.0 - t,
                a: 3.0 * (t / 5.0).sin(),
                b: t / 3.0 - 4.0,
            }
        })
        .collect();
    let overall = Lab {
        l: 80.0,
        a: 0.0,
        b: 2.0,
    };
    let color_table = ColorTable::new(theta_h.clone(), theta_d.clone(), nodes, overall)?;
    let mut flakes = Flakes {
        theta_h,
        theta_d,
        offsets: vec![0].into(),
        probability: vec![].into(),
        lower: vec![],
        upper: vec![],
        texture: FlakeTexture {
            texel_um: 20.0,
            grain_um: 34.0,
            lifetime_deg: [3.0, 6.0],
            persistence_deg: [6.0, 12.0],
        },
    };
    let mut random = Random(3);
    for k in 0..flakes.slices() {
        #[allow(clippy::cast_precision_loss)]
        let (row, count) = ((k / flakes.theta_d.len()) as f64, 20 + k % 31);
        let weights: Vec<f64> = (0..count).map(|_| 0.01 + random.unit().powi(6)).collect();
        let sum: f64 = weights.iter().sum();
        let mut lightness: Vec<f64> = (0..count)
            .map(|_| (140.0 - 12.0 * row) * random.unit().powi(3) - 3.0)
            .collect();
        lightness.sort_by(f64::total_cmp);
        for (weight, l) in weights.iter().zip(lightness) {
            let tint = [40.0 * (random.unit() - 0.5), 40.0 * (random.unit() - 0.5)];
            #[allow(clippy::cast_possible_truncation)]
            let center = [l, tint[0], tint[1]].map(|v| v as f32);
            #[allow(clippy::cast_possible_truncation)]
            let half = [
                5.0 * random.unit(),
                4.0 * random.unit(),
                4.0 * random.unit(),
            ]
            .map(|v| v as f32);
            flakes.probability.push(weight / sum);
            flakes
                .lower
                .push(std::array::from_fn(|axis| center[axis] - half[axis]));
            flakes
                .upper
                .push(std::array::from_fn(|axis| center[axis] + half[axis]));
        }
        flakes
            .offsets
            .push(u32::try_from(flakes.probability.len())?);
    }
    checked(CarPaint {
        coat: Some(Coat {
            ior: 1.5,
            roughness: 0.02,
            thickness_um: None,
        }),
        diffuse: [0.05, 0.055, 0.06],
        lobes: vec![
            Lobe {
                weight: [0.06, 0.065, 0.07],
                alpha: 0.35,
                f0: 0.8,
            },
            Lobe {
                weight: [0.05, 0.05, 0.05],
                alpha: 0.12,
                f0: 0.5,
            },
        ],
        color_table,
        flakes: Some(flakes),
    })
}

/// The silver, its flakes turning from green to violet with the half angle.
fn travelling() -> Result<CarPaint, Anything> {
    let mut paint = silver()?;
    let flakes = paint.flakes.as_mut().ok_or("the silver has flakes")?;
    for slice in 0..flakes.slices() {
        #[allow(clippy::cast_precision_loss)]
        let turn = 2.4 + 0.45 * (slice / flakes.theta_d.len()) as f64;
        #[allow(clippy::cast_possible_truncation)]
        let tint = [35.0 * turn.cos(), 35.0 * turn.sin()].map(|v| v as f32);
        for k in flakes.offsets[slice] as usize..flakes.offsets[slice + 1] as usize {
            for corner in [&mut flakes.lower[k], &mut flakes.upper[k]] {
                corner[1] += tint[0];
                corner[2] += tint[1];
            }
        }
    }
    checked(paint)
}

fn checked(paint: CarPaint) -> Result<CarPaint, Anything> {
    paint.validate(&carpaint::paint::Limits::default())?;
    Ok(paint)
}

/// A small generator of its own (xorshift64*), so that fixtures never change with a dependency.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        #[allow(clippy::cast_precision_loss)]
        let top = (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64;
        top / 9_007_199_254_740_992.0
    }

    fn within(&mut self, low: i32, high: i32) -> i32 {
        #[allow(clippy::cast_possible_truncation)]
        let step = (self.unit() * f64::from(high - low)) as i32;
        low + step
    }

    fn direction(&mut self) -> Direction {
        let (z, turn) = (0.1 + 0.9 * self.unit(), std::f64::consts::TAU * self.unit());
        let across = (1.0 - z * z).sqrt();
        [across * turn.cos(), across * turn.sin(), z]
    }

    fn near(&mut self, w: Direction) -> Direction {
        let moved: Direction = std::array::from_fn(|k| w[k] + 0.2 * (self.unit() - 0.5));
        let length = moved.iter().map(|v| v * v).sum::<f64>().sqrt();
        let unit = moved.map(|v| v / length);
        if unit[2] > 0.05 { unit } else { w }
    }
}
