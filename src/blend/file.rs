//! The `.blend` file: a correspondence with everything a realisation needs.

use serde::{Deserialize, Serialize};

use super::{
    Blend, BlendSettings, BlendedFlakes, BlendedPaint, Boxes, CorrespondenceReport, Origin, PAINTS,
};
use crate::color::{Lab, LinearRgb};
use crate::paint::{
    AngleGrid, CarPaint, Clustering, Coat, ColorTable, Container, ContainerError, FlakeTexture,
    Flakes, Limits, Lobe, NotFinite, PaintError, Reader, Writer, check_corners, check_list,
};

/// Latest version of the file that is read and the one that is written.
pub const VERSION: u32 = 1;

/// Why a file is no blend.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BlendFileError {
    /// The file as a file.
    #[error(transparent)]
    Container(#[from] ContainerError),
    /// The parameters of one of its paints.
    #[error("paint {place} in the .blend file is not valid: {source}")]
    Paint {
        /// Place in hash order.
        place: usize,
        /// What is wrong with it.
        source: PaintError,
    },
    /// The lists in it do not fit together.
    #[error("the .blend file is inconsistent: {0}")]
    Shape(String),
}

#[derive(Serialize, Deserialize)]
struct Header {
    paints: Vec<PaintHeader>,
    asked: Vec<usize>,
    settings: BlendSettings,
    report: CorrespondenceReport,
    chi_theta_h_deg: AngleGrid,
    chi_theta_d_deg: AngleGrid,
    flakes: Option<FlakeHeader>,
}

#[derive(Serialize, Deserialize)]
struct PaintHeader {
    name: String,
    hash: String,
    coat: Option<Coat>,
    diffuse: LinearRgb,
    lobes: Vec<Lobe>,
    chi_overall: Lab,
    #[serde(default, skip_serializing_if = "Origin::is_plain")]
    origin: Origin,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    clustering: Option<Clustering>,
}

#[derive(Serialize, Deserialize)]
struct FlakeHeader {
    theta_h_deg: AngleGrid,
    theta_d_deg: AngleGrid,
    textures: Vec<FlakeTexture>,
}

impl Blend {
    /// Whether bytes begin like a `.blend` file.
    #[must_use]
    pub fn recognises(bytes: &[u8]) -> bool {
        Container::is(bytes, "blend")
    }

    /// The bytes of the file.
    ///
    /// # Errors
    ///
    /// [`NotFinite`] for the first number that is none, wherever it stands.
    pub fn to_bytes(&self) -> Result<Vec<u8>, NotFinite> {
        let mut writer = Writer::default();
        for paint in &self.paints {
            let nodes: Vec<[f64; 3]> = paint
                .color_table
                .nodes()
                .iter()
                .map(|lab| lab.to_array())
                .collect();
            writer.array(&nodes);
        }
        if let Some(flakes) = &self.flakes {
            writer.array(&flakes.offsets);
            check_list("flakes.probability", &flakes.probability)?;
            writer.array(&flakes.probability);
            for (place, own) in flakes.boxes.iter().enumerate() {
                check_corners(&format!("paints[{place}].lower"), &own.lower)?;
                check_corners(&format!("paints[{place}].upper"), &own.upper)?;
                writer.array(&own.lower);
                writer.array(&own.upper);
            }
        }
        let header = Header {
            paints: self.paints.iter().map(PaintHeader::of).collect(),
            asked: self.asked.clone(),
            settings: self.settings,
            report: self.report.clone(),
            chi_theta_h_deg: self.paints[0].color_table.theta_h().clone(),
            chi_theta_d_deg: self.paints[0].color_table.theta_d().clone(),
            flakes: self.flakes.as_ref().map(|flakes| FlakeHeader {
                theta_h_deg: flakes.theta_h.clone(),
                theta_d_deg: flakes.theta_d.clone(),
                textures: flakes.textures.clone(),
            }),
        };
        writer.finish("blend", VERSION, &header)
    }

