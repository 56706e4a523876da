//! Motion: where objects are, and how they bend, at a point in time.
//!
//! An [`Animation`] is data, not code: a [`Motion`] an object, and a [`Rig`] of nodes that move by
//! key frames, on which objects and the joints of skins may hang, and the weights of morph targets.
//! [`Scene::pose`] evaluates it into one [`ObjectPose`] an object, one [`JointPose`] a joint and one
//! weight a target, flat records that a GPU applies to every vertex by the equations that stand
//! there; [`Scene::animate`] applies the same on the CPU.
//! Poses are computed in `f64` from IEEE operations alone, so they are the same on every platform.

mod morph;
mod pose;
mod rig;
mod skin;
mod track;

pub use morph::{Difference, MorphError, MorphNormals, MorphWeights, Morphed, Targets};
pub use pose::{ObjectPose, ScenePose};
pub(crate) use rig::invert;
pub use rig::{Placement, Rig, RigNode};
pub use skin::{Influence, Joint, JointPose, Skin, SkinError, Skinned};
pub use track::{Interpolation, Track, TrackError, WeightTrack};

use crate::{Scene, generate::math::sin_cos_turns};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use niwaki_core::Aabb;
use rayon::prelude::*;
use std::sync::Arc;

/// How the objects of a scene move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// One an object, in order. Objects past the end rest.
    pub motions: Vec<Motion>,
    /// How many seconds of it there are to show, above 0. Times outside are not refused: motions
    /// go on before and after, and key frames hold their ends.
    pub duration: f64,
    /// What moves by key frames, and skins. Shared, since it may be large.
    pub rig: Arc<Rig>,
}

/// How one object moves: it morphs first, then bends, then moves as a whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// As a whole.
    pub rigid: Rigid,
    /// How it bends, if it does.
    pub wave: Option<Wave>,
    /// Index into [`Rig::skinned`] if joints bend it, before waves do.
    pub skinned: Option<u32>,
    /// Index into [`Rig::morphed`] if it morphs, before all else.
    pub morphed: Option<u32>,
}

impl Motion {
    /// True if it neither moves nor bends.
    #[must_use]
    pub fn is_rest(&self) -> bool {
        self.rigid == Rigid::Rest
            && self.wave.is_none()
            && self.skinned.is_none()
            && self.morphed.is_none()
    }
}

/// Motion of an object as a whole.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Rigid {
    /// None.
    #[default]
    Rest,
    /// Jumps that repeat, with turns in the air, on ground that may sway.
    Hop(Hop),
    /// With a node of the [`Rig`]: a point x at rest is at time t at W(t) · `from_rest` · x.
    Node {
        /// Index into [`Rig::nodes`]; the object rests if there is no such node.
        node: u32,
        /// From the world at rest to the node's coordinates; [`Rig::from_rest`] has it.
        from_rest: DAffine3,
    },
}

/// Jumps that repeat.
///
/// With c = frac(t / `period` + `phase`) and a = min(c / `airborne`, 1), a point x at rest is at
/// time t (seconds) at
///
/// `pivot` + R (x − `pivot`) + 4a(1 − a) `jump` + sin(2π(t / `sway_period` + `sway_phase`)) `sway`
///
/// where R turns by 2π · `turns` · a²(3 − 2a) around `axis`, counterclockwise seen from its tip.
/// An object with a period that is not above 0, or anything not finite, rests in that respect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hop {
    /// The point around which it turns.
    pub pivot: Vec3,
    /// Unit axis of the turn.
    pub axis: Vec3,
    /// Turns a jump; with a whole number it lands as it stood.
    pub turns: f32,
    /// Where the top of a jump is, from its beginning.
    pub jump: Vec3,
    /// Seconds from jump to jump.
    pub period: f32,
    /// Where in its period it is at time 0, in periods.
    pub phase: f32,
    /// The share of a period spent in the air, above 0 to 1.
    pub airborne: f32,
    /// How far the ground sways to either side.
    pub sway: Vec3,
    /// Seconds a sway.
    pub sway_period: f32,
    /// Where in its sway it is at time 0, in periods.
    pub sway_phase: f32,
}

impl Default for Hop {
    /// Rest: upright, no jump, no turn, no sway.
    fn default() -> Self {
        Self {
            pivot: Vec3::ZERO,
            axis: Vec3::Y,
            turns: 0.0,
            jump: Vec3::ZERO,
            period: 1.0,
            phase: 0.0,
            airborne: 1.0,
            sway: Vec3::ZERO,
            sway_period: 1.0,
            sway_phase: 0.0,
        }
    }
}

