//! What a picture shows, in a query or in a body: scene, size, samples, lights, environment.

use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Deserializer};
use utoipa::{IntoParams, ToSchema};

use super::profile::ProfileText;
use super::targets;
use crate::accuracy::Profile;
use crate::blend::RealisationWeights;
use crate::service::app::App;
use crate::service::environments::{self, STUDIO, Unread};
use crate::service::http::{Place, Problem};
use crate::service::shelf::Shelved;
use crate::service::work::{Asked, Light, Picked, PictureFormat, Shape, Show, Target, View};
use crate::workshop::MOST_SAMPLES;

/// Longest side of a picture.
const LONGEST_SIDE: u32 = 4096;

/// Most lights of a scene.
const MOST_LIGHTS: usize = 16;

/// What a picture shows.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ViewQuery {
    /// What the paint is on, `sphere` unless given.
    scene: Option<Shape>,
    /// What is shown on it, `paint` unless given. `aspecular` is the angle between view and mirrored main light in place of
    /// the paint, the same for every paint and weights; it takes neither `spp`, `profile`, `max_error` nor `max_seconds`.
    show: Option<Show>,
    /// Width and height in pixels, `512x512` unless given.
    #[param(value_type = Option<String>, pattern = "^[0-9]{1,4}x[0-9]{1,4}$", example = "512x512")]
    size: Option<Size>,
    /// Samples per pixel, in place of the preset's; refused beside another number in the profile.
    #[param(minimum = 1, maximum = 4096)]
    spp: Option<u32>,
    /// Panorama that lights it and stands behind it, the id of an answer to `POST /v1/environments`; `studio`, the built-in
    /// one, unless given. A panorama is all the light there is unless `light` is given.
    #[param(pattern = "^(studio|e_[0-9a-f]{32})$", example = "studio")]
    environment: Option<String>,
    /// Direction towards the light, in place of the scene's usual one: x to the right, y up, z towards the viewer. Angles
    /// are told for the strongest light, which the built-in studio's key is beside one of usual strength.
    #[param(style = Form, explode = false, min_items = 3, max_items = 3)]
    light: Option<Vec<f32>>,
    /// Accuracy: `draft`, `standard`, `reference`, and knobs such as `draft,samples_per_pixel=100`.
    #[param(value_type = Option<String>, example = "standard")]
    profile: Option<ProfileText>,
    /// In place of a profile: the cheapest whose picture is at most so far off, CIEDE2000 in the mean: what samples leave to
    /// chance, and the paint's own error.
    #[param(exclusive_minimum = 0.0)]
    max_error: Option<f64>,
    /// In place of a profile: the most accurate that is done in so many seconds here.
    #[param(exclusive_minimum = 0.0)]
    max_seconds: Option<f64>,
}

/// Pixels across or down.
#[derive(ToSchema)]
#[schema(minimum = 1, maximum = 4096)]
#[allow(dead_code)] // says what is accepted
pub struct Side(u32);

/// `WxH` in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Size([u32; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |side: &str| {
            side.parse()
                .ok()
                .filter(|pixels| (1..=LONGEST_SIDE).contains(pixels))
        };
        text.split_once('x')
            .and_then(|(width, height)| Some(Self([side(width)?, side(height)?])))
            .ok_or_else(|| format!("{text:?} is no size; accepted is WxH such as 512x512, up to {LONGEST_SIDE} each."))
    }
}

impl<'de> Deserialize<'de> for Size {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?
            .parse()
            .map_err(serde::de::Error::custom)
    }
}

