//! Materials that must be met, and films that must be found or left out.

use super::*;
use crate::color::Lab;
use crate::export::glb::brdf::thin_film;
use crate::export::made_up::metallic;
use crate::paint::{AngleGrid, CarPaint, Coat, ColorTable, Lobe};

#[test]
fn what_gltf_can_say_it_says() {
    // A Lambertian base under a coat is a glTF material but for the coat's transmission.
    let paint = CarPaint {
        coat: None,
        diffuse: [0.3, 0.1, 0.05],
        lobes: vec![],
        color_table: ColorTable::white(),
        flakes: None,
    };
    let (_, loss) = fit(&Reflectance::new(&paint));
    assert!(loss.worst < 1.0, "{loss:?}");
}

#[test]
fn a_metallic_is_met_within_a_just_visible_difference() {
    let paint = metallic(8, 6, 20);
    let (material, loss) = fit(&Reflectance::new(&paint));
    assert!(loss.median < 3.0, "{loss:?} {material:?}");
}

/// Günther et al. 2005: diffuse; weights of three lobes; α; F0. The published flakes are not part of the fits.
const PUBLISHED: [(&str, [[f64; 3]; 6]); 4] = [
    (
        "silver",
        [
            [0.055, 0.063, 0.071],
            [0.065, 0.082, 0.088],
            [0.11, 0.11, 0.13],
            [0.008, 0.013, 0.015],
            [0.38, 0.17, 0.013],
            [1.0, 0.92, 0.9],
        ],
    ),
    (
        "gray",
        [
            [0.012, 0.015, 0.016],
            [0.062, 0.076, 0.08],
            [0.11, 0.12, 0.12],
            [0.0083, 0.015, 0.016],
            [0.39, 0.17, 0.013],
            [0.92, 0.87, 0.9],
        ],
    ),
    (
        "blue",
        [
            [0.0079, 0.023, 0.1],
            [0.0011, 0.0015, 0.0019],
            [0.025, 0.03, 0.043],
            [0.059, 0.074, 0.082],
            [0.15, 0.043, 0.02],
            [1.0, 0.094, 0.17],
        ],
    ),
    (
        "acrylic",
        [
            [0.42, 0.32, 0.1],
            [0.0, 0.0, 0.0],
            [0.028, 0.026, 0.006],
            [0.017, 0.0075, 0.0041],
            [0.88, 0.8, 0.015],
            [1.0, 0.9, 0.17],
        ],
    ),
];

#[test]
fn published_paints_are_met() {
    for (name, [diffuse, first, second, third, alpha, f0]) in PUBLISHED {
        let lobe = |k: usize, weight| Lobe {
            weight,
            alpha: alpha[k],
            f0: f0[k],
        };
        let lobes = vec![lobe(0, first), lobe(1, second), lobe(2, third)];
        let paint = CarPaint {
            coat: None,
            diffuse,
            lobes,
            color_table: ColorTable::white(),
            flakes: None,
        };
        let (material, loss) = fit(&Reflectance::new(&paint));
        assert!(loss.median < 3.0 && loss.worst < 10.0, "{name}: {loss:?}");
        assert!(
            material.clearcoat > 0.1 && material.clearcoat_roughness < 0.2,
            "{name} keeps its lacquer"
        );
    }
}

/// A paint whose base is a thin film: what a facet reflects has the film's color at its angle of incidence.
fn interference(ior: f64, thickness_nm: f64, coat: Option<Coat>) -> CarPaint {
    let angles = |n: u32, step: f64| {
        AngleGrid::new((0..n).map(|k| f64::from(k) * step).collect()).expect("ascending")
    };
    let (theta_h, theta_d) = (angles(1, 0.0), angles(19, 5.0));
    let color = |incidence_deg: &f64| {
        let cosine = incidence_deg.to_radians().cos();
        Lab::from_rgb(thin_film(ior, thickness_nm, cosine, [0.3; 3]))
    };
    let nodes: Vec<Lab> = theta_d.degrees().iter().map(color).collect();
    let white = Lab::from([100.0, 0.0, 0.0]);
    CarPaint {
        coat,
        diffuse: [0.0; 3],
        lobes: vec![Lobe {
            weight: [0.25; 3],
            alpha: 0.6,
            f0: 1.0,
        }],
        color_table: ColorTable::new(theta_h, theta_d, nodes, white).expect("fits"),
        flakes: None,
    }
}

#[test]
fn a_hue_that_stays_gets_no_film() {
    let (material, _) = fit(&Reflectance::new(&metallic(8, 6, 20)));
    assert_eq!(material.iridescence, 0.0);
}

#[test]
fn a_film_is_chosen_where_it_brings_a_travelling_hue_nearer() {
    let paint = interference(1.6, 600.0, None);
    let reflectance = Reflectance::new(&paint);
    let targets = targets(&reflectance);
    assert!(hue_travels(&targets));
    let plain = fit_plain(&reflectance, &targets);
    let plain_loss = loss(&plain.material, &reflectance, None);
    let (material, loss) = fit(&reflectance);
    assert!(material.iridescence > 0.2, "{material:?}");
    assert!((100.0..=1200.0).contains(&material.iridescence_thickness_nm));
    assert!(
        loss.median < 0.5 * plain_loss.median && loss.worst < plain_loss.worst,
        "{loss:?}, without a film {plain_loss:?}"
    );
    // It is the film that does it: without it the same material is far off.
    let bare = GltfMaterial {
        iridescence: 0.0,
        ..material
    };
    assert!(super::loss(&bare, &reflectance, None).median > 2.0 * loss.median);
}

#[test]
fn a_film_that_hardly_helps_is_left_out_though_the_hue_travels() {
    let paint = interference(1.8, 400.0, Some(Coat::smooth(1.5)));
    let reflectance = Reflectance::new(&paint);
    let targets = targets(&reflectance);
    assert!(hue_travels(&targets));
    let plain = fit_plain(&reflectance, &targets);
    let film = fit_film(&plain, &targets, 1.0);
    assert!(
        plain.merit > GOOD_ENOUGH && film.merit < plain.merit,
        "a film was worth a try: {} to {}",
        plain.merit,
        film.merit
    );
    assert_eq!(fit(&reflectance).0, plain.material);
}

/// Along a walk as a derivative takes it, and from film to film.
#[test]
fn what_is_kept_of_films_is_what_they_reflect() {
    let paint = interference(1.8, 400.0, Some(Coat::smooth(1.5)));
    let targets = targets(&Reflectance::new(&paint));
    let fixed = GltfMaterial::default();
    let problem = Fitting::new(&targets, Layout::Film, fixed, 1.0);
    let base = vec![0.2, 0.3, 0.4, 0.1, 0.2, 0.3, 0.25, 0.4, 1.8, 400.0];
    let mut out = Vec::new();
    for by in [1.0, 1.01, 0.9] {
        for k in 0..=base.len() {
            let mut x = base.clone();
            x.iter_mut().skip(k).take(1).for_each(|v| *v *= by);
            problem.residuals(&x, &mut out);
            let material = problem.material(&x);
            for (t, own) in targets.iter().zip(out.chunks(3)) {
                let shown = reflected(material.at(&t.cosines));
                let wanted = t.metric.difference(t.lab, shown);
                assert_eq!(own, wanted.map(|d| d * t.weight.sqrt()), "{k} by {by}");
            }
        }
    }
}
