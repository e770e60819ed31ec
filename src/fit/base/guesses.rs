//! Colors where nothing was measured, held to what light there is.
//!
//! Next to grazing no goniometer reads, and nodes of the color table there take their neighbours' color. The lobes' Fresnel
//! factor goes on rising to 1 meanwhile, so that a deeply colored film would come to give back more light than it gets,
//! in that color. What it does give back at grazing is reflected by its surface, which is colorless. The guessed nodes
//! are moved towards gray of the same luminance, as little as makes the energy certificate hold, and where gray is too
//! bright itself, on towards black. What was measured stays as it is.

use crate::color::{Lab, luminance};
use crate::paint::{CarPaint, ColorTable, certify};

/// Steps from a guessed color to gray, and from there to black.
const STEPS: u16 = 16;

/// The paint with its guessed nodes moved, where that makes it give back no more light than it gets; `None` where nothing
/// has to be moved, or moving does not help.
pub(super) fn held_to_energy(paint: &CarPaint, guessed: &[bool]) -> Option<CarPaint> {
    let conserves = |paint: &CarPaint| certify(paint).conserves;
    if !guessed.contains(&true) || conserves(paint) {
        return None;
    }
    let moved = |steps: u16| CarPaint {
        color_table: moved(&paint.color_table, guessed, steps),
        ..paint.clone()
    };
    let (mut too_bright, mut held) = (0, 2 * STEPS);
    if !conserves(&moved(held)) {
        return None;
    }
    while held - too_bright > 1 {
        let middle = u16::midpoint(held, too_bright);
        if conserves(&moved(middle)) {
            held = middle;
        } else {
            too_bright = middle;
        }
    }
    Some(moved(held))
}

fn moved(table: &ColorTable, guessed: &[bool], steps: u16) -> ColorTable {
    let [gray, dark] = [steps.min(STEPS), steps.saturating_sub(STEPS)]
        .map(|steps| f64::from(steps) / f64::from(STEPS));
    let nodes = table.nodes().iter().zip(guessed).map(|(node, guessed)| {
        if !guessed {
            return *node;
        }
        let rgb = node.to_rgb();
        let bright = luminance(rgb);
        Lab::from_rgb(rgb.map(|v| (v + (bright - v) * gray) * (1.0 - dark)))
    });
    let grids = (table.theta_h().clone(), table.theta_d().clone());
    ColorTable::new(grids.0, grids.1, nodes.collect(), table.overall())
        .unwrap_or_else(|_| table.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{AngleGrid, Lobe};

    /// A narrow lobe under a deeply blue table whose last column was not measured.
    fn film(weight: f64) -> (CarPaint, Vec<bool>) {
        let grid = |angles: &[f64]| AngleGrid::new(angles.to_vec()).expect("ascends");
        let blue = Lab::from_rgb([0.4, 0.1, 10.0]);
        let table = ColorTable::new(
            grid(&[0.0, 90.0]),
            grid(&[0.0, 75.0, 90.0]),
            vec![blue; 6],
            blue,
        );
        let paint = CarPaint {
            coat: None,
            diffuse: [0.0; 3],
            lobes: vec![Lobe {
                weight: [weight; 3],
                alpha: 0.06,
                f0: 0.05,
            }],
            color_table: table.expect("a table"),
            flakes: None,
        };
        (paint, [false, false, true].repeat(2))
    }

    #[test]
    fn a_guess_that_is_too_bright_is_made_paler_and_what_was_measured_stays() {
        let (paint, guessed) = film(0.05);
        assert!(!certify(&paint).conserves);
        let held = held_to_energy(&paint, &guessed).expect("is held");
        assert!(certify(&held).conserves);
        let (before, after) = (paint.color_table.nodes(), held.color_table.nodes());
        for k in 0..6 {
            let [was, is] = [before[k], after[k]].map(Lab::to_rgb);
            if guessed[k] {
                assert!(is[2] < was[2] && is[1] > was[1], "{was:?} {is:?}");
                assert!(luminance(is) <= luminance(was) * (1.0 + 1e-9));
            } else {
                assert_eq!(before[k], after[k]);
            }
        }
    }

    #[test]
    fn nothing_is_moved_without_need_or_without_help() {
        let (dim, guessed) = film(0.001);
        assert_eq!(held_to_energy(&dim, &guessed), None);
        let (bright, _) = film(0.05);
        assert_eq!(held_to_energy(&bright, &[false; 6]), None);
        // Too bright where it was measured.
        let (glaring, guessed) = film(40.0);
        assert_eq!(held_to_energy(&glaring, &guessed), None);
    }
}
