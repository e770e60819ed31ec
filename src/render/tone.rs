//! From linear light to what a screen can show: Khronos PBR Neutral.
//!
//! Khronos PBR Neutral (Khronos Group, `ToneMapping` repository, `PBR_Neutral` specification, 2024) keeps base colors under
//! white light as they are and compresses only what is brighter than 0.8. With `x = min(R, G, B)`, `F90 = 0.04`,
//! `k = 0.8 − F90`, `d = 0.15`:
//!
//! ```text
//! f = x − x²/(4 F90) for x ≤ 2 F90, else F90;    c ← c − f;    p = max(c)
//! p ≤ k: done.  Else  n = 1 − (1−k)²/(p + 1 − 2k),  g = 1/(d (p − n) + 1),  c ← (c n/p) g + n (1 − g)
//! ```

use super::vector::Vec3;

const F90: f32 = 0.04;
const START: f32 = 0.8 - F90;
const DESATURATION: f32 = 0.15;

/// Khronos PBR Neutral of a linear sRGB color; negative light counts as none.
#[must_use]
pub fn neutral(color: Vec3) -> Vec3 {
    let color = color.map(|v| v.max(0.0));
    let least = color[0].min(color[1]).min(color[2]);
    let offset = if least < 2.0 * F90 {
        least - least * least / (4.0 * F90)
    } else {
        F90
    };
    let color = color.map(|v| v - offset);
    let peak = color[0].max(color[1]).max(color[2]);
    if peak < START {
        return color;
    }
    let room = 1.0 - START;
    let pressed = 1.0 - room * room / (peak + room - START);
    let keep = 1.0 / (DESATURATION * (peak - pressed) + 1.0);
    color.map(|v| v / peak * pressed * keep + pressed * (1.0 - keep))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn base_colors_under_a_shiny_surface_come_back() {
        // The specification: out = in − F90 for colors between 0.08 and 0.8.
        for color in [[0.08, 0.3, 0.8], [0.5, 0.5, 0.5], [0.2, 0.79, 0.1]] {
            for (x, y) in neutral(color).iter().zip(color) {
                assert!((x - (y - 0.04)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn black_stays_black_and_any_light_fits_the_screen() {
        assert_eq!(neutral([0.0; 3]), [0.0; 3]);
        // Worked from the formula by hand: p = 0.96, n = 1 − 0.0576/(0.96 + 0.24 − 0.76) = 0.8690909; grey has no tint
        // to lose.
        assert!((neutral([1.0; 3])[0] - 0.869_090_9).abs() < 1e-6);
        assert!(neutral([1e6, 0.0, 0.0]).iter().all(|&v| v <= 1.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn more_light_is_never_darker(r in 0.0..20.0_f32, g in 0.0..20.0_f32, b in 0.0..20.0_f32) {
            let (dim, bright) = (neutral([r, g, b]), neutral([r * 1.01, g * 1.01, b * 1.01]));
            let peak = |c: Vec3| c[0].max(c[1]).max(c[2]);
            prop_assert!(peak(bright) >= peak(dim) - 1e-6);
            prop_assert!(dim.iter().all(|v| (0.0..=1.0).contains(v)));
        }
    }
}
