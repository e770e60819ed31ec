//! The paints of a study: their pictures, opened once, and their fits by cluster settings, kept.

use std::path::Path;

use super::WorkshopError;
use crate::accuracy::clustering_error;
use crate::fit::{BoxRule, ClusterSettings, SimulatedPatch, fit_flakes};
use crate::measurement::{FlakePictures, PackageBase};
use crate::paint::{CarPaint, Clustering, PaintFile, Provenance};
use crate::workshop::ingest::{finish, fitted_base};
use crate::workshop::thing::{Source, find};
use crate::workshop::{IngestOptions, Measurement, open_measurement};

/// Paints that can be clustered again and again.
pub struct Material {
    sources: Vec<Pictures>,
    fits: Vec<(ClusterSettings, Vec<PaintFile>)>,
}

/// One paint: its base and the pictures of its flakes.
pub(super) struct Pictures {
    pub name: String,
    pub base: CarPaint,
    pub flakes: Box<dyn FlakePictures>,
}

impl std::fmt::Debug for Material {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Material")
            .field("paints", &self.names())
            .finish_non_exhaustive()
    }
}

/// Paints of a study that names none.
const SAMPLES: [&str; 4] = [
    "sample:polaris_silber",
    "sample:ford_f8",
    "sample:opel_titan",
    "sample:bmw339",
];

impl Material {
    pub(super) fn open(names: &[String]) -> Result<Self, WorkshopError> {
        let samples = SAMPLES.map(str::to_owned);
        let names = if names.is_empty() { &samples } else { names };
        let sources = names
            .iter()
            .map(|name| open(name))
            .collect::<Result<Vec<_>, _>>()?;
        if sources.len() < 2 {
            return Err(WorkshopError::usage(
                "PAINT",
                "a study needs two paints or more, to blend them",
            ));
        }
        Ok(Self {
            sources,
            fits: Vec::new(),
        })
    }

    /// So many paints of a few slices of few texels.
    #[cfg(test)]
    pub(super) fn tiny(paints: u64) -> Self {
        let base = crate::workshop::samples::by_name("polaris_silber").expect("a sample");
        let recipe = |seed| crate::fit::FlakeRecipe {
            angles: 4,
            texels: 12,
            seed,
            ..crate::fit::FlakeRecipe::default()
        };
        let source = |seed| Pictures {
            name: format!("tiny {seed}"),
            base: base.base(),
            flakes: Box::new(SimulatedPatch::new(&base.base(), &recipe(seed)).expect("in range")),
        };
        Self {
            sources: (0..paints).map(source).collect(),
            fits: Vec::new(),
        }
    }

    pub(super) fn names(&self) -> Vec<String> {
        let about = |p: &Pictures| {
            let [width, height] = p.flakes.size();
            format!(
                "{} ({} slices of {width} x {height} texels)",
                p.name,
                p.flakes.slices()
            )
        };
        self.sources.iter().map(about).collect()
    }

    pub(super) fn sources(&self) -> &[Pictures] {
        &self.sources
    }

    /// The first paints with these settings; fitted once.
    pub(super) fn fitted(
        &mut self,
        settings: &ClusterSettings,
        count: usize,
    ) -> Result<&[PaintFile], WorkshopError> {
        let place = self.fits.iter().position(|(own, _)| own == settings);
        let place = place.unwrap_or_else(|| {
            self.fits.push((*settings, Vec::new()));
            self.fits.len() - 1
        });
        let fits = &mut self.fits[place].1;
        for source in self.sources.iter().take(count).skip(fits.len()) {
            fits.push(source.fit(settings)?);
        }
        Ok(&fits[..count.min(fits.len())])
    }
}

impl Pictures {
    /// Fits the flakes, as an ingest does.
    pub fn fit(&self, settings: &ClusterSettings) -> Result<PaintFile, WorkshopError> {
        let fitted = fit_flakes(&*self.flakes, settings, &|_, _| ())
            .map_err(|e| WorkshopError::input(&self.name, e))?;
        let paint = CarPaint {
            flakes: Some(fitted.flakes),
            ..self.base.clone()
        };
        let clustering = Clustering {
            error: clustering_error(&*self.flakes, &paint),
            ..fitted.clustering
        };
        Ok(finish(
            self.name.clone(),
            Provenance::default(),
            paint,
            None,
            Some(clustering),
            fitted.warnings,
        ))
    }
}

fn open(name: &str) -> Result<Pictures, WorkshopError> {
    let none = || {
        WorkshopError::input(
            name,
            "a study clusters flakes anew: give measurements with pictures of flakes, or metallic samples",
        )
    };
    match find(name)? {
        Source::Sample(sample) => {
            let patch: SimulatedPatch = sample.patch()?.ok_or_else(none)?;
            Ok(Pictures {
                name: sample.name.to_owned(),
                base: sample.base(),
                flakes: Box::new(patch),
            })
        }
        Source::Path(path) => of_package(name, &path)?.ok_or_else(none),
    }
}

fn of_package(name: &str, path: &Path) -> Result<Option<Pictures>, WorkshopError> {
    let options = IngestOptions::default();
    if crate::paint::PaintFile::recognises(&crate::workshop::thing::first_bytes(path)?) {
        return Ok(None);
    }
    let Measurement::Package(mut package) = open_measurement(path, &options)? else {
        return Ok(None);
    };
    let Some(flakes) = package.flakes.take() else {
        return Ok(None);
    };
    let base = match &package.base {
        Some(PackageBase::Model {
            diffuse,
            lobes,
            color_table,
        }) => CarPaint {
            coat: package.coat,
            diffuse: *diffuse,
            lobes: lobes.clone(),
            color_table: color_table.clone(),
            flakes: None,
        },
        Some(base) => fitted_base(base, package.coat)
            .map_err(|problem| WorkshopError::input(name, problem))?,
        None => return Ok(None),
    };
    Ok(Some(Pictures {
        name: package.name,
        base,
        flakes: Box::new(flakes),
    }))
}

/// Cluster settings that a study tries: moments unless told otherwise.
pub(super) fn clustered(clusters: usize, box_rule: BoxRule, angle_step: usize) -> ClusterSettings {
    ClusterSettings {
        clusters,
        box_rule,
        angle_step,
    }
}
