//! What can be asked to be estimated.

use serde::Deserialize;
use utoipa::ToSchema;

use crate::accuracy::Profile;
use crate::service::app::App;
use crate::service::http::Problem;
use crate::service::parameters::view::{self, Names, Side};
use crate::service::parameters::{Named, ProfileDocument, ProfileText, WeightQuery};
use crate::service::work::{Format, Light, PictureFormat, Shape, Show, View};

/// Work to estimate.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EstimateOrder {
    /// `ingest` (again, of a paint that was uploaded as a measurement; of a new one `POST /v1/estimates/ingest`), `blend`, `realise`, `bundle` or `preview`.
    pub work: WorkName,
    /// Id of the paint to ingest again, or to write or draw.
    pub paint: Option<String>,
    /// Id of the blend to write or draw.
    pub blend: Option<String>,
    /// Ids of the paints to blend.
    pub paints: Option<Vec<String>>,
    /// Weights of a blend, in the order of its paints; even unless given.
    weights: Option<Vec<f64>>,
    /// Weights of coat, diffuse, lobes and color table alone.
    base: Option<Vec<f64>>,
    /// Weights of the flakes' lightness, grain and lifetime alone.
    flake_lightness: Option<Vec<f64>>,
    /// Weights of the flakes' color alone.
    flake_color: Option<Vec<f64>>,
    /// Factor on the flakes' color.
    flake_saturation: Option<f64>,
    /// What is written: of `realise` a file, `zip` unless given; of `preview` a picture, `png` unless given.
    pub format: Option<FormatName>,
    /// What the paint is on, `sphere` unless given.
    scene: Option<Shape>,
    /// Pixels across and down of a picture, 512 each unless given.
    #[schema(value_type = Option<Vec<Side>>, min_items = 2, max_items = 2)]
    size: Option<[u32; 2]>,
    /// What a picture shows, `paint` unless given. `aspecular` takes neither `profile` nor `max_error` nor `max_seconds`.
    show: Option<Show>,
    /// Panorama that lights a picture, the id of an answer to `POST /v1/environments`; `studio`, the built-in one, unless
    /// given.
    #[schema(pattern = "^(studio|e_[0-9a-f]{32})$")]
    environment: Option<String>,
    /// Lights in place of the scene's usual one; none leaves the surroundings alone.
    #[schema(max_items = 16)]
    lights: Option<Vec<Light>>,
    /// Accuracy: the name of a preset, or an object of knobs.
    #[schema(value_type = Option<ProfileDocument>)]
    pub profile: Option<ProfileText>,
    /// In place of a profile: the cheapest whose error is at most this: Lab, of a picture CIEDE2000 in the mean.
    #[schema(exclusive_minimum = 0.0)]
    pub max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[schema(exclusive_minimum = 0.0)]
    pub max_seconds: Option<f64>,
}

/// Kinds of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WorkName {
    /// A measurement becomes a paint.
    Ingest,
    /// Paints become a blend.
    Blend,
    /// A paint or blend becomes a file.
    Realise,
    /// All paints of a blend become one file.
    Bundle,
    /// A paint or blend becomes a picture.
    Preview,
}

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FormatName {
    /// Texture bundle.
    Zip,
    /// glTF binary.
    Glb,
    /// `material.json` with the textures inline.
    Json,
    /// A `.paint`.
    Paint,
    /// Picture for a screen.
    Png,
    /// Picture in linear light.
    Exr,
}

const OF_BLEND: [&str; 6] = [
    "blend",
    "weights",
    "base",
    "flake_lightness",
    "flake_color",
    "flake_saturation",
];

const OF_PICTURE: [&str; 7] = [
    "paint",
    "format",
    "scene",
    "size",
    "show",
    "environment",
    "lights",
];

