//! Nodes that hang on each other and move by key frames, and what hangs on them, as in glTF.

use super::{MorphWeights, Morphed, Skin, Skinned, Track, track::normalized};
use glam::{DAffine3, DQuat, DVec3};

/// Nodes, skins, weights of morph targets, and the vertices that hang on them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rig {
    /// Nodes that move, parents before their children.
    pub nodes: Vec<RigNode>,
    /// Joints that bend objects.
    pub skins: Vec<Skin>,
    /// Objects that skins bend.
    pub skinned: Vec<Skinned>,
    /// How far meshes go to their morph targets.
    pub weights: Vec<MorphWeights>,
    /// Objects that morph.
    pub morphed: Vec<Morphed>,
}

/// A coordinate system that moves. Its place in that of its parent at time t is `fixed` · T(t) ·
/// R(t) · S(t), with the values at rest where there is no track.
#[derive(Clone, Debug, PartialEq)]
pub struct RigNode {
    /// The node on which it hangs: one that stands before it in the list. Any other number is the
    /// world, like `None`.
    pub parent: Option<u32>,
    /// What lies between the parent and this node and does not move.
    pub fixed: DAffine3,
    /// At rest.
    pub rest: Placement,
    /// Translation over time.
    pub translation: Option<Track<3>>,
    /// Rotation over time.
    pub rotation: Option<Track<4>>,
    /// Scale over time.
    pub scale: Option<Track<3>>,
}

/// A translation, a rotation and a scale; the scale comes first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Translation in the units of the parent.
    pub translation: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Factors along the node's own axes.
    pub scale: DVec3,
}

impl Default for Placement {
    /// Where the parent is.
    fn default() -> Self {
        Self { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl Placement {
    /// As a transform.
    #[must_use]
    pub fn transform(&self) -> DAffine3 {
        let rotation = normalized(self.rotation);
        DAffine3::from_scale_rotation_translation(self.scale, rotation, self.translation)
    }
}

impl RigNode {
    /// A node that rests on the world's origin.
    #[must_use]
    pub fn resting(parent: Option<u32>, fixed: DAffine3, rest: Placement) -> Self {
        Self { parent, fixed, rest, translation: None, rotation: None, scale: None }
    }

    /// Where it is in the coordinates of its parent; at rest without a time.
    fn local(&self, time: Option<f64>) -> DAffine3 {
        let Some(time) = time else { return self.fixed * self.rest.transform() };
        let at = |track: &Option<Track<3>>, rest| track.as_ref().map_or(rest, |t| t.at(time));
        let now = Placement {
            translation: at(&self.translation, self.rest.translation),
            rotation: self.rotation.as_ref().map_or(self.rest.rotation, |t| t.at(time)),
            scale: at(&self.scale, self.rest.scale),
        };
        self.fixed * now.transform()
    }
}

impl Rig {
    /// From the coordinates of each node to the world at a time in seconds, or at rest.
    #[must_use]
    pub fn worlds(&self, time: Option<f64>) -> Vec<DAffine3> {
        let mut worlds: Vec<DAffine3> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let parent = node.parent.and_then(|p| worlds.get(p as usize));
            let local = node.local(time);
            worlds.push(parent.map_or(local, |parent| *parent * local));
        }
        worlds
    }

    /// What takes points of a node as it rests to where they are, given where the node is now:
    /// [`Rigid::Node`](super::Rigid::Node). `None` if the node is flat at rest, so that its
    /// points do not say where they came from.
    #[must_use]
    pub fn from_rest(&self, node: u32) -> Option<DAffine3> {
        let rest = *self.worlds(None).get(node as usize)?;
        invert(&rest)
    }
}

/// The inverse of a transform, if it has one.
pub(crate) fn invert(transform: &DAffine3) -> Option<DAffine3> {
    if transform.matrix3.determinant() == 0.0 {
        return None;
    }
    let inverse = transform.inverse();
    inverse.is_finite().then_some(inverse)
}
