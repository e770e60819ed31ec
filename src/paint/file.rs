//! The `.paint` file: a paint with everything known about it, but not the measurement it came from.

use serde::{Deserialize, Serialize};

use super::container::{Arrays, Container, ContainerError, Writer};
use super::energy::EnergyCertificate;
use super::finite::{NotFinite, check_corners, check_list};
use super::{
    AngleGrid, CarPaint, ClusteringError, Coat, ColorTable, FitResiduals, FlakeTexture, Flakes,
    Limits, Lobe, PaintError, Percentiles, ReadingResiduals, Realisation, SeenDifference,
};
use crate::color::{Lab, LinearRgb};

/// Latest version of the file that is read and the one that is written.
pub const VERSION: u32 = 1;

/// Most characters of a name.
pub const NAME_CHARACTERS: usize = 200;

/// Where a paint comes from, kept and given back untouched.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Kind of source: `package`, `rgl`, `mpi-2005`, `merl`, `csv`, `cxf`, `sample`, `blend`.
    pub source: String,
    /// BLAKE3 of the source's bytes, hexadecimal; of a blend, the hashes of its paints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hashes: Vec<String>,
    /// Whether the flakes were simulated instead of measured.
    #[serde(default)]
    pub simulated_flakes: bool,
    /// Of which blend it is a realisation, where it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub realisation: Option<Realisation>,
    /// What else the source said about itself: license, instrument, maker, color code, date.
    #[serde(default, skip_serializing_if = "std::collections::BTreeMap::is_empty")]
    pub notes: std::collections::BTreeMap<String, String>,
}

impl Provenance {
    /// Whether the paint is a realisation of a blend.
    #[must_use]
    pub fn is_blend(&self) -> bool {
        self.source == "blend"
    }
}

/// How the flakes were clustered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clustering {
    /// Most clusters a slice may have.
    pub clusters: usize,
    /// Rule that boxes follow: `tight` or `moments`.
    pub box_rule: String,
    /// Of the measured angles every n-th was fitted, on either grid.
    #[serde(default = "every_angle", skip_serializing_if = "is_every_angle")]
    pub angle_step: usize,
    /// Distance W1 in Lab between a slice's pixels and its clusters, bounded from above over all fitted slices: what
    /// moving every pixel to a color of its own cluster's box would cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub w1_bound: Option<Percentiles>,
    /// Distance W1 of the lightnesses between slices that were left out after the fit and the mixtures that stand in for
    /// them, Lab units; only of a paint that was thinned for a blend.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out_w1: Option<Percentiles>,
    /// What of that would be noticed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out_seen: Option<SeenDifference>,
    /// How far the clusters are from the pixels, where it was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<ClusteringError>,
    /// Error in Lab of the blend that the paint was realised from; no pictures of it exist to compare with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub realised_lab: Option<f64>,
    /// What would be noticed of that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub realised_seen: Option<SeenDifference>,
    /// Distance W1 of the lightnesses between slices and themselves with fewer clusters, Lab units; only of a realised
    /// paint that was reduced for another blend.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduced_w1: Option<Percentiles>,
    /// What would be noticed of that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduced_seen: Option<SeenDifference>,
}

impl Clustering {
    /// The box rule of a paint whose clusters came of a blend.
    pub const BLENDED: &str = "blended";

    /// Whether the clusters came of a blend: no profile makes them.
    #[must_use]
    pub fn is_of_blend(&self) -> bool {
        self.box_rule == Self::BLENDED
    }

