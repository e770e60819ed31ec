//! Profiles in requests: the name of a preset, knobs as text, or an object of knobs.

use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

use crate::accuracy::{Knobs, Profile, ProfileError};
use crate::paint::Clustering;
use crate::service::http::Problem;
use crate::service::shelf::Shelved;
use crate::service::work::Thing;
use crate::workshop::{Settled, check_clusters, settled};

/// What would be accepted in place of a profile that is none.
const ACCEPTED: &str =
    "draft, standard, reference, or knobs such as clusters=100 or {\"clusters\": 100}";

/// A profile as it was asked for, and the clusters that stood beside it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProfileText(pub Knobs, Option<u32>);

impl<'de> Deserialize<'de> for ProfileText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Knobs::of_name_or_object(deserializer).map(|knobs| Self(knobs, None))
    }
}

/// An accuracy profile: a preset's name, or knobs beside a preset.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
#[schema(example = "standard")]
#[allow(dead_code)] // says what is accepted
pub enum ProfileDocument {
    /// `draft`, `standard` or `reference`; knobs may follow, separated by commas: `standard,clusters=100`.
    #[schema(title = "Name")]
    Name(String),
    /// Knobs.
    #[schema(title = "Knobs")]
    Knobs(KnobsDocument),
}

/// Knobs of a profile. What is left out stays as the preset has it. Of a paint or a blend that is there, a knob by which
/// it was made otherwise is refused: it is not made anew.
#[derive(Debug, Serialize, ToSchema)]
#[allow(dead_code)] // says what is accepted
pub struct KnobsDocument {
    /// Where the other knobs stand: `draft`, `standard` or `reference`; `standard` unless given.
    preset: Option<String>,
    /// Most clusters of a flake slice. Paints are clustered when they are uploaded.
    #[schema(minimum = 1, maximum = 4096)]
    clusters: Option<u32>,
    /// Box of a cluster: `moments` or `tight`.
    box_rule: Option<String>,
    /// Every n-th measured angle is used.
    #[schema(minimum = 1, maximum = 16)]
    angle_step: Option<u32>,
    /// Solver of each slice: `exact`, `sinkhorn` or `greedy`.
    transport: Option<String>,
    /// Smoothing of `sinkhorn`, as a part of the mean cost.
    #[schema(minimum = 1e-6, maximum = 10.0)]
    epsilon: Option<f64>,
    /// Cost of moving a color: `distance` in Lab, or `squared`.
    cost: Option<String>,
    /// Order in which more than two paints are joined: `canonical`, by content hash; the `cheapest` of all; or `sampled`,
    /// the cheapest as a few slices tell.
    order: Option<String>,
    /// Precision of textures: `f32`, `f16` or `8bit`.
    precision: Option<String>,
    /// How a bundle's flakes can be drawn: `alias`, `inverse_cdf` or `both`.
    draw: Option<String>,
    /// Samples per pixel of a picture.
    #[schema(minimum = 1, maximum = 4096)]
    samples_per_pixel: Option<u32>,
}

impl ProfileText {
    /// The same with clusters that stand beside it.
    #[must_use]
    pub fn with_clusters(self, clusters: Option<u32>) -> Self {
        Self(self.0, clusters)
    }

    /// The knobs, with those that stand beside them.
    fn knobs(&self) -> Knobs {
        Knobs {
            clusters: self.1.or(self.0.clusters),
            ..self.0
        }
    }

    /// Refuses samples per pixel that stand beside others in the profile of a query.
    ///
    /// # Errors
    ///
    /// [`Problem`] that names the parameter.
    pub fn refuse_other_samples(&self, spp: Option<u32>) -> Result<(), Problem> {
        match twice("spp", spp, self.0.samples_per_pixel) {
            Some((detail, accepted)) => Err(Problem::parameter("spp", detail).accepting(accepted)),
            None => Ok(()),
        }
    }

    /// The same of a body.
    ///
    /// # Errors
    ///
    /// [`Problem`] that points at the field.
    pub fn refuse_other_samples_in_body(&self, samples: Option<u32>) -> Result<(), Problem> {
        match twice("samples_per_pixel", samples, self.0.samples_per_pixel) {
            Some((detail, accepted)) => {
                Err(Problem::value("/samples_per_pixel", detail).accepting(accepted))
            }
            None => Ok(()),
        }
    }

    /// The profile, asked for in a query.
    ///
    /// # Errors
    ///
    /// [`Problem`] that names the parameter and what would be accepted.
    pub fn of_query(&self) -> Result<Profile, Problem> {
        if let Some((detail, accepted)) = twice("clusters", self.1, self.0.clusters) {
            return Err(Problem::parameter("clusters", detail).accepting(accepted));
        }
        self.knobs().profile().map_err(|error| {
            let parameter = match error.knob() {
                Some("clusters") if self.1.is_some() => "clusters",
                _ => "profile",
            };
            accepting(Problem::parameter(parameter, sentence(&error)), &error)
        })
    }

    /// Refuses knobs of a query that a paint or a blend was made by otherwise, to make something of it as it is.
    ///
    /// # Errors
    ///
    /// [`Problem`] that names the parameter.
    pub fn fits(&self, thing: &Shelved) -> Result<(), Problem> {
        match self.made_otherwise(thing) {
            Some(Misfit {
                detail, accepted, ..
            }) => Err(Problem::parameter("profile", detail).accepting(accepted)),
            None => Ok(()),
        }
    }

