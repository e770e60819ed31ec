use super::*;
use crate::measurement::{ReadOptions, sniff};
use proptest::prelude::*;

mod comma_separated;
mod cxf;
mod paints;

const TABLE: &str =
    "aspecular_deg,L,a,b\r\n-15,90.5,-0.5,1\r\n15,95.25,-0.6,0.9\r\n45,48.7,-0.9,-1.2\r\n";

fn read_as(layout: Layout, text: &str) -> Result<ReadingsFile, ReadingsError> {
    ReadingsFile::read(text.as_bytes(), layout, None, &Limits::default())
}

fn refused(layout: Layout, text: &str) -> String {
    read_as(layout, text).expect_err("refused").to_string()
}

fn angles_of(file: &ReadingsFile) -> Vec<f64> {
    file.readings.rows.iter().map(|row| row[0]).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]
    /// Bytes changed, cut and doubled anywhere make readings or an error, never a panic.
    #[test]
    fn damage_is_an_error_at_worst(
        is_table in any::<bool>(), at_share in 0.0..1.0_f64, length in 0..40_usize,
        put in prop::collection::vec(prop_oneof![any::<u8>(), prop::sample::select(b"<>&\"'/=,;#.\n -9e".to_vec())], 0..12),
    ) {
        use cxf::{angle, at, document, lab, object, specification};
        let several = specification("s", &format!("<MultiAngle>{}{}</MultiAngle>", angle("15"), angle("45")));
        let (layout, mut bytes) = if is_table {
            (Layout::Csv, format!("# name: x\n# observer: 10\n{TABLE}").into_bytes())
        } else {
            let values = lab("s15", 90.0) + &lab("s", 5.0).replace("ns", "45as45");
            (Layout::Cxf, document(&object("o1", "silver", &values), &(at("s15", "15") + &several)).into_bytes())
        };
        let from = (at_share * bytes.len() as f64) as usize;
        let to = (from + length).min(bytes.len());
        bytes.splice(from..to, put);
        let _ = sniff(&bytes, &ReadOptions::default());
        if let Ok(file) = ReadingsFile::read(&bytes, layout, None, &Limits::default()) {
            let _ = file.readings.colors();
            let _ = file.readings.texture_notes();
        }
    }
}
