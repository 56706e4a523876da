//! glTF 2.0 documents: nodes, cameras, lights.
//!
//! The `gltf` crate reads the JSON; every index and range is checked here, because its typed
//! readers trust them.

use super::{
    LoadOptions,
    accessor::Document,
    container::{buffers, split_glb},
    gltf_animation::{self, Clip},
    gltf_material, gltf_mesh,
    gltf_morph::NodeWeights,
    gltf_skin::{self, Place},
    read,
};
use crate::{Camera, Dropped, Instance, InstancedScene, Light, LightKind, LoadError, Rig};
use glam::{DAffine3, DMat4, Vec3};
use gltf::json::{
    Node, Root, camera, extensions::scene::khr_lights_punctual as punctual, validation::Checked,
};
use niwaki_core::to_u32;
use std::{collections::HashMap, path::Path, sync::atomic::AtomicU64};

/// Extensions that change what this crate reads and that it understands.
const UNDERSTOOD: &[&str] = &[
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Loads `.gltf` or `.glb` bytes.
pub(super) fn load(
    path: &Path,
    name: &str,
    options: &LoadOptions,
) -> Result<InstancedScene, LoadError> {
    let bytes = read::bytes(path, options)?;
    let (json, binary) = if bytes.starts_with(b"glTF") {
        split_glb(path, &bytes)?
    } else {
        (bytes.as_slice(), None)
    };
    let root: Root =
        gltf::json::deserialize::from_slice(json).map_err(|error| LoadError::Gltf {
            path: path.into(),
            at: format!("JSON line {} column {}", error.line(), error.column()),
            reason: error.to_string(),
            remedy: "export the file again, or see what the Khronos glTF validator says",
        })?;
    let buffers = buffers(path, &root, binary, options)?;
    let document =
        Document { path, root: &root, buffers: &buffers, from_nothing: AtomicU64::new(0) };
    let mut dropped = Dropped::default();
    check_extensions(&document, &mut dropped)?;
    let materials = gltf_material::read(&document, options, &mut dropped);
    let meshes = gltf_mesh::read(&document, &materials, options, &mut dropped)?;
    let clip = gltf_animation::read(&document, options, &mut dropped)?;
    let mut scene = InstancedScene {
        name: name.into(),
        parts: meshes.parts,
        instances: Vec::new(),
        materials: materials.materials,
        textures: materials.textures,
        cameras: Vec::new(),
        lights: Vec::new(),
        environment: None,
        rig: Rig::default(),
        duration: clip.duration,
        dropped,
    };
    walk(&document, &meshes.ranges, clip, &mut scene)?;
    Ok(scene)
}

fn check_extensions(document: &Document<'_>, dropped: &mut Dropped) -> Result<(), LoadError> {
    for (i, name) in document.root.extensions_required.iter().enumerate() {
        if UNDERSTOOD.contains(&name.as_str()) {
            continue;
        }
        if name.starts_with("KHR_materials_") || name.contains("_texture_") {
            dropped.note(|| format!("the file requires {name}, which is not simulated"));
            continue;
        }
        return Err(document.fail(
            format!("extensionsRequired[{i}]"),
            format!("{name} is not supported"),
            "export the file without it (no mesh compression, no GPU instancing)",
        ));
    }
    Ok(())
}

/// The nodes to begin with: those of the default scene, of the first, or, in a file without
/// scenes, those that are no node's child.
fn roots(document: &Document<'_>) -> Result<Vec<usize>, LoadError> {
    let root = document.root;
    let index = root.scene.map_or(0, |s| s.value());
    if let Some(scene) = root.scenes.get(index) {
        return Ok(scene.nodes.iter().map(|n| n.value()).collect());
    }
    if let Some(scene) = root.scene {
        let reason = format!("scenes[{}] does not exist", scene.value());
        return Err(document.fail("scene", reason, "name a scene that exists"));
    }
    let mut is_child = vec![false; root.nodes.len()];
    for child in root.nodes.iter().filter_map(|n| n.children.as_ref()).flatten() {
        if let Some(flag) = is_child.get_mut(child.value()) {
            *flag = true;
        }
    }
    Ok((0..root.nodes.len()).filter(|&i| !is_child[i]).collect())
}

/// A node to be visited, and what is known of its parent.
struct Visit {
    node: usize,
    /// Where the parent rests.
    parent: DAffine3,
    place: Place,
}

/// Places what the nodes hold. An explicit stack: files with a million nodes in a chain exist.
fn walk(
    document: &Document<'_>,
    ranges: &[std::ops::Range<u32>],
    mut clip: Clip,
    scene: &mut InstancedScene,
) -> Result<(), LoadError> {
    const TREE: &str = "every node may have one parent, and none may be its own ancestor";
    let nodes = &document.root.nodes;
    let mut places: Vec<Option<Place>> = vec![None; nodes.len()];
    let mut skins = Skins::default();
    let mut weights = NodeWeights::default();
    let begin =
        |node| Visit { node, parent: DAffine3::IDENTITY, place: (None, DAffine3::IDENTITY) };
    let mut stack: Vec<Visit> = roots(document)?.into_iter().rev().map(begin).collect();
    while let Some(Visit { node: i, parent, place: (on, fixed) }) = stack.pop() {
        let at = || format!("nodes[{i}]");
        let Some(node) = nodes.get(i) else {
            let reason = format!("it does not exist, there are {}", nodes.len());
            return Err(document.fail(at(), reason, "remove the reference to it"));
        };
        if places[i].is_some() {
            return Err(document.fail(at(), "it is reached a second time", TREE));
        }
        let (transform, place) = match clip.tracks.remove(&i) {
            Some(tracks) => {
                let moving = tracks.node(on, fixed, node);
                let transform = parent * moving.rest.transform();
                let number = to_u32(scene.rig.nodes.len());
                scene.rig.nodes.push(moving);
                (transform, (Some(number), DAffine3::IDENTITY))
            }
            None => {
                let local = local_transform(node);
                (parent * local, (on, fixed * local))
            }
        };
        places[i] = Some(place);
        let morph = weights.number(document, i, node, &mut clip, &mut scene.rig)?;
        if let Some(mesh) = node.mesh {
            let range = ranges.get(mesh.value()).cloned().ok_or_else(|| {
                let reason = format!("meshes[{}] does not exist", mesh.value());
                document.fail(at(), reason, "remove the reference to it")
            })?;
            let skin = node.skin.map(|skin| skins.number(skin.value()));
            scene.instances.extend(range.map(|part| {
                let (bound, morphs) = scene
                    .parts
                    .get(part as usize)
                    .map_or((false, false), |p| (!p.influences.is_empty(), p.targets.is_some()));
                Instance {
                    part,
                    transform,
                    node: place.0,
                    skin: skin.filter(|_| bound),
                    weights: morph.filter(|_| morphs),
                }
            }));
        }
        if place.0.is_some() && (node.camera.is_some() || has_light(node)) {
            scene.dropped.note(|| format!("{}: its camera or light stays where it rests", at()));
        }
        place_camera(document, node, &transform, scene, i);
        place_light(document, node, &transform, scene, i);
        if let Some(children) = &node.children {
            let child =
                |c: &gltf::json::Index<Node>| Visit { node: c.value(), parent: transform, place };
            stack.extend(children.iter().rev().map(child));
        }
    }
    for number in skins.used {
        scene.rig.skins.push(gltf_skin::read(document, number, &places)?);
    }
    Ok(())
}

/// The skins that a scene uses, numbered in the order in which it does.
#[derive(Default)]
struct Skins {
    numbers: HashMap<usize, u32>,
    used: Vec<usize>,
}

impl Skins {
    fn number(&mut self, of_file: usize) -> u32 {
        *self.numbers.entry(of_file).or_insert_with(|| {
            self.used.push(of_file);
            to_u32(self.used.len() - 1)
        })
    }
}

fn has_light(node: &Node) -> bool {
    node.extensions.as_ref().is_some_and(|e| e.khr_lights_punctual.is_some())
}

fn local_transform(node: &Node) -> DAffine3 {
    if let Some(m) = node.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from)));
    }
    gltf_animation::placement(node).transform()
}