    /// The same of a profile in a JSON body.
    ///
    /// # Errors
    ///
    /// [`Problem`] that points at the knob.
    pub fn fits_in_body(&self, thing: &Shelved) -> Result<(), Problem> {
        self.made_otherwise(thing).map_or(Ok(()), Misfit::in_body)
    }

    /// Refuses clusters, asked for in a JSON body, that a paint does not have: paints are clustered when they are uploaded.
    ///
    /// # Errors
    ///
    /// [`Problem`] that points at the knob.
    pub fn clusters_fit_in_body(&self, thing: &Shelved) -> Result<(), Problem> {
        self.other_clusters(thing).map_or(Ok(()), Misfit::in_body)
    }

    fn made_otherwise(&self, thing: &Shelved) -> Option<Misfit> {
        self.other_clusters(thing).or_else(|| {
            let Settled { knob, made, asked } = settled(&thing.thing, &self.0)?;
            Some(Misfit {
                detail: format!("{} was made with {knob}={made}, not {asked}.", thing.id),
                accepted: format!("{knob}={made}, or a profile without {knob}"),
                knob,
            })
        })
    }

    fn other_clusters(&self, thing: &Shelved) -> Option<Misfit> {
        let wanted = self.0.clusters?;
        let (fits, had, accepted) = match &thing.thing {
            Thing::Paint(paint) => (
                check_clusters(&thing.id, paint, wanted as usize).is_ok(),
                counts([paint.clustering.as_ref()].into_iter()),
                "a profile without clusters, or a paint uploaded with so many",
            ),
            Thing::Blend(blend) => (
                (blend.clusterings()).all(|own| own.is_some_and(|c| c.clusters == wanted as usize)),
                counts(blend.clusterings()),
                "a profile without clusters, or a blend of paints uploaded with so many",
            ),
        };
        (!fits).then(|| Misfit {
            knob: "clusters".to_owned(),
            detail: format!("{} has {had} clusters a slice, not {wanted}.", thing.id),
            accepted: accepted.to_owned(),
        })
    }

    /// The profile, asked for in a JSON body.
    ///
    /// # Errors
    ///
    /// [`Problem`] that points at the field and says what would be accepted.
    pub fn of_body(&self) -> Result<Profile, Problem> {
        if let Some((detail, accepted)) = twice("clusters", self.1, self.0.clusters) {
            return Err(Problem::value("/clusters", detail).accepting(accepted));
        }
        self.knobs().profile().map_err(|error| {
            let pointer = match error.knob() {
                Some("clusters") if self.1.is_some() => "/clusters".to_owned(),
                Some(knob) => format!("/profile/{knob}"),
                None => "/profile".to_owned(),
            };
            accepting(Problem::value(pointer, sentence(&error)), &error)
        })
    }
}

/// What is wrong where a number stands beside a profile that turns the same knob to another, and what would be accepted.
fn twice(field: &str, beside: Option<u32>, in_profile: Option<u32>) -> Option<(String, String)> {
    let (beside, own) = beside.zip(in_profile)?;
    let detail = format!("{field} is {beside}, and {own} in the profile beside it.");
    (beside != own).then(|| (detail, "one of the two".to_owned()))
}

/// A knob that a thing was made by otherwise.
struct Misfit {
    knob: String,
    detail: String,
    accepted: String,
}

impl Misfit {
    fn in_body(self) -> Result<(), Problem> {
        let pointer = format!("/profile/{}", self.knob);
        Err(Problem::value(pointer, self.detail).accepting(self.accepted))
    }
}

/// Most clusters of a slice, paint by paint.
fn counts<'a>(of: impl Iterator<Item = Option<&'a Clustering>>) -> String {
    let each = of.map(|own| {
        own.map_or("an unknown number of".to_owned(), |c| {
            c.clusters.to_string()
        })
    });
    each.collect::<Vec<_>>().join(" and ")
}

fn sentence(error: &ProfileError) -> String {
    match error {
        ProfileError::Range { knob, value, .. } => format!("{knob} is {value}."),
        error => format!("{error}."),
    }
}

fn accepting(problem: Problem, error: &ProfileError) -> Problem {
    problem.accepting(match error {
        ProfileError::Range { accepted, .. } => (*accepted).to_owned(),
        ProfileError::Epsilon => "transport sinkhorn beside it, or no epsilon".to_owned(),
        _ => ACCEPTED.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use utoipa::PartialSchema;

    #[test]
    fn the_interface_documents_every_knob_and_no_other() {
        let schema = serde_json::to_value(KnobsDocument::schema()).expect("serialises");
        let mut documented: Vec<&str> = schema["properties"]
            .as_object()
            .expect("an object")
            .keys()
            .map(String::as_str)
            .collect();
        documented.sort_unstable();
        let all: Knobs = "preset=draft,transport=sinkhorn,epsilon=0.5"
            .parse()
            .expect("knobs");
        let knobs = Knobs::of(&all.profile().expect("a profile"))
            .over(&all)
            .expect("knobs");
        let knobs = serde_json::to_value(knobs).expect("serialises");
        let mut there: Vec<&str> = knobs
            .as_object()
            .expect("an object")
            .keys()
            .map(String::as_str)
            .collect();
        there.sort_unstable();
        assert_eq!(documented, there);
    }
}
