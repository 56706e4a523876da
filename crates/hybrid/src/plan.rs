//! The effect plan: which passes a frame runs, at which quality, and why.
//!
//! ```
//! use niwaki_hybrid::{EffectPlan, FrameFacts, ObjectFacts, Settings};
//! use niwaki_scene::{SceneFacts, generate};
//!
//! let scene = generate::generate("city", 2_000, 1).ok_or("no such scene")?;
//! let settings = Settings::default();
//! let facts = SceneFacts::new(&scene, settings.mirror_roughness);
//! let plan = EffectPlan::decide(&FrameFacts {
//!     scene: &facts,
//!     objects: &ObjectFacts::of(&scene, &facts),
//!     camera: &scene.cameras[0],
//!     width: 320,
//!     height: 180,
//!     settings: &settings,
//!     kept: None,
//! });
//! println!("{plan}");
//! # Ok::<(), &str>(())
//! ```
//!
//! The plan is made on the CPU from bounds alone, before anything is drawn, and errs on the side of
//! running: leaving out what it leaves out never changes the image. It holds no handles and can be
//! printed, stored, compared and overridden ([`Settings::force_all`](crate::Settings::force_all)).

mod decide;
mod facts;

pub use facts::{FrameFacts, ObjectFacts};

use crate::{Face, Region};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Something that a frame may or may not need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Effect {
    /// Moving and bending the vertices of dynamic objects.
    Deformation,
    /// Rasterising what the camera sees (section 3.1).
    PrimaryView,
    /// Testing the alpha of surfaces, in views and in rays.
    Alpha,
    /// Depth as the lights see it (section 3.5).
    ShadowMaps,
    /// Rasterising one face of the cube map (section 3.2).
    CubeFace(Face),
    /// Rasterising what comes next behind the cube map's surfaces, a draw of each face more.
    SecondLayer,
    /// Reducing the cube map's depth to a pyramid of least and greatest depths.
    DepthPyramid,
    /// Culling triangles into the near region and building its tree (section 3.3).
    NearRegion,
    /// Tracing rays to lights within the near region.
    ShadowRays,
    /// Tracing rays that look for what holds ambient light back within the near region.
    OcclusionRays,
    /// Following reflected rays (section 3.4).
    ReflectionRays,
    /// Following refracted rays.
    RefractionRays,
    /// Following rays straight on behind blended surfaces.
    TransparencyRays,
    /// Evaluating the environment where rays leave the scene.
    Sky,
}

impl Effect {
    /// All effects in the order in which a frame runs them.
    pub const ALL: [Self; 19] = [
        Self::Deformation,
        Self::PrimaryView,
        Self::Alpha,
        Self::ShadowMaps,
        Self::CubeFace(Face::PosX),
        Self::CubeFace(Face::NegX),
        Self::CubeFace(Face::PosY),
        Self::CubeFace(Face::NegY),
        Self::CubeFace(Face::PosZ),
        Self::CubeFace(Face::NegZ),
        Self::SecondLayer,
        Self::DepthPyramid,
        Self::NearRegion,
        Self::ShadowRays,
        Self::OcclusionRays,
        Self::ReflectionRays,
        Self::RefractionRays,
        Self::TransparencyRays,
        Self::Sky,
    ];
}

/// How much an effect that runs takes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Quality {
    /// There is only one.
    Full,
    /// Objects that are drawn or deformed.
    Objects(u32),
    /// Objects drawn into an image.
    View {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Objects drawn.
        objects: u32,
    },
    /// Faces of the cube map.
    Faces {
        /// How many.
        faces: u32,
        /// Width and height in pixels.
        resolution: u32,
    },
    /// Shadow maps: one for a directional light and for a spot light whose cone fits into one view,
    /// six for any other.
    Maps {
        /// How many.
        layers: u32,
        /// Width and height in pixels.
        resolution: u32,
    },
    /// This many rays from each surface.
    Rays(u32),
    /// Followed up to this many surfaces.
    Depth(u32),
}

/// What a frame does about an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Decision {
    /// It runs.
    Run {
        /// How much it takes on.
        quality: Quality,
    },
    /// What the last frame made still holds and is used again.
    Keep,
    /// Nothing calls for it: no work is given to the GPU.
    Skip,
}

/// One effect with the decision about it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedPass {
    /// The effect.
    pub effect: Effect,
    /// What to do about it.
    pub decision: Decision,
    /// Why, in one line.
    pub reason: String,
}

/// What frames leave behind that the next one may use.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// True if dynamic objects have been moved to where they are.
    pub deformed: bool,
    /// The region whose triangles the tree holds.
    pub tree: Option<Region>,
    /// True if that tree holds every triangle of the scene, wherever the camera stands.
    pub tree_holds_all: bool,
    /// The region for which each face was drawn, and its resolution.
    pub faces: [Option<(Region, u32)>; 6],
    /// Layers of the faces.
    pub layers: u32,
    /// Layers and resolution of the shadow maps.
    pub shadow_maps: Option<(u32, u32)>,
}

