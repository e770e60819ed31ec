//! CIEDE2000, the color difference of paint tolerances.
//!
//! Source: G. Sharma, W. Wu, E. Dalal, "The CIEDE2000 color-difference formula: implementation notes", Color Research
//! and Application 30 (2005), with kL = kC = kH = 1. The formula jumps where two hues stand 180° apart and is not a
//! metric: never sum it along a path.

use super::lab::Lab;

/// CIEDE2000 difference of two colors under the same white, `>= 0`; NaN of a color that is not finite.
#[must_use]
pub fn ciede2000(x: Lab, y: Lab) -> f64 {
    // C⁷/(C⁷ + 25⁷), divided by C⁷, which overflows where the quotient is just 1.
    let seventh = |c: f64| (1.0 / (1.0 + (25.0 / c).powi(7))).sqrt();
    let g = 0.5 * (1.0 - seventh(f64::midpoint(x.a.hypot(x.b), y.a.hypot(y.b))));
    let (a1, a2) = (x.a * (1.0 + g), y.a * (1.0 + g));
    let (c1, c2) = (a1.hypot(x.b), a2.hypot(y.b));
    let hue = |a: f64, b: f64| {
        if a == 0.0 && b == 0.0 {
            0.0
        } else {
            b.atan2(a).to_degrees().rem_euclid(360.0)
        }
    };
    let (h1, h2) = (hue(a1, x.b), hue(a2, y.b));

    let gray = c1 * c2 == 0.0;
    let turn = match h2 - h1 {
        _ if gray => 0.0,
        d if d > 180.0 => d - 360.0,
        d if d < -180.0 => d + 360.0,
        d => d,
    };
    let (dl, dc) = (y.l - x.l, c2 - c1);
    let dh = 2.0 * (c1 * c2).sqrt() * (turn / 2.0).to_radians().sin();

    let (l, c) = (f64::midpoint(x.l, y.l), f64::midpoint(c1, c2));
    let h = if gray {
        h1 + h2
    } else if (h1 - h2).abs() <= 180.0 {
        f64::midpoint(h1, h2)
    } else if h1 + h2 < 360.0 {
        f64::midpoint(h1, h2) + 180.0
    } else {
        f64::midpoint(h1, h2) - 180.0
    };
    let cosine = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cosine(h - 30.0) + 0.24 * cosine(2.0 * h) + 0.32 * cosine(3.0 * h + 6.0)
        - 0.20 * cosine(4.0 * h - 63.0);
    let l50 = (l - 50.0) * (l - 50.0);
    let sl = 1.0 + 0.015 * l50 / (20.0 + l50).sqrt();
    let (sc, sh) = (1.0 + 0.045 * c, 1.0 + 0.015 * c * t);
    let turned = 60.0 * (-((h - 275.0) / 25.0).powi(2)).exp();
    let rt = -2.0 * seventh(c) * turned.to_radians().sin();
    let (l, c, h) = (dl / sl, dc / sc, dh / sh);
    let squared = l * l + c * c + h * h + rt * c * h;
    // Not `max`, which would call NaN a perfect match.
    if squared < 0.0 { 0.0 } else { squared.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_published_pairs_hold_to_their_last_digit() {
        let table = include_str!("../../tests/stability/sharma_2005.txt");
        for line in table.lines().filter(|line| !line.starts_with('#')) {
            let row: Vec<f64> = line
                .split(' ')
                .map(|v| v.parse().expect("a number"))
                .collect();
            let [l1, a1, b1, l2, a2, b2, want] = row[..] else {
                panic!("seven numbers in '{line}'");
            };
            let got = ciede2000([l1, a1, b1].into(), [l2, a2, b2].into());
            assert!((got - want).abs() < 6e-5, "{line}: {got}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn it_does_not_matter_which_color_comes_first(
            x in prop::array::uniform3(-100.0..150.0_f64), y in prop::array::uniform3(-100.0..150.0_f64),
        ) {
            let (forth, back) = (ciede2000(x.into(), y.into()), ciede2000(y.into(), x.into()));
            prop_assert!((forth - back).abs() <= 1e-9 * forth.max(1.0));
            prop_assert!(ciede2000(x.into(), x.into()) == 0.0);
        }
    }
}
