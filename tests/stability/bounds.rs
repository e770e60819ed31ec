//! Every number of a paint at its bounds, a hair beyond them, and not a number: accepted there, refused by name here.

use crate::paints::{D, H, metallic};
use carpaint::color::Lab;
use carpaint::paint::{CarPaint, ColorTable, Flakes, Limits, PaintError};

/// The next number above, for finite numbers.
fn above(x: f64) -> f64 {
    x.next_up()
}

fn below(x: f64) -> f64 {
    x.next_down()
}

fn validate(change: impl FnOnce(&mut CarPaint)) -> Result<(), PaintError> {
    let mut paint = metallic(1, H, D);
    assert!(paint.coat.is_some());
    change(&mut paint);
    paint.validate(&Limits::default())
}

/// A number of a paint: its path, its bounds, and how to set it.
type Bounded = (&'static str, f64, f64, fn(&mut CarPaint, f64));

fn flakes(paint: &mut CarPaint) -> &mut Flakes {
    paint.flakes.as_mut().expect("has flakes")
}

fn set_overall(paint: &mut CarPaint, value: f64) {
    let table = &paint.color_table;
    let (h, d) = (table.theta_h().clone(), table.theta_d().clone());
    let overall = Lab {
        l: 50.0,
        a: value,
        b: 0.0,
    };
    paint.color_table = ColorTable::new(h, d, table.nodes().to_vec(), overall).expect("finite");
}

fn set_node(paint: &mut CarPaint, value: f64) {
    let table = &paint.color_table;
    let (h, d) = (table.theta_h().clone(), table.theta_d().clone());
    let mut nodes = table.nodes().to_vec();
    nodes[3].b = value;
    paint.color_table = ColorTable::new(h, d, nodes, table.overall()).expect("finite");
}

const NUMBERS: [Bounded; 15] = [
    ("coat.ior", 1.0, 4.0, |p, v| {
        p.coat.as_mut().expect("coated").ior = v;
    }),
    ("coat.roughness", 0.0, 1.0, |p, v| {
        p.coat.as_mut().expect("coated").roughness = v;
    }),
    ("coat.thickness_um", 0.0, 1e6, |p, v| {
        p.coat.as_mut().expect("coated").thickness_um = Some(v);
    }),
    ("diffuse[2]", 0.0, 1e3, |p, v| p.diffuse[2] = v),
    ("lobes[1].weight[0]", 0.0, 1e3, |p, v| {
        p.lobes[1].weight[0] = v;
    }),
    ("lobes[2].alpha", f64::MIN_POSITIVE, 10.0, |p, v| {
        p.lobes[2].alpha = v;
    }),
    ("lobes[0].f0", 0.0, 1.0, |p, v| p.lobes[0].f0 = v),
    ("color_table[3]", -2000.0, 2000.0, set_node),
    ("color_table.overall", -2000.0, 2000.0, set_overall),
    ("flakes.texel_um", 1e-3, 1e5, |p, v| {
        flakes(p).texture.texel_um = v;
    }),
    ("flakes.grain_um", 1e-3, 1e6, |p, v| {
        flakes(p).texture.grain_um = v;
    }),
    ("flakes.lifetime_deg[1]", 0.01, 1e4, |p, v| {
        flakes(p).texture.lifetime_deg[1] = v;
    }),
    ("flakes.persistence_deg[0]", 0.01, 1e4, |p, v| {
        flakes(p).texture.persistence_deg[0] = v;
    }),
    ("flakes.slices[1].box[2][0]", -2000.0, 2000.0, |p, v| {
        // Both corners, in order: the box is a point at the value, as near as f32 has it.
        flakes(p).lower[9][0] = v as f32;
        flakes(p).upper[9][0] = v as f32;
    }),
    ("flakes.slices[0].probability[4]", 0.0, 1.0, |p, v| {
        let list = &mut flakes(p).probability;
        let rest = (1.0 - v) / 6.0;
        list[..7].fill(rest.clamp(0.0, 1.0));
        list[4] = v;
    }),
];

#[test]
fn every_number_is_accepted_at_its_bounds_and_refused_beyond_them_by_its_path() {
    for (path, low, high, set) in NUMBERS {
        for value in [low, high] {
            let held = validate(|p| set(p, value));
            assert!(held.is_ok(), "{path} at {value}: {held:?}");
        }
        // A box's corner is an f32: the next one of those is further away.
        let single = path.contains("box");
        let beyond = if single {
            [low * (1.0 + 1e-6), high * (1.0 + 1e-6)]
        } else {
            [below(low), above(high)]
        };
        for value in beyond {
            match validate(|p| set(p, value)) {
                Err(PaintError::Range {
                    field, value: told, ..
                }) => {
                    assert_eq!(field, path, "{value}");
                    assert!(
                        (told - value).abs() <= if single { 1e-3 } else { 0.0 },
                        "{path}: {told}"
                    );
                }
                other => panic!("{path} at {value}: {other:?}"),
            }
        }
    }
}

#[test]
fn a_number_that_is_none_is_refused_wherever_it_stands() {
    for (path, .., set) in NUMBERS {
        if path.starts_with("color_table") {
            continue; // a table with such a number cannot be made: see below
        }
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(validate(|p| set(p, wrong)).is_err(), "{path} is {wrong}");
        }
    }
    let paint = metallic(1, H, D);
    let table = &paint.color_table;
    for wrong in [f64::NAN, f64::INFINITY] {
        let mut nodes = table.nodes().to_vec();
        nodes[2].a = wrong;
        let (h, d) = (table.theta_h().clone(), table.theta_d().clone());
        assert!(ColorTable::new(h.clone(), d.clone(), nodes, table.overall()).is_err());
        let overall = Lab {
            l: wrong,
            ..table.overall()
        };
        assert!(ColorTable::new(h, d, table.nodes().to_vec(), overall).is_err());
    }
}

