//! What the manifest says about the base: parameters, or a table.

use super::field::Field;
use crate::color::LinearRgb;
use crate::measurement::package::PackageError;
use crate::paint::{AngleGrid, Limits, Lobe, MAX_ALPHA};

/// The base as the manifest describes it.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::measurement) enum BaseEntry {
    Model {
        diffuse: LinearRgb,
        lobes: Vec<Lobe>,
        color_table: Option<TableEntry>,
    },
    Table {
        file: String,
        layout: TableLayout,
        header_bytes: u64,
    },
}

/// The color table's picture.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::measurement) struct TableEntry {
    pub file: String,
    pub theta_h: AngleGrid,
    pub theta_d: AngleGrid,
}

/// Layout of a package's BRDF table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableLayout {
    /// 180 x 90 x 90 x RGB, little-endian `f32`.
    Mpi2005,
    /// Three dimensions and three planes of little-endian `f64`.
    Merl,
}

pub(super) fn base(
    field: &Field,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<BaseEntry, PackageError> {
    field.object(&["model", "brdf_table"], warnings)?;
    match (field.get("model"), field.get("brdf_table")) {
        (Some(model), None) => model_base(&model, limits, warnings),
        (None, Some(table)) => {
            table.object(&["file", "layout", "header_bytes"], warnings)?;
            let layout = table.want("layout", "\"mpi-2005\" or \"merl\"")?;
            let layout = match layout.text()? {
                "mpi-2005" => TableLayout::Mpi2005,
                "merl" => TableLayout::Merl,
                _ => return layout.refuse("\"mpi-2005\" or \"merl\""),
            };
            let header_bytes = table
                .get("header_bytes")
                .map_or(Ok(0), |f| f.whole(0, 1 << 20))?;
            Ok(BaseEntry::Table {
                file: table.want("file", "the name of a file")?.file()?,
                layout,
                header_bytes,
            })
        }
        _ => field.refuse("exactly one of model and brdf_table"),
    }
}

fn model_base(
    model: &Field,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<BaseEntry, PackageError> {
    model.object(&["diffuse", "lobes", "color_table"], warnings)?;
    let diffuse = model
        .want("diffuse", "a number from 0 to 1000, or three of them")?
        .channels()?;
    let list = model.want("lobes", "1 to 8 lobes")?;
    let mut lobes = Vec::new();
    for lobe in list.list(limits.lobes, "lobes")? {
        lobe.object(&["weight", "alpha", "f0"], warnings)?;
        let accepted = "above 0, to 10";
        lobes.push(Lobe {
            weight: lobe
                .want("weight", "a number from 0 to 1000, or three of them")?
                .channels()?,
            alpha: lobe
                .want("alpha", accepted)?
                .number(f64::MIN_POSITIVE, MAX_ALPHA, accepted)?,
            f0: lobe.want("f0", "0 to 1")?.number(0.0, 1.0, "0 to 1")?,
        });
    }
    if lobes.is_empty() {
        return list.refuse(format!("1 to {} lobes", limits.lobes));
    }
    let table = |field: Field| {
        field.object(&["file", "theta_h_deg", "theta_i_deg"], warnings)?;
        Ok(TableEntry {
            file: field.want("file", "the name of a file")?.file()?,
            theta_h: field
                .want("theta_h_deg", "a list of angles")?
                .angles(limits)?,
            theta_d: field
                .want("theta_i_deg", "a list of angles")?
                .angles(limits)?,
        })
    };
    let color_table = model.get("color_table").map(table).transpose()?;
    Ok(BaseEntry::Model {
        diffuse,
        lobes,
        color_table,
    })
}
