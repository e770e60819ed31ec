//! Color at its edges.

use carpaint::color::{D65_2, Lab, ciede2000};

/// Lab colors that break careless code: black, negative light, far above white, out of gamut, no chroma at all.
const HARD: [[f64; 3]; 9] = [
    [0.0, 0.0, 0.0],
    [-30.0, 0.0, 0.0],
    [8.0, 0.0, 0.0],
    [1900.0, 0.0, 0.0],
    [50.0, 200.0, -200.0],
    [50.0, -200.0, 200.0],
    [50.0, 1e-9, 0.0],
    [100.0, 0.0, -1e-9],
    [2000.0, 2000.0, -2000.0],
];

#[test]
fn lab_and_back_keeps_twelve_digits() {
    for lab in HARD {
        let back = Lab::from_xyz(Lab::from(lab).to_xyz(D65_2), D65_2).to_array();
        // The three f values are of the size of the largest of L/116, a/500, b/200; cube and cube root keep each to a
        // few ulp; a and b are differences of f times 500 and 200.
        let size = lab.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
        for (x, y) in back.iter().zip(lab) {
            assert!(
                (x - y).abs() <= 1e-12 * 5.0 * size.max(100.0),
                "{lab:?} became {back:?}"
            );
        }
    }
}

#[test]
fn differences_of_hard_colors_are_finite_and_symmetric() {
    for x in HARD {
        for y in HARD {
            let (forth, back) = (ciede2000(x.into(), y.into()), ciede2000(y.into(), x.into()));
            assert!(forth.is_finite() && forth >= 0.0, "{x:?} {y:?}: {forth}");
            // Hues exactly opposite may take either mean; none of these pairs but the two greens and purples do.
            if (x[1] * y[2] - x[2] * y[1]).abs() > 1e-6 {
                assert!(
                    (forth - back).abs() <= 1e-9 * forth.max(1.0),
                    "{x:?} {y:?}: {forth} {back}"
                );
            }
        }
    }
}

#[test]
fn a_hue_that_crosses_zero_degrees_is_a_small_step() {
    // Hues of 359.9° and 0.1° at chroma 40: an arc of 40 · 0.2° = 0.14, divided by the hue weight of about 1.5.
    let at = |degrees: f64| Lab {
        l: 50.0,
        a: 40.0 * degrees.to_radians().cos(),
        b: 40.0 * degrees.to_radians().sin(),
    };
    let step = ciede2000(at(359.9), at(0.1));
    assert!(step > 0.03 && step < 0.15, "{step}");
}
