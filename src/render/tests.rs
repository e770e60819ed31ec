//! Tests of `render`.

use super::*;
use crate::paint::{AngleGrid, Coat, ColorTable, FlakeTexture, Flakes, Lobe};

fn solid(diffuse: f64, coat: Option<Coat>) -> CarPaint {
    CarPaint {
        coat,
        diffuse: [diffuse; 3],
        lobes: Vec::new(),
        color_table: ColorTable::white(),
        flakes: None,
    }
}

/// One slice: nineteen dark texels to one bright one.
fn sparkling() -> CarPaint {
    let flakes = Flakes {
        theta_h: AngleGrid::single(),
        theta_d: AngleGrid::single(),
        offsets: vec![0, 2].into(),
        probability: vec![0.95, 0.05].into(),
        lower: vec![[5.0, 0.0, 0.0], [120.0, 0.0, 0.0]],
        upper: vec![[9.0, 0.0, 0.0], [160.0, 0.0, 0.0]],
        texture: FlakeTexture {
            texel_um: 20.0,
            grain_um: 12.0,
            lifetime_deg: [3.0; 2],
            persistence_deg: [6.0; 2],
        },
    };
    let lobes = vec![Lobe {
        weight: [0.05; 3],
        alpha: 0.3,
        f0: 0.5,
    }];
    CarPaint {
        lobes,
        flakes: Some(flakes),
        ..solid(0.05, Some(Coat::smooth(1.5)))
    }
}

fn scene(size: u32, samples: u32) -> Scene {
    Scene {
        samples_per_pixel: samples,
        ..Scene::new(Shape::Sphere, [size, size])
    }
}

fn film(paint: &CarPaint, scene: &Scene) -> Film {
    render(paint, scene, &Limits::default(), &|_| {})
        .expect("a valid scene")
        .film
}

/// Mean and relative deviation from a plane-free local mean, of luminance over a block in the middle of a ball.
fn texture_of(film: &Film, size: usize) -> f32 {
    let at = |x: usize, y: usize| film.pixels()[y * film.width() as usize + x][1];
    let from = film.width() as usize / 2 - size / 2;
    let (mut sum, mut count) = (0.0, 0.0);
    for y in from..from + size {
        for x in from..from + size {
            let around = (at(x - 1, y) + at(x + 1, y) + at(x, y - 1) + at(x, y + 1)) / 4.0;
            sum += (at(x, y) / around - 1.0).powi(2);
            count += 1.0;
        }
    }
    (sum / count).sqrt()
}

#[test]
fn a_white_furnace_gives_a_diffuse_paint_its_albedo() {
    let furnace = Scene {
        background: Background::Environment,
        ..scene(16, 64)
    }
    .in_environment(Environment::uniform([1.0; 3]));
    for pixel in film(&solid(0.6, None), &furnace).pixels() {
        // Pixels are object, surroundings, or a mixture.
        assert!((0.6 - 0.012..=1.0 + 1e-4).contains(&pixel[0]), "{pixel:?}");
    }
    let middle = film(&solid(0.6, None), &furnace).pixels()[8 * 16 + 8];
    assert!((middle[0] - 0.6).abs() < 0.006, "{middle:?}");
}

#[test]
fn under_a_coat_a_furnace_gives_no_more_than_it_got() {
    let furnace = scene(16, 256).in_environment(Environment::uniform([1.0; 3]));
    for roughness in [0.0, 0.05] {
        let coat = Coat {
            ior: 1.5,
            roughness,
            thickness_um: None,
        };
        for pixel in film(&solid(0.9, Some(coat)), &furnace).pixels() {
            assert!((0.5..=1.02).contains(&pixel[1]), "{roughness}: {pixel:?}");
        }
    }
}

/// Rough coats approach the mirror image: the same furnace, the same light.
#[test]
fn a_narrow_highlight_carries_the_light_of_the_mirror_image() {
    let furnace = scene(8, 256).in_environment(Environment::uniform([1.0; 3]));
    let light = |roughness| {
        film(
            &solid(
                0.0,
                Some(Coat {
                    ior: 1.5,
                    roughness,
                    thickness_um: None,
                }),
            ),
            &furnace,
        )
        .pixels()[4 * 8 + 4][0]
    };
    assert!(
        (light(0.004) / light(0.0) - 1.0).abs() < 0.02,
        "{} {}",
        light(0.004),
        light(0.0)
    );
}

#[test]
fn pictures_are_the_same_on_any_number_of_threads() {
    let (paint, scene) = (sparkling(), scene(40, 8));
    let pictures: Vec<Vec<u8>> = [1, 2, 8]
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads");
            pool.install(|| film(&paint, &scene).to_exr().expect("encodes"))
        })
        .into();
    assert_eq!(pictures[0], pictures[1]);
    assert_eq!(pictures[0], pictures[2]);
}

#[test]
fn a_solid_color_does_not_sparkle_and_a_metallic_does() {
    let scene = Scene {
        object_mm: 8.0,
        ..scene(96, 64)
    };
    let calm = texture_of(&film(&solid(0.8, Some(Coat::smooth(1.5))), &scene), 20);
    let lively = texture_of(&film(&sparkling(), &scene), 20);
    assert!(calm < 0.015, "{calm}");
    assert!(lively > 4.0 * calm, "{lively} {calm}");
}

