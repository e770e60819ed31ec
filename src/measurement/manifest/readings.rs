//! What the manifest says about the readings of a multi-angle instrument.

use super::field::Field;
use crate::color::{Illuminant, Observer};
use crate::measurement::multi_angle::{MultiAngle, most_readings};
use crate::measurement::package::PackageError;
use crate::paint::Limits;

/// Angles of light that are accepted: above the horizon.
const LIGHT: &str = "degrees from 0 to below 90";

pub(super) fn multi_angle(
    field: &Field,
    limits: &Limits,
    warnings: &mut Vec<String>,
) -> Result<MultiAngle, PackageError> {
    field.object(
        &[
            "illumination_deg",
            "illuminant",
            "observer",
            "columns",
            "rows",
        ],
        warnings,
    )?;
    let illuminant = field.want("illuminant", "\"D65\" or \"D50\"")?;
    let observer = field.want("observer", "\"2\" or \"10\"")?;
    let list = field.want("columns", "a list of names, the first aspecular_deg")?;
    let mut columns = Vec::new();
    for column in list.list(1000, "names")? {
        let name = column.text()?;
        if columns.iter().any(|other| other == name) {
            return column.refuse("a name that no other column has");
        }
        columns.push(name.to_owned());
    }
    if !MultiAngle::are_readings(&columns) {
        return list.refuse("aspecular_deg first, then L, a, b or spectral columns nm400 to nm700");
    }
    let mut rows = Vec::new();
    for row in field
        .want("rows", "a list of rows")?
        .list(most_readings(limits), "rows")?
    {
        let cells = row.list(columns.len(), "numbers")?;
        if cells.len() != columns.len() {
            return row.refuse(format!("{} numbers, one per column", columns.len()));
        }
        let number = |f: &Field| f.number(-1e6, 1e6, "a number from -1000000 to 1000000");
        let angle = cells[0].number(-90.0, 180.0, "an aspecular angle from -90 to 180 degrees")?;
        let rest = cells[1..].iter().map(number);
        rows.push(
            std::iter::once(Ok(angle))
                .chain(rest)
                .collect::<Result<Vec<f64>, _>>()?,
        );
    }
    let readings = MultiAngle {
        illumination_deg: field.want("illumination_deg", LIGHT)?.number(
            0.0,
            90.0_f64.next_down(),
            LIGHT,
        )?,
        illuminant: match illuminant.text()? {
            "D65" => Illuminant::D65,
            "D50" => Illuminant::D50,
            _ => return illuminant.refuse("\"D65\" or \"D50\""),
        },
        observer: match observer.text()? {
            "2" => Observer::Two,
            "10" => Observer::Ten,
            _ => return observer.refuse("\"2\" or \"10\""),
        },
        columns,
        rows,
    };
    // What has no color at all is refused where its colors are wanted.
    let told = readings.colors().ok().and_then(|colors| colors.warning);
    warnings.extend(told.map(|why| format!("multi_angle: {why}")));
    Ok(readings)
}
