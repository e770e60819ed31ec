//! What is no number never gets into a file: it is refused by its place, or never made.

use crate::paints::{D, H, blend, metallic, solid};
use carpaint::blend::{Blend, BlendDeviation, BlendError, BlendSettings, Ingredient};
use carpaint::color::Lab;
use carpaint::paint::{
    CarPaint, Clamp, Clustering, Coat, ColorTable, ColorTableError, FitResiduals, LuminanceError,
    PaintFile, Percentiles, Provenance, ReadingError, ReadingResiduals, Realisation,
    SeenDifference, certify,
};

type ChangeOfFile = fn(&mut PaintFile, f64);
type ChangeOfPaint = fn(&mut CarPaint);

const NONE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

/// A paint of which everything is known that a file can hold.
fn file() -> PaintFile {
    let mut paint = metallic(2, H, D);
    paint.coat = Some(Coat {
        ior: 1.5,
        roughness: 0.02,
        thickness_um: Some(40.0),
    });
    let luminance = LuminanceError {
        median: 0.01,
        p90: 0.02,
        floor_median: 0.01,
        floor_p90: 0.02,
    };
    let provenance = Provenance {
        source: "blend".into(),
        realisation: Some(Realisation {
            paints: vec!["a".into(), "b".into()],
            base: vec![0.5; 2],
            flake_lightness: vec![0.5; 2],
            flake_color: vec![0.5; 2],
            flake_saturation: 1.0,
            clamps: vec![Clamp {
                field: "diffuse".into(),
                bound: "held to 0..1000".into(),
                count: 1,
                of: 3,
                worst: 0.5,
            }],
        }),
        ..Provenance::default()
    };
    PaintFile {
        name: "whole".into(),
        provenance,
        clustering: Some(clustering()),
        residuals: Some(FitResiduals {
            relative_rmse: 0.1,
            all: luminance,
            near_mirror: luminance,
            instrument: Vec::new(),
            invalid_share: 0.0,
        }),
        readings: Some(ReadingResiduals {
            illumination_deg: 45.0,
            rows: vec![ReadingError {
                aspecular_deg: 15.0,
                delta_e_2000: 1.0,
            }],
            median: 1.0,
            worst: 1.0,
            approximate: false,
        }),
        energy: certify(&paint),
        warnings: Vec::new(),
        paint,
    }
}

fn clustering() -> Clustering {
    Clustering {
        clusters: 7,
        box_rule: "moments".into(),
        angle_step: 1,
        w1_bound: Some(Percentiles::default()),
        left_out_w1: Some(Percentiles::default()),
        left_out_seen: Some(SeenDifference {
            delta_e_2000: [0.5; 6],
            sparkle: [0.25; 6],
            lit: [0.125; 6],
        }),
        error: None,
        realised_lab: Some(0.5),
        realised_seen: Some(SeenDifference {
            delta_e_2000: [0.5; 6],
            sparkle: [0.25; 6],
            lit: [0.125; 6],
        }),
        reduced_w1: Some(Percentiles::default()),
        reduced_seen: Some(SeenDifference {
            delta_e_2000: [0.5; 6],
            sparkle: [0.25; 6],
            lit: [0.125; 6],
        }),
    }
}

#[test]
fn a_paint_with_a_number_that_is_none_is_refused_by_its_place() {
    file().to_bytes().expect("a whole file is written");
    let cases: [(&str, ChangeOfFile); 20] = [
        ("physical.diffuse[1]", |f, v| f.paint.diffuse[1] = v),
        ("physical.coat.ior", |f, v| {
            f.paint.coat.as_mut().expect("coated").ior = v;
        }),
        ("physical.coat.thickness_um", |f, v| {
            f.paint.coat.as_mut().expect("coated").thickness_um = Some(v);
        }),
        ("physical.lobes[2].weight[0]", |f, v| {
            f.paint.lobes[2].weight[0] = v;
        }),
        ("physical.lobes[0].alpha", |f, v| f.paint.lobes[0].alpha = v),
        ("physical.flakes.texture.grain_um", |f, v| {
            f.paint.flakes.as_mut().expect("has").texture.grain_um = v;
        }),
        ("flakes.probability[9]", |f, v| {
            f.paint.flakes.as_mut().expect("has").probability[9] = v;
        }),
        ("flakes.lower[4][0]", |f, v| {
            f.paint.flakes.as_mut().expect("has").lower[4][0] = v as f32;
        }),
        ("flakes.upper[41][2]", |f, v| {
            f.paint.flakes.as_mut().expect("has").upper[41][2] = v as f32;
        }),
        ("residuals.relative_rmse", |f, v| {
            f.residuals.as_mut().expect("has").relative_rmse = v;
        }),
        ("residuals.near_mirror.floor_p90", |f, v| {
            f.residuals.as_mut().expect("has").near_mirror.floor_p90 = v;
        }),
        ("readings.rows[0].delta_e_2000", |f, v| {
            f.readings.as_mut().expect("has").rows[0].delta_e_2000 = v;
        }),
        ("clustering.realised_lab", |f, v| {
            f.clustering.as_mut().expect("has").realised_lab = Some(v);
        }),
        ("clustering.w1_bound.worst", |f, v| {
            let bound = f.clustering.as_mut().expect("has").w1_bound.as_mut();
            bound.expect("has").worst = v;
        }),
        ("clustering.left_out_seen.sparkle[5]", |f, v| {
            let seen = f.clustering.as_mut().expect("has").left_out_seen.as_mut();
            seen.expect("has").sparkle[5] = v;
        }),
        ("clustering.reduced_w1.p90", |f, v| {
            let w1 = f.clustering.as_mut().expect("has").reduced_w1.as_mut();
            w1.expect("has").p90 = v;
        }),
        ("clustering.reduced_seen.lit[0]", |f, v| {
            let seen = f.clustering.as_mut().expect("has").reduced_seen.as_mut();
            seen.expect("has").lit[0] = v;
        }),
        ("energy.albedo[0]", |f, v| f.energy.albedo[0] = v),
        ("provenance.realisation.base[1]", |f, v| {
            f.provenance.realisation.as_mut().expect("has").base[1] = v;
        }),
        ("provenance.realisation.clamps[0].worst", |f, v| {
            f.provenance.realisation.as_mut().expect("has").clamps[0].worst = v;
        }),
    ];
    for (field, change) in cases {
        for value in NONE {
            let mut spoiled = file();
            change(&mut spoiled, value);
            let refused = spoiled.to_bytes().expect_err(field);
            assert_eq!(refused.field, field);
            assert_eq!(refused.value.to_bits(), value.to_bits(), "{refused}");
        }
    }
}

