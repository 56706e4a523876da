//! How instances move, as they are flattened.

use super::{Flat, FlattenError, Instance, Part};
use crate::{
    Animation, Dropped, Motion, Rig, Rigid,
    animation::{JointPose, Morphed, Skinned, invert},
};
use glam::{DAffine3, Vec3};
use niwaki_core::to_u32;
use std::{borrow::Cow, ops::Range, sync::Arc};

/// Where an instance stands at rest.
pub(super) enum Place<'a> {
    At(DAffine3),
    /// Where these joints take its vertices.
    By(&'a [JointPose]),
}

impl Place<'_> {
    /// True if it leaves everything as it is.
    pub(super) fn is_identity(&self) -> bool {
        matches!(self, Self::At(transform) if *transform == DAffine3::IDENTITY)
    }

    /// True if it turns triangles inside out.
    pub(super) fn mirrors(&self) -> bool {
        match self {
            Self::At(transform) => transform.matrix3.determinant() < 0.0,
            Self::By(joints) => {
                let mirrors = |joint: &&JointPose| {
                    let [a, b, c] = joint.rows.map(|row| row.truncate().as_dvec3());
                    a.dot(b.cross(c)) < 0.0
                };
                2 * joints.iter().filter(mirrors).count() > joints.len()
            }
        }
    }
}

/// The motions of the objects, as they are flattened.
pub(super) struct Moves {
    rig: Rig,
    /// Where the nodes rest.
    worlds: Vec<DAffine3>,
    /// What the joints of all skins do at rest, and which are each skin's.
    joints: Vec<JointPose>,
    ranges: Vec<Range<usize>>,
    /// The weights of all morph targets at rest, and which are each mesh's.
    weights: Vec<f32>,
    weight_ranges: Vec<Range<usize>>,
    pub(super) motions: Vec<Motion>,
}

impl Moves {
    pub(super) fn new(rig: Rig) -> Self {
        let worlds = rig.worlds(None);
        let joints = rig.joints(&worlds);
        let mut next = 0;
        let range = |skin: &crate::animation::Skin| {
            let first = next;
            next += skin.joints.len();
            first..next
        };
        let ranges = rig.skins.iter().map(range).collect();
        let weights = rig.weights_at(None);
        let mut next = 0;
        let weight_range = |weights: &crate::animation::MorphWeights| {
            let first = next;
            next += weights.rest.len();
            first..next
        };
        let weight_ranges = rig.weights.iter().map(weight_range).collect();
        Self { rig, worlds, joints, ranges, weights, weight_ranges, motions: Vec::new() }
    }

    /// A part's positions and normals with the weights that its instance has at rest.
    pub(super) fn shape<'a>(
        &self,
        part: &'a Part,
        instance: &Instance,
    ) -> (Cow<'a, [Vec3]>, Cow<'a, [Vec3]>) {
        let base = (part.mesh.positions(), part.normals.as_slice());
        let weights = instance
            .weights
            .and_then(|i| self.weights.get(self.weight_ranges.get(i as usize)?.clone()));
        match (&part.targets, weights) {
            (Some(targets), Some(weights)) if weights.iter().any(|w| *w != 0.0) => {
                let (mut positions, mut normals) = (base.0.to_vec(), base.1.to_vec());
                targets.shape(weights, base, &mut positions, &mut normals);
                (positions.into(), normals.into())
            }
            _ => (base.0.into(), base.1.into()),
        }
    }

    /// An instance that morphs over time. Its vertices are where it rests, or where they were
    /// bound to its skin.
    fn morphed(
        &self,
        part: &Part,
        instance: &Instance,
        place: &Place<'_>,
    ) -> Result<Option<Morphed>, FlattenError> {
        let Some(targets) = &part.targets else { return Ok(None) };
        let Some(number) = instance.weights.map(|n| n as usize) else { return Ok(None) };
        if self.rig.weights.get(number).is_none_or(|weights| weights.track.is_none()) {
            return Ok(None);
        }
        let Some(weights) = self.weight_ranges.get(number).cloned() else { return Ok(None) };
        let mirrored = place.mirrors();
        let mut base = Flat::default();
        let targets = match place {
            Place::At(transform) => {
                base.place((part.mesh.positions(), &part.normals), &part.influences, place);
                targets.transformed(&transform.matrix3, &part.normals, mirrored)
            }
            Place::By(_) => {
                let sign = if mirrored { -1.0 } else { 1.0 };
                base.positions = part.mesh.positions().to_vec();
                base.normals = part.normals.iter().map(|n| *n * sign).collect();
                if mirrored { targets.with_turned_normals() } else { targets.clone() }
            }
        };
        Morphed::new(weights, base.positions, base.normals, targets)
            .map(Some)
            .map_err(|source| FlattenError::Morph { part: part.name.clone(), source })
    }

    /// What the joints of an instance do at rest, if it has a skin.
    pub(super) fn joints(&self, instance: &Instance) -> Option<&[JointPose]> {
        self.joints.get(self.ranges.get(instance.skin? as usize)?.clone())
    }

    pub(super) fn motion(
        &mut self,
        part: &Part,
        instance: &Instance,
        dropped: &mut Dropped,
    ) -> Result<Motion, FlattenError> {
        let is_bound = instance.skin.is_some() && !part.influences.is_empty();
        let joints = self.joints(instance).filter(|_| is_bound);
        let place = joints.map_or(Place::At(instance.transform), Place::By);
        let morphed = self.morphed(part, instance, &place)?;
        let mirrored = place.mirrors();
        let morphed = morphed.map(|morphed| {
            self.rig.morphed.push(morphed);
            to_u32(self.rig.morphed.len() - 1)
        });
        let still = Motion { morphed, ..Motion::default() };
        if let Some(number) = instance.skin.filter(|_| is_bound)
            && let Some(skin) = self.rig.skins.get(number as usize)
        {
            let sign = if mirrored { -1.0 } else { 1.0 };
            // Also where nothing moves: what follows relies on the numbers of joints.
            let skinned = Skinned::new(
                number,
                skin.joints.len(),
                part.mesh.positions().to_vec(),
                part.normals.iter().map(|n| *n * sign).collect(),
                part.influences.clone(),
            )
            .map_err(|source| FlattenError::Skin { part: part.name.clone(), source })?;
            if morphed.is_none() && skin.joints.iter().all(|joint| joint.node.is_none()) {
                return Ok(still);
            }
            self.rig.skinned.push(skinned);
            let skinned = Some(to_u32(self.rig.skinned.len() - 1));
            return Ok(Motion { skinned, ..still });
        }
        let Some(node) = instance.node else { return Ok(still) };
        match self.worlds.get(node as usize).and_then(invert) {
            Some(from_rest) => Ok(Motion { rigid: Rigid::Node { node, from_rest }, ..still }),
            None => {
                dropped.animations += 1;
                dropped.note(|| format!("{}: it is flat at rest, so it cannot move", part.name));
                Ok(still)
            }
        }
    }

    /// The animation, if anything moves.
    pub(super) fn finish(self, duration: f64) -> Option<Animation> {
        let moves = self.motions.iter().any(|motion| !motion.is_rest());
        // A single pose has no length, but there is something to show.
        let duration = if duration > 0.0 { duration } else { 1.0 };
        moves.then(|| Animation { motions: self.motions, duration, rig: Arc::new(self.rig) })
    }
}