/// Which passes a frame runs, at which quality, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectPlan {
    /// Every effect once, in the order of [`Effect::ALL`].
    pub passes: Vec<PlannedPass>,
    /// The traced region and the cube map around it.
    pub region: Region,
    /// Numbers of the objects that the camera may see.
    pub visible: Vec<u32>,
    /// Numbers of the objects that each face may show.
    pub in_faces: [Vec<u32>; 6],
    /// Layers of the cube map: 2 if the settings ask for them or rays look through something.
    pub layers: u32,
    /// Numbers of the objects that meet the traced region.
    pub in_region: Vec<u32>,
    /// True if the tree of the near region holds every triangle of the scene.
    pub region_holds_all: bool,
    /// What will hold after this frame.
    pub kept: Kept,
}

impl EffectPlan {
    /// Decides about all effects.
    #[must_use]
    pub fn decide(facts: &FrameFacts<'_>) -> Self {
        decide::decide(facts)
    }

    /// The decision about an effect and the reason for it.
    #[must_use]
    pub fn pass(&self, effect: Effect) -> Option<&PlannedPass> {
        self.passes.iter().find(|p| p.effect == effect)
    }

    /// The decision about an effect.
    #[must_use]
    pub fn decision(&self, effect: Effect) -> Decision {
        self.pass(effect).map_or(Decision::Skip, |p| p.decision)
    }

    /// True if an effect's work is done in this frame.
    #[must_use]
    pub fn runs(&self, effect: Effect) -> bool {
        matches!(self.decision(effect), Decision::Run { .. })
    }

    /// True if the results of an effect are used in this frame: it runs, or its last results hold.
    #[must_use]
    pub fn uses(&self, effect: Effect) -> bool {
        self.decision(effect) != Decision::Skip
    }

    /// True if rays are followed beyond the primary view.
    #[must_use]
    pub fn follows_rays(&self) -> bool {
        [Effect::ReflectionRays, Effect::RefractionRays, Effect::TransparencyRays]
            .into_iter()
            .any(|effect| self.uses(effect))
    }
}

/// A number of things: "1 lamp", "2 lamps".
fn counted(n: u32, thing: &str) -> String {
    if n == 1 { format!("1 {thing}") } else { format!("{n} {thing}s") }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Deformation => f.pad("deformation"),
            Self::PrimaryView => f.pad("primary view"),
            Self::Alpha => f.pad("alpha"),
            Self::ShadowMaps => f.pad("shadow maps"),
            Self::CubeFace(face) => f.pad(&format!("cube face {face}")),
            Self::SecondLayer => f.pad("second layer"),
            Self::DepthPyramid => f.pad("depth pyramid"),
            Self::NearRegion => f.pad("near region"),
            Self::ShadowRays => f.pad("shadow rays"),
            Self::OcclusionRays => f.pad("occlusion rays"),
            Self::ReflectionRays => f.pad("reflection rays"),
            Self::RefractionRays => f.pad("refraction rays"),
            Self::TransparencyRays => f.pad("transparency rays"),
            Self::Sky => f.pad("sky"),
        }
    }
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Full => Ok(()),
            Self::Objects(n) => f.write_str(&counted(n, "object")),
            Self::View { width, height, objects } => {
                write!(f, "{width}x{height}, {}", counted(objects, "object"))
            }
            Self::Faces { faces, resolution } => write!(f, "{faces} of {resolution}x{resolution}"),
            Self::Maps { layers, resolution } => write!(f, "{layers} of {resolution}x{resolution}"),
            Self::Rays(n) => write!(f, "{} a surface", counted(n, "ray")),
            Self::Depth(n) => write!(f, "depth {n}"),
        }
    }
}

impl fmt::Display for PlannedPass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (word, quality) = match self.decision {
            Decision::Run { quality } => ("run", quality.to_string()),
            Decision::Keep => ("keep", String::new()),
            Decision::Skip => ("skip", String::new()),
        };
        write!(f, "{word:<4}  {:<17}", self.effect)?;
        if !quality.is_empty() {
            write!(f, "  [{quality}]")?;
        }
        write!(f, "  {}", self.reason)
    }
}

impl fmt::Display for EffectPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Region { half_size, far, .. } = self.region;
        writeln!(f, "near region: {half_size:.4} around the camera, map up to {far:.4}")?;
        for (k, pass) in self.passes.iter().enumerate() {
            if k > 0 {
                writeln!(f)?;
            }
            write!(f, "{pass}")?;
        }
        Ok(())
    }
}