    fn check(&self, limits: &Limits) -> Result<(), PaintFileError> {
        let refuse = |field, value: &dyn std::fmt::Display, accepted| {
            Err(PaintFileError::Clustering {
                field,
                value: value.to_string(),
                accepted,
            })
        };
        if !(1..=limits.clusters).contains(&self.clusters) {
            return refuse("clusters", &self.clusters, "1 to the limit");
        }
        if !["tight", "moments", Self::BLENDED].contains(&self.box_rule.as_str()) {
            return refuse("box_rule", &self.box_rule, "tight, moments or blended");
        }
        if !(1..=90).contains(&self.angle_step) {
            return refuse("angle_step", &self.angle_step, "1 to 90");
        }
        let seen = |seen: &Option<SeenDifference>| -> Vec<f64> {
            let each = seen.iter();
            let each = each.flat_map(|seen| [seen.delta_e_2000, seen.sparkle, seen.lit]);
            each.flatten().collect()
        };
        let spread = |of: &Percentiles| vec![of.median, of.p90, of.worst];
        let w1 = |w1: &Option<Percentiles>| w1.as_ref().map(spread).unwrap_or_default();
        let measured = self.error.as_ref().map(|error| {
            let lists = [
                spread(&error.lightness_w1),
                spread(&error.mean_luminance),
                spread(&error.sparkle),
                error.instrument.to_vec(),
                error.lit.map(Vec::from).unwrap_or_default(),
            ];
            lists.concat()
        });
        for (field, figures) in [
            ("error", measured.unwrap_or_default()),
            ("realised_lab", self.realised_lab.into_iter().collect()),
            ("realised_seen", seen(&self.realised_seen)),
            ("w1_bound", w1(&self.w1_bound)),
            ("left_out_w1", w1(&self.left_out_w1)),
            ("left_out_seen", seen(&self.left_out_seen)),
            ("reduced_w1", w1(&self.reduced_w1)),
            ("reduced_seen", seen(&self.reduced_seen)),
        ] {
            let off = figures
                .iter()
                .find(|off| !(**off >= 0.0 && off.is_finite()));
            if let Some(off) = off {
                return refuse(field, off, "0 or more");
            }
        }
        Ok(())
    }
}

fn every_angle() -> usize {
    1
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_every_angle(step: &usize) -> bool {
    *step == 1
}

/// A paint and what is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct PaintFile {
    /// Name, 1 to 200 characters.
    pub name: String,
    /// Where it comes from.
    pub provenance: Provenance,
    /// The parameters.
    pub paint: CarPaint,
    /// How the flakes were clustered, where there are any.
    pub clustering: Option<Clustering>,
    /// How well the base fits its measurement, where it was fitted.
    pub residuals: Option<FitResiduals>,
    /// How far the paint is from the multi-angle readings that came with its measurement, where some did.
    pub readings: Option<ReadingResiduals>,
    /// Energy certificate.
    pub energy: EnergyCertificate,
    /// What the user should know: dirty data, averaged azimuths, energy above 1, clamped values.
    pub warnings: Vec<String>,
}