    /// Reads a file and validates every paint in it.
    ///
    /// # Errors
    ///
    /// [`BlendFileError`] for another kind of file, a newer version, a damaged file, or parameters out of range.
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<Self, BlendFileError> {
        let container = Container::open(bytes, "blend", VERSION)?;
        let header: Header = container.header()?;
        let mut reader = container.reader();
        let count = header.paints.len();
        let shape = |what: &str| Err(BlendFileError::Shape(what.to_owned()));
        let mut places = header.asked.clone();
        places.sort_unstable();
        if !PAINTS.contains(&count) || places != (0..count).collect::<Vec<_>>() {
            return shape("its paints and their order do not match");
        }
        let mut paints = Vec::with_capacity(count);
        for (place, paint) in header.paints.into_iter().enumerate() {
            let nodes = reader
                .array::<[f64; 3]>()?
                .into_iter()
                .map(Lab::from)
                .collect();
            let (h, d) = (
                header.chi_theta_h_deg.clone(),
                header.chi_theta_d_deg.clone(),
            );
            let color_table =
                ColorTable::new(h, d, nodes, paint.chi_overall).map_err(|source| {
                    BlendFileError::Paint {
                        place,
                        source: source.into(),
                    }
                })?;
            paints.push(paint.with(color_table));
        }
        let flakes = match header.flakes {
            None => None,
            Some(flakes) if flakes.textures.len() != count => {
                return shape("not one flake texture a paint");
            }
            Some(flakes) => Some(read_flakes(flakes, count, &mut reader)?),
        };
        reader.end()?;
        let blend = Self {
            paints,
            asked: header.asked,
            flakes,
            settings: header.settings,
            report: header.report,
        };
        blend.validate(limits)?;
        Ok(blend)
    }

    /// Validates each paint as it stands alone: its own boxes with the common probabilities.
    fn validate(&self, limits: &Limits) -> Result<(), BlendFileError> {
        // Corresponding clusters of k paints are at most the sum of theirs, four slices each where grids differ.
        let limits = Limits {
            clusters: limits.clusters * 4 * self.paints.len(),
            ..*limits
        };
        for (place, paint) in self.paints.iter().enumerate() {
            let flakes = self.flakes.as_ref().map(|f| Flakes {
                theta_h: f.theta_h.clone(),
                theta_d: f.theta_d.clone(),
                offsets: f.offsets.clone(),
                probability: f.probability.clone(),
                lower: f.boxes[place].lower.clone(),
                upper: f.boxes[place].upper.clone(),
                texture: f.textures[place],
            });
            let alone = CarPaint {
                coat: paint.coat,
                diffuse: paint.diffuse,
                lobes: paint.lobes.clone(),
                color_table: paint.color_table.clone(),
                flakes,
            };
            alone
                .validate(&limits)
                .map_err(|source| BlendFileError::Paint { place, source })?;
        }
        Ok(())
    }
}

fn read_flakes(
    header: FlakeHeader,
    paints: usize,
    reader: &mut Reader<'_>,
) -> Result<BlendedFlakes, ContainerError> {
    let (offsets, probability) = (reader.array()?.into(), reader.array()?.into());
    let mut boxes = Vec::with_capacity(paints);
    for _ in 0..paints {
        boxes.push(Boxes {
            lower: reader.array()?,
            upper: reader.array()?,
        });
    }
    Ok(BlendedFlakes::new(
        [header.theta_h_deg, header.theta_d_deg],
        offsets,
        probability,
        boxes,
        header.textures,
    ))
}

impl PaintHeader {
    fn of(paint: &BlendedPaint) -> Self {
        Self {
            name: paint.name.clone(),
            hash: paint.hash.clone(),
            coat: paint.coat,
            diffuse: paint.diffuse,
            lobes: paint.lobes.clone(),
            chi_overall: paint.color_table.overall(),
            origin: paint.origin.clone(),
            clustering: paint.clustering.clone(),
        }
    }

    fn with(self, color_table: ColorTable) -> BlendedPaint {
        let Self {
            name,
            hash,
            coat,
            diffuse,
            lobes,
            origin,
            clustering,
            ..
        } = self;
        BlendedPaint {
            name,
            hash,
            coat,
            diffuse,
            lobes,
            color_table,
            origin,
            clustering,
        }
    }
}