impl Hop {
    /// From rest to where it is at `time`, in seconds.
    fn transform(&self, time: f64) -> DAffine3 {
        let cycles = |period: f32, phase: f32| {
            let cycles = time / f64::from(period) + f64::from(phase);
            (period > 0.0 && cycles.is_finite()).then(|| cycles - cycles.floor())
        };
        let air = match cycles(self.period, self.phase) {
            Some(c) if self.airborne > 0.0 => (c / f64::from(self.airborne)).min(1.0),
            _ => 0.0,
        };
        let mut shift = self.jump.as_dvec3() * (4.0 * air * (1.0 - air));
        if let Some(c) = cycles(self.sway_period, self.sway_phase) {
            shift += self.sway.as_dvec3() * sin_cos_turns(c).0;
        }
        let angle = f64::from(self.turns) * air * air * (3.0 - 2.0 * air);
        let turn = turn(self.axis.as_dvec3(), angle);
        let pivot = self.pivot.as_dvec3();
        DAffine3::from_mat3_translation(turn, pivot - turn * pivot + shift)
    }
}

/// The rotation by `turns` full turns around a unit axis (Rodrigues), from IEEE operations alone.
fn turn(axis: DVec3, turns: f64) -> DMat3 {
    let (sin, cos) = sin_cos_turns(turns);
    let column = |e: DVec3| e * cos + axis.cross(e) * sin + axis * (axis.dot(e) * (1.0 - cos));
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

/// A travelling wave in cloth or water that is held along one side.
///
/// With s = clamp(`hold` · p + `hold_offset`, 0, 1), a point p at rest goes to
///
/// p + s² sin(2π (`wave` · p − `frequency` t + `phase`)) `displacement`
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// How far, and in which direction, the crests are from rest.
    pub displacement: Vec3,
    /// Where the wave travels; its length is the number of crests a unit of length.
    pub wave: Vec3,
    /// Crests a second.
    pub frequency: f32,
    /// At time 0, in crests.
    pub phase: f32,
    /// Direction away from where the cloth is held, over the length on which it comes free.
    pub hold: Vec3,
    /// Such that `hold` · p + `hold_offset` is 0 where it is held.
    pub hold_offset: f32,
}

impl Animation {
    /// Where objects `0..objects` and all joints are, and the weights of all morph targets, at `time`, in seconds from the beginning. A
    /// time that is not finite counts as 0.
    #[must_use]
    pub fn pose(&self, time: f64, objects: usize) -> ScenePose {
        let time = if time.is_finite() { time } else { 0.0 };
        let worlds = self.rig.worlds(Some(time));
        let pose = |i: usize| {
            let motion = self.motions.get(i);
            motion.map_or(ObjectPose::REST, |motion| motion.pose(time, &worlds))
        };
        ScenePose {
            objects: (0..objects).map(pose).collect(),
            joints: self.rig.joints(&worlds),
            weights: self.rig.weights_at(Some(time)),
        }
    }

    /// Where objects `0..objects` are as [`Animation::pose`] says, without joints and weights.
    #[must_use]
    pub fn poses(&self, time: f64, objects: usize) -> Vec<ObjectPose> {
        self.pose(time, objects).objects
    }

    /// The bound vertices of an object that joints bend.
    #[must_use]
    pub fn skinned(&self, object: usize) -> Option<&Skinned> {
        self.rig.skinned.get(self.motions.get(object)?.skinned? as usize)
    }

    /// The vertices of an object that morphs.
    #[must_use]
    pub fn morphed(&self, object: usize) -> Option<&Morphed> {
        self.rig.morphed.get(self.motions.get(object)?.morphed? as usize)
    }

    /// Where the joints of an object are among those of a pose.
    #[must_use]
    pub fn joints_of(&self, object: usize) -> Option<std::ops::Range<usize>> {
        let skin = self.skinned(object)?.skin() as usize;
        let count = self.rig.skins.get(skin)?.joints.len();
        let first = self.rig.skins[..skin].iter().map(|s| s.joints.len()).sum();
        Some(first..first + count)
    }
}