#[test]
fn a_color_table_with_a_color_that_is_none_is_never_made() {
    let table = solid(1).color_table;
    for value in NONE {
        for axis in 0..3 {
            let spoiled = |lab: Lab| {
                let mut numbers = lab.to_array();
                numbers[axis] = value;
                Lab::from(numbers)
            };
            let (h, d) = (table.theta_h().clone(), table.theta_d().clone());
            let mut nodes = table.nodes().to_vec();
            nodes[3] = spoiled(nodes[3]);
            let made = ColorTable::new(h.clone(), d.clone(), nodes, table.overall());
            assert_eq!(made, Err(ColorTableError::NotFinite { row: 1, column: 1 }));
            let overall = spoiled(table.overall());
            let made = ColorTable::new(h, d, table.nodes().to_vec(), overall);
            assert!(
                matches!(made, Err(ColorTableError::NotFinite { .. })),
                "{made:?}"
            );
        }
    }
}

/// A blend of a paint that was changed and another, and what is said of its file.
fn file_of_blend(change: impl FnOnce(&mut CarPaint)) -> Result<(), String> {
    let (mut a, b) = (metallic(4, H, D), metallic(5, H, D));
    change(&mut a);
    let given = [("a", &a), ("b", &b)].map(|(name, paint)| Ingredient { name, paint });
    let blend = Blend::new(&given, &BlendSettings::default(), &|_| ());
    let blend = blend.map_err(|error: BlendError| error.to_string())?;
    let file = blend.to_bytes().map_err(|error| error.to_string())?;
    assert!(Blend::recognises(&file));
    Ok(())
}

#[test]
fn a_blend_with_a_number_that_is_none_is_refused_by_its_place_or_never_made() {
    assert_eq!(file_of_blend(|_| ()), Ok(()));
    let cases: [(&str, ChangeOfPaint); 6] = [
        ("diffuse[2] is NaN", |p| p.diffuse[2] = f64::NAN),
        ("lobes[1].f0 is inf", |p| p.lobes[1].f0 = f64::INFINITY),
        ("textures[", |p| {
            p.flakes.as_mut().expect("has").texture.lifetime_deg[1] = f64::NAN;
        }),
        ("is NaN", |p| {
            p.flakes.as_mut().expect("has").lower[3][1] = f32::NAN;
        }),
        ("is inf", |p| {
            p.flakes.as_mut().expect("has").upper[3][1] = f32::INFINITY;
        }),
        ("mass NaN", |p| {
            p.flakes.as_mut().expect("has").probability[3] = f64::NAN;
        }),
    ];
    for (says, change) in cases {
        let refused = file_of_blend(change).expect_err(says);
        assert!(refused.contains(says), "{refused} does not say {says}");
    }
}

#[test]
fn a_report_of_a_blend_with_a_number_that_is_none_is_refused_by_its_place() {
    let deviation = BlendDeviation {
        aspecular_deg: 15.0,
        delta_e_2000: 0.1,
        sparkle: f64::NAN,
        lit: None,
    };
    let spoiled = Clustering {
        realised_lab: Some(f64::INFINITY),
        ..clustering()
    };
    let made = || blend(&[&metallic(4, H, D), &metallic(5, H, D)]);
    let refused = made()
        .with_accuracy(vec![deviation], &[None, None])
        .to_bytes();
    assert_eq!(
        refused.expect_err("refused").field,
        "report.against_exact[0].sparkle"
    );
    let refused = made()
        .with_accuracy(Vec::new(), &[Some(spoiled), None])
        .to_bytes();
    let field = refused.expect_err("refused").field;
    assert!(field.ends_with("].clustering.realised_lab"), "{field}");
}
