//! Color at its edges.

use crate::paints::Stream;
use carpaint::color::{
    D65_2, Illuminant, Lab, Observer, WhitePoint, ciede2000, rgb_to_xyz, xyz_to_rgb,
};

/// Lab colors that break careless code: black, negative light, far above white, out of gamut, no chroma at all.
const HARD: [[f64; 3]; 11] = [
    [0.0, 0.0, 0.0],
    [-30.0, 0.0, 0.0],
    [8.0, 0.0, 0.0],
    [8.000_000_000_1, 1e-9, -1e-9],
    [1900.0, 0.0, 0.0],
    [50.0, 200.0, -200.0],
    [50.0, -200.0, 200.0],
    [50.0, 1e-9, 0.0],
    [100.0, 0.0, -1e-9],
    [2000.0, 2000.0, -2000.0],
    [-2000.0, -2000.0, 2000.0],
];

const KNEE: f64 = 6.0 / 29.0;

fn whites() -> [WhitePoint; 4] {
    [
        (Illuminant::D65, Observer::Two),
        (Illuminant::D65, Observer::Ten),
        (Illuminant::D50, Observer::Two),
        (Illuminant::D50, Observer::Ten),
    ]
    .map(|(light, eye)| WhitePoint::of(light, eye))
}

#[test]
fn lab_and_back_closes_to_rounding_under_every_white() {
    let mut random = Stream(6);
    let any = (0..20_000).map(|_| {
        let size = 10.0_f64.powf(random.within(-3.0, 3.3));
        [0; 3].map(|_| size * random.within(-1.0, 1.0))
    });
    let mut worst = 0.0_f64;
    for lab in HARD.into_iter().chain(any) {
        for white in whites() {
            let back = Lab::from_xyz(Lab::from(lab).to_xyz(white), white).to_array();
            // Each f, of the size of (L + 16)/116 + a/500, is rounded some six times on its way through cube and cube
            // root, which give back a relative error as it was: 3 EPS of it at the most. L is 116 of them, a and b are
            // 500 and 200 times the difference of two: 8.6 of a size beyond 100. Six roundings that fall either way are
            // √6 times half an EPS: 8.6 · 1.2 = 11 EPS of the size, and a half more.
            let size = lab.iter().fold(100.0_f64, |m, v| m.max(v.abs()));
            for (x, y) in back.iter().zip(lab) {
                worst = worst.max((x - y).abs() / (f64::EPSILON * size));
                assert!(
                    (x - y).abs() <= 16.0 * f64::EPSILON * size,
                    "{lab:?} became {back:?}"
                );
            }
        }
    }
    println!("worst: {worst} EPS of the size");
}

#[test]
fn light_to_lab_and_back_keeps_the_digits_of_the_brightest_channel() {
    let mut random = Stream(1);
    for k in 0..100_000 {
        let scale = 10.0_f64.powf(random.within(-12.0, 4.0));
        let negative = if k % 3 == 0 { -0.2 } else { 0.0 };
        let xyz = [0; 3].map(|_| scale * random.within(negative, 1.0));
        let back = Lab::from_xyz(xyz, D65_2).to_xyz(D65_2);
        // f of each channel comes back to a few EPS of the largest |f|, since a and b are differences to fy; light is its
        // cube, 3 f² of that, or on the linear branch 3 KNEE². Negative light is on the linear branch, where |f| grows
        // fast: that is what the condition number of the three together is.
        let compressed = |t: f64| {
            if t > KNEE.powi(3) {
                t.cbrt()
            } else {
                t / (3.0 * KNEE * KNEE) + 4.0 / 29.0
            }
        };
        let white = [D65_2.x, D65_2.y, D65_2.z];
        let f: [f64; 3] = std::array::from_fn(|c| compressed(xyz[c] / white[c]));
        let largest = f.iter().fold(0.2_f64, |m, v| m.max(v.abs()));
        for c in 0..3 {
            let accepted = 8.0 * f64::EPSILON * largest * 3.0 * f[c].max(KNEE).powi(2);
            assert!(
                (back[c] - xyz[c]).abs() <= accepted,
                "{xyz:?} became {back:?}"
            );
            // Light that is light, brighter than the knee and within a hundredth of the brightest, whose f is at most
            // 100^(1/3) = 4.7 times its own: three times 4 EPS of that f, and cube and cube root themselves.
            if xyz.iter().all(|v| *v > 0.01 && *v > 0.01 * scale) {
                assert!((back[c] / xyz[c] - 1.0).abs() <= 64.0 * f64::EPSILON);
            }
        }
    }
}