#[test]
fn probabilities_of_a_slice_sum_to_one_within_a_few_roundings_each() {
    // Seven clusters: 7e-12 is accepted, which is what masses carried through two blends may have gathered.
    for (off, accepted) in [
        (5e-12, true),
        (-5e-12, true),
        (1e-11, false),
        (-1e-11, false),
    ] {
        let result = validate(|p| flakes(p).probability[10] += off);
        assert_eq!(result.is_ok(), accepted, "{off}: {result:?}");
        if let Err(PaintError::Range { field, .. }) = result {
            assert_eq!(field, "flakes.slices[1].probability");
        }
    }
}

#[test]
fn a_box_turned_inside_out_is_refused_by_cluster_and_axis() {
    let error = validate(|p| {
        let f = flakes(p);
        f.upper[8][2] = f.lower[8][2] - 1e-3;
    })
    .expect_err("refused");
    assert!(
        matches!(&error, PaintError::Range { field, .. } if field == "flakes.slices[1].box[1][2]"),
        "{error}"
    );
}

#[test]
fn lists_that_do_not_fit_together_are_refused_and_never_read_past_their_end() {
    let shape = |change: fn(&mut Flakes)| match validate(|p| change(flakes(p))) {
        Err(PaintError::Shape { field, .. } | PaintError::Count { field, .. }) => field,
        other => panic!("{other:?}"),
    };
    assert_eq!(shape(|f| f.offsets.truncate(3)), "flakes.offsets");
    assert_eq!(shape(|f| f.probability.truncate(41)), "flakes.clusters");
    assert_eq!(shape(|f| f.lower.truncate(41)), "flakes.clusters");
    assert_eq!(shape(|f| f.upper.push([0.0; 3])), "flakes.clusters");
    assert_eq!(shape(|f| f.offsets[0] = 1), "flakes.clusters");
    assert_eq!(shape(|f| f.offsets[2] = f.offsets[1]), "flakes.slices[1]");
    assert_eq!(shape(|f| f.offsets[2] = 0), "flakes.slices[1]");
    // The first slice would end behind the last cluster; the list descends after it.
    assert!(shape(|f| f.offsets[1] = 100).starts_with("flakes."));
    assert!(shape(|f| f.offsets[3] = u32::MAX).starts_with("flakes."));
}

#[test]
fn more_of_anything_than_the_limits_allow_is_refused_with_both_numbers() {
    let paint = metallic(1, H, D);
    let exactly = Limits {
        lobes: 3,
        clusters: 7,
        ..Limits::default()
    };
    paint.validate(&exactly).expect("at the limits");
    let refused = paint.validate(&Limits {
        lobes: 2,
        ..exactly
    });
    assert!(
        matches!(&refused, Err(PaintError::Count { field, count: 3, .. }) if field == "lobes"),
        "{refused:?}"
    );
    let refused = paint.validate(&Limits {
        clusters: 6,
        ..exactly
    });
    assert!(
        matches!(&refused, Err(PaintError::Count { field, count: 7, .. }) if field == "flakes.slices[0]"),
        "{refused:?}"
    );
}
