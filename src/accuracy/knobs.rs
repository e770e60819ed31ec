//! The knobs of a profile: every setting by a name that a person can type.
//!
//! One list for the command line (`--knob clusters=100`), JSON (`{"preset": "standard", "clusters": 100}`) and addresses
//! (`profile=standard,clusters=100`). What is left out stays as the preset has it, which is `standard` unless named.

mod choices;
mod error;
mod reading;

use serde::{Deserialize, Serialize};

pub use self::choices::{CostKnob, Draw, Preset, Transport};
pub use self::error::ProfileError;
use super::Profile;
use crate::blend::Order;
use crate::export::Precision;
use crate::fit::BoxRule;
use crate::transport::{Cost, Method};

/// Smoothing of a Sinkhorn transport that names none, as a part of the mean cost.
const EPSILON: f64 = 0.01;

/// Settings of a profile that were given; the others are the preset's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Knobs {
    /// Where the other knobs stand: `draft`, `standard` or `reference`.
    #[serde(
        default,
        deserialize_with = "read::preset",
        skip_serializing_if = "Option::is_none"
    )]
    pub preset: Option<Preset>,
    /// Most clusters of a flake slice, 1 to 4096.
    #[serde(
        default,
        deserialize_with = "read::clusters",
        skip_serializing_if = "Option::is_none"
    )]
    pub clusters: Option<u32>,
    /// Box of a cluster: `moments` or `tight`.
    #[serde(
        default,
        deserialize_with = "read::box_rule",
        skip_serializing_if = "Option::is_none"
    )]
    pub box_rule: Option<BoxRule>,
    /// Every n-th measured angle is used, 1 to 16.
    #[serde(
        default,
        deserialize_with = "read::angle_step",
        skip_serializing_if = "Option::is_none"
    )]
    pub angle_step: Option<u32>,
    /// Solver of each slice: `exact`, `sinkhorn` or `greedy`.
    #[serde(
        default,
        deserialize_with = "read::transport",
        skip_serializing_if = "Option::is_none"
    )]
    pub transport: Option<Transport>,
    /// Smoothing of `sinkhorn`, as a part of the mean cost, 1e-6 to 10.
    #[serde(
        default,
        deserialize_with = "read::epsilon",
        skip_serializing_if = "Option::is_none"
    )]
    pub epsilon: Option<f64>,
    /// Cost of moving a color: `distance` in Lab, or `squared`.
    #[serde(
        default,
        deserialize_with = "read::cost",
        skip_serializing_if = "Option::is_none"
    )]
    pub cost: Option<CostKnob>,
    /// Order in which more than two paints are joined: `canonical`, by content hash; the `cheapest` of all; or `sampled`,
    /// the cheapest as a few slices tell.
    #[serde(
        default,
        deserialize_with = "read::order",
        skip_serializing_if = "Option::is_none"
    )]
    pub order: Option<Order>,
    /// Precision of textures: `f32`, `f16` or `8bit`.
    #[serde(
        default,
        deserialize_with = "read::precision",
        skip_serializing_if = "Option::is_none"
    )]
    pub precision: Option<Precision>,
    /// How a bundle's flakes can be drawn: `alias` table, `inverse_cdf` of 500 steps, or `both`.
    #[serde(
        default,
        deserialize_with = "read::draw",
        skip_serializing_if = "Option::is_none"
    )]
    pub draw: Option<Draw>,
    /// Samples per pixel of a picture, 1 to 4096.
    #[serde(
        default,
        deserialize_with = "read::samples_per_pixel",
        skip_serializing_if = "Option::is_none"
    )]
    pub samples_per_pixel: Option<u32>,
}

/// What a knob can be set to.
fn accepted(knob: &str) -> &'static str {
    match knob {
        "preset" => "draft, standard or reference",
        "box_rule" => "moments or tight",
        "angle_step" => "a whole number from 1 to 16",
        "transport" => "exact, sinkhorn or greedy",
        "epsilon" => "1e-6 to 10",
        "cost" => "distance or squared",
        "order" => "canonical, sampled or cheapest",
        "precision" => "f32, f16 or 8bit",
        "draw" => "alias, inverse_cdf or both",
        _ => "a whole number from 1 to 4096",
    }
}

/// Readers of the knobs: a value that is none of its knob's is refused by the knob's name.
mod read {
    use serde::de::{DeserializeOwned, Error as _};
    use serde::{Deserialize as _, Deserializer};
    use serde_json::Value;