#[test]
fn flakes_add_their_mean_however_few_samples_see_them() {
    let mean = |samples| {
        let film = film(&sparkling(), &scene(48, samples));
        let middle: Vec<f32> = (14..34)
            .flat_map(|y| (14..34).map(move |x| y * 48 + x))
            .map(|k| film.pixels()[k][1])
            .collect();
        #[allow(clippy::cast_precision_loss)]
        let mean = middle.iter().sum::<f32>() / middle.len() as f32;
        mean
    };
    let (few, many) = (mean(4), mean(256));
    assert!((few / many - 1.0).abs() < 0.03, "{few} {many}");
}

#[test]
fn every_pixel_of_every_shape_is_finite_and_no_light_is_negative() {
    for shape in [Shape::Sphere, Shape::Capsule, Shape::Panel] {
        let scene = Scene {
            samples_per_pixel: 4,
            ..Scene::new(shape, [50, 34])
        };
        for pixel in film(&sparkling(), &scene).pixels() {
            assert!(
                pixel.iter().all(|v| v.is_finite() && *v >= 0.0),
                "{shape:?}: {pixel:?}"
            );
        }
    }
}

#[test]
fn the_report_says_what_was_left_out() {
    let report = render(&solid(0.5, None), &scene(8, 1), &Limits::default(), &|_| {})
        .expect("valid")
        .report;
    assert!(!report.plan.has(Effect::Flakes) && !report.plan.has(Effect::Coat));
    assert!(report.plan.has(Effect::Environment));
    let report = render(&sparkling(), &scene(8, 1), &Limits::default(), &|_| {})
        .expect("valid")
        .report;
    assert!(report.plan.has(Effect::Flakes) && report.plan.has(Effect::MirrorImage));
}

#[test]
fn a_scene_out_of_range_is_refused_by_field() {
    let refused =
        |scene: Scene| match render(&solid(0.5, None), &scene, &Limits::default(), &|_| {}) {
            Err(RenderError::Scene { field, .. }) => field,
            other => panic!("{other:?}"),
        };
    assert_eq!(refused(scene(0, 1)), "size");
    assert_eq!(refused(scene(8, 0)), "samples_per_pixel");
    assert_eq!(
        refused(Scene {
            exposure: f32::NAN,
            ..scene(8, 1)
        }),
        "exposure"
    );
    assert_eq!(
        refused(Scene {
            object_mm: 0.0,
            ..scene(8, 1)
        }),
        "object_mm"
    );
    let dark = DirectionalLight {
        towards: [0.0; 3],
        irradiance: [1.0; 3],
    };
    assert_eq!(
        refused(Scene {
            lights: vec![dark],
            ..scene(8, 1)
        }),
        "lights.towards"
    );
}

#[test]
fn no_light_at_all_is_black_not_an_error() {
    let night = scene(12, 2).in_environment(Environment::uniform([0.0; 3]));
    assert!(
        film(&sparkling(), &night)
            .pixels()
            .iter()
            .all(|p| *p == [0.0; 3])
    );
}

/// The truth is a picture of four thousand samples, whose own chance is a sixteenth.
#[test]
fn the_stated_chance_of_a_picture_is_its_distance_from_the_truth() {
    let paint = solid(0.4, Some(Coat::smooth(1.5)));
    let drawn =
        |samples| render(&paint, &scene(48, samples), &Limits::default(), &|_| {}).expect("valid");
    let (some, truth) = (drawn(8), drawn(2048));
    let exposure = scene(48, 8).exposure;
    let errors: Vec<f64> = (some.film.pixels().iter().zip(truth.film.pixels()))
        .map(|(x, y)| {
            crate::color::ciede2000(noise::shown(*x, exposure), noise::shown(*y, exposure))
        })
        .collect();
    #[allow(clippy::cast_precision_loss)]
    let actual = errors.iter().sum::<f64>() / errors.len() as f64;
    let stated = some.report.sampling;
    assert_eq!(stated.pixels, 12 * 12);
    assert!(
        (0.6..1.6).contains(&(stated.mean_delta_e / actual)),
        "{stated:?} {actual}"
    );
    assert!(truth.report.sampling.mean_delta_e < stated.mean_delta_e / 4.0);
    let bound = stated.flip_between_drawings.expect("drawn");
    let flip = difference(&some.film, &truth.film).flip;
    assert!((1.0..4.0).contains(&(bound / flip)), "{bound} {flip}");
}

#[test]
fn progress_reaches_the_end() {
    let highest = std::sync::Mutex::new(0.0_f32);
    let tell = |share: f32| {
        let mut highest = highest.lock().expect("unpoisoned");
        *highest = highest.max(share);
    };
    render(&solid(0.5, None), &scene(8, 1), &Limits::default(), &tell).expect("valid");
    assert_eq!(*highest.lock().expect("unpoisoned"), 1.0);
}

#[test]
fn texels_have_the_mean_and_the_size_that_was_asked_for() {
    let limits = Limits::default();
    let bytes = texels(&sparkling(), 0.0, 0.0, [128, 96], 3, &limits).expect("flakes");
    let (width, height, pixels) = film::tests::read_exr(&bytes);
    assert_eq!((width, height), (128, 96));
    let want = sparkling().flakes.expect("flakes").slice_at(0).mean()[1];
    #[allow(clippy::cast_precision_loss)]
    let mean = pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / pixels.len() as f64;
    assert!((mean / want - 1.0).abs() < 0.15, "{mean} {want}");
    assert!(matches!(
        texels(&solid(0.5, None), 0.0, 0.0, [8, 8], 3, &limits),
        Err(RenderError::NoFlakes)
    ));
    assert!(texels(&sparkling(), 91.0, 0.0, [8, 8], 3, &limits).is_err());
}
