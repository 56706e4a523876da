//! Which effects a rendering simulates, and why: decided by what the scene contains.
//!
//! A plan only leaves out what the [facts](SceneFacts) exclude, so that it never changes an image:
//! [`Planning::Everything`] renders the same bits and shows what not planning would cost.

use niwaki_scene::SceneFacts;
use std::fmt;

/// Who decides on the effects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Planning {
    /// The scene: what nothing in it calls for is left out.
    #[default]
    Scene,
    /// Nobody: every effect runs on every surface, rays that can carry no light included. The
    /// image is the same, bit for bit; for checking that, and for measuring what planning saves.
    Everything,
}

/// Something that takes rays or look-ups and that not every scene calls for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Effect {
    /// Light from point, spot and directional lights, with a shadow ray for each.
    PunctualLight,
    /// Light from emissive triangles that is sampled at surfaces.
    AreaLight,
    /// Light from the environment that is sampled at surfaces.
    EnvironmentLight,
    /// Light that stands for what bounced more than the integrator follows.
    Ambient,
    /// Rays that find out how much of the ambient light surfaces around hold back.
    Occlusion,
    /// What rays that leave the scene see.
    Sky,
    /// Light that surfaces give off, where a ray meets them.
    Emission,
    /// Alpha looked up at every hit, shadow rays stepping from surface to surface.
    Alpha,
    /// Reflected rays.
    Reflection,
    /// Refracted rays.
    Refraction,
    /// Beer's law inside transmitting materials.
    Absorption,
}

impl Effect {
    /// All effects in the order of a plan.
    pub const ALL: [Self; 11] = [
        Self::PunctualLight,
        Self::AreaLight,
        Self::EnvironmentLight,
        Self::Ambient,
        Self::Occlusion,
        Self::Sky,
        Self::Emission,
        Self::Alpha,
        Self::Reflection,
        Self::Refraction,
        Self::Absorption,
    ];
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::PunctualLight => "punctual light",
            Self::AreaLight => "area light",
            Self::EnvironmentLight => "environment light",
            Self::Ambient => "ambient",
            Self::Occlusion => "occlusion",
            Self::Sky => "sky",
            Self::Emission => "emission",
            Self::Alpha => "alpha",
            Self::Reflection => "reflection",
            Self::Refraction => "refraction",
            Self::Absorption => "absorption",
        })
    }
}

/// Whether an effect runs, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decision {
    /// The effect.
    pub effect: Effect,
    /// It runs.
    pub runs: bool,
    /// What decided.
    pub reason: String,
}

/// The effects of one rendering. Prints as a table.
///
/// ```
/// use niwaki_render::{Effect, PathSettings, PathTracer};
/// let scene = niwaki_scene::generate::generate("hair", 1_000, 1).ok_or("no such scene")?;
/// let plan = PathTracer::new(PathSettings::default()).plan(&scene);
/// assert!(!plan.runs(Effect::Refraction));
/// println!("{plan}");
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EffectPlan {
    decisions: Vec<Decision>,
}

impl EffectPlan {
    /// All effects that some integrator has; `has` names those of this one.
    pub(crate) fn new(facts: &SceneFacts, has: &[Effect], planning: Planning) -> Self {
        let decide = |&effect: &Effect| {
            let (runs, reason) = called_for(effect, facts);
            match planning {
                Planning::Scene => Decision { effect, runs, reason },
                Planning::Everything if runs => Decision { effect, runs, reason },
                Planning::Everything => {
                    Decision { effect, runs: true, reason: format!("forced, though {reason}") }
                }
            }
        };
        Self { decisions: Effect::ALL.iter().filter(|e| has.contains(e)).map(decide).collect() }
    }

    /// Leaves an effect out by a setting.
    pub(crate) fn without(mut self, effect: Effect, reason: &str) -> Self {
        for decision in self.decisions.iter_mut().filter(|d| d.effect == effect) {
            *decision = Decision { effect, runs: false, reason: reason.into() };
        }
        self
    }

    /// Lets an effect run by a setting.
    pub(crate) fn with(mut self, effect: Effect, reason: &str) -> Self {
        for decision in self.decisions.iter_mut().filter(|d| d.effect == effect) {
            *decision = Decision { effect, runs: true, reason: reason.into() };
        }
        self
    }

    /// True if the integrator has the effect and it runs.
    #[must_use]
    pub fn runs(&self, effect: Effect) -> bool {
        self.decisions.iter().any(|d| d.effect == effect && d.runs)
    }

    /// One for each effect that the integrator has.
    #[must_use]
    pub fn decisions(&self) -> &[Decision] {
        &self.decisions
    }
}

impl fmt::Display for EffectPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, Decision { effect, runs, reason }) in self.decisions.iter().enumerate() {
            let separator = if i == 0 { "" } else { "\n" };
            write!(
                f,
                "{separator}{effect:<17} {:<4} {reason}",
                if *runs { "runs" } else { "off" }
            )?;
        }
        Ok(())
    }
}

/// Whether a scene calls for an effect, and what says so.
fn called_for(effect: Effect, facts: &SceneFacts) -> (bool, String) {
    let lights = &facts.lights;
    let worn = |has: fn(&niwaki_scene::MaterialFacts) -> bool| {
        let triangles: usize = facts.worn().filter(|m| has(m)).map(|m| m.triangles).sum();
        (facts.worn().filter(|m| has(m)).count(), triangles)
    };
    let materials = |(count, triangles): (usize, usize), does: &str, they_do: &str| match count {
        0 => (false, format!("no material {does}")),
        1 => (true, format!("1 material on {triangles} triangles {does}")),
        _ => (true, format!("{count} materials on {triangles} triangles {they_do}")),
    };
    match effect {
        Effect::PunctualLight => match lights.punctual() {
            0 => (false, "no punctual light shines".into()),
            1 => (true, "1 punctual light shines".into()),
            n => (true, format!("{n} punctual lights shine")),
        },
        Effect::AreaLight | Effect::Emission => materials(worn(|m| m.emissive), "emits", "emit"),
        Effect::EnvironmentLight | Effect::Sky | Effect::Ambient | Effect::Occlusion => (
            lights.environment,
            if lights.environment { "the environment shines" } else { "the environment is dark" }
                .into(),
        ),
        Effect::Alpha => {
            materials(worn(|m| m.has_alpha()), "lets rays pass by alpha", "let rays pass by alpha")
        }
        Effect::Reflection => {
            materials(worn(|m| m.reflective), "reflects like a mirror", "reflect like mirrors")
        }
        Effect::Refraction => materials(worn(|m| m.transmissive), "transmits", "transmit"),
        Effect::Absorption => materials(worn(|m| m.absorbing), "absorbs inside", "absorb inside"),
    }
}
