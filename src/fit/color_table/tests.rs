//! Tests of `color_table`.

use super::*;

#[test]
fn the_grid_holds_the_instruments_angles_and_ascends() {
    for ior in [1.0, 1.25, 1.5, 1.8] {
        let read: Vec<f64> = instrument_pairs()
            .iter()
            .map(|&(wi, wo)| {
                half_angles(refract(wi, ior), refract(wo, ior))
                    .theta_h
                    .to_degrees()
            })
            .collect();
        let rows = angles(&THETA_H, read.iter().copied());
        assert!(AngleGrid::new(rows.clone()).is_ok());
        for value in read {
            assert!(
                rows.iter().any(|r| (r - value).abs() < 1e-5),
                "{ior}: {value}"
            );
        }
    }
}

#[test]
fn a_color_outside_the_gamut_comes_in_without_going_far() {
    let seen = [-0.002, 0.003, 0.019];
    let inside = nearest_in_gamut(seen, 2.0);
    assert!(inside.iter().all(|v| *v >= 0.0));
    let off = |rgb: LinearRgb| ciede2000(Lab::from_rgb(rgb), Lab::from_rgb(seen));
    assert!(off(inside) < off(seen.map(|v| v.max(0.0))), "{inside:?}");
    assert_eq!(nearest_in_gamut([-0.1, 0.0, 0.0], 2.0), [0.0; 3]);
}

#[test]
fn gaps_take_their_neighbours_color() {
    let node = |color| Node {
        color,
        mapped: false,
    };
    let nodes = [node(Some([2.0; 3])), node(None), node(None), node(None)];
    assert_eq!(fill(&nodes, 2), vec![[2.0; 3]; 4]);
    assert_eq!(fill(&[node(None)], 1), vec![[1.0; 3]]);
}
