//! Blending what lies under the flakes: coat, diffuse, color table.

use super::clamp::Ledger;
use super::{BlendError, BlendedPaint};
use crate::color::Lab;
use crate::paint::{AngleGrid, CarPaint, Coat, ColorTable, Limits, MAX_LAB, MAX_WEIGHT};

/// Angles of all the paints' color tables, each once.
pub(super) fn common_table_grid(
    paints: &[&CarPaint],
) -> Result<(AngleGrid, AngleGrid), BlendError> {
    common_grid(
        paints
            .iter()
            .map(|p| (p.color_table.theta_h(), p.color_table.theta_d())),
    )
    .map(|grid| grid.unwrap_or_else(|| (AngleGrid::single(), AngleGrid::single())))
}

/// The union of several pairs of angle grids, `None` of none.
pub(super) fn common_grid<'a>(
    grids: impl Iterator<Item = (&'a AngleGrid, &'a AngleGrid)>,
) -> Result<Option<(AngleGrid, AngleGrid)>, BlendError> {
    let union = grids.fold(None, |union: Option<(AngleGrid, AngleGrid)>, (h, d)| {
        Some(union.map_or_else(
            || (h.clone(), d.clone()),
            |(uh, ud)| (uh.union(h), ud.union(d)),
        ))
    });
    let accepted = Limits::default().common_angles();
    match union.as_ref().map(|(h, d)| h.len().max(d.len())) {
        Some(angles) if angles > accepted => Err(BlendError::Angles { angles, accepted }),
        _ => Ok(union),
    }
}

/// A coat for every paint: an uncoated one is a coat of index 1, as rough as its partners' mean, and one whose thickness
/// nobody stated is as thick as theirs. `None` where no paint is coated.
pub(super) fn coats(paints: &[BlendedPaint]) -> Option<Vec<Coat>> {
    let known: Vec<Coat> = paints.iter().filter_map(|p| p.coat).collect();
    let stand_in = Coat {
        ior: 1.0,
        roughness: mean(known.iter().map(|c| c.roughness))?,
        thickness_um: None,
    };
    let thickness = mean(known.iter().filter_map(|c| c.thickness_um));
    let of = |paint: &BlendedPaint| {
        let coat = paint.coat.unwrap_or(stand_in);
        Coat {
            thickness_um: coat.thickness_um.or(thickness),
            ..coat
        }
    };
    Some(paints.iter().map(of).collect())
}

/// Coats blend linearly. Paints of weight 0 have no say in whether there is a coat or a thickness at all.
pub(super) fn coat(paints: &[BlendedPaint], weights: &[f64], ledger: &mut Ledger) -> Option<Coat> {
    let coats = coats(paints)?;
    let mix = |get: &dyn Fn(&Coat) -> f64| {
        coats
            .iter()
            .zip(weights)
            .map(|(c, w)| w * get(c))
            .sum::<f64>()
    };
    let taking_part = || {
        let weighted = paints.iter().zip(weights).filter(|(_, w)| **w != 0.0);
        weighted.filter_map(|(paint, _)| paint.coat)
    };
    let ior = ledger.hold("coat.ior", mix(&|c| c.ior), 1.0, 4.0);
    // A coat of index 1 reflects and bends nothing, but a paint that has one gets it back.
    if ior == 1.0 && !taking_part().any(|coat| coat.ior == 1.0) {
        return None;
    }
    let stated = taking_part().any(|coat| coat.thickness_um.is_some());
    Some(Coat {
        ior,
        roughness: ledger.hold("coat.roughness", mix(&|c| c.roughness), 0.0, 1.0),
        thickness_um: stated.then(|| {
            let mixed = mix(&|c| c.thickness_um.unwrap_or_default());
            ledger.hold("coat.thickness_um", mixed, 0.0, 1e6)
        }),
    })
}

/// Mean of some numbers, `None` of none.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v));
    (count > 0.0).then(|| sum / count)
}

/// Diffuse albedo blends linearly.
pub(super) fn diffuse(paints: &[BlendedPaint], weights: &[f64], ledger: &mut Ledger) -> [f64; 3] {
    std::array::from_fn(|c| {
        let value = paints
            .iter()
            .zip(weights)
            .map(|(p, w)| w * p.diffuse[c])
            .sum();
        ledger.hold("diffuse", value, 0.0, MAX_WEIGHT)
    })
}

fn add(sum: &mut Lab, weight: f64, lab: Lab) {
    sum.l += weight * lab.l;
    sum.a += weight * lab.a;
    sum.b += weight * lab.b;
}

/// Color tables blend in CIELAB, node by node (Golla and Klein 2018, 4.2).
pub(super) fn color_table(
    paints: &[BlendedPaint],
    weights: &[f64],
    ledger: &mut Ledger,
) -> ColorTable {
    let first = &paints[0].color_table;
    let mut nodes = vec![Lab::default(); first.nodes().len()];
    let mut overall = Lab::default();
    for (paint, &w) in paints.iter().zip(weights) {
        for (sum, &lab) in nodes.iter_mut().zip(paint.color_table.nodes()) {
            add(sum, w, lab);
        }
        add(&mut overall, w, paint.color_table.overall());
    }
    let mut farthest = [0.0_f64; 3];
    for node in nodes.iter().chain([&overall]) {
        for (farthest, value) in farthest.iter_mut().zip(node.to_array()) {
            *farthest = farthest.max(value.abs());
        }
    }
    let (mut held, mut worst) = (0, 0.0_f64);
    if farthest.iter().any(|value| *value > MAX_LAB) {
        for node in nodes.iter_mut().chain([&mut overall]) {
            *node = Lab::from(node.to_array().map(|value| {
                let beyond = value.abs() - MAX_LAB;
                held += usize::from(beyond > 0.0);
                worst = worst.max(beyond);
                value.clamp(-MAX_LAB, MAX_LAB)
            }));
        }
    }
    ledger.record(
        "color_table",
        "Lab held to -2000..2000",
        held,
        3 * (nodes.len() + 1),
        worst,
    );
    ColorTable::new(
        first.theta_h().clone(),
        first.theta_d().clone(),
        nodes,
        overall,
    )
    .expect("one finite color per node of the common grid")
}
