//! How time grows with the size of the work.

use super::material::clustered;
use super::{Material, StudyOptions, Tell, WorkshopError, shortest};
use crate::accuracy::Profile;
use crate::accuracy::study::Growth;
use crate::fit::{BoxRule, ClusterSettings, Clusterer};
use crate::measurement::SliceRoom;
use crate::paint::{CarPaint, Limits, PaintFile};
use crate::render::{self, Scene, Shape};
use crate::workshop::blend_paints;

/// Measures all curves.
pub(super) fn measure(
    material: &mut Material,
    options: &StudyOptions,
    tell: Tell<'_>,
) -> Result<Vec<Growth>, WorkshopError> {
    let goes = if options.quick { 2 } else { 5 };
    tell("growth with slices", 0.92);
    let slices = slices(material, goes)?;
    tell("growth with texels", 0.94);
    let texels = texels(material, goes)?;
    tell("growth with clusters", 0.95);
    let (whole_of_clusters, clusters) = clusters(material, goes)?;
    tell("growth with paints", 0.97);
    let (whole_of_paints, paints) = paints(material, goes)?;
    tell("growth with pixels", 0.98);
    let pixels = pixels(material, goes)?;
    tell("growth", 1.0);
    Ok(vec![
        slices,
        texels,
        whole_of_clusters,
        clusters,
        whole_of_paints,
        paints,
        pixels,
    ])
}

fn blend_of(paints: &[PaintFile], goes: usize) -> Result<f64, WorkshopError> {
    let paints: Vec<&PaintFile> = paints.iter().collect();
    let go = || blend_paints(&paints, &Profile::standard(), &|_| ());
    shortest(goes, rayon::current_num_threads(), go).map(|(seconds, _)| seconds)
}

/// Blending paints of which every n-th slice is left: the angles stay spread over the same range.
fn slices(material: &mut Material, goes: usize) -> Result<Growth, WorkshopError> {
    let standard = Profile::standard().flakes;
    let whole: Vec<PaintFile> = material.fitted(&standard, 2)?.to_vec();
    let mut points = Vec::new();
    for step in [4, 3, 2, 1] {
        let thinned: Vec<PaintFile> = whole
            .iter()
            .map(|file| PaintFile {
                paint: CarPaint {
                    flakes: file.paint.flakes.as_ref().map(|f| f.thinned(step)),
                    ..file.paint.clone()
                },
                ..file.clone()
            })
            .collect();
        let flakes = thinned[0].paint.flakes.as_ref();
        let count = flakes.map_or(0, crate::paint::Flakes::slices);
        points.push([count as f64, blend_of(&thinned, goes)?]);
    }
    Ok(Growth::new("slices", "blending two paints", 1.0, points))
}

/// Clustering a picture, and the same picture beside itself 4 and 16 times.
fn texels(material: &Material, goes: usize) -> Result<Growth, WorkshopError> {
    let source = &material.sources()[0];
    let mut room = SliceRoom::default();
    let refused = |e: &dyn std::fmt::Display| WorkshopError::input(&source.name, e);
    source.flakes.read(0, &mut room).map_err(|e| refused(&e))?;
    let mut points = Vec::new();
    for times in [1_usize, 4, 16, 64] {
        let planes = room
            .picture
            .planes
            .each_ref()
            .map(|plane| plane.repeat(times));
        let planes = planes.each_ref().map(Vec::as_slice);
        let mut clusterer = Clusterer::default();
        let (seconds, _) = shortest(goes.max(5), 1, || {
            clusterer
                .cluster(planes, &ClusterSettings::default())
                .map_err(|e| refused(&e))
        })?;
        points.push([planes[0].len() as f64, seconds]);
    }
    Ok(Growth::new("texels", "clustering a slice", 1.0, points))
}

/// Two paints at ever more clusters: from pictures to the blend, and the blend alone.
fn clusters(material: &mut Material, goes: usize) -> Result<(Growth, Growth), WorkshopError> {
    let (mut whole, mut alone) = (Vec::new(), Vec::new());
    for n in [24, 50, 100, 200] {
        let settings = clustered(n, BoxRule::Moments, 1);
        let mut ingested = 0.0;
        for source in material.sources().iter().take(2) {
            let go = || source.fit(&settings);
            ingested += shortest(1, rayon::current_num_threads(), go)?.0;
        }
        let fits = material.fitted(&settings, 2)?.to_vec();
        let seconds = blend_of(&fits, goes)?;
        alone.push([n as f64, seconds]);
        whole.push([n as f64, ingested + seconds]);
    }
    Ok((
        Growth::new("clusters", "clustering and blending two paints", 1.6, whole),
        Growth::new("clusters, blend alone", "blending two paints", 1.6, alone),
    ))
}

/// Blends of ever more paints, as many as the study has: from pictures to the blend, and the blend alone.
fn paints(material: &mut Material, goes: usize) -> Result<(Growth, Growth), WorkshopError> {
    let standard = Profile::standard().flakes;
    let fits = material.fitted(&standard, 5)?.to_vec();
    let (mut ingested, mut whole, mut alone) = (0.0, Vec::new(), Vec::new());
    for (k, source) in material.sources().iter().take(5).enumerate() {
        let go = || source.fit(&standard);
        ingested += shortest(1, rayon::current_num_threads(), go)?.0;
        if k > 0 {
            let seconds = blend_of(&fits[..=k], goes)?;
            alone.push([(k + 1) as f64, seconds]);
            whole.push([(k + 1) as f64, ingested + seconds]);
        }
    }
    Ok((
        Growth::new("paints", "clustering and blending them all", 1.0, whole),
        Growth::new(
            "paints, blend alone",
            "blending them all: each is joined to the clusters of all before it, which add up",
            1.0,
            alone,
        ),
    ))
}

fn pixels(material: &mut Material, goes: usize) -> Result<Growth, WorkshopError> {
    let paint = material.fitted(&Profile::standard().flakes, 1)?[0]
        .paint
        .clone();
    let mut points = Vec::new();
    for side in [96, 192, 384] {
        let scene = Scene {
            samples_per_pixel: 4,
            ..Scene::new(Shape::Sphere, [side; 2])
        };
        let go = || {
            render::render(&paint, &scene, &Limits::default(), &|_| ())
                .map_err(WorkshopError::internal)
        };
        let (seconds, _) = shortest(goes, rayon::current_num_threads(), go)?;
        points.push([f64::from(side * side), seconds]);
    }
    Ok(Growth::new("pixels", "drawing a ball", 1.0, points))
}
