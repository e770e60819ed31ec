//! Blends: how the flakes of one paint become those of another, and any mixture of the two.
//!
//! A [`Blend`] holds the correspondence of two to five paints: per angle pair a list of clusters, each with one
//! probability and one box *per paint*, found by optimal transport (Golla and Klein 2018, section 4). A realisation at
//! any weights moves boxes and parameters and never solves anything: see [`Blend::realise`], where flakes are blended.
//!
//! Promised: weights follow the order in which the paints were asked for, while everything is computed in the order of
//! their content hashes, so that a blend and its reverse share one correspondence and agree to the last bit; at weight 1
//! of one paint the blend is that paint; whatever had to be clamped is reported.
//!
//! Left to others: solving a transport problem (`transport`), reducing clusters of a paint that has too many (`fit`).

mod base;
mod boxes;
mod clamp;
mod correspondence;
mod file;
mod geometric;
mod lobes;
mod mixture;
mod order;
mod origin;
mod pairs;
mod parts;
mod realise;
mod report;
mod slice;
mod thinned;
mod weights;

pub use clamp::Clamp;
pub use correspondence::{BlendSettings, Look};
pub use file::BlendFileError;
pub use order::Order;
pub use origin::{Origin, Reduction, Thinning};
pub use pairs::PairReport;
pub(crate) use parts::Part;
pub use realise::Realised;
pub use report::{BlendDeviation, CorrespondenceReport};
pub use weights::{RealisationWeights, WeightError};

use correspondence::correspond;
use rayon::prelude::*;

use crate::paint::{
    AngleGrid, CarPaint, Clustering, Coat, ColorTable, FlakeTexture, Lobe, SharedList,
};
use crate::transport::TransportError;

/// Fewest and most paints of a blend.
pub const PAINTS: std::ops::RangeInclusive<usize> = 2..=5;

/// One paint that goes into a blend.
#[derive(Clone, Copy, Debug)]
pub struct Ingredient<'a> {
    /// What its owner calls it.
    pub name: &'a str,
    /// Its parameters.
    pub paint: &'a CarPaint,
}

/// Several paints with the correspondence between their flakes.
#[derive(Clone, Debug, PartialEq)]
pub struct Blend {
    /// The paints, in the order of their content hashes.
    pub(crate) paints: Vec<BlendedPaint>,
    /// Index in `paints` of the paint that was asked for first, second, …
    pub(crate) asked: Vec<usize>,
    pub(crate) flakes: Option<BlendedFlakes>,
    pub(crate) settings: BlendSettings,
    pub(crate) report: CorrespondenceReport,
}

/// What a blend keeps of one paint beside its boxes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BlendedPaint {
    pub name: String,
    pub hash: String,
    pub coat: Option<Coat>,
    pub diffuse: [f64; 3],
    pub lobes: Vec<Lobe>,
    pub color_table: ColorTable,
    pub origin: Origin,
    /// How its flakes were clustered, where that is known.
    pub clustering: Option<Clustering>,
}

/// Corresponding clusters of all paints on their common angles.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BlendedFlakes {
    pub theta_h: AngleGrid,
    pub theta_d: AngleGrid,
    pub offsets: SharedList<u32>,
    pub probability: SharedList<f64>,
    /// Boxes of each paint, one list a paint, in the order of `Blend::paints`.
    pub boxes: Vec<Boxes>,
    /// Magnitude that no number of any corner exceeds, Lab; one a paint.
    pub reaches: Vec<f32>,
    pub textures: Vec<FlakeTexture>,
}

/// Boxes of one paint, one a cluster.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Boxes {
    pub lower: Vec<[f32; 3]>,
    pub upper: Vec<[f32; 3]>,
}

impl BlendedFlakes {
    /// Corresponding clusters on these angles of θh and θd.
    fn new(
        [theta_h, theta_d]: [AngleGrid; 2],
        offsets: SharedList<u32>,
        probability: SharedList<f64>,
        boxes: Vec<Boxes>,
        textures: Vec<FlakeTexture>,
    ) -> Self {
        Self {
            theta_h,
            theta_d,
            offsets,
            probability,
            reaches: boxes.iter().map(boxes::reach).collect(),
            boxes,
            textures,
        }
    }
}

/// Why paints cannot be blended.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BlendError {
    /// Too few or too many.
    #[error("{0} paints given, a blend takes 2 to 5")]
    Paints(usize),
    /// More angles than are accepted on the common grid.
    #[error(
        "the common grid of these paints has {angles} angles on an axis, accepted are {accepted}"
    )]
    Angles {
        /// Angles of the longer axis.
        angles: usize,
        /// What would be accepted.
        accepted: usize,
    },
    /// A slice could not be transported.
    #[error("flakes at theta_h {theta_h_deg}°, theta_d {theta_d_deg}°: {source}")]
    Transport {
        /// Half angle of the slice.
        theta_h_deg: f64,
        /// Difference angle of the slice.
        theta_d_deg: f64,
        /// What the solver says.
        source: TransportError,
    },
}