#[test]
fn black_is_black_and_white_is_one_hundred_exactly() {
    for white in whites() {
        // 116 · 4/29 − 16 is 0 in reals; 4/29 rounds, so does the product: half an ulp of 16 twice.
        let black = Lab::from_xyz([0.0; 3], white);
        assert!(black.l.abs() <= 16.0 * f64::EPSILON, "{black:?}");
        assert_eq!((black.a, black.b), (0.0, 0.0));
        let lab = Lab::from_xyz([white.x, white.y, white.z], white);
        assert_eq!(lab.to_array(), [100.0, 0.0, 0.0]);
        assert!(
            Lab::from(black.to_array())
                .to_xyz(white)
                .iter()
                .all(|v| v.abs() < 1e-17)
        );
    }
}

#[test]
fn the_compression_has_no_step_at_its_knee() {
    // Both branches have value KNEE and slope 1/(3 KNEE²) there: across 1e-9 of light f moves by 7.8e-9, L by 9.0e-7.
    let knee = KNEE.powi(3);
    let lightness = |y: f64| Lab::from_xyz([0.0, y, 0.0], D65_2).l;
    for power in 3..16 {
        let step = 10.0_f64.powi(-power);
        let rise = lightness(knee + step) - lightness(knee - step);
        let want = 116.0 * 2.0 * step / (3.0 * KNEE * KNEE);
        // The cube root's second derivative: −2/3 of step over knee; and three roundings of 16.
        let accepted = want * step / knee + 48.0 * f64::EPSILON;
        assert!(
            (rise - want).abs() <= accepted,
            "{step}: {rise} instead of {want}"
        );
    }
}

#[test]
fn negative_light_is_negative_lightness_and_grows_strictly() {
    let mut before = f64::NEG_INFINITY;
    for k in -1000..1000 {
        let lab = Lab::from_xyz([0.0, 1e-5 * f64::from(k), 0.0], D65_2);
        assert!(lab.l > before && lab.l.is_finite(), "{k}: {lab:?}");
        // Yellow-blue and red-green of light that is green alone have one sign each.
        assert_eq!(lab.l.abs() < 1e-12, k == 0);
        before = lab.l;
    }
}

#[test]
fn a_color_out_of_gamut_comes_back_through_negative_channels() {
    for lab in [
        [50.0, 200.0, -200.0],
        [50.0, -200.0, 200.0],
        [90.0, -150.0, 0.0],
        [2.0, 30.0, -60.0],
    ] {
        let rgb = Lab::from(lab).to_rgb();
        assert!(rgb.iter().any(|v| *v < 0.0), "{lab:?} is {rgb:?}");
        let back = Lab::from_rgb(rgb).to_array();
        // The matrix has condition number 4.6 and a dark channel's f moves by 7.8 for 1 of light: 500 · 7.8 · 32 EPS.
        for (x, y) in back.iter().zip(lab) {
            assert!(
                (x - y).abs() <= 500.0 * 7.8 * 32.0 * f64::EPSILON * 4.0,
                "{lab:?} became {back:?}"
            );
        }
    }
}

#[test]
fn rgb_and_back_closes_to_rounding_at_every_scale() {
    let mut random = Stream(2);
    for _ in 0..10_000 {
        let scale = 10.0_f64.powf(random.within(-300.0, 300.0));
        let rgb = [0; 3].map(|_| scale * random.within(-1.0, 1.0));
        let back = xyz_to_rgb(rgb_to_xyz(rgb));
        let size = rgb.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        for (x, y) in back.iter().zip(rgb) {
            // Condition number 4.6, six roundings each way.
            assert!(
                (x - y).abs() <= 32.0 * f64::EPSILON * size,
                "{rgb:?} became {back:?}"
            );
        }
    }
}

#[test]
fn the_published_differences_hold_to_their_last_digit() {
    let table = include_str!("sharma_2005.txt");
    let mut pairs = 0;
    for line in table.lines().filter(|line| !line.starts_with('#')) {
        let row: Vec<f64> = line
            .split(' ')
            .map(|v| v.parse().expect("a number"))
            .collect();
        let (x, y, want) = ([row[0], row[1], row[2]], [row[3], row[4], row[5]], row[6]);
        // Printed to four digits: half of the last, and what the printed colors were rounded by.
        for got in [ciede2000(x.into(), y.into()), ciede2000(y.into(), x.into())] {
            assert!((got - want).abs() < 6e-5, "{line}: {got}");
        }
        pairs += 1;
    }
    assert_eq!(pairs, 34);
}

