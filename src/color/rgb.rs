//! Linear sRGB and XYZ.
//!
//! Matrix: IEC 61966-2-1 primaries with D65, seven digits as published; its inverse is computed from it, so that a
//! round trip closes to rounding.

/// Linear sRGB, D65, 2° observer. 1 is the perfect diffuser for a reflectance factor; values may exceed 1 and may be
/// slightly negative for colors outside the gamut.
pub type LinearRgb = [f64; 3];

const TO_XYZ: [[f64; 3]; 3] = [
    [0.412_456_4, 0.357_576_1, 0.180_437_5],
    [0.212_672_9, 0.715_152_2, 0.072_175_0],
    [0.019_333_9, 0.119_192_0, 0.950_304_1],
];

const FROM_XYZ: [[f64; 3]; 3] = inverse(TO_XYZ);

pub(super) const fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut out = [[0.0; 3]; 3];
    let det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    let mut r = 0;
    while r < 3 {
        let mut c = 0;
        while c < 3 {
            let (a, b, d, e) = ((c + 1) % 3, (c + 2) % 3, (r + 1) % 3, (r + 2) % 3);
            out[r][c] = (m[a][d] * m[b][e] - m[a][e] * m[b][d]) / det;
            c += 1;
        }
        r += 1;
    }
    out
}

pub(super) const fn times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = m;
    [
        x[0] * v[0] + x[1] * v[1] + x[2] * v[2],
        y[0] * v[0] + y[1] * v[1] + y[2] * v[2],
        z[0] * v[0] + z[1] * v[1] + z[2] * v[2],
    ]
}

/// XYZ (`Y = 1` for the perfect diffuser) of a linear sRGB color.
#[must_use]
pub const fn rgb_to_xyz(rgb: LinearRgb) -> [f64; 3] {
    times(&TO_XYZ, rgb)
}

/// Linear sRGB of an XYZ color (`Y = 1` for the perfect diffuser).
#[must_use]
pub fn xyz_to_rgb(xyz: [f64; 3]) -> LinearRgb {
    times(&FROM_XYZ, xyz)
}

/// Relative luminance, BT.709 weights to four digits.
#[must_use]
pub fn luminance(rgb: LinearRgb) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn green_has_the_published_xyz() {
        assert_eq!(
            rgb_to_xyz([0.0, 1.0, 0.0]),
            [0.357_576_1, 0.715_152_2, 0.119_192_0]
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn xyz_and_back_is_the_same_color(r in -1.0..100.0_f64, g in -1.0..100.0_f64, b in -1.0..100.0_f64) {
            let back = xyz_to_rgb(rgb_to_xyz([r, g, b]));
            // The matrix has condition number 4.6: a few ulp of the largest channel.
            let scale = r.abs().max(g.abs()).max(b.abs()).max(1e-300);
            for (x, y) in back.iter().zip([r, g, b]) {
                prop_assert!((x - y).abs() <= 32.0 * f64::EPSILON * scale);
            }
        }
    }
}