impl ViewQuery {
    fn view(
        &self,
        app: &App,
        spp: Option<u32>,
        environment: Option<String>,
    ) -> Result<View, Problem> {
        let Size(size) = self.size.unwrap_or(Size([512, 512]));
        let profile = self.profile.clone().unwrap_or_default().of_query()?;
        let light = self.light.as_deref().map(|list| {
            <[f32; 3]>::try_from(list)
                .map(|towards| Light {
                    towards,
                    irradiance: None,
                })
                .map_err(|_| {
                    let detail = format!("light has {} numbers.", list.len());
                    Problem::parameter("light", detail)
                        .accepting("3 numbers, the direction towards the light")
                })
        });
        let show = self.show.unwrap_or_default();
        let asked = View {
            show,
            scene: self.scene.unwrap_or_default(),
            size,
            samples_per_pixel: samples(show, spp, &profile),
            environment,
            lights: light.transpose()?.map(|light| vec![light]),
        };
        view(app, asked, &Names::QUERY)
    }
}

impl ViewQuery {
    /// The view, with the samples that meet a target where there is one.
    pub async fn picked_view(
        &self,
        app: &App,
        thing: &Arc<Shelved>,
        weights: Option<&RealisationWeights>,
        format: PictureFormat,
    ) -> Result<(View, Option<Picked>), Problem> {
        let sampled = [
            ("spp", self.spp.is_some()),
            ("profile", self.profile.is_some()),
            ("max_error", self.max_error.is_some()),
            ("max_seconds", self.max_seconds.is_some()),
        ];
        refuse_samples_of_angles(self.show.unwrap_or_default(), &sampled, &Names::QUERY)?;
        if let Some(asked) = &self.profile {
            asked.fits(thing)?;
            asked.refuse_other_samples(self.spp)?;
        }
        let knobs = self.profile.is_some() || self.spp.is_some();
        let target = targets::of_query(self.max_error, self.max_seconds, knobs)?;
        let environment = environment(app, self.environment.as_deref(), &Names::QUERY).await?;
        if !target.is_some() {
            return Ok((self.view(app, self.spp, environment)?, None));
        }
        // How many samples it takes is yet to be found.
        let view = self.view(app, Some(1), environment)?;
        let found = picked(app, thing, weights, (view, format), target).await?;
        Ok((found.0, Some(found.1)))
    }
}

/// A view with the samples that meet a target.
///
/// # Errors
///
/// [`Problem`] for weights that are refused, and when too many wait to compute.
pub async fn picked(
    app: &App,
    thing: &Arc<Shelved>,
    weights: Option<&RealisationWeights>,
    (mut view, format): (View, PictureFormat),
    target: Target,
) -> Result<(View, Picked), Problem> {
    let whole = (&thing.id, thing.file, weights, &view, format, target);
    let (works, thing, weights) = (Arc::clone(&app.works), Arc::clone(thing), weights.cloned());
    let wanted = view.clone();
    let unread = app.unread(view.environment.as_deref()).await?;
    let found = app.pick(&whole, move || {
        let environment = unread.as_ref().map(Unread::read).transpose()?;
        let asked = Asked::Preview {
            thing: &thing.thing,
            weights: weights.as_ref(),
            view: &wanted,
            environment: environment.as_deref(),
            format,
        };
        works.pick(&asked, &target).map_err(Problem::of_query)
    });
    let found = found.await?;
    view.samples_per_pixel = found.profile().samples_per_pixel;
    Ok((view, found))
}

/// How a request calls what makes a view.
pub struct Names {
    place: Place,
    samples: &'static str,
    /// The light of a query, or the list that lights stand in.
    light: &'static str,
}

impl Names {
    /// In a query.
    pub const QUERY: Self = Self {
        place: Place::Query,
        samples: "spp",
        light: "light",
    };
    /// In a JSON body.
    pub const BODY: Self = Self {
        place: Place::Body,
        samples: "samples_per_pixel",
        light: "lights",
    };

    fn refuse(&self, name: &str, detail: String, accepted: String) -> Problem {
        let problem = match self.place {
            Place::Body => Problem::value(format!("/{name}"), detail),
            _ => Problem::parameter(name, detail),
        };
        problem.accepting(accepted)
    }

    /// A problem with a parameter, where parameters stand.
    fn own(&self, problem: Problem) -> Problem {
        match self.place {
            Place::Body => problem.in_body(),
            _ => problem,
        }
    }

