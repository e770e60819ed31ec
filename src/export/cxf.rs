//! Readings as a `CxF3` document (ISO 17972-1): what measuring and recipe software exchanges.
//!
//! One object holds an L, a, b for each angle, each with a specification of its own that names light, observer and
//! geometry (`MultiAngle`, one `BRDFAngle`). The same paint, name and angles give the same bytes: the format wants a date
//! of creation, which is the day of the measurement where the paint knows it, and 1970-01-01 where it does not.

use std::borrow::Cow;
use std::fmt::Write as _;

use super::readings::Readings;

/// Media type of the document: `CxF3` has none of its own.
pub const CXF_MEDIA_TYPE: &str = "application/xml";

/// Day of a paint that does not know when it was measured.
const UNKNOWN_DAY: &str = "1970-01-01";

impl Readings {
    /// The readings as a `CxF3` document of a paint of this name, measured on this day.
    #[must_use]
    pub fn to_cxf(&self, name: &str, measured_on: Option<&str>) -> String {
        let date = format!(
            "{}T00:00:00Z",
            measured_on.and_then(day).unwrap_or(UNKNOWN_DAY)
        );
        let name = escaped(name);
        let light = self.illumination_deg;
        let (mut colors, mut specifications) = (String::new(), String::new());
        for (k, [angle, l, a, b]) in self.rows.iter().enumerate() {
            let (id, notation) = (format!("angle{k}"), format!("{light}as{angle}"));
            let _ = write!(
                colors,
                "\n          <cc:ColorCIELab Name=\"{notation}\" ColorSpecification=\"{id}\"><cc:L>{l}</cc:L><cc:A>{a}</cc:A>\
                 <cc:B>{b}</cc:B></cc:ColorCIELab>"
            );
            let (illuminant, observer) = (self.illuminant, self.observer);
            let _ = write!(
                specifications,
                "\n      <cc:ColorSpecification Id=\"{id}\">\n        <cc:TristimulusSpec><cc:Illuminant>{illuminant}\
                 </cc:Illuminant><cc:Observer>{observer}_Degree</cc:Observer><cc:Method>unknown</cc:Method>\
                 </cc:TristimulusSpec>\n        <cc:MeasurementSpec>\n          <cc:MeasurementType>\
                 Colorimetric_Reflectance</cc:MeasurementType>\n          <cc:GeometryChoice><cc:MultiAngle><cc:BRDFAngle \
                 Notation=\"{notation}\"><cc:IlluminationAngle>{light}</cc:IlluminationAngle><cc:Aspecular>{angle}\
                 </cc:Aspecular></cc:BRDFAngle></cc:MultiAngle></cc:GeometryChoice>\n        </cc:MeasurementSpec>\n      \
                 </cc:ColorSpecification>"
            );
        }
        format!(
            r#"<?xml version="1.0" encoding="UTF-8"?>
<cc:CxF xmlns:cc="http://colorexchangeformat.com/CxF3-core">
  <cc:FileInformation>
    <cc:Creator>carpaint</cc:Creator>
    <cc:CreationDate>{date}</cc:CreationDate>
    <cc:Description>Readings of a paint by a virtual multi-angle instrument</cc:Description>
  </cc:FileInformation>
  <cc:Resources>
    <cc:ObjectCollection>
      <cc:Object ObjectType="Standard" Name="{name}" Id="paint">
        <cc:CreationDate>{date}</cc:CreationDate>
        <cc:ColorValues>{colors}
        </cc:ColorValues>
      </cc:Object>
    </cc:ObjectCollection>
    <cc:ColorSpecificationCollection>{specifications}
    </cc:ColorSpecificationCollection>
  </cc:Resources>
</cc:CxF>
"#
        )
    }
}

/// A name as the value of an attribute. Two code points that a name may have are none of XML's.
fn escaped(name: &str) -> String {
    let known: String = name
        .chars()
        .map(|c| {
            if matches!(c, '\u{fffe}' | '\u{ffff}') {
                '\u{fffd}'
            } else {
                c
            }
        })
        .collect();
    let escaped: Cow<str> = quick_xml::escape::escape(known.as_str());
    escaped.into_owned()
}

/// The day that a text begins with, `2026-03-31`, where it does.
fn day(text: &str) -> Option<&str> {
    let (day, rest) = (text.get(..10)?, text.get(10..)?);
    let digits = day.bytes().enumerate().all(|(at, c)| {
        if matches!(at, 4 | 7) {
            c == b'-'
        } else {
            c.is_ascii_digit()
        }
    });
    let number = |range: std::ops::Range<usize>| day.get(range)?.parse::<u32>().ok();
    let (year, month, of_month) = (number(0..4)?, number(5..7)?, number(8..10)?);
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let last = match month {
        2 => 28 + u32::from(leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    };
    let is_day = digits && year > 0 && (1..=last).contains(&of_month);
    (is_day && !rest.starts_with(|c: char| c.is_ascii_digit())).then_some(day)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::readings;
    use crate::measurement::{Layout, ReadingsFile};
    use crate::paint::{ASPECULAR_DEG, CarPaint, ColorTable, Limits};

    fn read() -> Readings {
        let paint = CarPaint {
            coat: None,
            diffuse: [0.3, 0.2, 0.05],
            lobes: Vec::new(),
            color_table: ColorTable::white(),
            flakes: None,
        };
        readings(&paint, &ASPECULAR_DEG).expect("all above the paint")
    }

    #[test]
    fn what_is_written_is_read_again_to_the_last_digit() {
        let name = "A <\"silver\"> & 'more'";
        let document = read().to_cxf(name, Some("2026-03-31T12:00:00+02:00"));
        let file = ReadingsFile::read(document.as_bytes(), Layout::Cxf, None, &Limits::default())
            .expect("our own document");
        assert_eq!(file.name.as_deref(), Some(name));
        assert_eq!(file.notes["measured_on"], "2026-03-31T00:00:00Z");
        let rows: Vec<Vec<f64>> = read().rows.iter().map(|row| row.to_vec()).collect();
        assert_eq!(file.readings.rows, rows);
        assert!(file.warnings.is_empty(), "{:?}", file.warnings);
    }

    #[test]
    fn the_date_is_the_measurements_day_or_a_known_one_and_no_clocks() {
        for (said, written) in [
            ("2026-03-31", "2026-03-31"),
            ("2024-02-29 in the morning", "2024-02-29"),
            ("2023-02-29", UNKNOWN_DAY),
            ("2023-13-01", UNKNOWN_DAY),
            ("31.03.2026", UNKNOWN_DAY),
            ("2026-03-311", UNKNOWN_DAY),
            ("März 2026 oder so", UNKNOWN_DAY),
        ] {
            let document = read().to_cxf("silver", Some(said));
            let date = format!("<cc:CreationDate>{written}T00:00:00Z</cc:CreationDate>");
            assert_eq!(document.matches(&date).count(), 2, "{said}");
        }
        assert_eq!(
            read().to_cxf("silver", None),
            read().to_cxf("silver", Some("unknown"))
        );
    }
}
