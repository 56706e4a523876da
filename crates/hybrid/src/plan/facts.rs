//! What a plan is made from.

use super::Kept;
use crate::Settings;
use niwaki_core::Aabb;
use niwaki_scene::{Camera, MaterialFacts, Scene, SceneFacts};
use std::ops::Range;

/// What is known of an object, a range of triangles that is culled as a whole (section 3.3).
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectFacts {
    /// Its triangles.
    pub triangles: Range<u32>,
    /// The box that holds it in this frame, in world space.
    pub bounds: Aabb,
    /// If it has moved or bent since the last frame, the box that held it then.
    pub moved_from: Option<Aabb>,
    /// True if its vertices are computed anew for this frame.
    pub dynamic: bool,
    /// Some of it calls for reflected rays.
    pub reflective: bool,
    /// Some of it calls for refracted rays.
    pub transmissive: bool,
    /// Some of it is cut out or blended by alpha.
    pub alpha: bool,
    /// Some of it is blended with what lies behind.
    pub blended: bool,
    /// Some of it scatters the light of lamps.
    pub lit: bool,
}

impl ObjectFacts {
    /// The facts of triangles `triangles` of a scene, at rest.
    #[must_use]
    pub fn of_range(scene: &Scene, facts: &SceneFacts, triangles: Range<u32>) -> Self {
        let mut object = Self {
            triangles: triangles.clone(),
            bounds: Aabb::EMPTY,
            moved_from: None,
            dynamic: false,
            reflective: false,
            transmissive: false,
            alpha: false,
            blended: false,
            lit: false,
        };
        let mut last = None;
        for triangle in triangles.start as usize..(triangles.end as usize).min(scene.mesh.len()) {
            object.bounds = object.bounds.union(scene.mesh.triangle(triangle).bounds());
            let id = scene.material_ids.get(triangle).copied().unwrap_or(0);
            if last == Some(id) {
                continue;
            }
            last = Some(id);
            let material = facts.materials.get(id as usize).or_else(|| facts.materials.first());
            if let Some(material) = material {
                object.wear(material);
            }
        }
        object
    }

    /// The facts of all objects of a scene, at rest.
    #[must_use]
    pub fn of(scene: &Scene, facts: &SceneFacts) -> Vec<Self> {
        let objects = scene.objects_or_whole();
        let of = |object: &niwaki_scene::Object| Self {
            dynamic: object.dynamic,
            ..Self::of_range(scene, facts, object.triangles.clone())
        };
        objects.iter().map(of).collect()
    }

    /// True if light passes some of it or it has holes, so that rays see what it hides from the
    /// centre of the cube map.
    #[must_use]
    pub const fn is_clear(&self) -> bool {
        self.transmissive || self.alpha
    }

    /// True if rays go on from it.
    #[must_use]
    pub const fn is_specular(&self) -> bool {
        self.reflective || self.transmissive
    }

    fn wear(&mut self, material: &MaterialFacts) {
        self.reflective |= material.reflective;
        self.transmissive |= material.transmissive;
        self.alpha |= material.has_alpha();
        self.blended |= material.blended;
        self.lit |= material.diffuse || material.glossy;
    }
}

/// What a plan is made from.
#[derive(Clone, Copy, Debug)]
pub struct FrameFacts<'a> {
    /// Materials and lights.
    pub scene: &'a SceneFacts,
    /// The objects as they stand in this frame. Together they hold every triangle.
    pub objects: &'a [ObjectFacts],
    /// The view.
    pub camera: &'a Camera,
    /// Width of the image in pixels.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// What to simulate.
    pub settings: &'a Settings,
    /// What the last frame left, if it had the same scene and settings.
    pub kept: Option<&'a Kept>,
}
