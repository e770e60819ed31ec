//! What the manifest says about the pictures of flakes.

use super::field::Field;
use crate::measurement::package::PackageError;
use crate::paint::{AngleGrid, Limits};

/// Texels below this are finer than light's own waves, micrometres.
const LEAST_TEXEL_UM: f64 = 0.3;

/// The slices' pictures.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::measurement) struct FlakesEntry {
    pub pattern: SlicePattern,
    pub theta_h: AngleGrid,
    pub theta_d: AngleGrid,
    pub texel_um: f64,
    pub size: [u32; 2],
}

/// Names of the slices: a path with the indices of θh and θd in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::measurement) struct SlicePattern(Vec<Piece>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum Piece {
    Text(String),
    ThetaH(usize),
    ThetaD(usize),
}

impl SlicePattern {
    fn parse(pattern: &str) -> Option<Self> {
        let mut pieces = Vec::new();
        let mut rest = pattern;
        while let Some((text, tail)) = rest.split_once('{') {
            let (field, tail) = tail.split_once('}')?;
            pieces.push(Piece::Text(text.to_owned()));
            let (axis, width) = field.split_once(':').unwrap_or((field, "0"));
            let width = width.parse().ok().filter(|w| *w <= 9)?;
            pieces.push(match axis {
                "h" => Piece::ThetaH(width),
                "i" => Piece::ThetaD(width),
                _ => return None,
            });
            rest = tail;
        }
        pieces.push(Piece::Text(rest.to_owned()));
        let has = |wanted: fn(&Piece) -> bool| pieces.iter().any(wanted);
        (has(|p| matches!(p, Piece::ThetaH(_))) && has(|p| matches!(p, Piece::ThetaD(_))))
            .then_some(Self(pieces))
    }

    /// Name of one slice.
    pub(in crate::measurement) fn name(&self, theta_h: usize, theta_d: usize) -> String {
        use std::fmt::Write as _;
        let mut name = String::new();
        for piece in &self.0 {
            match piece {
                Piece::Text(text) => name.push_str(text),
                Piece::ThetaH(width) => _ = write!(name, "{theta_h:0width$}"),
                Piece::ThetaD(width) => _ = write!(name, "{theta_d:0width$}"),
            }
        }
        name
    }
}

pub(super) fn flakes(
    field: &Field,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<FlakesEntry, PackageError> {
    field.object(
        &[
            "slices",
            "theta_h_deg",
            "theta_i_deg",
            "texel_um",
            "size_px",
        ],
        warnings,
    )?;
    let accepted = "a path with {h:02} and {i:02} in it";
    let slices = field.want("slices", accepted)?;
    let Some(pattern) = SlicePattern::parse(&slices.file()?) else {
        return slices.refuse(accepted);
    };
    let size = field.want("size_px", "[width, height]")?;
    let sides = size.list(2, "two numbers")?;
    let [width, height] = &sides[..] else {
        return size.refuse("[width, height]");
    };
    let side = |f: &Field| {
        Ok(u32::try_from(f.whole(1, limits.slice_pixels.min(1 << 24))?).unwrap_or(u32::MAX))
    };
    let (width, height) = (side(width)?, side(height)?);
    if u64::from(width) * u64::from(height) > limits.slice_pixels {
        return size.refuse(format!("at most {} pixels", limits.slice_pixels));
    }
    let theta_h = field
        .want("theta_h_deg", "a list of angles")?
        .angles(limits)?;
    let theta_d = field
        .want("theta_i_deg", "a list of angles")?
        .angles(limits)?;
    for (name, grid) in [("theta_h_deg", &theta_h), ("theta_i_deg", &theta_d)] {
        let last = grid.degrees()[grid.len() - 1];
        if grid.len() > 2 && last <= std::f64::consts::FRAC_PI_2 {
            warnings.push(format!(
                "flakes.{name} ends at {last}°: angles are in degrees; are these radians?"
            ));
        }
    }
    let places = (0..theta_h.len()).flat_map(|h| (0..theta_d.len()).map(move |d| (h, d)));
    let mut names = std::collections::BTreeSet::new();
    for name in places.map(|(h, d)| pattern.name(h, d)) {
        if let Some(twice) = names.replace(name) {
            return slices.refuse(format!(
                "a path that names every slice otherwise, which {accepted} does; two would be {twice:?}"
            ));
        }
    }
    let accepted = "above 0, to 100000";
    let texel_um = field.want("texel_um", accepted)?;
    let texel_um = texel_um.number(f64::MIN_POSITIVE, 1e5, accepted)?;
    if texel_um < LEAST_TEXEL_UM {
        warnings.push(format!(
            "flakes.texel_um is {texel_um}: no camera tells so little apart; are these millimetres?"
        ));
    }
    Ok(FlakesEntry {
        pattern,
        theta_h,
        theta_d,
        texel_um,
        size: [width, height],
    })
}