/// The origin and the directions of the local axes `−Z` and `Y`, if the transform keeps them.
fn frame(transform: &DAffine3) -> Option<(Vec3, Vec3, Vec3)> {
    let position = transform.translation.as_vec3();
    let forward = (-transform.matrix3.z_axis).try_normalize()?.as_vec3();
    let up = transform.matrix3.y_axis.try_normalize()?.as_vec3();
    (position.is_finite() && forward.is_finite() && up.is_finite())
        .then_some((position, forward, up))
}

fn place_camera(
    document: &Document<'_>,
    node: &Node,
    transform: &DAffine3,
    scene: &mut InstancedScene,
    at: usize,
) {
    let Some(index) = node.camera else { return };
    let usable = document
        .root
        .cameras
        .get(index.value())
        .filter(|c| matches!(c.type_, Checked::Valid(camera::Type::Perspective)))
        .and_then(|c| c.perspective.as_ref())
        .map(|p| p.yfov)
        .filter(|fov| *fov > 0.0 && *fov < std::f32::consts::PI)
        .zip(frame(transform));
    match usable {
        Some((fov, (position, forward, up))) => {
            scene.cameras.push(Camera::facing(position, forward.as_dvec3(), up, fov));
        }
        None => {
            scene.dropped.cameras_and_lights += 1;
            scene.dropped.note(|| {
                format!("nodes[{at}]: cameras[{}] is no usable perspective camera", index.value())
            });
        }
    }
}

fn place_light(
    document: &Document<'_>,
    node: &Node,
    transform: &DAffine3,
    scene: &mut InstancedScene,
    at: usize,
) {
    let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) else {
        return;
    };
    let usable = document.root.get(light.light).and_then(|l| read_light(l, transform));
    match usable {
        Some(light) => scene.lights.push(light),
        None => {
            scene.dropped.cameras_and_lights += 1;
            scene.dropped.note(|| {
                format!("nodes[{at}]: light {} does not exist or is broken", light.light.value())
            });
        }
    }
}

fn read_light(light: &punctual::Light, transform: &DAffine3) -> Option<Light> {
    let (position, direction, _) = frame(transform)?;
    let Checked::Valid(kind) = light.type_ else { return None };
    let kind = match kind {
        punctual::Type::Point => LightKind::Point,
        punctual::Type::Directional => LightKind::Directional,
        punctual::Type::Spot => {
            let spot = light.spot.as_ref()?;
            let outer = spot.outer_cone_angle.clamp(1e-3, std::f32::consts::FRAC_PI_2);
            LightKind::Spot { inner: spot.inner_cone_angle.clamp(0.0, outer * 0.999), outer }
        }
    };
    let intensity = Vec3::from(light.color) * light.intensity;
    (intensity.is_finite() && intensity.min_element() >= 0.0).then_some(Light {
        kind,
        position,
        direction,
        intensity,
    })
}
