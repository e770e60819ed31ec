//! Which effects a picture needs, decided before a pixel is shaded.
//!
//! What a paint does not have is not simulated: a solid color never reaches flake code, an uncoated paint never coat
//! code. The plan is part of every answer, with a reason for what was left out.

use serde::Serialize;

use super::scene::Scene;
use crate::paint::CarPaint;

/// Something that can be seen in a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// Refraction, absorption by reflection and highlight of the clear coat.
    Coat,
    /// The coat's mirror image of the surroundings.
    MirrorImage,
    /// Cook-Torrance lobes of the base.
    Lobes,
    /// Color of the base by angle.
    ColorTable,
    /// Flakes, drawn per texel.
    Flakes,
    /// Light from the surroundings.
    Environment,
    /// Light of single directions.
    DirectionalLights,
    /// The object's shadow on the floor.
    GroundShadow,
}

/// One line of the plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PlannedEffect {
    /// What.
    pub effect: Effect,
    /// Whether it is simulated.
    pub simulated: bool,
    /// Why, or why not.
    pub reason: String,
}

/// The plan of a picture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct EffectPlan {
    /// Every effect, simulated or not.
    pub effects: Vec<PlannedEffect>,
}

impl EffectPlan {
    /// Looks at scene and paint.
    #[must_use]
    pub fn new(paint: &CarPaint, scene: &Scene, lit_by_environment: bool) -> Self {
        let coat = paint.coat.filter(|coat| coat.ior > 1.0);
        let lobes = paint.lobes.iter().filter(|lobe| !lobe.is_absent()).count();
        let table = paint.color_table.nodes().len();
        let sweep = scene.background == super::Background::Sweep;
        let line = |effect, simulated, reason: String| PlannedEffect {
            effect,
            simulated,
            reason,
        };
        let effects = vec![
            line(
                Effect::Coat,
                coat.is_some(),
                coat.map_or("the paint is uncoated".into(), |c| format!("ior {}", c.ior)),
            ),
            line(
                Effect::MirrorImage,
                coat.is_some_and(|c| c.is_mirror()),
                match coat {
                    None => "the paint is uncoated".into(),
                    Some(c) if c.is_mirror() => "the coat is smooth".into(),
                    Some(c) => format!(
                        "the coat's roughness {} gives a highlight of finite width",
                        c.roughness
                    ),
                },
            ),
            line(
                Effect::Lobes,
                lobes > 0,
                format!("{lobes} lobes with weight"),
            ),
            line(Effect::ColorTable, true, format!("{table} angle pairs")),
            line(
                Effect::Flakes,
                paint.flakes.is_some(),
                paint.flakes.as_ref().map_or_else(
                    || "the paint is a solid color".into(),
                    |f| format!("drawn per texel of {} µm", f.texture.texel_um),
                ),
            ),
            line(
                Effect::Environment,
                lit_by_environment,
                if lit_by_environment {
                    "sampled by its radiance"
                } else {
                    "it is black"
                }
                .into(),
            ),
            line(
                Effect::DirectionalLights,
                !scene.lights.is_empty(),
                format!("{} lights", scene.lights.len()),
            ),
            line(
                Effect::GroundShadow,
                sweep,
                if sweep {
                    "the object stands on a sweep"
                } else {
                    "the environment is the background"
                }
                .into(),
            ),
        ];
        Self { effects }
    }

    /// Whether an effect is simulated.
    #[must_use]
    pub fn has(&self, effect: Effect) -> bool {
        self.effects
            .iter()
            .any(|e| e.effect == effect && e.simulated)
    }
}
