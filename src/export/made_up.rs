//! A made-up paint for this room's tests.

use crate::color::Lab;
use crate::export::About;
use crate::paint::{AngleGrid, CarPaint, Coat, ColorTable, FlakeTexture, Flakes, Lobe, Provenance};

/// A metallic of `rows x columns` slices of `clusters` skewed clusters.
pub(super) fn metallic(rows: u32, columns: u32, clusters: u32) -> CarPaint {
    let grid = |n: u32, reach: f64| {
        AngleGrid::new(
            (0..n)
                .map(|k| f64::from(k) * reach / f64::from(n))
                .collect(),
        )
        .expect("ascending")
    };
    let (theta_h, theta_d) = (grid(rows, 60.0), grid(columns, 42.0));
    let mut flakes = Flakes {
        theta_h,
        theta_d,
        offsets: vec![0].into(),
        probability: vec![].into(),
        lower: vec![],
        upper: vec![],
        texture: FlakeTexture {
            texel_um: 20.0,
            grain_um: 40.0,
            lifetime_deg: [3.0, 5.0],
            persistence_deg: [6.0, 10.0],
        },
    };
    for slice in 0..rows * columns {
        let sum: f64 = (0..clusters)
            .map(|k| 0.9_f64.powi(i32::try_from(k).expect("few")))
            .sum();
        for k in 0..clusters {
            let t = f64::from(k) / f64::from(clusters);
            #[allow(clippy::cast_possible_truncation)]
            let l = (110.0 * t * t * t * (1.0 - 0.8 * f64::from(slice / columns) / f64::from(rows))
                - 2.0) as f32;
            flakes
                .probability
                .push(0.9_f64.powi(i32::try_from(k).expect("few")) / sum);
            flakes.lower.push([l, -3.0, -1.5]);
            flakes.upper.push([l + 2.0, 2.0, 1.0]);
        }
        flakes.offsets.push((slice + 1) * clusters);
    }
    let white = Lab {
        l: 100.0,
        a: 0.0,
        b: 0.0,
    };
    let node = |k: u32| Lab {
        l: 92.0 - f64::from(k) / 40.0,
        a: 1.0,
        b: -6.0,
    };
    let (chi_h, chi_d) = (grid(30, 90.0), grid(30, 90.0));
    CarPaint {
        coat: Some(Coat::smooth(1.5)),
        diffuse: [0.03, 0.035, 0.05],
        lobes: vec![
            Lobe {
                weight: [0.05, 0.055, 0.06],
                alpha: 0.35,
                f0: 0.8,
            },
            Lobe {
                weight: [0.04, 0.045, 0.05],
                alpha: 0.14,
                f0: 0.6,
            },
        ],
        color_table: ColorTable::new(chi_h, chi_d, (0..900).map(node).collect(), white)
            .expect("fits"),
        flakes: Some(flakes),
    }
}

/// Something to say about it.
pub(super) fn about() -> About {
    About {
        name: "made up".into(),
        provenance: Provenance::default(),
        report: serde_json::json!({"weights": {"weights": [1.0]}}),
    }
}