/// Why a file is no paint.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PaintFileError {
    /// The file as a file.
    #[error(transparent)]
    Container(#[from] ContainerError),
    /// Its name.
    #[error("the name in the .paint file has {0} characters, accepted are 1 to {NAME_CHARACTERS}")]
    Name(usize),
    /// A name that would not print.
    #[error("the name in the .paint file is {0:?}, accepted are printable characters")]
    Unprintable(String),
    /// What it says of how its flakes were clustered.
    #[error("clustering.{field} in the .paint file is {value}, accepted is {accepted}")]
    Clustering {
        /// The field.
        field: &'static str,
        /// What stands there.
        value: String,
        /// What may stand there.
        accepted: &'static str,
    },
    /// Its energy certificate.
    #[error("the energy certificate in the .paint file {0}")]
    Energy(&'static str),
    /// The parameters in it.
    #[error("the .paint file holds no valid paint: {0}")]
    Paint(#[from] PaintError),
}

#[derive(Serialize, Deserialize)]
struct Header {
    name: String,
    provenance: Provenance,
    physical: PhysicalHeader,
    clustering: Option<Clustering>,
    residuals: Option<FitResiduals>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    readings: Option<ReadingResiduals>,
    energy: EnergyCertificate,
    warnings: Vec<String>,
}

/// The parameters of a paint that are not arrays.
#[derive(Serialize, Deserialize)]
pub(crate) struct PhysicalHeader {
    coat: Option<Coat>,
    diffuse: LinearRgb,
    lobes: Vec<Lobe>,
    chi_theta_h_deg: AngleGrid,
    chi_theta_d_deg: AngleGrid,
    chi_overall: Lab,
    flakes: Option<FlakeHeader>,
}

#[derive(Serialize, Deserialize)]
struct FlakeHeader {
    theta_h_deg: AngleGrid,
    theta_d_deg: AngleGrid,
    texture: FlakeTexture,
}

impl PhysicalHeader {
    pub(crate) fn of(paint: &CarPaint) -> Self {
        Self {
            coat: paint.coat,
            diffuse: paint.diffuse,
            lobes: paint.lobes.clone(),
            chi_theta_h_deg: paint.color_table.theta_h().clone(),
            chi_theta_d_deg: paint.color_table.theta_d().clone(),
            chi_overall: paint.color_table.overall(),
            flakes: paint.flakes.as_ref().map(|flakes| FlakeHeader {
                theta_h_deg: flakes.theta_h.clone(),
                theta_d_deg: flakes.theta_d.clone(),
                texture: flakes.texture,
            }),
        }
    }
}

fn write_arrays(paint: &CarPaint, writer: &mut impl Arrays) {
    let nodes: Vec<[f64; 3]> = paint
        .color_table
        .nodes()
        .iter()
        .map(|lab| lab.to_array())
        .collect();
    writer.array(&nodes);
    if let Some(flakes) = &paint.flakes {
        writer.array(&flakes.offsets);
        writer.array(&flakes.probability);
        writer.array(&flakes.lower);
        writer.array(&flakes.upper);
    }
}

impl CarPaint {
    /// BLAKE3 of the physical content: equal parameters have equal hashes, whatever the paint is called.
    ///
    /// # Panics
    ///
    /// Never: plain data serialises.
    #[must_use]
    pub fn content_hash(&self) -> blake3::Hash {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&VERSION.to_le_bytes());
        hasher
            .update(&serde_json::to_vec(&PhysicalHeader::of(self)).expect("plain data serialises"));
        write_arrays(self, &mut hasher);
        hasher.finalize()
    }
}

impl PaintFile {
    /// Whether bytes begin like a `.paint` file.
    #[must_use]
    pub fn recognises(bytes: &[u8]) -> bool {
        Container::is(bytes, "paint")
    }

    /// The bytes of the file.
    ///
    /// # Errors
    ///
    /// [`NotFinite`] for the first number that is none, wherever it stands.
    pub fn to_bytes(&self) -> Result<Vec<u8>, NotFinite> {
        // Colors of a table are finite, or there is no table.
        if let Some(flakes) = &self.paint.flakes {
            check_list("flakes.probability", &flakes.probability)?;
            check_corners("flakes.lower", &flakes.lower)?;
            check_corners("flakes.upper", &flakes.upper)?;
        }
        let mut writer = Writer::default();
        write_arrays(&self.paint, &mut writer);
        let header = Header {
            name: self.name.clone(),
            provenance: self.provenance.clone(),
            physical: PhysicalHeader::of(&self.paint),
            clustering: self.clustering.clone(),
            residuals: self.residuals.clone(),
            readings: self.readings.clone(),
            energy: self.energy.clone(),
            warnings: self.warnings.clone(),
        };
        writer.finish("paint", VERSION, &header)
    }

    /// Reads a file and validates the paint in it.
    ///
    /// # Errors
    ///
    /// [`PaintFileError`] for another kind of file, a newer version, a damaged file, or parameters out of range.
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<Self, PaintFileError> {
        let container = Container::open(bytes, "paint", VERSION)?;
        let header: Header = container.header()?;
        let mut reader = container.reader();
        let physical = header.physical;
        let nodes = reader
            .array::<[f64; 3]>()?
            .into_iter()
            .map(Lab::from)
            .collect();
        let color_table = ColorTable::new(
            physical.chi_theta_h_deg,
            physical.chi_theta_d_deg,
            nodes,
            physical.chi_overall,
        )
        .map_err(PaintError::from)?;
        let flakes = match physical.flakes {
            None => None,
            Some(flakes) => Some(Flakes {
                theta_h: flakes.theta_h_deg,
                theta_d: flakes.theta_d_deg,
                offsets: reader.array()?.into(),
                probability: reader.array()?.into(),
                lower: reader.array()?,
                upper: reader.array()?,
                texture: flakes.texture,
            }),
        };
        reader.end()?;
        let length = header.name.chars().count();
        if !(1..=NAME_CHARACTERS).contains(&length) {
            return Err(PaintFileError::Name(length));
        }
        if header.name.chars().any(char::is_control) {
            return Err(PaintFileError::Unprintable(header.name));
        }
        if let Some(clustering) = &header.clustering {
            clustering.check(limits)?;
        }
        header.energy.check().map_err(PaintFileError::Energy)?;
        let (coat, diffuse, lobes) = (physical.coat, physical.diffuse, physical.lobes);
        let paint = CarPaint {
            coat,
            diffuse,
            lobes,
            color_table,
            flakes,
        };
        paint.validate(limits)?;
        Ok(Self {
            name: header.name,
            provenance: header.provenance,
            paint,
            clustering: header.clustering,
            residuals: header.residuals,
            readings: header.readings,
            energy: header.energy,
            warnings: header.warnings,
        })
    }
}