    macro_rules! knobs {
        ($($knob:ident)*) => {$(
            pub fn $knob<'de, D, T>(deserializer: D) -> Result<Option<T>, D::Error>
            where
                D: Deserializer<'de>,
                T: DeserializeOwned,
            {
                let given = Value::deserialize(deserializer)?;
                serde_json::from_value(given.clone()).map_err(|_| {
                    let (knob, accepted) = (stringify!($knob), super::accepted(stringify!($knob)));
                    D::Error::custom(format!("{knob} is {given}, accepted is {accepted}"))
                })
            }
        )*};
    }

    knobs! {
        preset clusters box_rule angle_step transport epsilon cost order precision draw samples_per_pixel
    }
}

impl Knobs {
    /// All knobs of a profile.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // in range
    pub fn of(profile: &Profile) -> Self {
        let (transport, epsilon) = match profile.blend.method {
            Method::Sinkhorn { epsilon } => (Transport::Sinkhorn, Some(epsilon)),
            Method::Greedy => (Transport::Greedy, None),
            _ => (Transport::Exact, None),
        };
        Self {
            preset: None,
            clusters: Some(profile.flakes.clusters as u32),
            box_rule: Some(profile.flakes.box_rule),
            angle_step: Some(profile.flakes.angle_step as u32),
            transport: Some(transport),
            epsilon,
            cost: Some(match profile.blend.cost {
                Cost::SquaredDistance => CostKnob::Squared,
                _ => CostKnob::Distance,
            }),
            order: Some(profile.blend.order),
            precision: Some(profile.export.precision),
            draw: Some(match (profile.export.alias, profile.export.inverse_cdf) {
                (true, true) => Draw::Both,
                (false, true) => Draw::InverseCdf,
                (_, false) => Draw::Alias,
            }),
            samples_per_pixel: Some(profile.samples_per_pixel),
        }
    }

    /// A profile as it can be asked for: a preset's name, or `standard` and the knobs that are turned otherwise.
    #[must_use]
    pub fn told(profile: &Profile) -> String {
        let knobs = |profile: &Profile| match serde_json::to_value(Self::of(profile)) {
            Ok(serde_json::Value::Object(knobs)) => knobs,
            _ => serde_json::Map::new(),
        };
        let standard = knobs(&Profile::standard());
        let turned = knobs(profile).into_iter().filter_map(|(knob, value)| {
            let text = (value.as_str()).map_or_else(|| value.to_string(), str::to_owned);
            (standard.get(&knob) != Some(&value)).then(|| format!(",{knob}={text}"))
        });
        match profile.name() {
            "custom" => turned.fold("standard".to_owned(), |all, one| all + &one),
            name => name.to_owned(),
        }
    }

    /// The profile that these knobs mean.
    ///
    /// # Errors
    ///
    /// [`ProfileError`] for a value out of range.
    pub fn profile(&self) -> Result<Profile, ProfileError> {
        self.turned(match self.preset.unwrap_or_default() {
            Preset::Draft => Profile::draft(),
            Preset::Standard => Profile::standard(),
            Preset::Reference => Profile::reference(),
        })
    }

    /// A profile with these knobs turned.
    ///
    /// # Errors
    ///
    /// [`ProfileError`] for a value out of range.
    pub fn turned(&self, mut profile: Profile) -> Result<Profile, ProfileError> {
        let whole = |knob, value: Option<u32>, most: u32| match value {
            Some(value) if !(1..=most).contains(&value) => Err(ProfileError::Range {
                knob,
                value: value.to_string(),
                accepted: accepted(knob),
            }),
            value => Ok(value),
        };
        if let Some(clusters) = whole("clusters", self.clusters, 4096)? {
            profile.flakes.clusters = clusters as usize;
        }
        if let Some(step) = whole("angle_step", self.angle_step, 16)? {
            profile.flakes.angle_step = step as usize;
        }
        if let Some(n) = whole("samples_per_pixel", self.samples_per_pixel, 4096)? {
            profile.samples_per_pixel = n;
        }
        profile.flakes.box_rule = self.box_rule.unwrap_or(profile.flakes.box_rule);
        profile.blend.method = self.method(profile.blend.method)?;
        match self.cost {
            Some(CostKnob::Distance) => profile.blend.cost = Cost::Distance,
            Some(CostKnob::Squared) => profile.blend.cost = Cost::SquaredDistance,
            None => {}
        }
        profile.blend.order = self.order.unwrap_or(profile.blend.order);
        profile.export.precision = self.precision.unwrap_or(profile.export.precision);
        if let Some(draw) = self.draw {
            profile.export.alias = draw != Draw::InverseCdf;
            profile.export.inverse_cdf = draw != Draw::Alias;
        }
        Ok(profile)
    }