#[test]
fn differences_of_hard_colors_are_finite_and_symmetric() {
    for x in HARD {
        assert_eq!(ciede2000(x.into(), x.into()), 0.0);
        for y in HARD {
            let (forth, back) = (ciede2000(x.into(), y.into()), ciede2000(y.into(), x.into()));
            assert!(forth.is_finite() && forth >= 0.0, "{x:?} {y:?}: {forth}");
            // Hues exactly opposite may take either mean; none of these pairs but the greens and purples do.
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
fn a_color_that_is_none_is_at_no_distance_and_never_the_same() {
    let gray = [50.0, 10.0, -10.0];
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for axis in 0..3 {
            let mut none = gray;
            none[axis] = wrong;
            for (x, y) in [(gray, none), (none, gray), (none, none), ([0.0; 3], none)] {
                let difference = ciede2000(x.into(), y.into());
                // What is infinitely far from a color may be told so; nothing else is a number.
                assert!(
                    difference.is_nan() || (wrong.is_infinite() && difference == f64::INFINITY),
                    "{x:?} {y:?}: {difference}"
                );
            }
        }
    }
}

#[test]
fn colors_of_any_size_are_apart_or_beyond_what_can_be_said() {
    for power in [3, 10, 44, 50, 77, 154, 200, 308] {
        let size = 10.0_f64.powi(power);
        for (x, y) in [
            ([size, 0.0, 0.0], [0.0; 3]),
            ([0.0, size, 0.0], [0.0; 3]),
            ([0.0, 0.0, size], [0.0, 0.0, -size]),
            ([50.0, size, size], [50.0, -size, size]),
            ([size; 3], [-size; 3]),
            ([size, 1.0, 1.0], [2.0, 1.0, size]),
        ] {
            for (x, y) in [(x, y), (y, x)] {
                let difference = ciede2000(x.into(), y.into());
                // Weights grow with chroma and lightness and never faster: such colors are tens of units apart at least.
                assert!(
                    difference.is_nan() || difference > 10.0,
                    "{x:?} {y:?}: {difference}"
                );
                // The seventh power of a chroma up to 1e44 is a number.
                assert!(power >= 44 || difference.is_finite(), "{x:?} {y:?}");
            }
        }
    }
}

#[test]
fn a_hue_that_crosses_zero_degrees_is_a_small_step() {
    let at = |chroma: f64, degrees: f64| Lab {
        l: 50.0,
        a: chroma * degrees.to_radians().cos(),
        b: chroma * degrees.to_radians().sin(),
    };
    // Hues of 359.9° and 0.1° at chroma 40: an arc of 40 · 0.2° = 0.14, divided by the hue weight of about 1.5.
    let step = ciede2000(at(40.0, 359.9), at(40.0, 0.1));
    assert!(step > 0.03 && step < 0.15, "{step}");
    // The formula is smooth there: the same step on either side of 0° differs by the weight's slope over 0.2° alone,
    // below 1 % (T moves by 0.17 + 0.48 + 0.96 + 0.8 an angle in radians at the most).
    let beside = ciede2000(at(40.0, 0.1), at(40.0, 0.3));
    assert!((step / beside - 1.0).abs() < 0.01, "{step} {beside}");
}

#[test]
fn a_chroma_of_a_billionth_is_kept_and_f32_would_have_lost_it() {
    // Next to gray G = 1/2, so that a counts one and a half times; at L = 50 all weights are 1 to 1e-9.
    let gray = Lab {
        l: 50.0,
        a: 0.0,
        b: 0.0,
    };
    for (a, b) in [(1e-9_f64, 0.0_f64), (0.0, 1e-9), (-3e-9, 4e-9)] {
        let want = (1.5 * a).hypot(b);
        let got = ciede2000(gray, Lab { l: 50.0, a, b });
        assert!(
            (got / want - 1.0).abs() < 1e-6,
            "{a} {b}: {got} instead of {want}"
        );
        // There and back, chroma carries 500 roundings of f = 0.57: 1e-13, a ten-thousandth of it.
        let back = Lab::from_xyz(Lab { l: 50.0, a, b }.to_xyz(D65_2), D65_2);
        assert!(
            (back.a - a).abs() < 5e-13 && (back.b - b).abs() < 5e-13,
            "{back:?}"
        );
    }
    // In f32 one ulp of f = 0.57 is 6e-8, which a multiplies by 500: steps of 3e-5.
    let (f, a) = (66.0_f32 / 116.0, 1e-9_f32);
    assert_eq!(500.0 * ((f + a / 500.0) - f), 0.0);
}
