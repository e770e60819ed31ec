//! Sums of errors, on figures made by hand.

use super::*;
use crate::blend::BlendDeviation;
use crate::paint::{ASPECULAR_DEG, ClusteringError, Percentiles, SeenDifference};

fn clustering(color: f64, lit: Option<f64>, sparkle: f64) -> Clustering {
    let at_p90 = |p90| Percentiles {
        p90,
        ..Percentiles::default()
    };
    Clustering {
        clusters: 50,
        box_rule: "moments".to_owned(),
        angle_step: 1,
        w1_bound: None,
        left_out_w1: None,
        left_out_seen: None,
        error: Some(ClusteringError {
            slices: 20,
            of: 100,
            lightness_w1: at_p90(0.3),
            mean_luminance: Percentiles::default(),
            sparkle: at_p90(sparkle),
            instrument: [color; 6],
            lit: lit.map(|lit| [lit; 6]),
        }),
        realised_lab: None,
        realised_seen: None,
        reduced_w1: None,
        reduced_seen: None,
    }
}

fn seen(clustering: &Clustering) -> Option<SeenError> {
    SeenError::of_clusters(Some(clustering)).ok()
}

fn deviations(lit: Option<f64>) -> Vec<BlendDeviation> {
    // In another order than the geometries'.
    ASPECULAR_DEG
        .iter()
        .rev()
        .map(|&aspecular_deg| BlendDeviation {
            aspecular_deg,
            delta_e_2000: aspecular_deg.abs(),
            sparkle: 0.01,
            lit,
        })
        .collect()
}

#[test]
fn what_was_not_measured_is_not_told() {
    assert!(SeenError::of_clusters(None).is_err());
    assert!(seen(&clustering(0.1, None, 0.0)).is_none());
    let thinned = Clustering {
        left_out_w1: Some(Percentiles::default()),
        ..clustering(0.1, Some(0.1), 0.0)
    };
    assert!(seen(&thinned).is_none());
    let known = Clustering {
        left_out_seen: Some(SeenDifference {
            delta_e_2000: [0.5; 6],
            sparkle: [0.25, 0.125, 0.0, 0.0, 0.0, 0.0],
            lit: [0.25; 6],
        }),
        ..thinned
    };
    let known = seen(&known).expect("measured");
    assert_eq!((known.delta_e_2000, known.sparkle), ([0.6; 6], 0.25));
    assert_eq!(known.lit, [0.35; 6]);
    let whole = seen(&clustering(0.1, Some(0.1), 0.0)).expect("measured");
    assert!(whole.and_transport(&deviations(None)).is_none());
    assert!(whole.and_transport(&deviations(Some(0.0))[1..]).is_none());
    assert_eq!(whole.and_transport(&[]), Some(whole));
}

#[test]
fn the_worst_paint_counts_and_steps_add_up_geometry_by_geometry() {
    let first = seen(&clustering(0.1, Some(0.3), 0.02)).expect("measured");
    let second = seen(&clustering(0.2, Some(0.1), 0.01)).expect("measured");
    let worse = first.or_worse(second);
    assert_eq!(
        (worse.delta_e_2000, worse.lit, worse.sparkle),
        ([0.2; 6], [0.3; 6], 0.02)
    );
    let blended = worse
        .and_transport(&deviations(Some(0.5)))
        .expect("measured");
    assert_eq!(
        blended.delta_e_2000,
        ASPECULAR_DEG.map(|angle| 0.2 + angle.abs())
    );
    assert_eq!((blended.lit, blended.sparkle), ([0.8; 6], 0.03));
    let writing = WritingError {
        rounding_w1: 0.05,
        instrument: vec![1.0; 6],
        sparkle: vec![0.0, 0.0, 0.07, 0.0, 0.0, 0.0],
        lit: vec![0.1; 6],
        inverse_cdf_loss: None,
    };
    let of = ResultError::of(Vec::new(), Ok(worse));
    let file = file_error(&of, Some(&writing));
    let seen = file.seen.expect("measured");
    assert_eq!((seen.delta_e_2000, file.lab), ([1.2; 6], Some(0.05)));
    assert!((seen.lit[3] - 0.4).abs() < 1e-12 && (seen.sparkle - 0.09).abs() < 1e-12);
    let of = ResultError {
        terms: file.terms,
        ..of
    };
    let is_seen = |sizes| of.stretched(sizes).seen.is_some();
    assert!(is_seen([1.0, 1.0]) && !is_seen([1.6, 1.0]) && !is_seen([1.0, 1.6]));
    assert_eq!(of.stretched([1.0, 1.6]).lab, Some(0.05));
    let other = of.of_other_material();
    assert!(other.seen.is_none() && other.unseen.is_some());
}

#[test]
fn a_realised_paint_is_seen_as_its_blend_was_and_what_was_merged_since_adds_up() {
    let of_blend = seen(&clustering(0.1, Some(0.3), 0.02)).expect("measured");
    let realised = Clustering {
        error: None,
        realised_lab: Some(0.3),
        realised_seen: Some(of_blend.kept()),
        ..clustering(0.0, None, 0.0)
    };
    assert_eq!(seen(&realised), Some(of_blend));
    let unseen = Clustering {
        realised_seen: None,
        ..realised.clone()
    };
    assert_eq!(SeenError::of_clusters(Some(&unseen)), Err(REALISED_UNSEEN));
    let reduced = Clustering {
        reduced_w1: Some(Percentiles::default()),
        ..realised
    };
    assert!(seen(&reduced).is_none());
    let measured = Clustering {
        reduced_seen: Some(SeenDifference {
            delta_e_2000: [0.25; 6],
            sparkle: [0.0, 0.5, 0.0, 0.0, 0.0, 0.0],
            lit: [0.0; 6],
        }),
        ..reduced
    };
    let measured = seen(&measured).expect("measured");
    assert_eq!((measured.delta_e_2000, measured.lit), ([0.35; 6], [0.3; 6]));
    assert_eq!(measured.sparkle, 0.52);
}

#[test]
fn a_picture_is_off_by_chance_and_by_its_paint_or_nobody_knows_how_far() {
    let seen = seen(&clustering(0.25, Some(0.0), 0.0)).expect("measured");
    let term = Term {
        what: "clusters",
        lab: Some(0.5),
        how: CLUSTERS,
    };
    let of = ResultError::of(vec![term], Ok(seen));
    let picture = PictureError::of(0.5, &of);
    assert_eq!(
        (picture.samples, picture.paint, picture.delta_e_2000),
        (0.5, Some(0.25), Some(0.75))
    );
    assert_eq!(picture.with_samples(0.125).delta_e_2000, Some(0.375));
    let stretched = of.stretched([1.6, 1.6]);
    let beyond = PictureError::of(0.5, &stretched);
    assert_eq!(
        (beyond.samples, beyond.paint, beyond.delta_e_2000),
        (0.5, None, None)
    );
    assert_eq!(Some(beyond.how), stretched.unseen);
    let solid = PictureError::of(0.5, &ResultError::none().stretched([3.0, 3.0]));
    assert_eq!(solid.delta_e_2000, Some(0.5));
}
