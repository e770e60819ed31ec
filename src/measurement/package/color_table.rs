//! The color table of a package: a picture of colors over angles.

use super::PackageError;
use super::slices::picture_bytes;
use crate::color::Lab;
use crate::measurement::archive::{Archive, Unpacking};
use crate::measurement::manifest::TableEntry;
use crate::measurement::picture::{Picture, PictureScratch};
use crate::paint::{AngleGrid, ColorTable, Limits, MAX_LAB};

pub(super) fn color_table_of(
    archive: &Archive,
    entry: TableEntry,
    limits: &Limits,
) -> Result<ColorTable, PackageError> {
    let TableEntry {
        file,
        theta_h,
        theta_d,
    } = entry;
    let side = |grid: &AngleGrid| u32::try_from(grid.len()).unwrap_or(u32::MAX);
    let size = [side(&theta_d), side(&theta_h)];
    let mut bytes = Vec::new();
    let most = picture_bytes(size);
    archive.read(&file, most, &mut bytes, &mut Unpacking::default())?;
    let picture = Picture::read_exr(&bytes, Some(size), limits, &mut PictureScratch::default());
    let picture = picture.map_err(|source| PackageError::Picture {
        file: file.clone(),
        source,
    })?;
    let colors =
        (0..picture.pixels()).map(|k| picture.planes.each_ref().map(|plane| f64::from(plane[k])));
    let nodes: Vec<Lab> = colors.map(Lab::from_rgb).collect();
    if let Some(k) = nodes
        .iter()
        .position(|lab| lab.to_array().iter().any(|v| v.abs() > MAX_LAB))
    {
        let (row, column) = (k / theta_d.len(), k % theta_d.len());
        let reason = format!("the color at row {row}, column {column} is beyond 2000 in L, a or b");
        return Err(PackageError::Damaged { file, reason });
    }
    let overall = overall_color(&theta_h, &theta_d, &nodes);
    ColorTable::new(theta_h, theta_d, nodes, overall)
        .map_err(|source| PackageError::ColorTable { file, source })
}

/// Mean of a table in linear light, each angle with the share of the axis that is nearest to it.
fn overall_color(theta_h: &AngleGrid, theta_d: &AngleGrid, nodes: &[Lab]) -> Lab {
    let shares = |grid: &AngleGrid| -> Vec<f64> {
        let d = grid.degrees();
        let share = |k: usize| d[(k + 1).min(d.len() - 1)] - d[k.saturating_sub(1)];
        if d.len() == 1 {
            vec![1.0]
        } else {
            (0..d.len()).map(share).collect()
        }
    };
    let (rows, columns) = (shares(theta_h), shares(theta_d));
    let (mut sum, mut weight) = ([0.0; 3], 0.0);
    for (k, lab) in nodes.iter().enumerate() {
        let share = rows[k / columns.len()] * columns[k % columns.len()];
        weight += share;
        for (s, c) in sum.iter_mut().zip(lab.to_rgb()) {
            *s += share * c;
        }
    }
    Lab::from_rgb(sum.map(|s| s / weight))
}