impl Blend {
    /// Finds the correspondence of two to five paints. `progress` hears the share of slices done.
    ///
    /// # Errors
    ///
    /// [`BlendError`] for too few or too many paints, a common grid that grew too large, or a slice that the chosen
    /// solver could not transport.
    pub fn new(
        ingredients: &[Ingredient<'_>],
        settings: &BlendSettings,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<Self, BlendError> {
        Self::on(ingredients, settings, None, progress)
    }

    /// The same on other angles than the paints' common ones, joined as they were.
    ///
    /// # Errors
    ///
    /// As [`Blend::new`].
    pub fn on(
        ingredients: &[Ingredient<'_>],
        settings: &BlendSettings,
        look: Option<Look<'_>>,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<Self, BlendError> {
        if !PAINTS.contains(&ingredients.len()) {
            return Err(BlendError::Paints(ingredients.len()));
        }
        let hashes: Vec<String> = ingredients
            .par_iter()
            .map(|i| i.paint.content_hash().to_hex().to_string())
            .collect();
        let mut canonical: Vec<usize> = (0..ingredients.len()).collect();
        canonical.sort_by(|&a, &b| hashes[a].cmp(&hashes[b]));
        let mut asked = vec![0; ingredients.len()];
        for (place, &k) in canonical.iter().enumerate() {
            asked[k] = place;
        }
        // Paints of equal content are one and the same, however often they are given.
        let first = |k: usize| canonical.iter().find(|&&j| hashes[j] == hashes[k]);
        let ordered: Vec<&CarPaint> = canonical
            .iter()
            .map(|&k| ingredients[first(k).map_or(k, |&j| j)].paint)
            .collect();
        let (flakes, report) = correspond(&ordered, settings, look, progress)?;
        let (chi_h, chi_d) = base::common_table_grid(&ordered)?;
        let paints = canonical
            .iter()
            .map(|&k| {
                let Ingredient { name, paint } = ingredients[k];
                BlendedPaint {
                    name: name.to_owned(),
                    hash: hashes[k].clone(),
                    coat: paint.coat,
                    diffuse: paint.diffuse,
                    lobes: paint.lobes.clone(),
                    color_table: paint.color_table.on(&chi_h, &chi_d),
                    origin: Origin::default(),
                    clustering: None,
                }
            })
            .collect();
        Ok(Self {
            paints,
            asked,
            flakes,
            settings: *settings,
            report,
        })
    }

    /// How many paints, which is how many weights a realisation takes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.paints.len()
    }

    /// Never: a blend has at least two paints.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.paints.is_empty()
    }

    /// The same blend asked for in another order: its `k`-th paint is the `order[k]`-th of before.
    ///
    /// # Panics
    ///
    /// When `order` names a paint that is not there.
    #[must_use]
    pub fn in_order(self, order: &[usize]) -> Self {
        Self {
            asked: order.iter().map(|&k| self.asked[k]).collect(),
            ..self
        }
    }

    /// Nodes of the color tables of all its paints.
    #[must_use]
    pub fn color_table_nodes(&self) -> usize {
        let nodes = |paint: &BlendedPaint| paint.color_table.nodes().len();
        self.paints.iter().map(nodes).sum()
    }

    /// Name and content hash of each paint, in the order asked for.
    pub fn ingredients(&self) -> impl Iterator<Item = (&str, &str)> + Clone {
        self.asked
            .iter()
            .map(|&k| (self.paints[k].name.as_str(), self.paints[k].hash.as_str()))
    }

    /// The same blend with what is known of its paints, in the order asked for.
    #[must_use]
    pub fn with_origins(mut self, origins: impl IntoIterator<Item = Origin>) -> Self {
        for (&place, origin) in self.asked.iter().zip(origins) {
            self.paints[place].origin = origin;
        }
        self
    }

    /// What is known of each paint, in the order asked for.
    pub fn origins(&self) -> impl Iterator<Item = &Origin> + Clone {
        self.asked.iter().map(|&place| &self.paints[place].origin)
    }

    /// Coat, diffuse albedo and lobes of each paint, in the order asked for.
    pub fn bases(&self) -> impl Iterator<Item = (Option<Coat>, [f64; 3], &[Lobe])> + Clone {
        let asked = self.asked.iter().map(|&place| &self.paints[place]);
        asked.map(|paint| (paint.coat, paint.diffuse, &paint.lobes[..]))
    }

    /// Texel size, grain and lifetime of each paint's flakes, in the order asked for; nothing where no paint has flakes.
    pub fn textures(&self) -> impl Iterator<Item = &FlakeTexture> {
        let textures = self.flakes.as_ref().map(|flakes| &flakes.textures);
        textures
            .into_iter()
            .flat_map(|of| self.asked.iter().filter_map(|&place| of.get(place)))
    }

    /// Which paint in the order asked for stands at this place in the order of content hashes.
    #[must_use]
    pub fn asked_at(&self, place: usize) -> Option<usize> {
        self.asked.iter().position(|&own| own == place)
    }

    /// Place in hash order of the paint that was asked for `k`-th.
    ///
    /// # Panics
    ///
    /// When there are not so many.
    #[must_use]
    pub fn place(&self, k: usize) -> usize {
        self.asked[k]
    }

    /// How the correspondence was found and how good it is.
    #[must_use]
    pub const fn report(&self) -> &CorrespondenceReport {
        &self.report
    }

    /// The same blend with what was measured of it against exact transport, and with how the flakes of each paint, in the
    /// order asked for, were clustered.
    #[must_use]
    pub fn with_accuracy(
        mut self,
        against_exact: Vec<BlendDeviation>,
        clusterings: &[Option<Clustering>],
    ) -> Self {
        self.report.against_exact = against_exact;
        for (&place, clustering) in self.asked.iter().zip(clusterings) {
            self.paints[place].clustering.clone_from(clustering);
        }
        self
    }

    /// How the flakes of each paint were clustered, in the order asked for, where that is known.
    pub fn clusterings(&self) -> impl Iterator<Item = Option<&Clustering>> + Clone {
        self.asked
            .iter()
            .map(|&k| self.paints[k].clustering.as_ref())
    }

    /// Settings the correspondence was found with.
    #[must_use]
    pub const fn settings(&self) -> &BlendSettings {
        &self.settings
    }
}

#[cfg(test)]
mod tests;
