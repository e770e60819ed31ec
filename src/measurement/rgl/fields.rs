//! Fields of the file, each checked for its shape and its numbers.

use super::RglError;
use super::density::Extent;
use crate::measurement::tensor::Tensors;

pub(super) fn wrong(name: &'static str, shape: &[usize], accepted: &str) -> RglError {
    RglError::Shape {
        name,
        shape: shape.to_vec(),
        accepted: accepted.to_owned(),
    }
}

/// A field of finite numbers, `>= 0` where it is a density.
pub(super) fn finite<'f>(
    file: &'f Tensors<'_>,
    name: &'static str,
    density: bool,
) -> Result<(Vec<f32>, &'f [usize]), RglError> {
    let (values, shape) = file.floats(name)?;
    let accepted = if density {
        "finite numbers from 0"
    } else {
        "finite numbers"
    };
    // f32 squared sums must stay finite: nothing a goniometer writes comes near 1e15.
    let good = |v: f32| v.abs() <= 1e15 && !(density && v < 0.0);
    match values.iter().position(|&v| !good(v)) {
        Some(index) => Err(RglError::Value {
            name,
            index,
            value: values[index],
            accepted,
        }),
        None if density && values.iter().all(|&v| v == 0.0) => Err(RglError::Empty(name)),
        None => Ok((values, shape)),
    }
}

pub(super) fn angles(
    file: &Tensors<'_>,
    name: &'static str,
    least: usize,
    range: std::ops::RangeInclusive<f32>,
    accepted: &'static str,
) -> Result<Vec<f64>, RglError> {
    let (values, shape) = file.floats(name)?;
    if shape.len() != 1 || values.len() < least || values.len() > 4096 {
        return Err(wrong(
            name,
            shape,
            &format!("one dimension of {least} to 4096"),
        ));
    }
    for (index, &value) in values.iter().enumerate() {
        if !range.contains(&value) || (index > 0 && value <= values[index - 1]) {
            return Err(RglError::Angle {
                name,
                index,
                value,
                accepted,
            });
        }
    }
    Ok(values.into_iter().map(f64::from).collect())
}

pub(super) fn surface(
    file: &Tensors<'_>,
    name: &'static str,
) -> Result<(Extent, Vec<f32>), RglError> {
    let (values, shape) = finite(file, name, true)?;
    match *shape {
        [rows, columns] if rows >= 2 && columns >= 2 => Ok((Extent { rows, columns }, values)),
        _ => Err(wrong(name, shape, "[2.., 2..]")),
    }
}