    fn light(&self, place: usize) -> String {
        match self.place {
            Place::Body => format!("{}/{place}", self.light),
            _ => self.light.to_owned(),
        }
    }
}

/// The environment that is asked for, by its id; `None` for the built-in studio.
///
/// # Errors
///
/// [`Problem`] for an id that no environment has.
pub async fn environment(
    app: &App,
    asked: Option<&str>,
    names: &Names,
) -> Result<Option<String>, Problem> {
    match asked {
        None | Some(STUDIO) => Ok(None),
        Some(id) if app.has_environment(id).await? => Ok(Some(id.to_owned())),
        Some(id) => Err(names.own(environments::not_offered(id))),
    }
}

/// Samples per pixel of what is shown: those asked for, or the profile's; angles have none to choose.
pub fn samples(show: Show, asked: Option<u32>, profile: &Profile) -> u32 {
    match show {
        Show::Paint => asked.unwrap_or(profile.samples_per_pixel),
        Show::Aspecular => 1,
    }
}

/// Refuses what chooses samples, by name and whether it is given, beside angles.
///
/// # Errors
///
/// [`Problem`] that names the first that is given.
pub fn refuse_samples_of_angles(
    show: Show,
    given: &[(&str, bool)],
    names: &Names,
) -> Result<(), Problem> {
    match given.iter().find(|(_, is)| *is) {
        Some((name, _)) if show == Show::Aspecular => {
            let detail = format!(
                "{name} stands beside show=aspecular: angles follow from the scene, without samples."
            );
            let accepted = format!("show=aspecular without {name}, or {name} with show=paint");
            Err(names.refuse(name, detail, accepted))
        }
        _ => Ok(()),
    }
}

/// A view, with everything in range.
pub fn view(app: &App, view: View, names: &Names) -> Result<View, Problem> {
    let (most, spp) = (app.config.limits.samples, view.samples_per_pixel);
    let [width, height] = view.size;
    let size = format!("{width}x{height}");
    if !(1..=most).contains(&spp) {
        let detail = format!("{} is {spp}.", names.samples);
        return Err(names.refuse(names.samples, detail, format!("1 to {most}")));
    }
    if !view
        .size
        .iter()
        .all(|side| (1..=LONGEST_SIDE).contains(side))
    {
        let accepted = format!("1 to {LONGEST_SIDE} each");
        return Err(names.refuse("size", format!("size is {size}."), accepted));
    }
    if u64::from(width) * u64::from(height) * u64::from(spp) > MOST_SAMPLES {
        let detail = format!("{} is {spp} for each of {size} pixels.", names.samples);
        let accepted = format!("up to {MOST_SAMPLES} samples in all");
        return Err(names.refuse(names.samples, detail, accepted));
    }
    let lights = view.lights.as_deref().unwrap_or_default();
    if lights.len() > MOST_LIGHTS {
        let detail = format!("{} has {} lights.", names.light, lights.len());
        return Err(names.refuse(names.light, detail, format!("up to {MOST_LIGHTS} lights")));
    }
    for (place, light) in lights.iter().enumerate() {
        let length: f32 = light.towards.iter().map(|v| v * v).sum();
        let bright = light.irradiance.unwrap_or_default();
        let dim = bright.iter().all(|v| (0.0..=65504.0).contains(v));
        if !(length > 0.0 && length.is_finite() && dim) {
            let name = names.light(place);
            let towards = light.towards;
            let detail = match light.irradiance {
                Some(irradiance) => {
                    format!("{name} is towards {towards:?} with irradiance {irradiance:?}.")
                }
                None => format!("{name} is towards {towards:?}."),
            };
            let accepted =
                "a direction of some length, and an irradiance of 0 to 65504 per channel";
            return Err(names.refuse(&name, detail, accepted.to_owned()));
        }
    }
    Ok(view)
}
