//! The profiles that a target is looked for among, from cheap to dear; of files from the smallest to the largest.

use crate::accuracy::Profile;
use crate::export::{ExportSettings, Precision};
use crate::fit::ClusterSettings;
use crate::workshop::{Format, Source, Work, find, is_paint_file};

/// Profiles to pick from, by what the work's accuracy depends on, from cheap to dear.
pub(super) fn ladder(work: &Work<'_>) -> Vec<Profile> {
    let standard = Profile::standard();
    let clustered = |clusters, angle_step| ClusterSettings {
        clusters,
        angle_step,
        ..standard.flakes
    };
    // Paints that came of a blend are reduced by all but the last.
    let every_other_angle_or_all = vec![
        Profile {
            flakes: clustered(standard.flakes.clusters, 2),
            ..standard
        },
        standard,
        Profile::reference(),
    ];
    match work {
        Work::Ingest { .. } => [
            (24, 2),
            (12, 1),
            (24, 1),
            (50, 1),
            (100, 1),
            (200, 1),
            (400, 1),
            (1000, 1),
            (1500, 1),
            (2500, 1),
            (4096, 1),
        ]
        .into_iter()
        .map(|(clusters, step)| Profile {
            flakes: clustered(clusters, step),
            ..standard
        })
        .collect(),
        // Paints have the clusters that they have, unless they came of a blend.
        Work::Blend { paints } if paints.iter().all(|paint| !paint.provenance.is_blend()) => {
            every_other_angle_or_all
        }
        Work::BlendNames { names, .. } if names.iter().all(|name| is_paint(name)) => {
            every_other_angle_or_all
        }
        Work::BlendNames { .. } | Work::Blend { .. } => {
            let by = |clusters| Profile {
                flakes: clustered(clusters, 1),
                ..standard
            };
            vec![
                Profile::draft(),
                by(12),
                by(24),
                standard,
                by(100),
                by(200),
                Profile::reference(),
                by(400),
                by(1000),
            ]
        }
        // Of the formats only textures are rounded; of a picture any number of samples may be picked.
        Work::Realise {
            format: Format::Glb | Format::Paint,
            ..
        }
        | Work::Preview(_) => vec![standard],
        Work::Realise { .. } | Work::Bundle { .. } => {
            [Precision::Eight, Precision::F16, Precision::F32]
                .into_iter()
                .map(|precision| Profile {
                    export: ExportSettings {
                        precision,
                        ..standard.export
                    },
                    ..standard
                })
                .collect()
        }
    }
}

/// Whether a name is that of a `.paint` file.
fn is_paint(name: &str) -> bool {
    matches!(find(name), Ok(Source::Path(path)) if is_paint_file(&path).unwrap_or(false))
}
