//! Morph targets of glTF meshes, and how far nodes go to them.

use super::{LoadOptions, accessor::Document, gltf_animation::Clip};
use crate::{
    Dropped, LoadError, Rig,
    animation::{Difference, MorphWeights, Targets},
};
use glam::Vec3;
use gltf::json::{
    Index, Mesh, Node,
    accessor::Accessor,
    mesh::{MorphTarget, Primitive},
};
use niwaki_core::to_u32;
use std::collections::HashMap;

const ALL_ALIKE: &str = "give every primitive of the mesh the same targets, or none";
const EACH_ITS_WEIGHT: &str = "give every morph target its weight";

/// How many targets a mesh has, by its first primitive.
pub(super) fn count(mesh: &Mesh) -> usize {
    mesh.primitives.first().map_or(0, |p| targets(p).len())
}

fn targets(primitive: &Primitive) -> &[MorphTarget] {
    primitive.targets.as_deref().unwrap_or(&[])
}

/// The primitives of a mesh have as many targets, and there is one weight a target.
pub(super) fn check(document: &Document<'_>, mesh: &Mesh, number: usize) -> Result<(), LoadError> {
    let wanted = count(mesh);
    for (p, primitive) in mesh.primitives.iter().enumerate() {
        let has = targets(primitive).len();
        if has != wanted {
            let at = format!("meshes[{number}].primitives[{p}].targets");
            let reason = format!("it has {has} morph targets, primitives[0] has {wanted}");
            return Err(document.fail(at, reason, ALL_ALIKE));
        }
    }
    let at = format!("meshes[{number}]");
    check_weights(document, mesh.weights.as_deref(), wanted, &at, &at)
}

fn check_weights(
    document: &Document<'_>,
    weights: Option<&[f32]>,
    wanted: usize,
    at: &str,
    mesh: &str,
) -> Result<(), LoadError> {
    let Some(weights) = weights.filter(|w| !w.is_empty()) else { return Ok(()) };
    let at = format!("{at}.weights");
    if weights.len() != wanted {
        let reason = format!("{} weights for the {wanted} morph targets of {mesh}", weights.len());
        return Err(document.fail(at, reason, EACH_ITS_WEIGHT));
    }
    match weights.iter().position(|w| !w.is_finite()) {
        Some(k) => {
            let reason = format!("weight {k} is {}, which is not finite", weights[k]);
            Err(document.fail(at, reason, "correct the weight"))
        }
        None => Ok(()),
    }
}

/// How many targets the mesh of a node has whose weights a channel moves.
pub(super) fn moved(document: &Document<'_>, node: usize, at: &str) -> Result<usize, LoadError> {
    const REMEDY: &str = "give the mesh morph targets, or remove the channel";
    let place = || format!("{at}.target");
    let Some(mesh) = document.root.nodes.get(node).and_then(|n| n.mesh) else {
        let reason = format!("nodes[{node}] has no mesh whose weights could move");
        return Err(document.fail(place(), reason, REMEDY));
    };
    let found = document.root.meshes.get(mesh.value()).map_or(0, count);
    if found == 0 {
        let m = mesh.value();
        let reason =
            format!("it moves weights, but meshes[{m}].primitives[0] has no morph targets");
        return Err(document.fail(place(), reason, REMEDY));
    }
    Ok(found)
}

/// Reads the targets of primitives.
pub(super) struct Reader<'a> {
    document: &'a Document<'a>,
    options: &'a LoadOptions,
    /// That were read: a few bytes of JSON may ask for all differences of the file again.
    bytes: u64,
}

impl<'a> Reader<'a> {
    pub(super) const fn new(document: &'a Document<'a>, options: &'a LoadOptions) -> Self {
        Self { document, options, bytes: 0 }
    }