    fn method(&self, preset: Method) -> Result<Method, ProfileError> {
        if let Some(epsilon) = self.epsilon.filter(|e| !(1e-6..=10.0).contains(e)) {
            return Err(ProfileError::Range {
                knob: "epsilon",
                value: format!("{epsilon:?}"),
                accepted: accepted("epsilon"),
            });
        }
        let method = match self.transport {
            Some(Transport::Exact) => Method::Exact,
            Some(Transport::Greedy) => Method::Greedy,
            Some(Transport::Sinkhorn) => Method::Sinkhorn { epsilon: EPSILON },
            None => preset,
        };
        match (method, self.epsilon) {
            (method, None) => Ok(method),
            (Method::Sinkhorn { .. }, Some(epsilon)) => Ok(Method::Sinkhorn { epsilon }),
            _ => Err(ProfileError::Epsilon),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_told_as_it_can_be_asked_for() {
        assert_eq!(Knobs::told(&Profile::draft()), "draft");
        for text in [
            "standard,precision=f32",
            "standard,clusters=100,transport=greedy",
        ] {
            let profile: Profile = text.parse().expect("a profile");
            let told = Knobs::told(&profile);
            assert_eq!(
                told.parse::<Profile>().expect("a profile"),
                profile,
                "{told}"
            );
            assert_eq!(told.len(), text.len(), "{told}");
        }
    }

    #[test]
    fn knobs_are_turned_one_by_one_and_the_others_stay() {
        let profile: Profile =
            "clusters=100,transport=sinkhorn,epsilon=0.5,cost=squared,draw=alias"
                .parse()
                .expect("knobs");
        let standard = Profile::standard();
        assert_eq!(profile.flakes.clusters, 100);
        assert_eq!(profile.blend.method, Method::Sinkhorn { epsilon: 0.5 });
        assert_eq!(profile.blend.cost, Cost::SquaredDistance);
        assert!(profile.export.alias && !profile.export.inverse_cdf);
        assert_eq!(profile.flakes.box_rule, standard.flakes.box_rule);
        assert_eq!(profile.samples_per_pixel, standard.samples_per_pixel);
    }

    #[test]
    fn what_is_no_knob_is_refused_by_name_with_what_there_is() {
        for (text, named) in [
            ("cluster=3", "`clusters`"),
            (
                "clusters",
                "clusters has no value, accepted is clusters= and a whole number from 1 to 4096",
            ),
            (
                "clusters=10,draft,clusters=20",
                "clusters is set twice, to 10 and to 20, accepted is one of the two",
            ),
            (
                "clusters=many",
                "clusters is \"many\", accepted is a whole number from 1 to 4096",
            ),
            (
                "clusters=",
                "clusters is \"\", accepted is a whole number from 1 to 4096",
            ),
            (
                "clusters=nan",
                "clusters is \"nan\", accepted is a whole number from 1 to 4096",
            ),
            (
                "clusters=0",
                "clusters is 0, accepted is a whole number from 1 to 4096",
            ),
            (
                "clusters=-1",
                "clusters is -1, accepted is a whole number from 1 to 4096",
            ),
            (
                "clusters=1.5",
                "clusters is 1.5, accepted is a whole number from 1 to 4096",
            ),
            (
                "clusters=99999999999",
                "clusters is 99999999999, accepted is a whole number from 1 to 4096",
            ),
            (
                "angle_step=1e99",
                "angle_step is 1e+99, accepted is a whole number from 1 to 16",
            ),
            (
                "transport=magic",
                "transport is \"magic\", accepted is exact, sinkhorn or greedy",
            ),
            (
                "precision=3",
                "precision is 3, accepted is f32, f16 or 8bit",
            ),
            ("transport=sinkhorn,epsilon=inf", "1e-6 to 10"),
            ("transport=sinkhorn,epsilon=1e99", "epsilon is 1e99"),
            ("best", "reference"),
            ("epsilon=0.1", "sinkhorn"),
            ("transport=sinkhorn,epsilon=0", "1e-6"),
            ("draft,clusters=3,clusters=4", "twice"),
            ("", "draft"),
        ] {
            let error = text.parse::<Profile>().expect_err(text).to_string();
            assert!(error.contains(named), "{text}: {error}");
        }
        let object = serde_json::json!({ "preset": "draft", "samples": 3 });
        let error = serde_json::from_value::<Profile>(object).expect_err("refused");
        assert!(error.to_string().contains("samples_per_pixel"), "{error}");
    }

    #[test]
    fn later_knobs_win_over_earlier_ones() {
        let file: Knobs = "draft,clusters=10".parse().expect("knobs");
        let given: Knobs = "clusters=20".parse().expect("knobs");
        let profile = given.over(&file).and_then(|k| k.profile()).expect("knobs");
        assert_eq!(profile.flakes.clusters, 20);
        assert_eq!(profile.flakes.angle_step, 2);
    }
}
