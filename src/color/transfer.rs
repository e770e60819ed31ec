//! The sRGB transfer curve, between linear light and what a screen is told (IEC 61966-2-1).

macro_rules! encode {
    ($linear:expr) => {
        if $linear <= 0.003_130_8 {
            12.92 * $linear
        } else {
            1.055 * $linear.powf(1.0 / 2.4) - 0.055
        }
    };
}

/// The curve's value of linear light, both 0 to 1.
#[must_use]
pub fn encode_srgb(linear: f64) -> f64 {
    encode!(linear)
}

/// The same at a pixel.
#[must_use]
pub fn encode_srgb_f32(linear: f32) -> f32 {
    encode!(linear)
}

/// Linear light of a value of the curve, both 0 to 1.
#[must_use]
pub fn decode_srgb(encoded: f64) -> f64 {
    if encoded <= 0.040_45 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_has_its_published_ends() {
        assert_eq!(encode_srgb(0.0), 0.0);
        assert!((encode_srgb(1.0) - 1.0).abs() < 1e-15);
        assert!((encode_srgb(0.214_041_140_482_232_5) - 0.5).abs() < 1e-12);
        assert!((encode_srgb_f32(0.214_041_14) - 0.5).abs() < 1e-6);
    }

    #[test]
    fn there_and_back_is_the_same_light() {
        for k in 0..=1000_u32 {
            let light = f64::from(k) / 1000.0;
            // The standard's two thresholds differ in the eighth digit.
            assert!((decode_srgb(encode_srgb(light)) - light).abs() < 1e-7);
        }
    }
}