    /// The targets of a primitive with so many vertices and these normals, as the file has them.
    pub(super) fn read(
        &mut self,
        primitive: &Primitive,
        vertices: usize,
        normals: &[Vec3],
        at: &str,
        dropped: &mut Dropped,
    ) -> Result<Option<Targets>, LoadError> {
        let all = targets(primitive);
        if all.is_empty() {
            return Ok(None);
        }
        let mut differences = Vec::new();
        let mut scratch: Vec<[Vec3; 2]> = Vec::new();
        for (t, target) in all.iter().enumerate() {
            let at = format!("{at}.targets[{t}]");
            // What has no normals is shaded by its triangles' own.
            let normal = target.normals.filter(|_| normals.len() == vertices);
            if target.positions.is_none() && normal.is_none() {
                continue;
            }
            scratch.clear();
            scratch.resize(vertices, [Vec3::ZERO; 2]);
            for (k, (accessor, name)) in
                [(target.positions, "POSITION"), (normal, "NORMAL")].into_iter().enumerate()
            {
                let Some(accessor) = accessor else { continue };
                let at = format!("{at}.{name}");
                self.spend(accessor, &at)?;
                self.document.scattered::<3>(accessor, vertices, &at, |v, difference| {
                    scratch[v][k] = difference.into();
                })?;
            }
            let mut broken = 0;
            for (v, [position, normal]) in scratch.iter_mut().enumerate() {
                for difference in [&mut *position, &mut *normal] {
                    if !difference.is_finite() {
                        *difference = Vec3::ZERO;
                        broken += 1;
                    }
                }
                // Normals that are not of unit length are scaled to it, and what is added to them.
                if let Some(n) = normals.get(v).filter(|n| !n.is_normalized()) {
                    let scale = n.length().recip();
                    *normal *= if scale.is_finite() { scale } else { 0.0 };
                }
                if *position != Vec3::ZERO || *normal != Vec3::ZERO {
                    let difference = Difference {
                        position: *position,
                        target: to_u32(t),
                        normal: *normal,
                        pad: 0,
                    };
                    differences.push((to_u32(v), difference));
                }
            }
            if broken > 0 {
                dropped.attributes += 1;
                dropped.note(|| format!("{at}: {broken} differences that are not finite"));
            }
        }
        Targets::new(to_u32(all.len()), vertices, &differences).map(Some).map_err(|error| {
            self.document.fail(format!("{at}.targets"), error.to_string(), "split the mesh")
        })
    }

    fn spend(&mut self, accessor: Index<Accessor>, at: &str) -> Result<(), LoadError> {
        let elements = self.document.stored(accessor, at)?;
        let each = size_of::<(u32, Difference)>() as u64;
        self.bytes = self.bytes.saturating_add(elements.saturating_mul(each));
        if self.bytes > self.options.max_bytes {
            return Err(LoadError::TooLarge {
                path: self.document.path.into(),
                what: "its morph targets",
                limit: self.options.max_bytes,
                option: "max_bytes",
            });
        }
        Ok(())
    }
}

/// The weights of the nodes of a scene.
#[derive(Default)]
pub(super) struct NodeWeights {
    /// Those that nodes share, by mesh.
    of_mesh: HashMap<usize, u32>,
}

impl NodeWeights {
    /// The number in the rig of what says how far node `i` goes to the targets of its mesh; `None`
    /// if it does not go to any.
    pub(super) fn number(
        &mut self,
        document: &Document<'_>,
        i: usize,
        node: &Node,
        clip: &mut Clip,
        rig: &mut Rig,
    ) -> Result<Option<u32>, LoadError> {
        let own = node.weights.as_deref().filter(|w| !w.is_empty());
        let at = format!("nodes[{i}]");
        let Some(m) = node.mesh.map(|mesh| mesh.value()) else {
            return match own {
                Some(_) => Err(document.fail(
                    format!("{at}.weights"),
                    "it has weights but no mesh",
                    "give it a mesh with morph targets, or remove the weights",
                )),
                None => Ok(None),
            };
        };
        let Some(mesh) = document.root.meshes.get(m) else { return Ok(None) };
        let wanted = count(mesh);
        check_weights(document, own, wanted, &at, &format!("meshes[{m}]"))?;
        let track = clip.weights.remove(&i);
        let of_mesh = mesh.weights.as_deref().filter(|w| !w.is_empty());
        let is_shared = own.is_none() && track.is_none();
        if is_shared && let Some(number) = self.of_mesh.get(&m) {
            return Ok(Some(*number));
        }
        let rest = match own.or(of_mesh) {
            Some(rest) => rest.to_vec(),
            // Only where there is a track, which is as long.
            None if track.is_some() => vec![0.0; wanted],
            None => return Ok(None),
        };
        if track.is_none() && rest.iter().all(|w| *w == 0.0) {
            return Ok(None);
        }
        let number = to_u32(rig.weights.len());
        rig.weights.push(MorphWeights { rest, track });
        if is_shared {
            self.of_mesh.insert(m, number);
        }
        Ok(Some(number))
    }
}
