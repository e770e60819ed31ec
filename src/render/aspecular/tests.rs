//! Tests of `aspecular`.

use super::*;
use crate::render::{DirectionalLight, Environment, Shape};

fn map(scene: &Scene) -> AspecularMap {
    aspecular(scene, &Limits::default(), &|_| {}).expect("a valid scene")
}

#[test]
fn the_angle_is_that_of_an_instrument_whatever_the_plane() {
    let at = |deg: f32, turn: f32| {
        let (s, c) = deg.to_radians().sin_cos();
        let (across, along) = turn.to_radians().sin_cos();
        [s * along, s * across, c]
    };
    let up = [0.0, 0.0, 1.0];
    // Light at 45°, mirrored to −45°; a reading of 15 looks from −30°, one of −15 from −60°.
    for (view, want) in [
        (-45.0, 0.0),
        (-30.0, 15.0),
        (-60.0, 15.0),
        (30.0, 75.0),
        (65.0, 110.0),
    ] {
        for turn in [0.0, 77.0] {
            let got = aspecular_deg(up, at(45.0, turn), at(view, turn));
            assert!((got - want).abs() < 1e-3, "{view}: {got}");
        }
    }
    assert!((aspecular_deg(up, up, [0.0, 0.0, -1.0]) - 180.0).abs() < 1e-3);
}

#[test]
fn a_light_behind_the_eye_is_mirrored_in_the_middle_of_a_ball() {
    let mut scene = Scene::new(Shape::Sphere, [65, 65]);
    scene.camera.origin = [0.0, 0.0, 7.0];
    scene.camera.target = [0.0; 3];
    scene.lights[0].towards = [0.0, 0.0, 2.0];
    scene.lights[0].irradiance = [2.0; 3];
    let map = map(&scene);
    let at = |x: usize, y: usize| map.degrees()[y * 65 + x];
    assert!(at(32, 32) < 0.1, "{}", at(32, 32));
    assert_eq!(at(0, 0), BESIDE);
    // The same at the same distance from the middle, and rising outwards.
    for k in 1..25 {
        assert!((at(32 + k, 32) - at(32, 32 - k)).abs() < 0.02);
        assert!(at(32 + k, 32) > at(31 + k, 32));
    }
    assert_eq!(map.report().main_light, MainLight::DirectionalLight);
    let [least, most] = map.report().range_deg.expect("a ball");
    assert!(
        least < 0.1 && most > 110.0 && most <= 180.0,
        "{least} {most}"
    );
}

#[test]
fn bands_have_their_colors_and_the_background_is_the_pictures() {
    let scene = Scene::new(Shape::Sphere, [96, 96]);
    let map = map(&scene);
    let pixels: Vec<[u8; 3]> = map.srgb8.chunks(3).map(|p| [p[0], p[1], p[2]]).collect();
    for band in &BANDS[..4] {
        assert!(pixels.contains(&band.srgb), "{band:?}");
    }
    let white = crate::paint::CarPaint {
        coat: None,
        diffuse: [0.5; 3],
        lobes: Vec::new(),
        color_table: crate::paint::ColorTable::white(),
        flakes: None,
    };
    let picture = crate::render::render(&white, &scene, &Limits::default(), &|_| {});
    let picture = picture.expect("a valid scene").film.to_srgb8();
    for (k, (got, want)) in pixels.iter().zip(picture.chunks(3)).enumerate() {
        if k / 96 < 4 {
            assert!(
                got.iter().zip(want).all(|(a, b)| a.abs_diff(*b) <= 1),
                "{k}"
            );
        }
    }
}

#[test]
fn the_main_light_is_the_one_of_the_largest_irradiance() {
    let towards = [0.3, 0.9, 0.1];
    let light = |irradiance: f32| DirectionalLight {
        towards,
        irradiance: [irradiance; 3],
    };
    let studio = Environment::studio().main_light();
    let bright = studio.irradiance[0];
    for (lights, main) in [
        (vec![], MainLight::Environment),
        (vec![light(0.99 * bright)], MainLight::Environment),
        (vec![light(1.01 * bright)], MainLight::DirectionalLight),
        (
            vec![light(0.0), light(2.0 * bright)],
            MainLight::DirectionalLight,
        ),
    ] {
        let mut scene = Scene::new(Shape::Capsule, [24, 16]);
        scene.lights = lights;
        let told = map(&scene);
        let want = match main {
            MainLight::Environment => studio.towards,
            MainLight::DirectionalLight => unit(towards),
        };
        let report = told.report();
        assert_eq!((report.main_light, report.towards), (main, want));
        assert_eq!(report.candidates.len(), scene.lights.len() + 1);
        let last = report.candidates[scene.lights.len()];
        assert_eq!(last.light, MainLight::Environment);
        assert_eq!(last.irradiance, studio.irradiance);
        // Alone, the same light gives the same angles.
        scene.environment = Environment::uniform([1.0; 3]);
        scene.lights = vec![DirectionalLight {
            towards: want,
            irradiance: [0.1; 3],
        }];
        assert_eq!(told.degrees(), map(&scene).degrees());
    }
}

#[test]
fn the_file_holds_the_angles_in_one_channel() {
    use exr::prelude::{ReadChannels, ReadLayers, read};
    let map = map(&Scene::new(Shape::Panel, [20, 14]));
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(map.to_exr().expect("encodes")))
        .expect("reads back");
    let channels = image.layer_data.channel_data.list;
    assert_eq!(channels.len(), 1);
    assert_eq!(channels[0].name.to_string(), "aspecular_deg");
    let values: Vec<f32> = channels[0].sample_data.values_as_f32().collect();
    assert_eq!(values, map.degrees());
    assert!(values.contains(&BESIDE) && values.iter().any(|&v| v > 0.0));
}
