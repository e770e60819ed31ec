//! Color: white points, linear sRGB, XYZ, CIELAB and color differences.
//!
//! Everything inside carpaint is linear sRGB with the D65 white point of the 2° observer, and CIELAB relative to the
//! perfect diffuser under that same white. A Lab value that came from elsewhere stands beside its illuminant and
//! observer. Arithmetic is `f64`.
//!
//! Left to others: tone mapping for a screen (`render`). Spectra come in as reflectance factors ([`Wavelengths`]) and are
//! colors from then on.

mod adaptation;
mod difference;
mod lab;
mod rgb;
mod spectrum;
mod transfer;
mod white;

pub use adaptation::adapted;
pub use difference::ciede2000;
pub use lab::Lab;
pub(crate) use lab::{KNEE, compress, expand, expand_dark, expand_f32};
pub use rgb::{LinearRgb, luminance, rgb_to_xyz, xyz_to_rgb};
pub use spectrum::{SpectrumError, Wavelengths};
pub use transfer::{decode_srgb, encode_srgb, encode_srgb_f32};
pub use white::{D65_2, Illuminant, Observer, WhitePoint};
