//! Key frames of glTF animations.

use super::{LoadOptions, accessor::Document, gltf_morph};
use crate::{
    Dropped, LoadError,
    animation::{Interpolation, Placement, RigNode, Track, TrackError, WeightTrack},
};
use glam::{DAffine3, DQuat, DVec3};
use gltf::json::{
    Index, Node,
    accessor::Accessor,
    animation::{Channel, Interpolation as Kind, Property, Sampler},
    validation::Checked,
};
use std::{collections::HashMap, sync::Arc};

const KEYS: &str = "correct the keys, or export the animation again";
const NAMES: &str = "name something that exists, or remove the channel";

/// A scale less than a tenth, along each axis, of what it grows to is no good measure at rest: the
/// digits that vertices lose there are missing when they grow.
const LEAST_OF_LARGEST: f64 = 1e-3;

/// The tracks of one node.
#[derive(Default)]
pub(super) struct Tracks {
    translation: Option<Track<3>>,
    rotation: Option<Track<4>>,
    scale: Option<Track<3>>,
}

/// One animation of a file.
#[derive(Default)]
pub(super) struct Clip {
    /// By the number of the node.
    pub(super) tracks: HashMap<usize, Tracks>,
    /// Weights of morph targets, by the number of the node.
    pub(super) weights: HashMap<usize, WeightTrack>,
    /// When the last key is, in seconds.
    pub(super) duration: f64,
}

/// Reads the animation that the options name.
pub(super) fn read(
    document: &Document<'_>,
    options: &LoadOptions,
    dropped: &mut Dropped,
) -> Result<Clip, LoadError> {
    let mut clip = Clip::default();
    let animations = &document.root.animations;
    let Some(number) = options.animation else { return Ok(clip) };
    let Some(animation) = animations.get(number) else {
        // A file without any stands still, whichever is asked for by default.
        if number == 0 {
            return Ok(clip);
        }
        let reason = format!("animations[{number}] does not exist, there are {}", animations.len());
        return Err(document.fail("animations", reason, "set LoadOptions::animation to another"));
    };
    if animations.len() > 1 {
        dropped.note(|| {
            let name = |a: &gltf::json::Animation| a.name.clone().unwrap_or_else(|| "?".into());
            let names: Vec<_> = animations.iter().take(32).map(name).collect();
            let all = animations.len();
            format!("animations[{number}] of {all} is used: {}", names.join(", "))
        });
    }
    let mut reader = Reader { document, options, bytes: 0, times: HashMap::new() };
    for (c, channel) in animation.channels.iter().enumerate() {
        let at = format!("animations[{number}].channels[{c}]");
        let sampler = animation.samplers.get(channel.sampler.value()).ok_or_else(|| {
            let count = animation.samplers.len();
            let reason =
                format!("samplers[{}] does not exist, there are {count}", channel.sampler.value());
            document.fail(format!("{at}.sampler"), reason, NAMES)
        })?;
        let place = format!("animations[{number}].samplers[{}]", channel.sampler.value());
        reader.channel(channel, sampler, &at, &place, &mut clip, dropped)?;
    }
    Ok(clip)
}

struct Reader<'a> {
    document: &'a Document<'a>,
    options: &'a LoadOptions,
    /// Of keys that were read: a few bytes of JSON may ask for all keys of the file again.
    bytes: u64,
    /// Times by their accessor: the tracks of a clip mostly share them.
    times: HashMap<usize, Arc<[f32]>>,
}