impl Motion {
    fn pose(&self, time: f64, worlds: &[DAffine3]) -> ObjectPose {
        let transform = match &self.rigid {
            Rigid::Rest => DAffine3::IDENTITY,
            Rigid::Hop(hop) => hop.transform(time),
            Rigid::Node { node, from_rest } => {
                worlds.get(*node as usize).map_or(DAffine3::IDENTITY, |world| *world * *from_rest)
            }
        };
        ObjectPose::new(&transform, self.wave.as_ref(), time)
    }
}

impl Scene {
    /// Where every object of [`Scene::objects_or_whole`] and every joint is, and the weights of all
    /// morph targets, at `time`, in seconds; all at rest without an animation.
    #[must_use]
    pub fn pose(&self, time: f64) -> ScenePose {
        let objects = self.objects.len().max(1);
        match &self.animation {
            Some(animation) => animation.pose(time, objects),
            None => ScenePose { objects: vec![ObjectPose::REST; objects], ..ScenePose::default() },
        }
    }

    /// Where every object is as [`Scene::pose`] says, without joints and weights.
    #[must_use]
    pub fn poses(&self, time: f64) -> Vec<ObjectPose> {
        self.pose(time).objects
    }

    /// Bounds of an object in a pose of this scene; never too small, except by rounding. `rest`
    /// are its bounds at rest.
    #[must_use]
    pub fn bounds_in(&self, pose: &ScenePose, object: usize, rest: Aabb) -> Aabb {
        let mut shape = rest;
        if let Some(animation) = &self.animation {
            let morphed = animation
                .morphed(object)
                .and_then(|morphed| Some((morphed, pose.weights.get(morphed.weights())?)));
            if let Some((morphed, weights)) = morphed {
                shape = morphed.bounds(weights);
            }
            if let Some(skinned) = animation.skinned(object)
                && let Some(joints) = animation.joints_of(object).and_then(|r| pose.joints.get(r))
            {
                let growth = morphed.map(|(morphed, weights)| morphed.growth(weights));
                shape = skinned.bounds(joints, growth);
            }
        }
        pose.objects.get(object).unwrap_or(&ObjectPose::REST).bounds(shape)
    }

    /// Writes the vertices, and the shading normals if the scene has any, as they are at `time`,
    /// in seconds. The vectors keep their memory from call to call; indices, and all else, stay
    /// those of the scene.
    pub fn animate(&self, time: f64, positions: &mut Vec<Vec3>, normals: &mut Vec<Vec3>) {
        let objects = self.objects_or_whole();
        let pose = self.pose(time);
        positions.clear();
        positions.extend_from_slice(self.mesh.positions());
        normals.clear();
        normals.extend_from_slice(&self.normals);
        for (i, (object, place)) in objects.iter().zip(&pose.objects).enumerate() {
            let range = object.vertices.start as usize..object.vertices.end as usize;
            let placed = positions.get_mut(range.clone()).unwrap_or(&mut []);
            let turned = normals.get_mut(range).unwrap_or(&mut []);
            if let Some(animation) = &self.animation {
                let skinned = animation
                    .skinned(i)
                    .and_then(|skinned| Some((skinned, pose.joints.get(animation.joints_of(i)?)?)));
                if let Some((skinned, _)) = skinned {
                    skinned.place(placed, turned);
                }
                if let Some(morphed) = animation.morphed(i)
                    && let Some(weights) = pose.weights.get(morphed.weights())
                {
                    morphed.shape(weights, placed, turned);
                }
                if let Some((skinned, joints)) = skinned {
                    skinned.bend(joints, placed, turned);
                }
            }
            if place.is_rest() {
                continue;
            }
            // Normals first: they need the points at rest.
            let pairs = turned.par_iter_mut().zip(placed.par_iter());
            pairs.with_min_len(4096).for_each(|(n, p)| *n = place.normal(*p, *n));
            placed.par_iter_mut().with_min_len(4096).for_each(|p| *p = place.point(*p));
        }
    }

    /// The scene as it stands at `time`, in seconds, without its animation.
    ///
    /// # Errors
    /// If motion took a vertex out of the range of `f32`.
    pub fn frozen(&self, time: f64) -> Result<Self, niwaki_core::MeshError> {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        self.animate(time, &mut positions, &mut normals);
        let mesh = niwaki_core::TriangleMesh::new(positions, self.mesh.indices().to_vec())?;
        let mut objects = self.objects.clone();
        for object in &mut objects {
            object.bounds = crate::object::bounds_of(&mesh, object.triangles.clone());
        }
        Ok(Self { mesh, normals, objects, animation: None, ..self.clone() })
    }
}
