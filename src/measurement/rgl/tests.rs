//! Tests of `rgl`.

use super::super::tensor::tests::tensor_file;
use super::*;

/// A small file with the given azimuths; `color` gives a color by azimuth and channel.
fn file(phi: &[f32], color: impl Fn(usize, usize) -> f32) -> Vec<u8> {
    let theta = [0.0, 0.8, 1.57];
    let n = phi.len();
    let vndf: Vec<f32> = (0..n * 3 * 16)
        .map(|k| 1.0 + f32::from(u8::try_from(k * 7 % 5).expect("small")))
        .collect();
    let colors: Vec<f32> = (0..n * 3 * 3 * 4)
        .map(|k| color(k / 36, k / 4 % 3))
        .collect();
    let n = n as u64;
    tensor_file(&[
        ("theta_i", &[3], &theta),
        ("phi_i", &[n], phi),
        ("ndf", &[2, 3], &[1.0, 0.5, 0.25, 1.0, 0.5, 0.25]),
        ("sigma", &[2, 2], &[1.0, 0.5, 1.0, 0.5]),
        ("vndf", &[n, 3, 4, 4], &vndf),
        ("rgb", &[n, 3, 3, 2, 2], &colors),
    ])
}

#[test]
fn an_even_color_is_the_microfacet_formula_whatever_the_warp() {
    let measured = RglMeasurement::read(&file(&[0.0], |_, c| [0.3, -0.2, 0.8][c])).expect("whole");
    let (wi, wo) = ([-0.5, 0.0, 0.75_f64.sqrt()], [0.5, 0.0, 0.75_f64.sqrt()]);
    // θi = 30°: σ at √(1/3) between 1 and 0.5; half vector along n, ndf 1.
    let sigma = 1.0 - 0.5 * (1.0_f64 / 3.0).sqrt();
    let rgb = measured.reflectance(wi, wo).expect("above the horizon");
    for (got, color) in rgb.iter().zip([0.3, -0.2, 0.8]) {
        let want = color / (4.0 * sigma * wo[2]);
        assert!((got - want).abs() < 1e-6, "{got} instead of {want}");
    }
    assert!(!measured.is_anisotropic());
}

#[test]
fn an_anisotropic_sample_is_averaged_over_azimuth() {
    let phi = [-3.0, -1.5, 0.0, 1.5, 3.0];
    let measured =
        RglMeasurement::read(&file(&phi, |p, _| f32::from(u8::try_from(p).expect("few"))))
            .expect("whole");
    let one = RglMeasurement::read(&file(&[0.0], |_, _| 1.0)).expect("whole");
    assert!(measured.is_anisotropic());
    let (wi, wo) = ([0.3, 0.1, 0.9_f64.sqrt()], [0.1, -0.3, 0.9_f64.sqrt()]);
    let (got, unit) = (
        measured.reflectance(wi, wo).expect("above"),
        one.reflectance(wi, wo).expect("above"),
    );
    // Trapezoid over 0, 1, 2, 3, 4 is 2; ndf and sigma do not change with azimuth here.
    assert!((got[0] / unit[0] - 2.0).abs() < 1e-6, "{got:?} {unit:?}");
}

#[test]
fn the_warp_is_the_integral_of_the_density() {
    let measured = RglMeasurement::read(&file(&[0.0], |_, _| 1.0)).expect("whole");
    let density = &measured.azimuths[0].densities[0];
    let read = |table: fn(&Density) -> &[f64], k: usize| table(density)[k];
    let (u, v) = (0.37, 0.81);
    let (x, y) = measured.sample_of(u, v, read).expect("positive density");
    // Midpoint sums of the bilinear density: the row's share up to u, and the share of rows up to v.
    let at = |u: f64, v: f64| {
        let c = measured.vndf.cell(u, v);
        let d = |r: usize, k: usize| density.values[(c.row + r) * 4 + c.column + k];
        (1.0 - c.y) * ((1.0 - c.x) * d(0, 0) + c.x * d(0, 1))
            + c.y * ((1.0 - c.x) * d(1, 0) + c.x * d(1, 1))
    };
    let n = 600;
    let middle = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
    let row = |v: f64, to: f64| (0..n).map(|k| at(middle(k) * to, v) * to).sum::<f64>();
    assert!((x - row(v, u) / row(v, 1.0)).abs() < 1e-5);
    let below: f64 = (0..n).map(|k| row(middle(k) * v, 1.0) * v).sum();
    let whole: f64 = (0..n).map(|k| row(middle(k), 1.0)).sum();
    assert!((y - below / whole).abs() < 1e-5, "{y} {}", below / whole);
}

#[test]
fn damage_is_named_by_field_and_value() {
    let error = |bytes: &[u8]| {
        RglMeasurement::read(bytes)
            .expect_err("damaged")
            .to_string()
    };
    assert!(error(b"nothing").contains("tensor_file"));
    let good = file(&[0.0], |_, _| 1.0);
    assert!(error(&good[..good.len() - 1]).contains("rgb"));
    let bad = file(&[0.0], |_, c| if c == 1 { f32::NAN } else { 1.0 });
    assert!(error(&bad).contains("rgb[4] is NaN"), "{}", error(&bad));
    assert!(error(&file(&[0.5, 0.1], |_, _| 1.0)).contains("phi_i[1] is 0.1"));
}

#[test]
fn nothing_is_measured_below_the_horizon() {
    let measured = RglMeasurement::read(&file(&[0.0], |_, _| 1.0)).expect("whole");
    assert_eq!(measured.reflectance([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]), None);
    assert_eq!(
        measured.reflectance([0.6, 0.0, -0.8], [0.0, 0.0, 1.0]),
        None
    );
    assert!(
        measured
            .reflectance([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])
            .is_some()
    );
}

#[test]
fn a_density_without_any_is_named() {
    let zero = [0.0; 32];
    for empty in ["ndf", "sigma", "vndf"] {
        let of = |name: &str| if name == empty { &zero } else { &[1.0; 32] };
        let bytes = tensor_file(&[
            ("theta_i", &[2], &[0.5, 1.0]),
            ("phi_i", &[1], &[0.0]),
            ("ndf", &[2, 2], &of("ndf")[..4]),
            ("sigma", &[2, 2], &of("sigma")[..4]),
            ("vndf", &[1, 2, 4, 4], of("vndf")),
            ("rgb", &[1, 2, 3, 2, 2], &[0.5; 24]),
        ]);
        let told = RglMeasurement::read(&bytes).map(|_| ());
        assert_eq!(told, Err(RglError::Empty(empty)));
    }
}