impl Reader<'_> {
    fn channel(
        &mut self,
        channel: &Channel,
        sampler: &Sampler,
        at: &str,
        place: &str,
        clip: &mut Clip,
        dropped: &mut Dropped,
    ) -> Result<(), LoadError> {
        let document = self.document;
        let node = channel.target.node.value();
        if node >= document.root.nodes.len() {
            let count = document.root.nodes.len();
            let reason = format!("nodes[{node}] does not exist, there are {count}");
            return Err(document.fail(format!("{at}.target.node"), reason, NAMES));
        }
        let property = match channel.target.path {
            Checked::Invalid => {
                dropped.animations += 1;
                dropped.note(|| {
                    format!("{at}: neither a translation, a rotation, a scale nor weights")
                });
                return Ok(());
            }
            Checked::Valid(property) => property,
        };
        let taken = |property: Property| {
            let reason = format!("nodes[{node}] has keys for its {property:?} already");
            document.fail(at, reason, "remove one of the two channels")
        };
        if property == Property::MorphTargetWeights {
            let targets = gltf_morph::moved(document, node, at)?;
            let track = self.weights(sampler, targets, place)?;
            clip.duration = clip.duration.max(track.end());
            return match clip.weights.insert(node, track) {
                Some(_) => Err(taken(property)),
                None => Ok(()),
            };
        }
        if document.root.nodes.get(node).is_some_and(|n: &Node| n.matrix.is_some()) {
            let remedy = "give the node a translation, a rotation and a scale instead";
            return Err(document.fail(
                format!("nodes[{node}]"),
                "it has a matrix but moves",
                remedy,
            ));
        }
        let tracks = clip.tracks.entry(node).or_default();
        let is_taken = match property {
            Property::Translation => tracks.translation.is_some(),
            Property::Rotation => tracks.rotation.is_some(),
            _ => tracks.scale.is_some(),
        };
        if is_taken {
            return Err(taken(property));
        }
        let end;
        match property {
            Property::Rotation => {
                let track = self.track::<4>(sampler, place)?;
                end = track.end();
                tracks.rotation = Some(track);
            }
            _ => {
                let track = self.track::<3>(sampler, place)?;
                end = track.end();
                let slot = if property == Property::Translation {
                    &mut tracks.translation
                } else {
                    &mut tracks.scale
                };
                *slot = Some(track);
            }
        }
        clip.duration = clip.duration.max(end);
        Ok(())
    }

    fn track<const N: usize>(
        &mut self,
        sampler: &Sampler,
        place: &str,
    ) -> Result<Track<N>, LoadError> {
        let interpolation = self.interpolation(sampler, place)?;
        let times = self.times(sampler, place)?;
        let values = self.values::<N>(sampler.output, &format!("{place}.output"))?;
        Track::new(interpolation, times, values).map_err(|error| self.wrong(&error, place))
    }

    fn weights(
        &mut self,
        sampler: &Sampler,
        targets: usize,
        place: &str,
    ) -> Result<WeightTrack, LoadError> {
        let interpolation = self.interpolation(sampler, place)?;
        let times = self.times(sampler, place)?;
        let values = self.values::<1>(sampler.output, &format!("{place}.output"))?;
        let values = values.into_iter().flatten().collect();
        WeightTrack::new(interpolation, times, targets, values)
            .map_err(|error| self.wrong(&error, place))
    }

    fn interpolation(&self, sampler: &Sampler, place: &str) -> Result<Interpolation, LoadError> {
        match sampler.interpolation {
            Checked::Valid(Kind::Step) => Ok(Interpolation::Step),
            Checked::Valid(Kind::Linear) => Ok(Interpolation::Linear),
            Checked::Valid(Kind::CubicSpline) => Ok(Interpolation::Cubic),
            Checked::Invalid => {
                let remedy = "use LINEAR, STEP or CUBICSPLINE";
                let at = format!("{place}.interpolation");
                Err(self.document.fail(at, "it is unknown", remedy))
            }
        }
    }

    fn times(&mut self, sampler: &Sampler, place: &str) -> Result<Arc<[f32]>, LoadError> {
        if let Some(times) = self.times.get(&sampler.input.value()) {
            return Ok(Arc::clone(times));
        }
        let times = self.values::<1>(sampler.input, &format!("{place}.input"))?;
        let times: Arc<[f32]> = times.into_iter().flatten().collect();
        self.times.insert(sampler.input.value(), Arc::clone(&times));
        Ok(times)
    }

    fn wrong(&self, error: &TrackError, place: &str) -> LoadError {
        let part = match error {
            TrackError::Value { .. } | TrackError::Count { .. } => "output",
            _ => "input",
        };
        self.document.fail(format!("{place}.{part}"), error.to_string(), KEYS)
    }

    fn values<const N: usize>(
        &mut self,
        accessor: Index<Accessor>,
        at: &str,
    ) -> Result<Vec<[f32; N]>, LoadError> {
        self.bytes += self.document.count(accessor, at)? as u64 * size_of::<[f32; N]>() as u64;
        if self.bytes > self.options.max_bytes {
            return Err(LoadError::TooLarge {
                path: self.document.path.into(),
                what: "its key frames",
                limit: self.options.max_bytes,
                option: "max_bytes",
            });
        }
        self.document.vectors::<N>(accessor, at)
    }
}

impl Tracks {
    /// A node of a rig with these tracks that rests as the file says, unless it then has hardly
    /// any size, or none.
    pub(super) fn node(self, parent: Option<u32>, fixed: DAffine3, node: &Node) -> RigNode {
        let mut rest = placement(node);
        if let Some(scale) = &self.scale {
            let volume = |scale: DVec3| scale.element_product().abs();
            let keys = scale.keys().map(|key| DVec3::from(key.map(f64::from)));
            let largest = keys.max_by(|a, b| volume(*a).total_cmp(&volume(*b)));
            if let Some(largest) = largest
                && volume(rest.scale) < LEAST_OF_LARGEST * volume(largest)
            {
                rest.scale = largest;
            }
        }
        let Self { translation, rotation, scale } = self;
        RigNode { parent, fixed, rest, translation, rotation, scale }
    }
}

/// Where a node without a matrix rests.
pub(super) fn placement(node: &Node) -> Placement {
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| {
        let q = DQuat::from_array(q.0.map(f64::from));
        // An all-zero quaternion says nothing.
        if q.is_finite() && q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
    });
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    Placement {
        translation: vector(node.translation.unwrap_or([0.0; 3])),
        rotation,
        scale: vector(node.scale.unwrap_or([1.0; 3])),
    }
}