impl EstimateOrder {
    /// Refuses a field that the work does not have: it would be an answer to another question.
    ///
    /// # Errors
    ///
    /// [`Problem`] that names the first such field, and those that the work has.
    pub fn refuse_beside_the_point(&self) -> Result<(), Problem> {
        let given = [
            ("paint", self.paint.is_some()),
            ("blend", self.blend.is_some()),
            ("paints", self.paints.is_some()),
            ("weights", self.weights.is_some()),
            ("base", self.base.is_some()),
            ("flake_lightness", self.flake_lightness.is_some()),
            ("flake_color", self.flake_color.is_some()),
            ("flake_saturation", self.flake_saturation.is_some()),
            ("format", self.format.is_some()),
            ("scene", self.scene.is_some()),
            ("size", self.size.is_some()),
            ("show", self.show.is_some()),
            ("environment", self.environment.is_some()),
            ("lights", self.lights.is_some()),
        ];
        let (work, own): (_, &[&str]) = match self.work {
            WorkName::Ingest => ("ingest", &["paint"]),
            WorkName::Blend => ("blend", &["paints"]),
            WorkName::Realise => ("realise", &["paint", "format"]),
            WorkName::Bundle => ("bundle", &["blend"]),
            WorkName::Preview => ("preview", &OF_PICTURE),
        };
        let weighs = matches!(self.work, WorkName::Realise | WorkName::Preview);
        let (work, taken) = match &self.blend {
            Some(_) if weighs => (work.to_owned(), [own, &OF_BLEND].concat()),
            None if weighs => (format!("{work}, of a paint,"), own.to_vec()),
            _ => (work.to_owned(), own.to_vec()),
        };
        match given.iter().find(|(name, is)| *is && !taken.contains(name)) {
            Some((name, _)) => Err(Problem::value(
                format!("/{name}"),
                format!("The work {work} takes no {name}."),
            )
            .accepting(taken.join(", "))),
            None => Ok(()),
        }
    }

    /// The file that a realisation is written as.
    ///
    /// # Errors
    ///
    /// [`Problem`] for a picture.
    pub fn file(&self) -> Result<Format, Problem> {
        match self.format.unwrap_or(FormatName::Zip) {
            FormatName::Zip => Ok(Format::Zip),
            FormatName::Glb => Ok(Format::Glb),
            FormatName::Json => Ok(Format::Json),
            FormatName::Paint => Ok(Format::Paint),
            FormatName::Png | FormatName::Exr => Err(Problem::value(
                "/format",
                "A realisation is no picture; the work for one is preview.",
            )
            .accepting("zip, glb, json or paint")),
        }
    }

    /// What a picture is written as.
    ///
    /// # Errors
    ///
    /// [`Problem`] for a file that is none.
    pub fn picture(&self) -> Result<PictureFormat, Problem> {
        match self.format.unwrap_or(FormatName::Png) {
            FormatName::Png => Ok(PictureFormat::Png),
            FormatName::Exr => Ok(PictureFormat::Exr),
            _ => Err(Problem::value(
                "/format",
                "A preview is a picture; the work for other files is realise.",
            )
            .accepting("png or exr")),
        }
    }

    /// The paint or blend to write or draw.
    pub fn named(&self) -> Named<'_> {
        Named {
            paint: self.paint.as_deref(),
            blend: self.blend.as_deref(),
            weights: WeightQuery::of_lists(
                self.weights.clone(),
                self.base.clone(),
                self.flake_lightness.clone(),
                self.flake_color.clone(),
                self.flake_saturation,
            ),
            or_even: true,
        }
    }

    /// What a picture of it shows, by the checks of a picture.
    ///
    /// # Errors
    ///
    /// [`Problem`] as a picture's.
    pub async fn view(&self, app: &App, profile: &Profile) -> Result<View, Problem> {
        let show = self.show.unwrap_or_default();
        let for_target = (self.max_error.is_some() || self.max_seconds.is_some()).then_some(1);
        let sampled = [
            ("profile", self.profile.is_some()),
            ("max_error", self.max_error.is_some()),
            ("max_seconds", self.max_seconds.is_some()),
        ];
        view::refuse_samples_of_angles(show, &sampled, &Names::BODY)?;
        let environment = view::environment(app, self.environment.as_deref(), &Names::BODY);
        let asked = View {
            show,
            scene: self.scene.unwrap_or_default(),
            size: self.size.unwrap_or([512; 2]),
            // How many samples meet a target is found once everything else is known to be right.
            samples_per_pixel: view::samples(show, for_target, profile),
            environment: environment.await?,
            lights: self.lights.clone(),
        };
        view::view(app, asked, &Names::BODY)
    }
}
